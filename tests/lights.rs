//! Lights, materials and objects that change from frame to frame.

mod folder;

use folder::Folder;
use glam::Vec3;
use reprobe::base::math::Rgb;
use reprobe::base::progress::Silent;
use reprobe::base::ray::Ray;
use reprobe::exchange::{LoadOptions, load};
use reprobe::io::ExrImage;
use reprobe::method::path_trace::{PathTraceParams, path_trace};
use reprobe::scene::{Animation, Emitter, Scene};
use reprobe::transport::path::{PathParams, radiance};
use reprobe::transport::{Sampler, World};
use reprobe::view::layers::LayerImages;
use std::f32::consts::{FRAC_1_PI, PI};

/// A floor of albedo .5 at y = 0, a dark wall behind it, a lamp under nothing and a pane of glass.
const SCENE: &str = r#"<scene version="3.0.0">
  <sensor type="perspective">
    <float name="fov" value="60"/>
    <transform name="to_world"><lookat origin="0, 1.5, 5" target="0, 0.7, 0" up="0, 1, 0"/></transform>
    <film type="hdrfilm"><integer name="width" value="24"/><integer name="height" value="16"/></film>
  </sensor>
  <bsdf type="twosided" id="Floor"><bsdf type="diffuse"><rgb name="reflectance" value="0.5"/></bsdf></bsdf>
  <bsdf type="roughplastic" id="Wall"><float name="alpha" value="0.3"/><rgb name="diffuse_reflectance" value="0.1, 0.2, 0.3"/></bsdf>
  <bsdf type="conductor" id="Mirror"/>
  <shape type="rectangle" id="floor"><transform name="to_world"><rotate x="1" angle="-90"/><scale value="4"/></transform><ref id="Floor"/></shape>
  <shape type="rectangle" id="wall"><transform name="to_world"><scale value="3"/><translate z="-2"/></transform><ref id="Wall"/></shape>
  <shape type="rectangle" id="mirror"><transform name="to_world"><scale value="0.3"/><translate x="2" y="1" z="-1.9"/></transform><ref id="Mirror"/></shape>
  <shape type="rectangle" id="lamp">
    <transform name="to_world"><rotate x="1" angle="90"/><scale value="0.4"/><translate y="3"/></transform>
    <emitter type="area"><rgb name="radiance" value="4, 3, 2"/></emitter>
  </shape>
  <shape type="rectangle" id="pane">
    <transform name="to_world"><scale value="0.5"/><translate x="-2" y="1"/></transform><bsdf type="dielectric"/>
  </shape>
MORE</scene>"#;

/// A tetrahedron.
const MESH: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";

fn folder(more: &str) -> Folder {
    let f = Folder::with(&SCENE.replace("MORE", more), "{}");
    std::fs::write(f.at("mesh.obj"), MESH).unwrap();
    f
}

fn scene(f: &Folder) -> Scene {
    load(&f.at("scene.xml"), &LoadOptions::default()).unwrap()
}

fn animation(f: &Folder, scene: &Scene, text: &str) -> reprobe::Result<Animation> {
    std::fs::write(f.at("lights.json"), text).unwrap();
    Animation::load(&f.at("lights.json"), scene)
}

fn image(world: &World, frame: u32) -> LayerImages {
    let params = PathTraceParams { spp: 8, path: PathParams { max_depth: 4, rr_depth: 2 }, ..PathTraceParams::default() };
    path_trace(world, world.scene.sensor.as_ref().unwrap(), &params, 1, frame, &Silent)
}

/// Radiance along a ray with one bounce and one sample: exact where all light comes from one point.
fn seen(world: &World, o: Vec3, d: Vec3) -> Rgb {
    let params = PathParams { max_depth: 1, rr_depth: 5 };
    radiance(world, &Ray::new(o, d.normalize()), &params, &mut Sampler::new(1, 1))
}

#[test]
fn a_file_without_changes_gives_the_same_bits() {
    let f = folder("");
    let empty = animation(&f, &scene(&f), "{}").unwrap();
    assert_eq!((empty.frames(), empty.changed_materials()), (1, vec![]));
    for world in [World::new(scene(&f)), World::opaque(scene(&f)).0] {
        let at = world.at(&empty, 0);
        assert_eq!(image(&world, 0), image(&at, 0));
        assert!(std::sync::Arc::ptr_eq(&world.scene.geometry, &at.scene.geometry), "nothing is copied");
    }
}

#[test]
fn a_point_light_lights_a_plane_by_the_inverse_square_wherever_it_is() {
    let f = folder("");
    let scene = scene(&f);
    let text = r#"{"fps": 2, "scene_lights": false, "lights": [{"type": "point", "intensity": [3, 2, 1], "keyframes": [
        {"time": 0, "position": [0, 2, 0]}, {"time": 1, "position": [1.5, 1, 0.5]}]}]}"#;
    let moving = animation(&f, &scene, text).unwrap();
    assert_eq!(moving.frames(), 3);
    let world = World::new(scene);
    for (frame, light) in [(0, [0.0, 2.0, 0.0]), (1, [0.75, 1.5, 0.25]), (2, [1.5, 1.0, 0.5]), (9, [1.5, 1.0, 0.5])] {
        let at = world.at(&moving, frame);
        for x in [-1.0, 0.0, 0.7] {
            let p = Vec3::new(x, 0.0, 0.3);
            let to_light = Vec3::from(light) - p;
            let irradiance = Rgb::new(3.0, 2.0, 1.0) * (to_light.normalize().y / to_light.length_squared());
            let found = seen(&at, p + Vec3::Y, Vec3::NEG_Y);
            assert!((found - irradiance * 0.5 * FRAC_1_PI).abs().max_element() < 1e-5, "{frame}, {x}: {found}");
        }
    }
}

#[test]
fn an_added_sphere_casts_its_shadow_and_moves_on() {
    let f = folder("");
    let scene = scene(&f);
    let text = r#"{"fps": 1, "scene_lights": false, "lights": [{"type": "directional", "direction": [0, -2, 0], "irradiance": [1, 1, 1]}],
        "objects": [{"type": "sphere", "radius": 0.3, "albedo": [0.2, 0.4, 0.6], "keyframes": [
            {"time": 0, "position": [1, 1, 0]}, {"time": 1, "position": [2, 1, 0]}]}]}"#;
    let moving = animation(&f, &scene, text).unwrap();
    let world = World::new(scene);
    let floor = |world: &World, x: f32| seen(world, Vec3::new(x, 0.1, 0.0), Vec3::NEG_Y).x;
    let lit = 0.5 * FRAC_1_PI;
    for (frame, centre) in [(0, 1.0), (1, 2.0)] {
        let at = world.at(&moving, frame);
        for (offset, expected) in [(-0.28, 0.0), (0.0, 0.0), (0.28, 0.0), (-0.32, lit), (0.32, lit)] {
            let found = floor(&at, centre + offset);
            assert!((found - expected).abs() < 1e-6, "{frame}: {found} at {offset}");
        }
        let top = seen(&at, Vec3::new(centre, 2.0, 0.0), Vec3::NEG_Y);
        assert!((top - Rgb::new(0.2, 0.4, 0.6) * FRAC_1_PI).abs().max_element() < 1e-4, "{top}");
    }
}

#[test]
fn materials_take_other_albedos_and_roughness() {
    let f = folder("");
    let scene = scene(&f);
    let text = r#"{"fps": 1, "materials": [
        {"id": "Floor", "keyframes": [{"time": 0, "albedo": [0.5, 0.5, 0.5]}, {"time": 1, "albedo": [1, 0, 0.25]}]},
        {"id": "Wall", "roughness": 0.05}],
        "scene_lights": false, "lights": [{"type": "directional", "direction": [0, -1, 0], "irradiance": [1, 1, 1]}]}"#;
    let changing = animation(&f, &scene, text).unwrap();
    let ids: Vec<&str> = changing.changed_materials().iter().map(|&m| scene.materials[m as usize].name.as_str()).collect();
    assert_eq!(ids, ["Floor", "Wall"]);
    let world = World::new(scene);
    for (frame, albedo) in [(0, Rgb::splat(0.5)), (1, Rgb::new(1.0, 0.0, 0.25))] {
        let at = world.at(&changing, frame);
        let found = seen(&at, Vec3::new(1.0, 0.5, 0.0), Vec3::NEG_Y);
        assert!((found - albedo * FRAC_1_PI).abs().max_element() < 1e-6, "{frame}: {found}");
        let wall = at.intersect(&Ray::new(Vec3::Y, Vec3::NEG_Z)).unwrap();
        assert_eq!(at.scene.bsdf(&wall).alpha(&wall), Some(0.05));
    }
}

#[test]
fn without_its_lights_a_scene_is_dark_and_its_lamps_are_surfaces() {
    let f = folder(r#"<emitter type="constant"/><emitter type="point"><point name="position" x="0" y="1" z="1"/></emitter>"#);
    let scene = scene(&f);
    let dark = animation(&f, &scene, r#"{"scene_lights": false}"#).unwrap();
    let world = World::new(scene);
    let at = world.at(&dark, 0);
    assert!(image(&world, 0).emission.iter().any(|c| *c != Rgb::ZERO));
    let layers = image(&at, 0);
    assert!(layers.full().iter().all(|c| *c == Rgb::ZERO));
    assert!(at.lights.is_empty());
    let up = Ray::new(Vec3::Y, Vec3::Y);
    assert_eq!(at.intersect(&up).unwrap().p.y, world.intersect(&up).unwrap().p.y);
}

#[test]
fn a_world_without_glass_stays_without() {
    let f = folder("");
    let scene = scene(&f);
    let text = r#"{"objects": [{"type": "box", "size": [0.2, 0.2, 0.2], "position": [-2, 1, -1]}]}"#;
    let added = animation(&f, &scene, text).unwrap();
    let through = Ray::new(Vec3::new(-2.0, 1.0, 2.0), Vec3::NEG_Z);
    let at = World::new(scene.clone()).at(&added, 0);
    assert_eq!(at.intersect(&through).unwrap().p.z, 0.0, "the pane");
    let at = World::opaque(scene).0.at(&added, 0);
    assert!((at.intersect(&through).unwrap().p.z + 0.9).abs() < 1e-6, "the box behind it");
    assert!(at.occluded(&Ray { t_max: 2.95, ..through }) && !at.occluded(&Ray { t_max: 2.85, ..through }));
}

/// One frame of everything there is.
const EVERYTHING: &str = r#"{"fps": 10, "scene_lights": true,
  "lights": [
    {"type": "point", "intensity": [1, 2, 3], "keyframes": [{"time": 0, "position": [1, 1, 1]}, {"time": 0.2, "position": [1, 2, 2]}]},
    {"type": "spot", "position": [-1, 2, 1], "target": [-1, 0, 0], "intensity": [9, 9, 8], "cutoff_angle": 40, "beam_width": 10},
    {"type": "directional", "direction": [0.5, -1, -0.25], "irradiance": [0.25, 0.5, 0.5]},
    {"type": "area", "position": [1, 2, 0], "target": [0, 0, 0], "up": [0, 0, 1], "size": [0.5, 0.25], "radiance": [7, 6, 5]}],
  "materials": [{"id": "Floor", "albedo": [0.25, 0.5, 0.75]}, {"id": "Wall", "roughness": 0.125, "albedo": [0.5, 0.25, 0.25]}],
  "emission": [{"shape": "wall", "radiance": [0.125, 0, 0.25]}, {"shape": "lamp", "radiance": [1, 1, 2]}],
  "objects": [
    {"type": "sphere", "radius": 0.25, "position": [0.5, 0.25, 1], "albedo": [0.75, 0.5, 0.25]},
    {"type": "box", "size": [0.5, 0.25, 1], "position": [-0.5, 0.5, 0.5], "rotation": [30, 45, -20], "albedo": [0.25, 0.25, 0.5]},
    {"type": "mesh", "filename": "mesh.obj", "scale": 0.5, "position": [1.5, 0, 0.5], "keyframes": [
      {"time": 0, "rotation": [0, 0, 0]}, {"time": 0.2, "rotation": [0, 80, 0]}]}]}"#;

/// The same, written by hand: frame 1, at the middle of its keyframes. Shapes that emit are put where they are in the scene, so that
/// emitters come in another order: the wall's second, that of the scene's lamp first.
const BY_HAND: &str = r#"
  <shape type="sphere">
    <float name="radius" value="0.25"/><transform name="to_world"><translate x="0.5" y="0.25" z="1"/></transform>
    <bsdf type="diffuse"><rgb name="reflectance" value="0.75, 0.5, 0.25"/></bsdf>
  </shape>
  <shape type="cube">
    <transform name="to_world">
      <scale x="0.25" y="0.125" z="0.5"/><rotate x="1" angle="30"/><rotate y="1" angle="45"/><rotate z="1" angle="-20"/>
      <translate x="-0.5" y="0.5" z="0.5"/>
    </transform>
    <bsdf type="diffuse"><rgb name="reflectance" value="0.25, 0.25, 0.5"/></bsdf>
  </shape>
  <shape type="obj">
    <string name="filename" value="mesh.obj"/>
    <transform name="to_world"><scale value="0.5"/><rotate y="1" angle="40"/><translate x="1.5" y="0" z="0.5"/></transform>
    <bsdf type="diffuse"><rgb name="reflectance" value="0.5"/></bsdf>
  </shape>
  <emitter type="point"><point name="position" x="1" y="1.5" z="1.5"/><rgb name="intensity" value="1, 2, 3"/></emitter>
  <emitter type="spot">
    <transform name="to_world"><lookat origin="-1, 2, 1" target="-1, 0, 0" up="0, 0, 1"/></transform>
    <rgb name="intensity" value="9, 9, 8"/><float name="cutoff_angle" value="40"/><float name="beam_width" value="10"/>
  </emitter>
  <emitter type="directional"><vector name="direction" x="0.5" y="-1" z="-0.25"/><rgb name="irradiance" value="0.25, 0.5, 0.5"/></emitter>
  <shape type="rectangle">
    <transform name="to_world">
      <scale x="0.25" y="0.125"/><lookat origin="1, 2, 0" target="0, 0, 0" up="0, 0, 1"/>
    </transform>
    <emitter type="area"><rgb name="radiance" value="7, 6, 5"/></emitter>
  </shape>
"#;

fn by_hand() -> String {
    let wall = r#"<translate z="-2"/></transform><ref id="Wall"/></shape>"#;
    let glow = r#"<emitter type="area"><rgb name="radiance" value="0.125, 0, 0.25"/></emitter></shape>"#;
    let changes = [
        (r#"value="0.5"/></bsdf></bsdf>"#, r#"value="0.25, 0.5, 0.75"/></bsdf></bsdf>"#.to_owned()),
        (
            r#"<float name="alpha" value="0.3"/><rgb name="diffuse_reflectance" value="0.1, 0.2, 0.3"/>"#,
            r#"<float name="alpha" value="0.125"/><rgb name="diffuse_reflectance" value="0.5, 0.25, 0.25"/>"#.to_owned(),
        ),
        (wall, wall.replace("</shape>", glow)),
        (r#"value="4, 3, 2""#, r#"value="1, 1, 2""#.to_owned()),
        ("MORE", BY_HAND.to_owned()),
    ];
    changes.into_iter().fold(SCENE.to_owned(), |scene, (from, to)| {
        assert_eq!(scene.matches(from).count(), 1, "{from}");
        scene.replace(from, &to)
    })
}

/// Both ways, `unit_scale` times as large.
#[test]
fn a_frame_is_the_scene_that_one_would_write_by_hand() {
    for unit_scale in [1.0, 3.0] {
        let f = folder("");
        let options = LoadOptions { unit_scale: Some(unit_scale), ..LoadOptions::default() };
        let base = load(&f.at("scene.xml"), &options).unwrap();
        let animated = animation(&f, &base, EVERYTHING).unwrap();
        assert_eq!((animated.frames(), animated.files.len()), (3, 1));
        let at = World::new(base).at(&animated, 1);
        let rebuilt = World::new(at.scene.clone());
        assert_eq!(image(&at, 1), image(&rebuilt, 1), "one tree or two");
        std::fs::write(f.at("hand.xml"), by_hand()).unwrap();
        let hand = load(&f.at("hand.xml"), &options).unwrap();
        // The file's emitters in the order of the animated scene's: the wall shines first there, and the lamp second.
        let mut hand = World::new(swapped(hand));
        let positions = |w: &World| w.scene.geometry.positions.clone();
        for (a, b) in positions(&at).iter().zip(positions(&hand)) {
            assert!((*a - b).abs().max_element() <= 2e-7 * (1.0 + b.abs().max_element()), "{a} where {b} is by hand");
        }
        assert_eq!(positions(&at).len(), positions(&hand).len());
        hand.scene.sensor = at.scene.sensor.clone();
        let (found, wanted) = (image(&at, 1).full(), image(&hand, 1).full());
        let mean = wanted.iter().sum::<Rgb>() / wanted.len() as f32;
        for (i, (a, b)) in found.iter().zip(&wanted).enumerate() {
            assert!((*a - *b).abs().max_element() <= 1e-4 * mean.max_element(), "pixel {i}: {a} where {b} is by hand");
        }
        assert!(mean.min_element() > 0.05, "{mean}");
    }
}

/// The same scene with its first two emitters in each other's place.
fn swapped(mut scene: Scene) -> Scene {
    scene.emitters.swap(0, 1);
    for object in &mut scene.geometry_mut().objects {
        object.emitter = object.emitter.map(|e| if e < 2 { 1 - e } else { e });
    }
    scene
}

#[test]
fn keyframes_are_met_and_their_ends_hold() {
    let f = folder("");
    let scene = scene(&f);
    let text = r#"{"fps": 4, "lights": [{"type": "spot", "position": [0, 3, 0], "cutoff_angle": 30, "keyframes": [
        {"time": 0.25, "target": [0, 0, 0], "intensity": [0, 1, 2]},
        {"time": 0.5, "target": [1, 0, 0], "intensity": [8, 1, 2]},
        {"time": 1.5, "target": [1, 0, 1], "intensity": [8, 1, 0]},
        {"time": 2, "target": [0, 0, 1], "intensity": [0, 1, 0]}]}]}"#;
    let moving = animation(&f, &scene, text).unwrap();
    assert_eq!(moving.frames(), 9);
    let spot = |frame| match moving.scene_at(&scene, frame).emitters.pop().unwrap() {
        Emitter::Spot { direction, intensity, cutoff_rad, beam_rad, .. } => (direction, intensity, cutoff_rad, beam_rad),
        other => panic!("{other:?}"),
    };
    let keys = [
        (0, [0, 0], [0, 1, 2]),
        (1, [0, 0], [0, 1, 2]),
        (2, [1, 0], [8, 1, 2]),
        (6, [1, 1], [8, 1, 0]),
        (8, [0, 1], [0, 1, 0]),
        (50, [0, 1], [0, 1, 0]),
    ];
    for (frame, [x, z], intensity) in keys {
        let (direction, found, cutoff, beam) = spot(frame);
        let expected = Vec3::new(x as f32, -3.0, z as f32).normalize();
        assert!((direction - expected).length() < 1e-6, "{frame}: {direction}");
        assert_eq!(found, Rgb::from(intensity.map(|i| i as f32)), "{frame}");
        assert!((cutoff - PI / 6.0).abs() < 1e-6 && (beam - PI / 8.0).abs() < 1e-6);
    }
    // The spline swings above 8 between the keys, and not below 0 after them.
    assert!(spot(4).1.x > 8.0);
    assert!((0..12).all(|frame| spot(frame).1.min_element() >= 0.0));
}

#[test]
fn wrong_files_are_errors_that_say_where() {
    let f = folder("");
    let scene = scene(&f);
    let point = |rest: &str| format!(r#"{{"fps": 2, "lights": [{{"type": "point", "position": [0, 1, 0], {rest}}}]}}"#);
    let cases = [
        ("{\n\"fps\": }".to_owned(), "lights.json:2: "),
        ("{\n\n\"light\": []}".into(), "lights.json:3: unknown field `light`"),
        (r#"{"lights": 7}"#.into(), "lights.json:1: invalid type"),
        (r#"{"scene_lights": "no"}"#.into(), "lights.json:1: invalid type"),
        (r#"{"fps": -1}"#.into(), "fps = -1: expected more than 0"),
        (r#"{"lights": [7]}"#.into(), "lights[0]: found 7, expected an object"),
        (r#"{"lights": [{}]}"#.into(), "lights[0]: found no \"type\""),
        (r#"{"lights": [{"type": "sun"}]}"#.into(), "lights[0]: type = \"sun\": expected one of point, spot, directional, area"),
        (point(r#""power": 3"#), "lights[0]: unknown \"power\", expected one of type, position, intensity, keyframes"),
        (point(r#""keyframes": []"#), "lights[0]: keyframes: expected a list of 1 to"),
        (r#"{"lights": [{"type": "point", "position": [0, 1, 0]}]}"#.into(), "lights[0]: found no \"intensity\""),
        (point(r#""intensity": 3"#), "lights[0]: intensity = 3: expected a list of three numbers of 0 or more"),
        (point(r#""intensity": [1, 2]"#), "lights[0]: intensity = [1,2]: expected a list of three"),
        (point(r#""intensity": [1, -2, 0]"#), "lights[0]: intensity = [1,-2,0]: expected"),
        (point(r#""intensity": [1, 1e300, 0]"#), "lights[0]: intensity"),
        (point(r#""intensity": [1, 1e400, 0]"#), "lights.json:1: number out of range"),
        (point(r#""intensity": [1, null, 0]"#), "lights[0]: intensity = [1,null,0]"),
        (point(r#""intensity": [1, 1, 1], "keyframes": [{"position": [0, 0, 0]}]"#), "lights[0].keyframes[0]: found no \"time\""),
        (point(r#""intensity": [1, 1, 1], "keyframes": [{"time": 0}]"#), "lights[0]: keyframes: found times alone"),
        (point(r#""intensity": [1, 1, 1], "keyframes": [{"time": "now", "position": [0, 0, 0]}]"#), "keyframes[0]: time = \"now\""),
        (
            point(r#""keyframes": [{"time": 0, "intensity": [1, 1, 1]}, {"time": 1, "position": [0, 0, 0]}]"#),
            "lights[0].keyframes[0]: found no \"position\", which other keyframes give",
        ),
        (
            point(r#""keyframes": [{"time": 0, "intensity": [1, 1, 1]}, {"time": 1, "intensity": [1, 1, "x"]}]"#),
            "lights[0].keyframes[1]: intensity",
        ),
        (
            point(r#""keyframes": [{"time": 1, "intensity": [1, 1, 1]}, {"time": 1, "intensity": [1, 1, 1]}]"#),
            "lights[0].keyframes[1]: time 1 follows 1: expected ascending",
        ),
        (point(r#""keyframes": [{"time": 0, "colour": [1, 1, 1]}]"#), "lights[0].keyframes[0]: unknown \"colour\""),
        (point(r#""keyframes": [{"time": 1e6, "intensity": [1, 1, 1]}]"#), "2000000 frames until the last keyframe"),
        (point(r#""keyframes": [{"time": 0, "intensity": [1, 1, 1]}]"#).replace("\"fps\": 2, ", ""), "without \"fps\""),
        (
            r#"{"lights": [{"type": "spot", "position": [0, 1, 0], "target": [0, 1, 0], "intensity": [1, 1, 1]}]}"#.into(),
            "lights[0]: position and target are the same",
        ),
        (
            r#"{"fps": 2, "lights": [{"type": "directional", "irradiance": [1, 1, 1], "keyframes": [
                {"time": 0, "direction": [1, 0, 0]}, {"time": 1, "direction": [-1, 0, 0]}]}]}"#.into(),
            "lights[0]: the direction has no length, at 0.5 s",
        ),
        (
            r#"{"lights": [{"type": "area", "position": [0, 1, 0], "target": [0, 0, 0], "size": [1, 1], "radiance": [1, 1, 1]}]}"#.into(),
            "lights[0]: up [0, 1, 0] is parallel",
        ),
        (
            r#"{"lights": [{"type": "area", "position": [0, 1, 0], "target": [1, 1, 0], "size": [0, 1], "radiance": [1, 1, 1]}]}"#.into(),
            "lights[0]: size = [0,1]: expected a list of two numbers of more than 0",
        ),
        (r#"{"materials": [{"id": "Flor", "albedo": [0, 0, 0]}]}"#.into(), "materials[0]: the scene has no material \"Flor\"; there are Floor, Wall, Mirror"),
        (r#"{"materials": [{"id": "Floor"}]}"#.into(), "materials[0]: found neither \"albedo\" nor \"roughness\""),
        (r#"{"materials": [{"id": "Floor", "albedo": [0, 0, 1.5]}]}"#.into(), "materials[0]: albedo = [0,0,1.5]: expected a list of three numbers from 0 to 1"),
        (r#"{"materials": [{"id": "Floor", "roughness": 0.5}]}"#.into(), "materials[0]: roughness: the material \"Floor\" is of no rough model"),
        (r#"{"materials": [{"id": "Mirror", "albedo": [0, 0, 0]}]}"#.into(), "materials[0]: albedo: the material \"Mirror\" has no diffuse"),
        (
            r#"{"materials": [{"id": "Wall", "roughness": 0.5}, {"id": "Wall", "albedo": [0, 0, 0]}]}"#.into(),
            "materials[1]: the material \"Wall\" is that of materials[0], too",
        ),
        (r#"{"emission": [{"shape": "door", "radiance": [1, 1, 1]}]}"#.into(), "emission[0]: the scene has no shape \"door\"; there are floor, wall, mirror, lamp, pane"),
        (r#"{"emission": [{"shape": "wall"}]}"#.into(), "emission[0]: found no \"radiance\""),
        (r#"{"objects": [{"type": "sphere", "position": [0, 0, 0]}]}"#.into(), "objects[0]: found no \"radius\""),
        (r#"{"objects": [{"type": "sphere", "radius": -1, "position": [0, 0, 0]}]}"#.into(), "objects[0]: radius = -1: expected a number of more than 0"),
        (r#"{"objects": [{"type": "box", "size": [1, 1], "position": [0, 0, 0]}]}"#.into(), "objects[0]: size = [1,1]: expected a list of three"),
        (r#"{"objects": [{"type": "mesh", "filename": "cat.obj", "position": [0, 0, 0]}]}"#.into(), "cat.obj"),
        (r#"{"objects": [{"type": "mesh", "filename": "lights.json", "position": [0, 0, 0]}]}"#.into(), "expected an obj, ply or serialized file, not .json"),
        (
            r#"{"fps": 1, "objects": [{"type": "box", "size": [1, 1, 1], "position": [0, 0, 0], "keyframes": [{"time": 0, "size": [1, 1, 1]}]}]}"#.into(),
            "objects[0].keyframes[0]: unknown \"size\", expected one of time, position, rotation, albedo",
        ),
        (
            format!(r#"{{"objects": [{}]}}"#, vec![r#"{"type": "sphere", "radius": 1, "position": [0, 0, 0]}"#; 300].join(",")),
            "triangles with those before, expected at most",
        ),
        (format!(r#"{{"lights": [{}]}}"#, vec!["{}"; 1001].join(",")), "lights: found 1001 entries, expected at most 1000"),
    ];
    for (text, expected) in cases {
        let message = animation(&f, &scene, &text).expect_err(&text).to_string();
        assert!(message.contains("lights.json") && message.contains(expected), "{text}: {message}");
    }
}

#[test]
fn frames_from_the_command_line() {
    let f = folder("");
    let lights = r#"{"fps": 2, "scene_lights": false, "lights": [{"type": "point", "intensity": [3, 3, 3], "keyframes": [
        {"time": 0, "position": [-2, 1, 1]}, {"time": 1, "position": [2, 1, 1]}]}],
        "objects": [{"type": "mesh", "filename": "mesh.obj", "position": [0, 0, 0]}]}"#;
    std::fs::write(f.at("lights.json"), lights).unwrap();
    let command = "render-path scene.xml --lights lights.json --method path-trace --spp 2 --aov all --device cpu -o out";
    f.success(command);
    let read = |name: &str| {
        let path = f.at("out").join(name);
        let image = ExrImage::read(&path).unwrap();
        (image.rgb(&path, "").unwrap(), image.f32(&path, "depth").unwrap(), image)
    };
    let [(first, depth, image), (last, ..)] = ["0000.exr", "0002.exr"].map(read);
    assert!(!f.at("out/0003.exr").exists());
    let half = |pixels: &[Rgb], right: bool| -> f32 {
        pixels.iter().enumerate().filter(|(i, _)| (i % 24 >= 12) == right).map(|(_, c)| c.y).sum()
    };
    assert!(half(&first, false) > 1.5 * half(&first, true) && half(&last, true) > 1.5 * half(&last, false));
    let provenance = image.provenance(&f.at("out/0000.exr")).unwrap();
    assert_eq!(provenance.inputs.keys().collect::<Vec<_>>(), ["lights", "lights.mesh0"]);
    // The auxiliary layers show the added mesh, too.
    f.success("render-path scene.xml --method path-trace --spp 2 --aov all --device cpu -o plain");
    let plain = ExrImage::read(&f.at("plain/0000.exr")).unwrap().f32(&f.at("plain/0000.exr"), "depth").unwrap();
    assert!(depth.iter().zip(&plain).any(|(a, b)| a < b) && depth.iter().zip(&plain).all(|(a, b)| a <= b));
    // A path of one frame stays for all, and of a longer one the frames count.
    let frame = r#"{"origin": [0, 1, 4], "target": [0, 0, 0]}"#;
    for (frames, count) in [(frame.to_owned(), 3), ([frame; 2].join(","), 2)] {
        std::fs::write(f.at("path.json"), format!(r#"{{"fov": 50, "size": [4, 4], "frames": [{frames}]}}"#)).unwrap();
        f.success(&format!(
            "render-path scene.xml --lights lights.json --path path.json --method path-trace --spp 1 --device cpu -o of{count}"
        ));
        assert!(
            f.at(&format!("of{count}/{:04}.exr", count - 1)).exists() && !f.at(&format!("of{count}/{count:04}.exr")).exists()
        );
    }
    let message = f.refusal("render-path scene.xml --lights lights.json --probes p --curvature c -o no");
    assert!(
        message.contains(
            "--lights: --method glossy-probes has no use for it: its probes hold the light that was baked; path-trace, radiance-probes, many-light has"
        ),
        "{message}"
    );
    let message = f.refusal("render-path scene.xml --lights none.json --method path-trace -o no");
    assert!(message.contains("none.json"), "{message}");
}

#[test]
fn the_example_of_the_docs_is_a_file_for_the_room() {
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR"));
    let docs = std::fs::read_to_string(root.join("docs/lights.md")).unwrap();
    let example = docs.split("```json\n").nth(1).and_then(|rest| rest.split("```").next()).unwrap();
    let f = folder("");
    std::fs::copy(root.join("scenes/room/bowl.obj"), f.at("bowl.obj")).unwrap();
    let room = load(&root.join("scenes/room/scene.xml"), &LoadOptions::default()).unwrap();
    let read = animation(&f, &room, example).unwrap();
    assert_eq!((read.frames(), read.lights.len(), read.objects.len(), read.changed_materials().len()), (49, 4, 3, 2));
}
