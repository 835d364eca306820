//! `render-path --method many-light` from the command line.

mod folder;
mod layers;

use folder::Folder;
use layers::{layer, squares};
use reprobe::base::math::{Rgb, reflect};
use reprobe::exchange::{LoadOptions, load};
use reprobe::material::bsdf::warp::direction;
use reprobe::material::bsdf::{Lobes, Query};
use reprobe::method::many_light::emit::exponent;
use reprobe::method::many_light::lobe::density;
use reprobe::method::many_light::{Kernel, ManyLightParams};
use reprobe::scene::Camera;
use reprobe::surface::CurvatureMap;
use reprobe::transport::path::{PathParams, radiance};
use reprobe::transport::{Sampler, World};
use reprobe::view::composite::downsample;
use reprobe::view::gbuffer::gbuffer;
use serde_json::Value;
use std::f32::consts::TAU;

/// A room with a plate of metal just above its floor, so that hardly anything stands in the way of indirect light.
const SCENE: &str = r#"<scene version="3.0.0">
    <sensor type="perspective"><float name="fov" value="75"/>
      <transform name="to_world"><lookat origin="0, 0, 1.7" target="0, -0.4, 0" up="0, 1, 0"/></transform>
      <film type="hdrfilm"><integer name="width" value="36"/><integer name="height" value="24"/></film></sensor>
    <bsdf type="twosided" id="wall"><bsdf type="diffuse"><rgb name="reflectance" value="0.7, 0.5, 0.3"/></bsdf></bsdf>
    <bsdf type="twosided" id="metal"><bsdf type="roughconductor"><float name="alpha" value="0.25"/></bsdf></bsdf>
    <shape type="cube" id="room"><transform name="to_world"><scale value="2"/></transform><ref id="wall"/></shape>
    <shape type="rectangle" id="plate"><transform name="to_world"><rotate x="1" angle="-90"/><translate y="-1.9"/></transform><ref id="metal"/></shape>
    <emitter type="point"><point name="position" x="0" y="1.5" z="0"/><rgb name="intensity" value="4"/></emitter>
    </scene>"#;
const LIGHTS: &str = r#"{"fps": 1, "scene_lights": false,
    "lights": [{"type": "point", "intensity": [4, 4, 4],
                "keyframes": [{"time": 0, "position": [-1.2, 1, 0.5]}, {"time": 2, "position": [1.2, 1, 0.5]}]}],
    "objects": [{"type": "box", "size": [0.5, 0.5, 0.5], "albedo": [0.9, 0.1, 0.1],
                 "keyframes": [{"time": 0, "position": [-0.5, -1, -0.5]}, {"time": 2, "position": [0.5, -1, -0.5]}]}]}"#;
const PATH: &str = r#"{"fov": 75, "size": [36, 24], "frames": [{"origin": [0, 0, 1.7], "target": [0, -0.4, 0]}]}"#;
const RENDER: &str = "render-path scene.xml --path path.json --method many-light";

fn timings(f: &Folder, folder: &str) -> Value {
    serde_json::from_str(&std::fs::read_to_string(f.at(folder).join("timings.json")).unwrap()).unwrap()
}

/// Rays a pixel each way: the path tracer's are spread over it, too, and the plate's edges lie within pixels.
const FINE: usize = 4;

/// What Phong lobes in place of microfacets add to the glossy layer, by quadrature: both see the same light of `bounces`, along rays spread
/// evenly over the hemisphere.
fn lobes_for_microfacets(f: &Folder, bounces: u32) -> Vec<Rgb> {
    const RAYS: u32 = 256;
    let world = World::new(load(&f.at("scene.xml"), &LoadOptions::default()).unwrap());
    let camera = world.scene.sensor.as_ref().unwrap();
    let camera = Camera { size: camera.size.map(|s| s * FINE as u32), ..camera.clone() };
    let view = gbuffer(&world, &CurvatureMap::flat(world.scene.geometry.positions.len()), &camera);
    let glossy = Query { lobes: Lobes::NON_DIFFUSE, ..Query::default() };
    let paths = PathParams { max_depth: bounces, rr_depth: u32::MAX };
    let fine = view.shade([7, 0], |p, stream| {
        let Some(alpha) = p.alpha else { return Rgb::ZERO };
        let (frame, bsdf) = (p.surface.frame, world.scene.bsdf(&p.surface));
        let (wi, mirrored) = (frame.to_local(p.wo), reflect(p.wo, p.normal));
        let albedo = bsdf.glossy_albedo(&p.surface, wi, glossy);
        let ray = |k| {
            let mut sampler = Sampler::new(stream, k);
            let u = sampler.next_2d();
            let local = direction(u.x, u.y);
            let d = frame.to_world(local);
            let lobe = albedo * density(Kernel::Phong, exponent(alpha, &ManyLightParams::default()), d.dot(mirrored));
            (lobe - bsdf.eval(&p.surface, wi, local, glossy)) * radiance(&world, &p.surface.spawn(d), &paths, &mut sampler)
        };
        (0..RAYS).map(ray).sum::<Rgb>() * (TAU / RAYS as f32)
    });
    downsample(&fine, view.size(), FINE)
}

/// Where hardly anything blocks indirect light, a frame is the path tracer's, at the same number of bounces, but for what Phong lobes in place
/// of microfacets do to the plate, which quadrature tells, unless rays follow the microfacets; then both layers are within the same bounds.
#[test]
fn a_convex_room_is_as_path_traced() {
    let f = Folder::with(SCENE, PATH);
    let render = format!("{RENDER} --supersample {FINE} --set direct_samples=4 --set sampling=full --set traversal=full");
    f.success(&format!("{render} --set bounces=3 -o gathered"));
    // A ray's end is one more bounce.
    f.success(&format!("{render} --set bounces=2 --set mirror_alpha=0.3 --set mirror_samples=4 -o followed"));
    f.success("render-path scene.xml --path path.json --method path-trace --max-depth 4 --spp 512 --device cpu -o reference");
    let read = |folder: &str, name: &str| squares(&layer(&f, &format!("{folder}/0000.exr"), name));
    let lobes = squares(&lobes_for_microfacets(&f, 3));
    for (folder, name) in [("gathered", "diffuse"), ("gathered", "glossy"), ("followed", "glossy")] {
        let (ours, mut theirs) = (read(folder, name), read("reference", name));
        if (folder, name) == ("gathered", "glossy") {
            theirs.iter_mut().zip(&lobes).for_each(|(sum, lobe)| *sum += lobe);
        }
        let rms = |values: &mut dyn Iterator<Item = f32>| (values.map(|x| x * x).sum::<f32>() / 36.0).sqrt();
        let (wrong, size) = (rms(&mut ours.iter().zip(&theirs).map(|(a, b)| a.y - b.y)), rms(&mut theirs.iter().map(|c| c.y)));
        assert!(size > 0.003 && wrong < 0.05 * size, "{folder} {name}: {wrong} of {size}");
        let [mean, expected] = [&ours, &theirs].map(|layer| layer.iter().map(|c| c.y).sum::<f32>() / 36.0);
        assert!((mean / expected - 1.0).abs() < 0.02, "{folder} {name}: {mean}, {expected}");
    }
    f.success(&format!("{RENDER} --set bounces=1 --set direct_samples=1 -o few"));
    let counts = &timings(&f, "few")["frames"][0]["counts"];
    let [points, most] = ["shading points", "most nodes"].map(|name| counts[name].as_f64().unwrap());
    assert!(points > 10.0 && points <= 36.0 * 24.0 && most > 100.0, "{counts}");
}

#[test]
fn lights_and_objects_move_and_any_frame_can_be_made_alone() {
    let f = Folder::with(SCENE, PATH);
    std::fs::write(f.at("lights.json"), LIGHTS).unwrap();
    let quick = "--set vpls=3000 --set bounces=1 --set direct_samples=2 --set mirror_alpha=0.3 --set lobes=2";
    f.success(&format!("{RENDER} --lights lights.json {quick} --threads 1 -o frames"));
    f.success(&format!("{RENDER} --lights lights.json {quick} --threads 3 --frames 2 -o alone"));
    let [first, last] = [0, 2].map(|i| layer(&f, &format!("frames/{i:04}.exr"), ""));
    let mean = |half: &dyn Fn(usize) -> bool, frame: &[Rgb]| {
        frame.iter().enumerate().filter(|(i, _)| half(i % 36)).map(|(_, c)| c.y).sum::<f32>()
    };
    let [left, right] = [mean(&|x| x < 18, &first), mean(&|x| x >= 18, &first)];
    assert!(left > 1.1 * right && mean(&|x| x < 18, &last) < mean(&|x| x >= 18, &last) / 1.1, "{left} {right}");
    let read = |path: &str| std::fs::read(f.at(path)).unwrap();
    assert!(read("frames/0002.exr") == read("alone/0002.exr"), "a frame depends on others or on threads");
}

#[test]
fn what_is_out_of_range_is_refused() {
    let f = Folder::with(SCENE, PATH);
    for set in [
        "vpls=0",
        "bounces=0",
        "min_cut=1",
        "shadow_rays=17",
        "max_exponent=0.5",
        "clamp=0",
        "sampling=some",
        "traversal=half",
        "lobes=5",
        "mirror_rays=65",
    ] {
        let message = f.refusal(&format!("{RENDER} --set {set} -o no"));
        assert!(message.contains(set.split('=').next().unwrap()), "{set}: {message}");
    }
    assert!(f.refusal(&format!("{RENDER} --probes p -o no")).contains("--probes: --method many-light has no use for it"));
}
