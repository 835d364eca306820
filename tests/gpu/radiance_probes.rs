//! Frames of radiance probes. The operator's kernels are held against their CPU functions with the same numbers going in: they read the same
//! half floats and differ in the order of their sums alone. Direct light draws the same random numbers on both sides.

use crate::frames::{rmse, text};
use crate::paths::difference;
use crate::{Device, room};
use glam::Vec3;
use reprobe::base::clock::Clock;
use reprobe::base::math::Rgb;
use reprobe::base::progress::Silent;
use reprobe::gpu::Checks;
use reprobe::lightmap::AtlasParams;
use reprobe::method::radiance_probes::bake::Bake;
use reprobe::method::radiance_probes::compress::CompressParams;
use reprobe::method::radiance_probes::gpu::RadianceProbesOnGpu;
use reprobe::method::radiance_probes::light::Lighting;
use reprobe::method::radiance_probes::params::{RadianceProbeParams, TransportParams};
use reprobe::scene::Camera;
use reprobe::transport::World;
use std::path::Path;

/// Largest difference, relative to the RMS of what is expected.
fn apart(gpu: &[Rgb], cpu: &[Rgb]) -> f32 {
    assert_eq!(gpu.len(), cpu.len());
    let size = (cpu.iter().map(|c| c.length_squared()).sum::<f32>() / (3 * cpu.len()) as f32).sqrt();
    assert!(size > 0.0, "there is no light");
    gpu.iter().zip(cpu).map(|(a, b)| (*a - *b).abs().max_element()).fold(0.0, f32::max) / size
}

/// A quick bake.
pub fn small(order: u32, relight_rays: u32) -> TransportParams {
    TransportParams {
        sh_order: order,
        rays: 48,
        relight_rays,
        atlas: AtlasParams { texel: Some(0.4), budget: 1 },
        compress: CompressParams { most_receivers: 200, error: 0.05, ..CompressParams::default() },
        ..TransportParams::default()
    }
}

/// By twelve probes.
pub fn lighting(world: &World, params: TransportParams) -> Lighting {
    let (low, high) = world.scene.geometry.bounds();
    let probes = (0..12)
        .map(|i| low + (high - low) * Vec3::new((i % 3) as f32 + 0.6, (i / 6) as f32 + 0.7, (i / 3 % 2) as f32 + 0.8) / 3.2);
    Lighting::new(world, Bake::new(world, probes.collect(), &params, &Silent).unwrap().all(), None)
}

pub fn every_pass_is_the_cpus(device: &Device) {
    let gpu = device.gpu();
    let world = room();
    let camera = Camera { size: [32, 18], ..world.scene.sensor.clone().unwrap() };
    // Terms of less than a workgroup's, as many, and more; numbers of rays that fill a tile, and that do not.
    for (order, rays, piece, bounces) in [(2, 768, u64::MAX, 1), (7, 1000, 40_000, 1), (9, 100, 1 << 27, 3)] {
        let lighting = lighting(&world, small(order, rays));
        let transport = &lighting.transport;
        let params = RadianceProbeParams { bounces, map_samples: 5, ..RadianceProbeParams::default() };
        let mut on_gpu = RadianceProbesOnGpu::new(gpu.clone(), &world, &lighting, &params, piece).unwrap();
        assert_eq!(on_gpu.pieces() > 1, piece == 40_000, "{} pieces", on_gpu.pieces());
        assert!(on_gpu.probe_bytes() > transport.bytes() as u64 / 2);
        on_gpu.frame(&camera, [3, 0], false).unwrap();
        let found = on_gpu.passes().unwrap();
        let cpu = lighting.light(&world, &params, (None, 3), &mut Clock::start());
        let (share, mean) = difference(&found.direct, &cpu.direct);
        let spaces = transport.project(&found.lambda);
        let mut errors = vec![
            ("projection", apart(&found.spaces, &spaces.concat())),
            ("receivers", apart(&found.indirect, &transport.reconstruct(&spaces))),
        ];
        if bounces == 1 {
            let reflectances = lighting.reflectances(&world);
            let radiance: Vec<Rgb> = found.direct.iter().zip(reflectances.iter()).map(|(d, r)| *d * *r).collect();
            errors.push(("relight", apart(&found.lambda, &transport.probe_radiance(&transport.hits, &radiance))));
        }
        let (others, total) = difference(&found.indirect, &cpu.indirect);
        eprintln!("order {order}: direct {share} {mean}, {errors:?}, indirect {others} {total}");
        assert!(share < 0.01 && mean < 2e-3, "direct light: {share} of the receivers, means by {mean}");
        assert!(errors.iter().all(|(_, e)| *e < 1e-4), "order {order}: {errors:?}");
        assert!(others < 0.02 && total < 1e-3, "indirect light: {others} of the receivers, means by {total}");
    }
}

/// The same by the command line, which tells of passes and memory.
pub fn commands_render_them(device: &Device) {
    const OF_PROBES: [&str; 3] = ["probe relight", "cluster projection", "receivers"];
    // A shadow ray that rounding sends past an edge is another sample, of few.
    for (name, options, most) in [
        ("probes", "--supersample 2", 1e-3),
        ("probes-indirect", "--set direct_samples=0", 1e-4),
        ("probes-direct", "--set bounces=0", 1e-3),
        ("probes-lights", "--lights lights.json", 1e-3),
        ("probes-dark", "--lights dark.json", 1e-3),
        ("probes-first-order", "--probes out/first-order --lights lights.json", 1e-3),
        ("probes-shapes", "--lights objects.json", 1e-3),
        ("probes-volume", "--probes out/first-order --lights objects.json --set bounces=1 --set feedback=true", 1e-3),
        ("probes-feedback", "--lights lights.json --set bounces=1 --set feedback=true", 1e-3),
    ] {
        // Kernels are compiled for each; of those without checks, these two have all.
        if device.checks == Checks::Off && !["probes", "probes-volume"].contains(&name) {
            continue;
        }
        let (frames, timings) = device.baked().both(device, name, &format!("--method radiance-probes {options}"));
        for images in &frames {
            for layer in ["emission", "diffuse", "glossy", ""] {
                eprintln!("{name}, {layer}: {}", rmse(images, layer));
                assert!(rmse(images, layer) < most, "{name}, {layer}: {}", rmse(images, layer));
            }
            let diffuse = images[0].rgb(Path::new(""), "diffuse").unwrap();
            assert!(
                diffuse.iter().filter(|c| c.max_element() > 0.0).count() * 3 > diffuse.len(),
                "{name}: next to nothing is lit"
            );
        }
        for pass in ["scene relight", "light map", "gbuffer", "diffuse", "composite"].into_iter().chain(OF_PROBES) {
            let is_there = timings["mean_ms"][pass].as_f64().is_some_and(|ms| ms > 0.0);
            let is_needed = match name {
                "probes-direct" => !OF_PROBES.contains(&pass),
                "probes-indirect" => pass != "diffuse",
                _ => true,
            };
            assert_eq!(is_there, is_needed, "{name}: {pass}");
        }
        assert!(timings["device"].is_string() && timings["gpu_probe_memory_bytes"].as_u64().unwrap() > 100_000);
    }
    let output = device.baked().render("gloss", Some(device), "--method radiance-probes --set gloss_samples=2");
    assert_eq!(output.status.code(), Some(2));
    assert!(
        text(&output.stderr).contains("no gloss_samples") && text(&output.stderr).contains("--device cpu"),
        "{}",
        text(&output.stderr)
    );
}
