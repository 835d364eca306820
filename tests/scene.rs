//! Scene files: what they mean in each dialect, and what a bad one is told.

use glam::{Vec2, Vec3};
use reprobe::exchange::{LoadOptions, load};
use reprobe::material::Texture;
use reprobe::material::bsdf::Bsdf;
use reprobe::scene::{Emitter, Scene};
use reprobe::transport::World;
use std::fs;
use std::path::Path;
use tempfile::TempDir;

const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n";

/// A folder with `a.obj`, `b.obj` and a bitmap.
fn folder() -> TempDir {
    let dir = tempfile::tempdir().unwrap();
    for name in ["a.obj", "b.obj"] {
        fs::write(dir.path().join(name), TRIANGLE).unwrap();
    }
    image::RgbImage::from_fn(4, 2, |x, y| image::Rgb([(x * 60) as u8, (y * 200) as u8, 90]))
        .save(dir.path().join("t.png"))
        .unwrap();
    dir
}

fn load_in(dir: &TempDir, name: &str, text: &str, options: &LoadOptions) -> reprobe::Result<Scene> {
    let path = dir.path().join(name);
    fs::write(&path, text).unwrap();
    load(&path, options)
}

fn xml(text: &str) -> Scene {
    let scene = load_in(&folder(), "s.xml", &format!("<scene version='3.0.0'>{text}</scene>"), &LoadOptions::default());
    scene.unwrap_or_else(|e| panic!("{e}"))
}

/// A shape with a material, and a light so that nothing warns.
fn with_bsdf(bsdf: &str) -> Scene {
    xml(&format!("<shape type='rectangle'>{bsdf}</shape><emitter type='constant'/>"))
}

const OLD: &str = r#"<?xml version='1.0' encoding='utf-8'?>
<scene version="0.6.0">
    <integrator type="path"><integer name="maxDepth" value="65"/></integrator>
    <sensor type="thinlens">
        <float name="fov" value="50"/> <string name="fovAxis" value="y"/>
        <float name="apertureRadius" value="0.1"/> <float name="focusDistance" value="3"/>
        <transform name="toWorld"><lookAt origin="1, 2, 3" target="-1, 0.5, 0" up="0.1, 1, 0"/></transform>
        <sampler type="independent"><integer name="sampleCount" value="16"/></sampler>
        <film type="hdrfilm"><integer name="width" value="320"/><integer name="height" value="200"/><rfilter type="tent"/></film>
    </sensor>
    <bsdf type="twosided" id="Wood">
        <bsdf type="roughplastic">
            <float name="alpha" value="0.2"/> <string name="distribution" value="ggx"/>
            <float name="intIOR" value="1.5"/> <float name="extIOR" value="1"/> <boolean name="nonlinear" value="true"/>
            <texture name="diffuseReflectance" type="bitmap">
                <string name="filename" value="t.png"/> <string name="filterType" value="bilinear"/>
                <string name="wrapMode" value="mirror"/>
            </texture>
        </bsdf>
    </bsdf>
    <bsdf type="bumpmap" id="Bumpy">
        <texture name="map" type="checkerboard"/>
        <bsdf type="roughconductor"><string name="material" value="Cu"/><float name="alphaU" value="0.1"/><float name="alphaV" value="0.3"/></bsdf>
    </bsdf>
    <shape type="obj">
        <string name="filename" value="a.obj"/> <boolean name="faceNormals" value="true"/>
        <transform name="toWorld"><scale value="2"/><rotate y="1" angle="90"/><translate x="1"/></transform>
        <ref id="Wood"/>
    </shape>
    <shape type="sphere">
        <point name="center" x="0" y="1" z="2"/> <float name="radius" value="0.5"/> <ref id="Bumpy"/>
        <emitter type="area"><spectrum name="radiance" value="2"/></emitter>
    </shape>
    <emitter type="point"><point name="position" x="0" y="3" z="0"/><rgb name="intensity" value="1, 2, 3"/></emitter>
</scene>"#;

const NEW: &str = r#"<scene version="3.0.0">
    <integrator type="path"><integer value="65" name="max_depth"/></integrator>
    <sensor type="thinlens">
        <string name="fov_axis" value="y"/> <float name="fov" value="50.0"/>
        <float name="aperture_radius" value=".1"/> <float name="focus_distance" value="3"/>
        <transform name="to_world"><lookat origin="1 2 3" target="-1 0.5 0" up="0.1 1 0"/></transform>
        <sampler type="independent"><integer name="sample_count" value="16"/></sampler>
        <film type="hdrfilm"><integer name="height" value="200"/><integer name="width" value="320"/><rfilter type="tent"/></film>
    </sensor>
    <bsdf type="twosided" id="wood">
        <bsdf type="roughplastic">
            <string name="distribution" value="ggx"/> <float name="alpha" value="0.2"/>
            <float name="int_ior" value="1.5"/> <float name="ext_ior" value="1"/> <boolean name="nonlinear" value="true"/>
            <texture name="diffuse_reflectance" type="bitmap">
                <string name="filename" value="t.png"/> <string name="filter_type" value="bilinear"/>
                <string name="wrap_mode" value="mirror"/>
            </texture>
        </bsdf>
    </bsdf>
    <bsdf type="bumpmap" id="bumpy">
        <texture name="map" type="checkerboard"/>
        <bsdf type="roughconductor"><string name="material" value="Cu"/><float name="alpha_u" value="0.1"/><float name="alpha_v" value="0.3"/></bsdf>
    </bsdf>
    <shape type="obj">
        <boolean name="face_normals" value="true"/> <string name="filename" value="a.obj"/>
        <transform name="to_world"><scale value="2"/><rotate value="0, 1, 0" angle="90"/><translate value="1, 0, 0"/></transform>
        <ref id="wood"/>
    </shape>
    <shape type="sphere">
        <point name="center" value="0, 1, 2"/> <float name="radius" value="0.5"/> <ref id="bumpy"/>
        <emitter type="area"><spectrum name="radiance" value="2"/></emitter>
    </shape>
    <emitter type="point"><point name="position" value="0, 3, 0"/><rgb name="intensity" value="1, 2, 3"/></emitter>
</scene>"#;

const JSON: &str = r#"{"type": "scene",
    "integrator": {"type": "path", "max_depth": 65},
    "sensor": {"type": "thinlens", "fov": 50, "fov_axis": "y", "aperture_radius": 0.1, "focus_distance": 3,
        "to_world": [{"look_at": {"origin": [1, 2, 3], "target": [-1, 0.5, 0], "up": [0.1, 1, 0]}}],
        "sampler": {"type": "independent", "sample_count": 16},
        "film": {"type": "hdrfilm", "width": 320, "height": 200, "filter": {"type": "tent"}}},
    "wood": {"type": "twosided", "nested": {"type": "roughplastic", "alpha": 0.2, "distribution": "ggx",
        "int_ior": 1.5, "ext_ior": 1, "nonlinear": true,
        "diffuse_reflectance": {"type": "bitmap", "filename": "t.png", "filter_type": "bilinear", "wrap_mode": "mirror"}}},
    "bumpy": {"type": "bumpmap", "map": {"type": "checkerboard"},
        "nested": {"type": "roughconductor", "material": "Cu", "alpha_u": 0.1, "alpha_v": 0.3}},
    "floor": {"type": "obj", "filename": "a.obj", "face_normals": true, "bsdf": {"type": "ref", "id": "wood"},
        "to_world": [{"scale": 2}, {"rotate": {"axis": [0, 1, 0], "angle": 90}}, {"translate": [1, 0, 0]}]},
    "ball": {"type": "sphere", "center": [0, 1, 2], "radius": 0.5, "bsdf": {"type": "ref", "id": "bumpy"},
        "light": {"type": "area", "radiance": {"type": "spectrum", "value": 2}}},
    "lamp": {"type": "point", "position": [0, 3, 0], "intensity": {"type": "rgb", "value": [1, 2, 3]}}}"#;

#[test]
fn three_ways_to_write_a_scene_are_one_scene() {
    let dir = folder();
    let scenes = [("old.xml", OLD), ("new.xml", NEW), ("s.json", JSON)]
        .map(|(name, text)| load_in(&dir, name, text, &LoadOptions::default()).unwrap_or_else(|e| panic!("{e}")));
    for scene in &scenes {
        assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
        assert_eq!(scene.hash, scenes[0].hash, "{}", scene.path.display());
        assert_eq!(scene.geometry.positions, scenes[0].geometry.positions);
        assert_eq!(scene.sensor, scenes[0].sensor);
        let bsdfs = |s: &Scene| s.materials.iter().map(|m| format!("{:?}", m.bsdf)).collect::<Vec<_>>();
        assert_eq!(bsdfs(scene), bsdfs(&scenes[0]));
        assert_eq!(format!("{:?}", scene.emitters), format!("{:?}", scenes[0].emitters));
    }
    let scene = &scenes[0];
    assert_eq!(scene.max_depth, Some(65));
    // Scaled by 2, turned by a quarter about y (x goes to -z), moved along x.
    assert!((scene.geometry.positions[1] - Vec3::new(1.0, 0.0, -2.0)).length() < 1e-6);
    assert!(scene.geometry.objects[0].face_normals && scene.geometry.objects[0].name == "a");
    let sensor = scene.sensor.as_ref().unwrap();
    assert_eq!((sensor.size, sensor.aperture_radius, sensor.focus_distance), ([320, 200], 0.1, 3.0));
    assert!((sensor.fov_x.to_degrees() - 73.452_67).abs() < 1e-4);
    let Emitter::Area { object: 1, radiance } = &scene.emitters[0] else { panic!("{:?}", scene.emitters) };
    // Mitsuba 3.9.1: an emitter's spectrum of one number is white of equal energy.
    assert!((radiance.eval(Vec2::ZERO) - Vec3::new(2.40959, 1.89658, 1.81783)).length() < 1e-4);
    let Bsdf::BumpMap(bump) = &scene.materials[1].bsdf else { panic!("{:?}", scene.materials[1]) };
    let Bsdf::RoughConductor(metal) = &*bump.nested else { panic!("{bump:?}") };
    assert!((metal.metal.eta - Vec3::new(0.201_005, 0.923_75, 1.102_215)).length() < 1e-4);
    assert_eq!((metal.alpha_u.eval(Vec2::ZERO).x, metal.alpha_v.eval(Vec2::ZERO).x), (0.1, 0.3));
}

#[test]
fn every_plugin_and_spelling_loads_without_a_warning() {
    let scene = xml(r#"
        <sensor type="perspective"><string name="focal_length" value="35mm"/><float name="near_clip" value="0.1"/></sensor>
        <bsdf type="diffuse" id="d"><rgb name="reflectance" value="0.1 0.2 0.3"/></bsdf>
        <texture type="bitmap" id="t"><string name="filename" value="t.png"/><boolean name="raw" value="true"/>
            <string name="filter_type" value="trilinear"/><transform name="to_uv"><scale x="2" y="3"/></transform></texture>
        <shape type="rectangle"><bsdf type="plastic"><ref name="diffuse_reflectance" id="t"/><string name="int_ior" value="water"/></bsdf></shape>
        <shape type="cube"><bsdf type="conductor"><string name="material" value="none"/></bsdf></shape>
        <shape type="disk"><bsdf type="conductor"><rgb name="eta" value="0.2 0.9 1.1"/><rgb name="k" value="3.9 2.4 2.1"/></bsdf></shape>
        <shape type="cylinder"><point name="p0" value="0 0 0"/><point name="p1" value="0 2 0"/><float name="radius" value="0.3"/>
            <bsdf type="dielectric"/></shape>
        <shape type="rectangle"><bsdf type="thindielectric"/></shape>
        <shape type="rectangle"><bsdf type="roughdielectric"><float name="alpha" value="0.3"/></bsdf></shape>
        <shape type="rectangle"><bsdf type="twosided"><ref id="d"/><bsdf type="diffuse"/></bsdf></shape>
        <shape type="rectangle"><bsdf type="normalmap"><ref name="normalmap" id="t"/><ref id="d"/></bsdf></shape>
        <shape type="rectangle"><bsdf type="blendbsdf"><float name="weight" value="0.3"/><ref id="d"/><bsdf type="plastic"/></bsdf></shape>
        <shape type="rectangle"><bsdf type="principled"><rgb name="base_color" value="1 0 0"/><float name="metallic" value="0.3"/>
            <float name="specular" value="0.4"/></bsdf></shape>
        <shape type="rectangle"/>
        <emitter type="spot"><transform name="to_world"><lookat origin="0 3 0" target="0 0 0" up="0 0 1"/></transform></emitter>
        <emitter type="directional"><vector name="direction" value="0 -2 0"/></emitter>
        <emitter type="envmap"><string name="filename" value="t.png"/><float name="scale" value="2"/></emitter>"#);
    assert!(scene.warnings.is_empty(), "{:#?}", scene.warnings);
    assert_eq!(scene.materials.len(), 12, "one shared, eleven of their own");
    let default = &scene.materials[scene.geometry.objects.last().unwrap().material as usize];
    assert!(matches!(&default.bsdf, Bsdf::Diffuse(d) if d.reflectance.eval(Vec2::ZERO) == Vec3::splat(0.5)));
    let Bsdf::Plastic(plastic) = &scene.materials[1].bsdf else { panic!() };
    assert_eq!((plastic.params.int_ior, plastic.params.ext_ior), (1.333, 1.000_277));
    let Texture::Bitmap(bitmap) = &plastic.params.diffuse_reflectance else { panic!() };
    assert_eq!(bitmap.image.pixel(1, 0).x, 60.0 / 255.0, "raw");
    assert_eq!(bitmap.to_uv.transform_point2(Vec2::ONE), Vec2::new(2.0, 3.0));
    // Mitsuba 3.9.1 at its default film of 768x576: 35 mm film's diagonal at a focal length of 35 mm.
    let Emitter::Spot { direction, cutoff_rad, beam_rad, .. } = scene.emitters[0] else { panic!() };
    assert!((direction + Vec3::Y).length() < 1e-6);
    assert!((cutoff_rad.to_degrees() - 20.0).abs() < 1e-4 && (beam_rad.to_degrees() - 15.0).abs() < 1e-4);
    let Emitter::Directional { direction, .. } = scene.emitters[1] else { panic!() };
    assert_eq!(direction, -Vec3::Y);
}

#[test]
fn masks_become_the_materials_opacity_wherever_they_stand() {
    let mask = "<bsdf type='mask'><float name='opacity' value='0.25'/>";
    let diffuse = "<bsdf type='diffuse'/>";
    let bump = "<bsdf type='bumpmap'><texture type='checkerboard'/>";
    for text in [
        format!("{mask}<bsdf type='twosided'>{diffuse}</bsdf></bsdf>"),
        format!("<bsdf type='twosided'>{mask}{diffuse}</bsdf></bsdf>"),
        format!("{mask}{bump}{diffuse}</bsdf></bsdf>"),
        format!("{bump}{mask}{diffuse}</bsdf></bsdf>"),
        format!("<bsdf type='mask'><float name='opacity' value='0.5'/><bsdf type='mask'>{diffuse}</bsdf></bsdf>"),
    ] {
        let scene = with_bsdf(&text);
        assert_eq!(scene.materials[0].opacity.as_ref().unwrap().eval(Vec2::ZERO, true), 0.25, "{text}");
        assert!(scene.warnings.is_empty());
    }
    assert!(with_bsdf(diffuse).materials[0].opacity.is_none());
}

#[test]
fn shapes_that_refer_to_one_bsdf_share_its_material() {
    let scene =
        xml("<bsdf type='diffuse' id='d'/><shape type='cube'><ref id='d'/></shape><shape type='disk'><ref id='d'/></shape>
        <shape type='cube'/><shape type='cube'/><emitter type='constant'/>");
    let used: Vec<u32> = scene.geometry.objects.iter().map(|o| o.material).collect();
    assert_eq!(used, [0, 0, 1, 1]);
    assert_eq!([&scene.materials[0].name, &scene.materials[1].name], ["d", "default"]);
}

/// Mitsuba 3.9.1, `ray_intersect` under a mirroring `to_world`: a sphere's normals turn inwards, a cylinder's do not.
#[test]
fn mirrored_spheres_face_inwards() {
    let outward = |shape: &str, flip: bool, x: f32| {
        let scene = xml(&format!(
            "<shape type='{shape}'><boolean name='flip_normals' value='{flip}'/>
             <transform name='to_world'><scale x='{x}'/></transform></shape><emitter type='constant'/>"
        ));
        let g = &scene.geometry;
        let radial = |t: u32| g.corners(t)[0].with_z(0.0);
        let side = (0..g.triangles.len() as u32).map(|t| g.area_normal(t).dot(radial(t))).sum::<f32>();
        let shading = (0..g.positions.len()).map(|i| g.normals[i].dot(g.positions[i].with_z(0.0))).sum::<f32>();
        assert_eq!(side > 0.0, shading > 0.0, "{shape}: winding and vertex normals disagree");
        side > 0.0
    };
    for flip in [false, true] {
        assert_eq!(outward("sphere", flip, 1.0), !flip);
        assert_eq!(outward("sphere", flip, -1.0), flip);
        assert_eq!(outward("cylinder", flip, -1.0), !flip);
    }
}

#[test]
fn parameters_includes_and_paths_resolve() {
    let dir = folder();
    fs::create_dir(dir.path().join("sub")).unwrap();
    fs::rename(dir.path().join("b.obj"), dir.path().join("sub/c.obj")).unwrap();
    let part = "<scene version='3.0.0'><shape type='obj'><string name='filename' value='$which'/></shape></scene>";
    fs::write(dir.path().join("part.xml"), part).unwrap();
    let text =
        "<scene version='3.0.0'><default name='which' value='a.obj'/><default name='r' value='2'/><default name='rr' value='3'/>
        <path value='sub'/><include filename='part.xml'/>
        <shape type='sphere'><float name='radius' value='$rr'/><point name='center' x='$r' y='0' z='-$r'/></shape>
        <emitter type='constant'/></scene>";
    let scene = load_in(&dir, "s.xml", text, &LoadOptions::default()).unwrap();
    assert_eq!(scene.geometry.objects[0].name, "a");
    let (lower, upper) = scene.geometry.bounds();
    assert!((upper.x - 5.0).abs() < 0.1 && (lower.z + 5.0).abs() < 0.1, "{lower} {upper}");
    let options = LoadOptions { defines: vec![("which".into(), "c.obj".into())], ..Default::default() };
    assert_eq!(load_in(&dir, "s.xml", text, &options).unwrap().geometry.objects[0].name, "c");
}

#[test]
fn unit_scale_keeps_the_picture_and_scales_all_lengths() {
    let text = "<scene version='3.0.0'><sensor type='thinlens'><float name='aperture_radius' value='0.1'/>
        <transform name='to_world'><translate x='1' z='-5'/></transform></sensor><shape type='sphere'/>
        <emitter type='point'><point name='position' value='0 3 0'/></emitter></scene>";
    let dir = folder();
    let [one, hundred] = [1.0, 100.0].map(|unit_scale| {
        load_in(&dir, "s.xml", text, &LoadOptions { unit_scale: Some(unit_scale), ..Default::default() }).unwrap()
    });
    assert!((hundred.geometry.bounds().1 - one.geometry.bounds().1 * 100.0).length() < 1e-3);
    let [near, far] = [&one, &hundred].map(|s| s.sensor.clone().unwrap());
    assert_eq!(far.position(), near.position() * 100.0);
    assert!((far.aperture_radius - 10.0).abs() < 1e-5 && far.focus_distance == 1e6 && far.fov_x == near.fov_x);
    let Emitter::Point { position, intensity } = hundred.emitters[0] else { panic!() };
    assert_eq!((position.y, intensity.x), (300.0, 1e4), "the irradiance stays");
    assert_ne!(one.hash, hundred.hash);
}

#[test]
fn the_hash_follows_content_not_names_or_layout() {
    let dir = folder();
    let hash = |text: &str| load_in(&dir, "s.xml", text, &LoadOptions::default()).unwrap().hash;
    let scene = |file: &str, radius: &str, space: &str| {
        format!(
            "<scene version='3.0.0'>{space}<shape type='obj'>{space}<string name='filename' value='{file}'/></shape>
             <shape type='sphere'><float name='radius' value='{radius}'/></shape><emitter type='constant'/></scene>"
        )
    };
    let base = hash(&scene("a.obj", "1", ""));
    assert_eq!(hash(&scene("b.obj", "1.0", "\n\n  <!-- the same bytes elsewhere -->")), base);
    assert_ne!(hash(&scene("a.obj", "1.5", "")), base);
    fs::write(dir.path().join("a.obj"), TRIANGLE.replace("v 1", "v 2")).unwrap();
    assert_ne!(hash(&scene("a.obj", "1", "")), base);
}

#[test]
fn threads_do_not_change_what_is_loaded() {
    let dir = folder();
    let shapes: String = (0..40)
        .map(|i| {
            let name = format!("m{i}.obj");
            fs::write(dir.path().join(&name), TRIANGLE.replace("v 1", &format!("v {i}"))).unwrap();
            format!("<shape type='obj'><string name='filename' value='{name}'/></shape>")
        })
        .collect();
    let text = format!("<scene version='3.0.0'>{shapes}<emitter type='constant'/></scene>");
    let [one, many] = [1, 7].map(|n| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap();
        pool.install(|| load_in(&dir, "s.xml", &text, &LoadOptions::default()).unwrap())
    });
    assert_eq!(one.geometry.positions, many.geometry.positions);
    assert_eq!(one.hash, many.hash);
    assert_eq!(one.geometry.positions[1].x, 0.0);
    assert_eq!(one.geometry.positions[3 * 39 + 1].x, 39.0);
}

#[test]
fn unknown_properties_are_warnings_with_their_line() {
    let scene = xml(
        "\n<shape type='cube'>\n<float name='wobble' value='1'/>\n<bsdf type='diffuse'>\n<float name='gloss' value='1'/></bsdf></shape>",
    );
    let [gloss, wobble, dark] = scene.warnings.as_slice() else { panic!("{:#?}", scene.warnings) };
    assert!(gloss.contains("s.xml:5: unknown property \"gloss\" of diffuse"), "{gloss}");
    assert!(wobble.contains("s.xml:3: unknown property \"wobble\" of cube"), "{wobble}");
    assert!(dark.contains("no emitter"), "{dark}");
}

#[test]
fn bad_xml_is_told_where_and_why() {
    let dir = folder();
    fs::write(dir.path().join("bad.obj"), "v 0 0 0\nv 1 0 0\nv nan 1 0\nf 1 2 3\n").unwrap();
    fs::write(dir.path().join("range.obj"), "v 0 0 0\nv 1 0 0\nf 1 2 9\n").unwrap();
    fs::write(dir.path().join("broken.png"), b"\x89PNG\r\n\x1a\n nothing").unwrap();
    fs::write(dir.path().join("loop.xml"), "<scene version='3.0.0'>\n<include filename='loop2.xml'/></scene>").unwrap();
    fs::write(dir.path().join("loop2.xml"), "<scene version='3.0.0'><include filename='loop.xml'/></scene>").unwrap();
    let deep = |open: &str, close: &str| format!("{}{}", open.repeat(5000), close.repeat(5000));
    // Seven tenfold references would be ten million models.
    let mut bomb = String::from("<bsdf type='diffuse' id='b0'/>");
    for i in 1..30 {
        let r = i - 1;
        bomb += &format!("<bsdf type='blendbsdf' id='b{i}'><ref id='b{r}'/><ref id='b{r}'/></bsdf>");
    }
    let shape = |inner: &str| format!("\n<shape type='cube'>{inner}</shape>");
    let matrix = |m: &str| shape(&format!("<transform name='to_world'>\n{m}</transform>"));
    let rows = "0 0 0 0 1 0 0 0 0 1 0 0 0 0 1";
    for (body, expected) in [
        ("\n<shape type='teapot'/>".into(), "s.xml:2: unknown shape plugin \"teapot\""),
        (shape("\n<bsdf type='velvet'/>"), "s.xml:3: unknown bsdf plugin \"velvet\""),
        ("\n<emitter type='timed_sunsky'/>".into(), "s.xml:2: timed_sunsky"),
        ("<texture type='marble'/>".into(), "unknown texture plugin"),
        ("<sensor type='fisheye'/>".into(), "unknown sensor plugin"),
        ("\n<widget type='x'/>".into(), "s.xml:2: unknown element <widget>"),
        ("<shape type='obj'>\n<string name='filename' value='no.obj'/></shape>".into(), "s.xml:2: no file \"no.obj\""),
        ("\n<shape type='obj'/>".into(), "s.xml:2: obj has no \"filename\""),
        ("<shape type='obj'><string name='filename' value='bad.obj'/></shape>".into(), "bad.obj"),
        ("<shape type='obj'><string name='filename' value='range.obj'/></shape>".into(), "range.obj"),
        ("<texture type='bitmap'><string name='filename' value='broken.png'/></texture>".into(), "broken.png"),
        ("\n<shape>".into(), "s.xml:2: not well-formed XML"),
        ("\n<shape/>".into(), "s.xml:2: <shape> has no attribute \"type\""),
        (shape("\n<ref id='nobody'/>"), "s.xml:3: nothing has the id \"nobody\""),
        ("<bsdf type='diffuse' id='d'/>\n<bsdf type='diffuse' id='d'/>".into(), "s.xml:2: the id \"d\" is given twice"),
        ("\n<include filename='loop.xml'/>".into(), "loop2.xml:1: \"loop.xml\" includes itself"),
        ("\n<include filename='none.xml'/>".into(), "s.xml:2: no file \"none.xml\""),
        ("\n<path value='nowhere'/>".into(), "s.xml:2: no folder"),
        (shape("\n<float name='radius' value='$big'/>"), "s.xml:3: the parameter \"$big\" has no value"),
        (matrix(&format!("<matrix value='nan {rows}'/>")), "s.xml:3: found \"nan\""),
        (matrix(&format!("<matrix value='1e30 {rows}'/>")), "s.xml:3: the transform holds"),
        (matrix("<matrix value='1 0 0'/>"), "s.xml:3: matrix: 3 numbers"),
        (matrix("<matrix value='0 0 0 0 0 0 0 0 1'/>"), "s.xml:2: the transform flattens space"),
        (matrix("<scale value='inf'/>"), "s.xml:3: found \"inf\""),
        (matrix("<shear value='1'/>"), "s.xml:3: found <shear>"),
        (shape("\n<boolean name='flip_normals' value='perhaps'/>"), "s.xml:3: found \"perhaps\""),
        (shape("\n<integer name='flip_normals' value='1'/>"), "s.xml:3: cube: flip_normals is an integer, expected a boolean"),
        ("<shape type='sphere'>\n<float name='radius' value='0'/></shape>".into(), "s.xml:2: radius = 0"),
        (shape("<bsdf type='roughplastic'>\n<float name='int_ior' value='-1'/></bsdf>"), "s.xml:3: int_ior = -1"),
        (shape("<bsdf type='conductor'>\n<string name='material' value='Un'/></bsdf>"), "s.xml:3: unknown metal \"Un\""),
        (shape("<bsdf type='diffuse'>\n<rgb name='reflectance' value='0, -1, 0'/></bsdf>"), "s.xml:3: diffuse: reflectance"),
        (shape("\n<bsdf type='twosided'/>"), "s.xml:3: twosided: found 0 nested bsdfs"),
        (shape("<bsdf type='roughplastic'>\n<string name='distribution' value='phong'/></bsdf>"), "s.xml:3: distribution"),
        ("<sensor type='perspective'>\n<float name='fov' value='180'/></sensor>".into(), "s.xml:2: fov = 180"),
        ("<emitter type='constant'/>\n<emitter type='constant'/>".into(), "s.xml:2: a second environment"),
        ("<bsdf type='twosided' id='a'><ref id='a'/></bsdf>".into(), "refer to themselves"),
        (bomb, "more than 200000"),
        (deep("<bsdf type='twosided'>", "</bsdf>"), "nested more than 500 deep"),
        ("<bsdf type='twosided'>".repeat(100) + &"</bsdf>".repeat(100), "nested more than 64 deep"),
        (deep("<a>", "</a>"), "s.xml"),
        ("<emitter type='constant'/>".into(), "s.xml: the scene has no triangles"),
        (
            "<shape type='obj'><string name='filename' value='flat.obj'/></shape><emitter type='constant'/>".into(),
            "s.xml: all triangles together have an area of 0",
        ),
    ] {
        fs::write(dir.path().join("flat.obj"), "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n").unwrap();
        let text = format!("<scene version='3.0.0'>{body}</scene>");
        let message = match load_in(&dir, "s.xml", &text, &LoadOptions::default()) {
            Ok(_) => panic!("loaded: {}", &body[..body.len().min(200)]),
            Err(e) => e.to_string(),
        };
        assert!(message.contains(expected), "{}\n  {message}\n  expected {expected}", &body[..body.len().min(200)]);
    }
    for text in [
        "",
        "nonsense",
        "<scene",
        "<?xml version='1.0'?>",
        "<!DOCTYPE a [<!ENTITY b 'c'>]><scene>&b;</scene>",
        "<bsdf type='diffuse'/>",
    ] {
        let message = load_in(&dir, "s.xml", text, &LoadOptions::default()).err().map(|e| e.to_string()).unwrap();
        assert!(message.contains("s.xml"), "{message}");
    }
    assert!(load(Path::new("/no/such/scene.xml"), &LoadOptions::default()).unwrap_err().to_string().contains("scene.xml"));
}

#[test]
fn every_truncation_of_a_scene_is_an_error_and_no_panic() {
    let dir = folder();
    for (name, text) in [("s.xml", OLD), ("s.json", JSON)] {
        for cut in (0..text.len() - 1).step_by(7) {
            let result = load_in(&dir, name, &text[..cut], &LoadOptions::default());
            assert!(result.is_err(), "{name} cut at {cut}");
        }
    }
}

#[test]
fn bad_json_is_told_where_and_why() {
    let dir = folder();
    for (body, expected) in [
        ("", "s.json:1: not well-formed JSON"),
        ("[1, 2]", "expected"),
        ("{\"type\": \"diffuse\"}", "s.json:1"),
        ("{\"type\": \"scene\",\n\"a\": {\"type\": \"teapot\"}}", "s.json:2: unknown plugin \"teapot\""),
        ("{\"type\": \"scene\",\n\"a\": {\"radius\": 1}}", "s.json:2: \"a\" has no \"type\""),
        ("{\"type\": \"scene\", \"a\": {\"type\": \"obj\",\n\"filename\": \"no.obj\"}}", "s.json:2: no file \"no.obj\""),
        ("{\"type\": \"scene\", \"a\": {\"type\": \"sphere\",\n\"radius\": \"big\"}}", "s.json:2: sphere: radius is a string"),
        ("{\"type\": \"scene\", \"a\": {\"type\": \"sphere\",\n\"radius\": null}}", "s.json:2"),
        ("{\"type\": \"scene\", \"a\": {\"type\": \"sphere\",\n\"radius\": 1e400}}", "s.json"),
        ("{\"type\": \"scene\", \"a\": {\"type\": \"sphere\",\n\"center\": [1, 2]}}", "s.json:2: \"center\": found a list of 2"),
        ("{\"type\": \"scene\", \"a\": {\"type\": \"cube\",\n\"to_world\": [[1, 2], [3, 4]]}}", "s.json:2: matrix: 4 numbers"),
        ("{\"type\": \"scene\", \"a\": {\"type\": \"cube\",\n\"to_world\": [{\"shear\": 1}]}}", "s.json:2: found \"shear\""),
        (
            "{\"type\": \"scene\", \"a\": {\"type\": \"cube\"},\n\"a\": {\"type\": \"cube\"}}",
            "s.json:2: the key \"a\" is here twice",
        ),
        (
            "{\"type\": \"scene\", \"a\": {\"type\": \"cube\",\n\"m\": {\"type\": \"ref\", \"id\": \"x\"}}}",
            "s.json:2: nothing has the id",
        ),
    ] {
        let message = load_in(&dir, "s.json", body, &LoadOptions::default()).err().map(|e| e.to_string());
        let message = message.unwrap_or_else(|| panic!("loaded: {body}"));
        assert!(message.contains(expected), "{body}\n  {message}\n  expected {expected}");
    }
    let deep = format!("{{\"type\": \"scene\", \"a\": {}{}}}", "{\"type\": \"twosided\", \"n\": ".repeat(3000), "}".repeat(3000));
    assert!(load_in(&dir, "s.json", &deep, &LoadOptions::default()).is_err());
    let deep = format!("{}1{}", "[".repeat(100_000), "]".repeat(100_000));
    assert!(load_in(&dir, "s.json", &deep, &LoadOptions::default()).is_err());
}

/// Unpacks scenes that lie beside the repository; `None` (and a line) where there are none.
fn real_scenes(names: &[&str]) -> Option<std::path::PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let unpack = root.join("../shared/scenes/unpack.sh");
    if !unpack.is_file() {
        println!("skipped: {} is not there", unpack.display());
        return None;
    }
    let folder = root.join("target/scenes");
    let status = std::process::Command::new("bash").arg(unpack).arg(&folder).args(names).status();
    assert!(status.is_ok_and(|s| s.success()), "unpack.sh failed");
    Some(folder)
}

fn albedo(bsdf: &Bsdf, uv: Vec2) -> Vec3 {
    match bsdf {
        Bsdf::TwoSided(b) => albedo(&b.front, uv),
        Bsdf::BumpMap(b) => albedo(&b.nested, uv),
        Bsdf::Diffuse(b) => b.reflectance.eval(uv),
        Bsdf::Plastic(b) => b.params.diffuse_reflectance.eval(uv),
        Bsdf::RoughPlastic(b) => b.params.diffuse_reflectance.eval(uv),
        _ => Vec3::ZERO,
    }
}

/// Pixel, then what Mitsuba 3.9.1 meets there: position, shading normal, texture coordinate, diffuse reflectance.
type Seen = ([f32; 2], [f32; 3], [f32; 3], [f32; 2], [f32; 3]);

#[test]
fn real_scenes_are_what_mitsuba_sees() {
    let staircase2: [Seen; 3] = [
        ([0.5, 0.5], [3.5934, 2.7349, 3.0892], [1.0, 0.0, 0.0], [0.0483, 3.1174], [0.89329; 3]),
        ([1000.25, 300.75], [1.7937, 2.107, -2.9982], [0.0, 0.0, 1.0], [5.362, 3.6678], [0.89329; 3]),
        ([640.0, 360.0], [1.0249, 1.6516, -0.2941], [1.0, 0.0, 0.0], [0.466, 0.0731], [0.47871, 0.09039, 0.00107]),
    ];
    let living_room: [Seen; 3] = [
        ([0.5, 0.5], [3.8521, 1.9405, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0], [0.1; 3]),
        ([1000.25, 300.75], [0.0, 1.5022, -3.6185], [1.0, 0.0, 0.0], [0.0, 1.0], [0.1; 3]),
        ([640.0, 360.0], [-0.4313, 1.1594, -0.8012], [1.0, 0.0, 0.0], [0.0, 1.0], [0.8; 3]),
    ];
    let Some(folder) = real_scenes(&["staircase2", "living-room"]) else { return };
    for (name, triangles, seen) in [("staircase2", 30_927, staircase2), ("living-room", 143_163, living_room)] {
        let scene = load(&folder.join(name).join("scene.xml"), &LoadOptions::default()).unwrap();
        assert!(scene.warnings.is_empty(), "{:#?}", scene.warnings);
        // Mitsuba's disks have no triangles.
        let flat = scene.geometry.objects.iter().filter(|o| o.name != "disk");
        assert_eq!(flat.map(|o| o.triangles.len()).sum::<usize>(), triangles, "{name}");
        let world = World::new(scene);
        let camera = world.scene.sensor.as_ref().unwrap();
        for (pixel, p, n, uv, reflectance) in seen {
            let s = world.intersect(&camera.ray(Vec2::from_array(pixel), Vec2::splat(0.5))).unwrap();
            let found = albedo(world.scene.bsdf(&s), s.uv);
            assert!((s.p - Vec3::from_array(p)).length() < 2e-4, "{name} {pixel:?}: p {}", s.p);
            assert!((s.frame.n - Vec3::from_array(n)).length() < 1e-3, "{name} {pixel:?}: n {}", s.frame.n);
            assert!((s.uv - Vec2::from_array(uv)).length() < 1e-3, "{name} {pixel:?}: uv {}", s.uv);
            assert!((found - Vec3::from_array(reflectance)).length() < 4e-3, "{name} {pixel:?}: reflectance {found}");
        }
    }
}
