//! The denoiser of path-traced frames.

use crate::paths::zoo;
use crate::{Device, room};
use reprobe::base::math::Rgb;
use reprobe::base::progress::Silent;
use reprobe::gpu::{Gpu, GpuScene};
use reprobe::method::path_trace::denoise_gpu::{Denoiser, GpuGuides};
use reprobe::method::path_trace::{PathTraceParams, path_trace};
use reprobe::scene::Camera;
use reprobe::transport::World;
use reprobe::view::denoise::{DenoiseParams, Guide, guides};
use reprobe::view::denoiser::Denoiser as OnCpu;
use std::sync::Arc;

fn rmse(a: &[Rgb], b: &[Rgb]) -> f32 {
    let sum: f32 = a.iter().zip(b).map(|(a, b)| (*a - *b).length_squared()).sum();
    (sum / (3 * a.len()) as f32).sqrt()
}

/// Share of the pixels whose guides differ by more than rounding.
fn apart(a: &[Guide], b: &[Guide]) -> f32 {
    assert_eq!(a.len(), b.len());
    let differ = |(a, b): &(&Guide, &Guide)| {
        let vectors = [(a.normal, b.normal), (a.albedo, b.albedo), (a.factor, b.factor)];
        let depth = (a.depth - b.depth).abs() > 1e-4 * b.depth;
        depth || vectors.iter().any(|(a, b)| a.distance(*b) > 1e-3)
    };
    a.iter().zip(b).filter(differ).count() as f32 / a.len() as f32
}

/// Guides, and a noisy frame filtered with the same ones on both sides.
fn check(gpu: &Arc<Gpu>, world: &World, camera: &Camera, params: &DenoiseParams, most_apart: f32) {
    let (spp, seed, frame) = (3, 4, 2);
    let scene = Arc::new(GpuScene::new(gpu.clone(), world).unwrap());
    let denoiser = Denoiser::new(scene, params).unwrap();
    let cpu = guides(world, camera, params.mirror_alpha, spp, seed, frame);
    let found = denoiser.read(&denoiser.guides(camera, spp, seed, frame).unwrap()).unwrap();
    for (name, a, b) in [("diffuse", &found[0], &cpu[0]), ("glossy", &found[1], &cpu[1])] {
        assert!(apart(a, b) <= most_apart, "{name}: {} of the guides differ", apart(a, b));
        assert!(b.iter().filter(|g| g.factor != Rgb::ZERO).count() * 4 > b.len(), "next to nothing is {name}");
    }
    let noisy = path_trace(world, camera, &PathTraceParams { spp, ..PathTraceParams::default() }, seed, frame, &Silent);
    let width = camera.size[0] as usize;
    let expected = OnCpu::Filter(*params).denoise(&noisy, &cpu, width).unwrap();
    let on_gpu = denoiser.denoise(&noisy, &GpuGuides::upload(gpu, &cpu, width).unwrap()).unwrap();
    assert_eq!(on_gpu.emission, noisy.emission);
    for (name, a, b, before) in [
        ("diffuse", &on_gpu.diffuse, &expected.diffuse, &noisy.diffuse),
        ("glossy", &on_gpu.glossy, &expected.glossy, &noisy.glossy),
    ] {
        assert!(rmse(a, b) < 1e-3, "{name}: {}", rmse(a, b));
        let changed = b.iter().zip(before).filter(|(b, before)| b.distance(**before) > 0.02 * before.max_element()).count();
        assert!(changed * 4 > b.len(), "{name}: the filter did next to nothing");
    }
}

pub fn denoised_frames_are_the_cpus(device: &Device) {
    let gpu = device.gpu();
    let world = room();
    let camera = Camera { size: [75, 42], ..world.scene.sensor.clone().unwrap() };
    let params = DenoiseParams::default();
    // All surfaces guided by what they show as mirrors; another rank, and none; the last level's taps far outside.
    let mirrors = DenoiseParams { mirror_alpha: 1.0, despeckle: 7, levels: 7, ..params };
    for params in [params, mirrors, DenoiseParams { despeckle: 0, levels: 1, ..params }] {
        check(&gpu, &world, &camera, &params, 0.005);
    }
}

pub fn guides_of_every_model_are_the_cpus(device: &Device) {
    let gpu = device.gpu();
    let folder = tempfile::tempdir().unwrap();
    let world = zoo(folder.path());
    let camera = world.scene.sensor.clone().unwrap();
    check(&gpu, &world, &camera, &DenoiseParams { mirror_alpha: 0.15, ..DenoiseParams::default() }, 0.02);
}
