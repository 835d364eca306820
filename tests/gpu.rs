//! Kernels against their CPU twins, on whatever adapter there is: a software one will do. Skipped, saying so, where there is none.

use glam::Vec3;
use reprobe::gpu::{Choice, Filter, Gpu, RayTracer, adapters};
use reprobe::math::direction_from_lat_long;
use reprobe::probe::seen::SeenBuffers;
use reprobe::render::filter::{FilterInput, FilterParams, Kernel, Method, NOT_GLOSSY, filter};
use reprobe::scene::Scene;
use reprobe::transport::{Hit, Ray, Sampler, World};
use std::path::Path;
use std::sync::Arc;

/// A real GPU before a software adapter.
fn gpu() -> Option<Arc<Gpu>> {
    let list = adapters();
    let Some(first) = list.first() else {
        eprintln!("skipped: no adapter; on Debian, mesa-vulkan-drivers has a software one");
        return None;
    };
    let name = Choice::Named(first.name.to_lowercase());
    Some(Arc::new(Gpu::open(&name).unwrap().unwrap()))
}

fn room() -> World {
    let scene = reprobe::scene::load(Path::new("scenes/room/scene.xml"), &Default::default()).unwrap();
    World::opaque(scene).0
}

/// Rays from within the room's bounds in all directions, some of them along the axes and short ones.
fn rays(world: &World, count: u32) -> Vec<Ray> {
    let points = &world.scene.geometry.positions;
    let (lo, hi) = points.iter().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(lo, hi), p| (lo.min(*p), hi.max(*p)));
    (0..count)
        .map(|i| {
            let mut sampler = Sampler::new(17, i);
            let ([x, y, z, u], [v, t, ..]) = (sampler.next_4d(), sampler.next_4d());
            let o = lo + (hi - lo) * Vec3::new(x, y, z);
            let d = match i % 8 {
                7 => [Vec3::X, Vec3::NEG_Y, Vec3::Z][i as usize / 8 % 3],
                _ => direction_from_lat_long(glam::Vec2::new(u, v)),
            };
            let t_max = if i % 5 == 0 { t } else { f32::INFINITY };
            Ray { t_max, ..Ray::new(o, d) }
        })
        .collect()
}

/// Hits are the same but where two triangles are equally near, or an edge is grazed; distances but for rounding.
fn check(scene: &Scene, rays: &[Ray], gpu: &[Option<Hit>], cpu: &[Option<Hit>]) {
    let scale = scene.geometry.positions.iter().fold(1f32, |m, p| m.max(p.abs().max_element()));
    let mut other = 0;
    for ((ray, a), b) in rays.iter().zip(gpu).zip(cpu) {
        match (a, b) {
            (None, None) => {}
            (Some(a), Some(b)) if a.triangle == b.triangle => {
                assert!((a.t - b.t).abs() < 1e-5 * scale, "{ray:?}: {a:?}, on the CPU {b:?}");
                assert!((a.u - b.u).abs() < 2e-3 && (a.v - b.v).abs() < 2e-3, "{ray:?}: {a:?}, on the CPU {b:?}");
            }
            (Some(a), Some(b)) if (a.t - b.t).abs() < 1e-5 * scale => {}
            _ => other += 1,
        }
    }
    assert!(other * 20_000 <= rays.len(), "{other} of {} rays meet something else", rays.len());
}

#[test]
fn closest_hits_are_the_cpus() {
    let Some(gpu) = gpu() else { return };
    let world = room();
    let tracer = RayTracer::new(gpu, &world).unwrap();
    let rays = rays(&world, 40_000);
    let cpu: Vec<_> = rays.iter().map(|ray| world.closest(ray)).collect();
    assert!(cpu.iter().filter(|h| h.is_some()).count() > 20_000 && cpu.iter().any(|h| h.is_none()));
    check(&world.scene, &rays, &tracer.closest(&world, &rays).unwrap(), &cpu);
}

#[test]
fn rays_go_on_through_alpha_masks_as_on_the_cpu() {
    let Some(gpu) = gpu() else { return };
    let mut scene = room().scene;
    for material in scene.materials.iter_mut().step_by(2) {
        material.opacity = Some(reprobe::scene::Texture::Constant(Vec3::splat(0.5)));
    }
    let world = World::opaque(scene).0;
    let rays = rays(&world, 20_000);
    let cpu: Vec<_> = rays.iter().map(|ray| world.closest(ray)).collect();
    let opaque = room();
    let passed = rays.iter().zip(&cpu).filter(|(ray, hit)| opaque.closest(ray) != **hit).count();
    assert!(passed > 2_000, "only {passed} rays pass a mask");
    check(&world.scene, &rays, &RayTracer::new(gpu, &world).unwrap().closest(&world, &rays).unwrap(), &cpu);
}

#[test]
fn a_probe_sees_the_same_through_either() {
    let Some(gpu) = gpu() else { return };
    let world = room();
    let (position, size) = (Vec3::new(0.3, 1.4, 0.2), [64, 32]);
    let rays = SeenBuffers::rays(position, size);
    let hits = RayTracer::new(gpu, &world).unwrap().closest(&world, &rays).unwrap();
    let (gpu, cpu) = (SeenBuffers::from_hits(&world, size, &rays, &hits), SeenBuffers::cast(&world, position, size));
    let depths = gpu.texels.iter().zip(&cpu.texels).filter_map(|(a, b)| Some((a.as_ref()?.depth, b.as_ref()?.depth)));
    let squares: Vec<f32> = depths.map(|(a, b)| (a - b) * (a - b)).collect();
    assert!(squares.len() > 1_000);
    assert!((squares.iter().sum::<f32>() / squares.len() as f32).sqrt() < 1e-3);
    assert_eq!(gpu.texels.iter().filter(|t| t.is_none()).count(), cpu.texels.iter().filter(|t| t.is_none()).count());
}

#[test]
fn the_filter_is_the_cpus() {
    let Some(gpu) = gpu() else { return };
    let (width, height) = (150, 91);
    let n = width * height;
    let place = |i: usize| ((i % width) as f32 / width as f32, (i / width) as f32 / height as f32);
    let noise = |i: usize| Sampler::new(5, i as u32).next_4d();
    let color: Vec<Vec3> = (0..n).map(|i| Vec3::from_slice(&noise(i)) * 4.0).collect();
    let energy: Vec<f32> = (0..n).map(|i| 6.0 * noise(i)[3]).collect();
    // Slanted edges of material, depth and normal, pixels without a glossy surface, kernels that turn and grow, some of none at all.
    let material: Vec<u32> =
        (0..n).map(place).map(|(x, y)| if x > 0.9 { NOT_GLOSSY } else { u32::from(x + 0.4 * y > 0.6) }).collect();
    let depth: Vec<f32> = (0..n).map(place).map(|(x, y)| 2.0 + x + if y > 0.3 + 0.2 * x { 1.0 } else { 0.0 }).collect();
    let normal: Vec<Vec3> = (0..n).map(place).map(|(x, y)| if y > 0.8 - 0.3 * x { Vec3::Y } else { Vec3::Z }).collect();
    let covariance = |(x, y): (f32, f32)| {
        let (s, c) = (5.0 * x + 2.0 * y).sin_cos();
        let (a, b) = if y < 0.1 { (0.0, 0.0) } else { ((12.0 * x).powi(2), (3.0 * y).powi(2)) };
        [a * c * c + b * s * s, (a - b) * c * s, a * s * s + b * c * c]
    };
    let covariance: Vec<[f32; 3]> = (0..n).map(place).map(covariance).collect();
    let input = FilterInput {
        width,
        height,
        color: &color,
        normal: &normal,
        depth: &depth,
        material: &material,
        covariance: &covariance,
        energy: &energy,
    };
    for (kernel, method) in
        [(Kernel::Gaussian, Method::FourPass), (Kernel::Ggx, Method::FourPass), (Kernel::Gaussian, Method::TwoPass)]
    {
        let params = FilterParams { kernel, method, ..FilterParams::default() };
        let on_gpu = Filter::new(gpu.clone(), &params, n).unwrap();
        let (a, b) = (on_gpu.filter(&input, &params).unwrap(), filter(&input, &params));
        let sum: f32 = a.iter().zip(&b).map(|(a, b)| (*a - *b).length_squared()).sum();
        let rmse = (sum / (3 * n) as f32).sqrt();
        assert!(rmse < 1e-3, "{kernel:?}, {method:?}: {rmse}");
        let changed = b.iter().zip(&color).filter(|(b, c)| b.distance(**c) > 0.1).count();
        assert!(changed * 2 > n, "the filter did next to nothing");
    }
    let full = FilterParams { method: Method::Full, ..FilterParams::default() };
    for (params, pixels, expected) in [(full, n, "filter.method"), (FilterParams::default(), 1 << 40, "MiB at the most")] {
        let Err(error) = Filter::new(gpu.clone(), &params, pixels) else { panic!("made it") };
        assert!(error.to_string().contains(expected), "{error}");
    }
}

#[test]
fn a_scene_without_surfaces_has_no_hits() {
    let Some(gpu) = gpu() else { return };
    let world = World::new(Scene::default());
    let hits = RayTracer::new(gpu, &world).unwrap().closest(&world, &[Ray::new(Vec3::ZERO, Vec3::X)]).unwrap();
    assert_eq!(hits, [None]);
}

#[test]
fn a_name_that_no_adapter_has_is_an_error_that_lists_those_there_are() {
    let Err(error) = Gpu::open(&Choice::Named("no such thing".into())) else { panic!("found it") };
    let error = error.to_string();
    assert!(error.contains("no such GPU"), "{error}");
    for adapter in adapters() {
        assert!(error.contains(&adapter.name), "{error}");
    }
}
