//! Path-traced frames. Both twins draw the same random numbers, so that pixels agree but for rounding, and for the few paths that rounding sends
//! another way.

use crate::{Device, room};
use glam::Vec3;
use reprobe::base::math::Rgb;
use reprobe::base::progress::Silent;
use reprobe::gpu::GpuScene;
use reprobe::method::path_trace::gpu::PathTracer;
use reprobe::method::path_trace::{PathTraceParams, path_trace, path_trace_full};
use reprobe::scene::Camera;
use reprobe::transport::World;
use reprobe::transport::path::PathParams;
use reprobe::view::layers::LayerImages;
use std::sync::Arc;

/// Share of the pixels that differ by more than rounding, and by how much the means do.
pub fn difference(a: &[Rgb], b: &[Rgb]) -> (f32, f32) {
    assert_eq!(a.len(), b.len());
    let apart = a.iter().zip(b).filter(|(a, b)| (**a - **b).abs().max_element() > 1e-3 * (1.0 + b.max_element())).count();
    let mean = |side: &[Rgb]| side.iter().map(|c| c.as_dvec3().element_sum()).sum::<f64>();
    (apart as f32 / a.len() as f32, ((mean(a) - mean(b)) / mean(b).max(1e-9)).abs() as f32)
}

fn check(what: &str, gpu: &LayerImages, cpu: &LayerImages, most_apart: f32) {
    for (layer, a, b) in [
        ("emission", &gpu.emission, &cpu.emission),
        ("diffuse", &gpu.diffuse, &cpu.diffuse),
        ("glossy", &gpu.glossy, &cpu.glossy),
    ] {
        assert!(b.iter().any(|c| *c != Rgb::ZERO), "{what}: no {layer}");
        let (apart, mean) = difference(a, b);
        assert!(apart <= most_apart && mean < 2e-3, "{what}, {layer}: {apart} of the pixels, means by {mean}");
    }
}

pub fn layers_and_full_images_are_the_cpus(device: &Device) {
    let gpu = device.gpu();
    let world = room();
    let camera = Camera { size: [48, 27], ..world.scene.sensor.clone().unwrap() };
    let params = PathTraceParams { spp: 8, ..PathTraceParams::default() };
    let scene = Arc::new(GpuScene::new(gpu, &world).unwrap());
    let tracer = PathTracer::new(scene.clone(), &params.path, true).unwrap();
    let cpu = path_trace(&world, &camera, &params, 3, 5, &Silent);
    check("room", &tracer.layers(&camera, params.spp, 3, 5, &Silent).unwrap(), &cpu, 0.01);
    let short = PathTraceParams { path: PathParams { max_depth: 2, rr_depth: 1 }, ..params };
    let full = PathTracer::new(scene, &short.path, false).unwrap().full(&camera, short.spp, 3, 5, &Silent).unwrap();
    let (apart, mean) = difference(&full, &path_trace_full(&world, &camera, &short, 3, 5, &Silent));
    assert!(apart < 0.01 && mean < 2e-3, "full image: {apart} of the pixels, means by {mean}");
}

/// A sphere of each scattering model, nested ones too, before every kind of emitter. No masks: whether a ray passes hangs on its last bit.
pub fn zoo(folder: &std::path::Path) -> World {
    let pixel = |x: u32, y: u32| image::Rgb([(40 + 30 * (x % 7)) as u8, (250 - 20 * (y % 9)) as u8, (150 + (x * y) % 101) as u8]);
    image::RgbImage::from_fn(16, 12, pixel).save(folder.join("map.png")).unwrap();
    let sky = (0..128).map(|i| if i == 37 { Rgb::splat(60.0) } else { Vec3::new(0.3, 0.4, 0.6) * (i % 16) as f32 / 8.0 });
    reprobe::io::ExrImage::new(16, 8).with_rgb("", &sky.collect::<Vec<_>>()).write(&folder.join("sky.exr")).unwrap();
    let map = |name: &str| format!("<texture type='bitmap' name='{name}'><string name='filename' value='map.png'/></texture>");
    let color = map("reflectance");
    let models = [
        format!("<bsdf type='diffuse'>{color}</bsdf>"),
        "<bsdf type='plastic'><boolean name='nonlinear' value='true'/></bsdf>".into(),
        "<bsdf type='roughplastic'><float name='alpha' value='0.2'/><string name='distribution' value='ggx'/></bsdf>".into(),
        "<bsdf type='conductor'><string name='material' value='Au'/></bsdf>".into(),
        "<bsdf type='roughconductor'><float name='alpha_u' value='0.3'/><float name='alpha_v' value='0.1'/></bsdf>".into(),
        "<bsdf type='roughconductor'><float name='alpha' value='0.2'/><string name='distribution' value='ggx'/></bsdf>".into(),
        "<bsdf type='dielectric'/>".into(),
        "<bsdf type='thindielectric'/>".into(),
        "<bsdf type='roughdielectric'><float name='alpha' value='0.2'/></bsdf>".into(),
        format!(
            "<bsdf type='principled'>{}<float name='roughness' value='0.4'/><float name='metallic' value='0.3'/><float name='clearcoat' value='0.8'/><float name='sheen' value='0.5'/></bsdf>",
            map("base_color")
        ),
        "<bsdf type='principled'><float name='roughness' value='0.3'/><float name='spec_trans' value='0.7'/></bsdf>".into(),
        format!(
            "<bsdf type='twosided'><bsdf type='bumpmap'>{}<float name='scale' value='0.05'/><bsdf type='roughplastic'/></bsdf></bsdf>",
            map("arbitrary")
        ),
        format!(
            "<bsdf type='normalmap'>{}<bsdf type='roughconductor'/></bsdf>",
            "<texture type='bitmap' name='normalmap'><boolean name='raw' value='true'/><string name='filename' value='map.png'/></texture>"
        ),
        format!(
            "<bsdf type='twosided'><bsdf type='blendbsdf'>{}<bsdf type='diffuse'/><bsdf type='roughconductor'><float name='alpha' value='0.1'/></bsdf></bsdf></bsdf>",
            map("weight")
        ),
    ];
    let spheres = models.iter().enumerate().map(|(i, model)| {
        let (x, z) = (-2.0 + (i % 5) as f32, (i / 5) as f32 * 1.2 - 1.2);
        format!(
            "<shape type='sphere'><float name='radius' value='0.4'/><point name='center' x='{x}' y='0.4' z='{z}'/>{model}</shape>"
        )
    });
    let text = format!(
        "<scene version='3.0.0'>
        <sensor type='thinlens'><float name='fov' value='50'/><float name='aperture_radius' value='0.02'/><float name='focus_distance' value='6'/>
          <transform name='to_world'><lookat origin='0.5,3,5.5' target='0,0.3,0' up='0,1,0'/></transform>
          <film type='hdrfilm'><integer name='width' value='64'/><integer name='height' value='48'/></film></sensor>
        <emitter type='envmap'><string name='filename' value='sky.exr'/></emitter>
        <emitter type='point'><point name='position' x='2' y='3' z='2'/><rgb name='intensity' value='6 5 4'/></emitter>
        <emitter type='spot'><transform name='to_world'><lookat origin='-2,3,1' target='0,0,0' up='0,1,0'/></transform><rgb name='intensity' value='9 9 9'/></emitter>
        <emitter type='directional'><vector name='direction' x='0.3' y='-1' z='0.2'/><rgb name='irradiance' value='1 1 0.5'/></emitter>
        <shape type='rectangle'><transform name='to_world'><rotate x='1' angle='90'/><translate y='3.5'/></transform>
          <emitter type='area'><rgb name='radiance' value='3 3 3'/></emitter></shape>
        <shape type='sphere'><float name='radius' value='0.15'/><point name='center' x='-1.5' y='1.2' z='1'/>
          <emitter type='area'>{}</emitter></shape>
        <shape type='rectangle'><transform name='to_world'><rotate x='1' angle='-90'/><scale value='4'/></transform>
          <bsdf type='diffuse'><texture type='checkerboard' name='reflectance'/></bsdf></shape>
        {}</scene>",
        map("radiance"),
        spheres.collect::<String>()
    );
    let file = folder.join("zoo.xml");
    std::fs::write(&file, text).unwrap();
    World::new(reprobe::exchange::load(&file, &Default::default()).unwrap())
}

pub fn every_model_and_emitter_is_the_cpus(device: &Device) {
    let gpu = device.gpu();
    let folder = tempfile::tempdir().unwrap();
    let world = zoo(folder.path()).with_outlook();
    let camera = world.scene.sensor.clone().unwrap();
    let params = PathTraceParams { spp: 8, ..PathTraceParams::default() };
    let scene = Arc::new(GpuScene::new(gpu, &world).unwrap());
    let gpu = PathTracer::new(scene, &params.path, true).unwrap().layers(&camera, params.spp, 1, 0, &Silent).unwrap();
    check("zoo", &gpu, &path_trace(&world, &camera, &params, 1, 0, &Silent), 0.05);
}

/// Seen by the camera too, at the edge of the horizon.
pub fn a_sky_and_its_sun_are_the_cpus(device: &Device) {
    let gpu = device.gpu();
    let folder = tempfile::tempdir().unwrap();
    let text = "<scene version='3.0.0'>
        <sensor type='perspective'><float name='fov' value='60'/>
          <transform name='to_world'><lookat origin='0,1,5' target='0,0.8,0' up='0,1,0'/></transform>
          <film type='hdrfilm'><integer name='width' value='48'/><integer name='height' value='32'/></film></sensor>
        <emitter type='sunsky'><transform name='to_world'><rotate x='1' angle='-90'/></transform>
          <vector name='sun_direction' x='0.2' y='0.05' z='-1'/><float name='sun_aperture' value='8'/></emitter>
        <shape type='rectangle'><transform name='to_world'><rotate x='1' angle='-90'/><scale value='4'/></transform>
          <bsdf type='diffuse'/></shape>
        <shape type='sphere'><float name='radius' value='0.7'/><point name='center' x='-1' y='0.7' z='0'/>
          <bsdf type='roughconductor'><float name='alpha' value='0.2'/></bsdf></shape>
        <shape type='sphere'><float name='radius' value='0.7'/><point name='center' x='1' y='0.7' z='1'/><bsdf type='diffuse'/></shape></scene>";
    let file = folder.path().join("sky.xml");
    std::fs::write(&file, text).unwrap();
    let world = || World::new(reprobe::exchange::load(&file, &Default::default()).unwrap());
    for (what, world) in [("sky", world()), ("what is seen of it", world().with_outlook())] {
        let camera = world.scene.sensor.clone().unwrap();
        let params = PathTraceParams { spp: 8, ..PathTraceParams::default() };
        let scene = Arc::new(GpuScene::new(gpu.clone(), &world).unwrap());
        let gpu = PathTracer::new(scene, &params.path, true).unwrap().layers(&camera, params.spp, 1, 0, &Silent).unwrap();
        check(what, &gpu, &path_trace(&world, &camera, &params, 1, 0, &Silent), 0.05);
    }
}

pub fn a_model_that_the_gpu_lacks_is_named(device: &Device) {
    let gpu = device.gpu();
    let folder = tempfile::tempdir().unwrap();
    let bump = "<texture type='checkerboard'/>";
    let text = format!(
        "<scene version='3.0.0'><shape type='sphere'><bsdf type='bumpmap' id='twice'>{bump}<bsdf type='bumpmap'>{bump}<bsdf type='diffuse'/></bsdf></bsdf></shape></scene>"
    );
    let file = folder.path().join("twice.xml");
    std::fs::write(&file, text).unwrap();
    let world = World::new(reprobe::exchange::load(&file, &Default::default()).unwrap());
    let Err(error) = GpuScene::new(gpu, &world) else { panic!("took it") };
    assert!(error.to_string().contains("twice") && error.to_string().contains("--device cpu"), "{error}");
}
