//! Frames of light field probes. Both twins draw the same random numbers, so that pixels agree but for rounding, and for the few rays that
//! rounding sends past an edge.

use crate::frames::rmse;
use crate::paths::difference;
use crate::{Device, room};
use glam::Vec3;
use reprobe::base::math::Rgb;
use reprobe::io::Provenance;
use reprobe::method::light_field_probes::LightFieldParams;
use reprobe::method::light_field_probes::bake::{LightFieldBakeParams, Seen, bounce, look};
use reprobe::method::light_field_probes::field::{LightField, no_surfels};
use reprobe::method::light_field_probes::gpu::LightFieldOnGpu;
use reprobe::method::light_field_probes::march::Search;
use reprobe::method::light_field_probes::probe::Light;
use reprobe::method::light_field_probes::shade::Shading;
use reprobe::probe::placement::{Density, Placement, ProbeGrid};
use reprobe::probe::places::{Places, ProbeList};
use reprobe::scene::Camera;
use reprobe::surface::CurvatureMap;
use reprobe::transport::World;
use reprobe::view::composite::{downsample, emission_layer};
use reprobe::view::gbuffer::{GBuffer, gbuffer};

const BAKE: LightFieldBakeParams = LightFieldBakeParams { size: 64, ambient_size: 8, spp: 2, lobe_samples: 1, bounces: 2 };
const SUPERSAMPLE: u32 = 2;

/// Probes that have two bounces of light.
fn field(world: &World, places: Places) -> LightField {
    let seen: Vec<Option<Seen>> =
        (0..places.len()).map(|i| (!places.is_blocked(i)).then(|| look(world, places.position(i), i as u32, &BAKE, 3))).collect();
    let surfels = seen.iter().map(|s| s.as_ref().map_or_else(no_surfels, |s| s.surfels.clone())).collect();
    let mut field = LightField::unlit(places, surfels);
    for _ in 0..BAKE.bounces {
        let seen = |i: usize| Ok(seen[i].clone().unwrap());
        bounce((world, &mut field), &seen, &BAKE, (Shading::far(world), 3), &mut |_, _, _| Ok(())).unwrap();
    }
    field
}

/// A grid with a probe that is blocked, and as many probes in other places, without order.
fn both_places(world: &World) -> [(&'static str, Places); 2] {
    let (low, high) = world.scene.geometry.bounds();
    let provenance = Provenance::new("place-probes", "", 0, &0);
    let mut grid = ProbeGrid::in_box(low, high, Density::Counts([3, 2, 2]), provenance.clone()).unwrap();
    let moved = |i: usize| (grid.position(i) + Vec3::new(0.1, -0.05, 0.07) * (i % 5) as f32).to_array();
    let positions = (0..grid.len()).rev().map(moved).collect();
    grid.blocked = vec![4];
    [
        ("grid", Places::Grid(grid)),
        ("list", Places::List(ProbeList { method: Placement::Sdf, positions, radius: None, provenance })),
    ]
}

fn check(what: &str, view: &GBuffer, gpu: &[Rgb], fine: &[Rgb], most_apart: f32) {
    let cpu = downsample(fine, view.size(), SUPERSAMPLE as usize);
    let lit = cpu.iter().filter(|c| **c != Rgb::ZERO).count();
    let (apart, mean) = difference(gpu, &cpu);
    let squares: f32 = gpu.iter().zip(&cpu).map(|(a, b)| (*a - *b).length_squared()).sum();
    let error = (squares / (3 * cpu.len()) as f32).sqrt();
    eprintln!("{what}: {apart} of the pixels, means by {mean}, RMSE {error}");
    assert!(lit * if what.contains("emission") { 200 } else { 5 } > cpu.len(), "{what}: next to nothing there");
    assert!(apart <= most_apart && mean < 2e-3 && error < 2e-3, "{what}");
}

fn sum(layer: &[Rgb]) -> f32 {
    layer.iter().map(|c| c.element_sum()).sum()
}

pub fn frames_are_the_cpus(device: &Device) {
    let gpu = device.gpu();
    let world = room();
    let camera = Camera { size: [64, 36], ..world.scene.sensor.clone().unwrap() };
    let fine = Camera { size: camera.size.map(|s| s * SUPERSAMPLE), ..camera.clone() };
    let view = gbuffer(&world, &CurvatureMap::flat(world.scene.geometry.positions.len()), &fine);
    for (name, places) in both_places(&world) {
        let field = field(&world, places);
        let default = LightFieldParams { supersample: SUPERSAMPLE, samples: 4, direct_samples: 2, ..LightFieldParams::default() };
        for (kind, params) in [
            ("hi-z", default),
            ("two-scale", LightFieldParams { search: Search::TwoScale, ..default }),
            // Samples in more than one dispatch, single texels, and rays that are lost early.
            ("many", LightFieldParams { samples: 19, footprint: 0.0, thickness: 0.0, ..default }),
            ("indirect alone", LightFieldParams { direct_samples: 0, ..default }),
        ] {
            let mut on_gpu = LightFieldOnGpu::new(gpu.clone(), &world, &field, &params).unwrap();
            let frame = on_gpu.frame(&camera, params.samples, 3, 5).unwrap();
            let shading = Shading { world: &world, field: &field, params, seed: 3, frame: 5, far: Shading::far(&world) };
            let glossy = shading.glossy(&view);
            // Much of it is what rays through the probes find.
            let dark = LightField { light: vec![Light::new(&[Rgb::ZERO], 1); field.light.len()], ..field.clone() };
            let direct = Shading { field: &dark, ..shading }.glossy(&view);
            assert!(sum(&glossy) > 1.3 * sum(&direct), "{} of {} is direct light", sum(&direct), sum(&glossy));
            let layers = [
                ("emission", &frame.layers.emission, emission_layer(&view), 0.0),
                ("diffuse", &frame.layers.diffuse, shading.diffuse(&view), 0.01),
                ("glossy", &frame.layers.glossy, glossy, 0.02),
            ];
            for (layer, a, b, apart) in layers {
                check(&format!("{name}, {kind}, {layer}"), &view, a, &b, apart);
            }
            for pass in ["gbuffer", "rays", "diffuse"] {
                assert!(frame.passes.iter().any(|(name, ms)| *name == pass && *ms > 0.0), "{pass}");
            }
            assert!(on_gpu.probe_bytes() > (11 * 64 * 64 * 16) as u64);
        }
    }
}

/// The same by the command line, which tells of passes and memory.
pub fn commands_render_them(device: &Device) {
    let options = "--method light-field-probes --samples 4 --set direct_samples=4 --trace two-scale";
    let (frames, timings) = device.baked().both(device, "light-field", options);
    for images in &frames {
        for layer in ["emission", "diffuse", "glossy", ""] {
            // A ray that rounding sends another way is another sample.
            assert!(rmse(images, layer) < 5e-3, "{layer}: {}", rmse(images, layer));
        }
    }
    for pass in ["gbuffer", "rays", "diffuse", "composite"] {
        assert!(timings["mean_ms"][pass].as_f64().unwrap() > 0.0, "{pass}");
    }
    assert!(timings["device"].is_string() && timings["gpu_probe_memory_bytes"].as_u64().unwrap() > 18 * 32 * 32 * 8 / 2);
}
