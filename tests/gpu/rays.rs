//! Closest hits.

use crate::{Device, room};
use glam::Vec3;
use reprobe::base::math::direction_from_lat_long;
use reprobe::base::ray::{Hit, Ray};
use reprobe::gpu::{Gpu, GpuScene, RayTracer};
use reprobe::method::glossy_probes::seen::SeenBuffers;
use reprobe::scene::Scene;
use reprobe::transport::{Sampler, World};
use std::sync::Arc;

pub fn tracer(gpu: Arc<Gpu>, world: &World) -> RayTracer {
    RayTracer::new(Arc::new(GpuScene::new(gpu, world).unwrap())).unwrap()
}

/// Rays from within the room's bounds in all directions, some of them along the axes and short ones.
pub fn rays(world: &World, count: u32) -> Vec<Ray> {
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
pub fn check(scene: &Scene, rays: &[Ray], gpu: &[Option<Hit>], cpu: &[Option<Hit>]) {
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

pub fn closest_hits_are_the_cpus(device: &Device) {
    let gpu = device.gpu();
    let world = room();
    let tracer = tracer(gpu, &world);
    let rays = rays(&world, 40_000);
    let cpu: Vec<_> = rays.iter().map(|ray| world.closest(ray)).collect();
    assert!(cpu.iter().filter(|h| h.is_some()).count() > 20_000 && cpu.iter().any(|h| h.is_none()));
    check(&world.scene, &rays, &tracer.closest(&rays).unwrap(), &cpu);
}

pub fn rays_go_on_through_alpha_masks_as_on_the_cpu(device: &Device) {
    let gpu = device.gpu();
    let mut scene = room().scene;
    for material in scene.materials.iter_mut().step_by(2) {
        material.opacity = Some(reprobe::material::Opacity::constant(0.5));
    }
    let world = World::opaque(scene).0;
    let rays = rays(&world, 20_000);
    let cpu: Vec<_> = rays.iter().map(|ray| world.closest(ray)).collect();
    let opaque = room();
    let passed = rays.iter().zip(&cpu).filter(|(ray, hit)| opaque.closest(ray) != **hit).count();
    assert!(passed > 2_000, "only {passed} rays pass a mask");
    check(&world.scene, &rays, &tracer(gpu, &world).closest(&rays).unwrap(), &cpu);
}

pub fn a_probe_sees_the_same_through_either(device: &Device) {
    let gpu = device.gpu();
    let world = room();
    let (position, size) = (Vec3::new(0.3, 1.4, 0.2), [64, 32]);
    let rays = SeenBuffers::rays(position, size);
    let hits = tracer(gpu, &world).closest(&rays).unwrap();
    let (gpu, cpu) = (SeenBuffers::from_hits(&world, size, &rays, &hits), SeenBuffers::cast(&world, position, size));
    let depths = gpu.texels.iter().zip(&cpu.texels).filter_map(|(a, b)| Some((a.as_ref()?.depth, b.as_ref()?.depth)));
    let squares: Vec<f32> = depths.map(|(a, b)| (a - b) * (a - b)).collect();
    assert!(squares.len() > 1_000);
    assert!((squares.iter().sum::<f32>() / squares.len() as f32).sqrt() < 1e-3);
    assert_eq!(gpu.texels.iter().filter(|t| t.is_none()).count(), cpu.texels.iter().filter(|t| t.is_none()).count());
}

pub fn a_scene_without_surfaces_has_no_hits(device: &Device) {
    let gpu = device.gpu();
    let world = World::new(Scene::default());
    let hits = tracer(gpu, &world).closest(&[Ray::new(Vec3::ZERO, Vec3::X)]).unwrap();
    assert_eq!(hits, [None]);
}
