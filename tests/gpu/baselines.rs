//! Frames by the baselines.

use crate::bakes::lightmap;
use crate::paths::difference;
use crate::{Device, room};
use reprobe::base::math::Rgb;
use reprobe::gpu::view::frame::BaselineFrame;
use reprobe::lightmap::{AtlasParams, LightMap, LightMapParams};
use reprobe::method::image_space_gather::gpu::ImageSpaceGather;
use reprobe::method::image_space_gather::{ImageSpaceGatherParams, gather_image, mirror_image};
use reprobe::method::lightmap_rt::gpu::LightmapRt;
use reprobe::method::lightmap_rt::{LightmapRtParams, lightmap_rt};
use reprobe::scene::Camera;
use reprobe::surface::CurvatureMap;
use reprobe::transport::World;
use reprobe::view::composite::{diffuse_layer, downsample, emission_layer};
use reprobe::view::gbuffer::{GBuffer, gbuffer};

/// The room with a light map, and a view of it with 2 x 2 rays a pixel.
struct Setting {
    world: World,
    lightmap: LightMap,
    camera: Camera,
    view: GBuffer,
}

const SUPERSAMPLE: u32 = 2;

impl Setting {
    fn new() -> Self {
        let world = room();
        let atlas = AtlasParams { texel: Some(0.3), ..AtlasParams::default() };
        let lightmap = lightmap(&world, &LightMapParams { spp: 4, atlas, ..LightMapParams::default() }, None);
        let camera = Camera { size: [64, 36], ..world.scene.sensor.clone().unwrap() };
        let fine = Camera { size: camera.size.map(|s| s * SUPERSAMPLE), ..camera.clone() };
        let view = gbuffer(&world, &CurvatureMap::flat(world.scene.geometry.positions.len()), &fine);
        Self { world, lightmap, camera, view }
    }

    /// Checks that a frame has the CPU's layers, `glossy` being at the view's size: but for this share of its pixels, and within `rmse`.
    fn check(&self, what: &str, frame: &BaselineFrame, glossy: &[Rgb], [apart, rmse]: [f32; 2]) {
        let small = |fine: &[Rgb]| downsample(fine, self.view.size(), SUPERSAMPLE as usize);
        let layers = [
            ("emission", &frame.layers.emission, small(&emission_layer(&self.view)), 0.0),
            ("diffuse", &frame.layers.diffuse, small(&diffuse_layer(&self.world.scene, &self.view, &self.lightmap)), 1e-3),
            ("glossy", &frame.layers.glossy, small(glossy), apart),
        ];
        for (layer, a, b, apart) in layers {
            let lit = b.iter().filter(|c| **c != Rgb::ZERO).count();
            assert!(lit * if layer == "emission" { 200 } else { 5 } > b.len(), "{what}: next to no {layer}");
            let (share, mean) = difference(a, &b);
            let squares: f32 = a.iter().zip(&b).map(|(a, b)| (*a - *b).length_squared()).sum();
            let error = (squares / (3 * b.len()) as f32).sqrt();
            eprintln!("{what}, {layer}: {share} of the pixels, means by {mean}, RMSE {error}");
            assert!(share <= apart && mean < 2e-3 && error < rmse, "{what}, {layer}");
        }
        assert!(frame.passes.iter().any(|(pass, ms)| *pass == "gbuffer" && *ms > 0.0));
    }
}

pub fn rays_along_the_lobes_are_the_cpus(device: &Device) {
    let gpu = device.gpu();
    let setting = Setting::new();
    let Setting { world, lightmap, camera, view } = &setting;
    for (next_event, bounces) in [(false, 3), (true, 2)] {
        let params = LightmapRtParams { supersample: SUPERSAMPLE, next_event, bounces, ..LightmapRtParams::default() };
        let mut on_gpu = LightmapRt::new(gpu.clone(), world, lightmap, &params).unwrap();
        let glossy = lightmap_rt(world, lightmap, view, &params, 3, 5);
        let frame = on_gpu.frame(camera, params.samples, 3, 5).unwrap();
        setting.check(&format!("next event {next_event}"), &frame, &glossy, [0.01, 2e-3]);
        // Samples in more than one dispatch, pixels in more than one run, and none.
        let params = LightmapRtParams { samples: 37, ..params };
        let glossy = lightmap_rt(world, lightmap, view, &params, 1, 0);
        setting.check("many samples", &on_gpu.frame(camera, 37, 1, 0).unwrap(), &glossy, [0.02, 2e-3]);
        assert!(on_gpu.frame(camera, 0, 1, 0).unwrap().layers.glossy.iter().all(|c| *c == Rgb::ZERO));
    }
}

pub fn gathered_mirror_pictures_are_the_cpus(device: &Device) {
    let gpu = device.gpu();
    let setting = Setting::new();
    let Setting { world, lightmap, camera, view } = &setting;
    let mut on_gpu = ImageSpaceGather::new(gpu, world, lightmap, SUPERSAMPLE).unwrap();
    let default = ImageSpaceGatherParams { supersample: SUPERSAMPLE, ..ImageSpaceGatherParams::default() };
    for (what, params) in [
        ("default", default),
        // Footprints that are summed up whole.
        ("whole", ImageSpaceGatherParams { samples: 400, search_samples: 400, max_radius: 9.0, ..default }),
        ("one mirror", ImageSpaceGatherParams { mirror_depth: 1, max_mirror_alpha: 0.05, min_normal_cos: 0.5, ..default }),
        ("no mirror", ImageSpaceGatherParams { mirror_depth: 0, ..default }),
    ] {
        let mirror = mirror_image(world, lightmap, view, &params);
        let glossy = gather_image(world, view, &mirror, &params);
        let frame = on_gpu.frame(camera, &params).unwrap();
        if params.mirror_depth == 0 {
            assert!(glossy.iter().chain(&frame.layers.glossy).all(|c| *c == Rgb::ZERO));
            continue;
        }
        setting.check(what, &frame, &glossy, [0.01, 1e-3]);
    }
}
