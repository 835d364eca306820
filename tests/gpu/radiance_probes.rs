//! Frames of radiance probes. The operator's kernels are held against their CPU functions with the same numbers going in: they read the same
//! half floats and differ in the order of their sums alone. Direct light draws the same random numbers on both sides.

use crate::frames::rmse;
use crate::paths::difference;
use crate::{Device, room};
use glam::Vec3;
use reprobe::base::clock::Clock;
use reprobe::base::math::Rgb;
use reprobe::base::progress::Silent;
use reprobe::lightmap::AtlasParams;
use reprobe::method::radiance_probes::bake::Bake;
use reprobe::method::radiance_probes::compress::CompressParams;
use reprobe::method::radiance_probes::gpu::RadianceProbesOnGpu;
use reprobe::method::radiance_probes::light::Lighting;
use reprobe::method::radiance_probes::params::{RadianceProbeParams, TransportParams};
use reprobe::scene::Camera;
use reprobe::transport::World;

/// Largest difference, relative to the RMS of what is expected.
fn apart(gpu: &[Rgb], cpu: &[Rgb]) -> f32 {
    assert_eq!(gpu.len(), cpu.len());
    let size = (cpu.iter().map(|c| c.length_squared()).sum::<f32>() / (3 * cpu.len()) as f32).sqrt();
    assert!(size > 0.0, "there is no light");
    gpu.iter().zip(cpu).map(|(a, b)| (*a - *b).abs().max_element()).fold(0.0, f32::max) / size
}

fn lighting(world: &World, order: u32, relight_rays: u32) -> Lighting {
    let (low, high) = world.scene.geometry.bounds();
    let probes = (0..12)
        .map(|i| low + (high - low) * Vec3::new((i % 3) as f32 + 0.6, (i / 6) as f32 + 0.7, (i / 3 % 2) as f32 + 0.8) / 3.2);
    let params = TransportParams {
        sh_order: order,
        rays: 48,
        relight_rays,
        atlas: AtlasParams { texel: Some(0.4), budget: 1 },
        compress: CompressParams { most_receivers: 200, error: 0.05, ..CompressParams::default() },
        ..TransportParams::default()
    };
    Lighting::new(world, Bake::new(world, probes.collect(), &params, &Silent).unwrap().all(), &[])
}

pub fn every_pass_is_the_cpus(device: &Device) {
    let gpu = device.gpu();
    let world = room();
    let camera = Camera { size: [32, 18], ..world.scene.sensor.clone().unwrap() };
    // Terms of less than a workgroup's, as many, and more; numbers of rays that fill a tile, and that do not.
    for (order, rays, piece) in [(2, 768, u64::MAX), (7, 1000, 40_000), (9, 100, 1 << 20)] {
        let lighting = lighting(&world, order, rays);
        let transport = &lighting.transport;
        for bounces in [1, 3] {
            let params = RadianceProbeParams { bounces, map_samples: 5, ..RadianceProbeParams::default() };
            let mut on_gpu = RadianceProbesOnGpu::new(gpu.clone(), &world, &lighting, &params, piece).unwrap();
            assert_eq!(on_gpu.pieces() > 1, piece == 40_000, "{} pieces", on_gpu.pieces());
            assert!(on_gpu.probe_bytes() > transport.bytes() as u64 / 2);
            on_gpu.frame(&camera, 3, 0).unwrap();
            let found = on_gpu.passes().unwrap();
            let cpu = lighting.light(&world, &params, 3, &mut Clock::start());
            let (share, mean) = difference(&found.direct, &cpu.direct);
            assert!(share < 0.01 && mean < 2e-3, "direct light: {share} of the receivers, means by {mean}");
            let spaces = transport.project(&found.lambda);
            let mut errors = vec![
                ("projection", apart(&found.spaces, &spaces.concat())),
                ("receivers", apart(&found.indirect, &transport.reconstruct(&spaces))),
            ];
            if bounces == 1 {
                let radiance: Vec<Rgb> = found.direct.iter().zip(lighting.reflectance()).map(|(d, r)| *d * *r).collect();
                errors.push(("relight", apart(&found.lambda, &transport.probe_radiance(&transport.hits, &radiance))));
            }
            eprintln!("order {order}, {bounces} bounces: direct {share} {mean}, {errors:?}");
            assert!(errors.iter().all(|(_, e)| *e < 1e-4), "order {order}, {bounces} bounces: {errors:?}");
            let (share, mean) = difference(&found.indirect, &cpu.indirect);
            assert!(share < 0.02 && mean < 1e-3, "indirect light: {share} of the receivers, means by {mean}");
        }
    }
}

/// The same by the command line, which tells of passes and memory.
pub fn commands_render_them(device: &Device) {
    for (name, options) in [
        ("probes-lit", "--supersample 2"),
        // Indirect light alone: no ray is another's sample.
        ("probes-indirect", "--set direct_samples=0"),
        ("probes-direct", "--set bounces=0"),
    ] {
        let (frames, timings) = device.baked().both(device, name, &format!("--method radiance-probes {options}"));
        for images in &frames {
            for layer in ["emission", "diffuse", "glossy", ""] {
                eprintln!("{name}, {layer}: {}", rmse(images, layer));
                assert!(rmse(images, layer) < 1e-3, "{name}, {layer}: {}", rmse(images, layer));
            }
            let diffuse = images[0].rgb(std::path::Path::new(""), "diffuse").unwrap();
            assert!(
                diffuse.iter().filter(|c| c.max_element() > 0.0).count() * 3 > diffuse.len(),
                "{name}: next to nothing is lit"
            );
        }
        let passes =
            ["scene relight", "probe relight", "cluster projection", "receivers", "light map", "gbuffer", "diffuse", "composite"];
        for pass in passes {
            let is_there = timings["mean_ms"][pass].as_f64().is_some_and(|ms| ms > 0.0);
            let is_needed = match name {
                "probes-direct" => !["probe relight", "cluster projection", "receivers"].contains(&pass),
                "probes-indirect" => pass != "diffuse",
                _ => true,
            };
            assert_eq!(is_there, is_needed, "{name}: {pass}");
        }
        assert!(timings["device"].is_string() && timings["gpu_probe_memory_bytes"].as_u64().unwrap() > 100_000);
    }
}
