//! Light that comes along a glossy lobe, by rays through the probes and radiance as wide as each of them stands for.

use super::LightFieldParams;
use super::field::LightField;
use super::trace::{Found, trace};
use crate::base::math::Rgb;
use crate::base::ray::Ray;
use crate::material::Surface;
use crate::material::bsdf::BsdfSample;
use crate::transport::{Sampler, World};
use crate::view::gbuffer::GLOSSY;
use glam::{Vec2, Vec3};
use std::f32::consts::PI;

/// A ray along a glossy lobe of a surface that is seen from `wo`, no longer than `far` metres, and how it was drawn.
pub fn lobe_ray(world: &World, (surface, wo): (&Surface, Vec3), far: f32, sampler: &mut Sampler) -> Option<(Ray, BsdfSample)> {
    let [x, y, lobe, _] = sampler.next_4d();
    let bsdf = world.scene.bsdf(surface);
    let sample = bsdf.sample(surface, surface.frame.to_local(wo), lobe, Vec2::new(x, y), GLOSSY)?;
    Some((Ray { t_max: far, ..surface.spawn(surface.frame.to_world(sample.wo)) }, sample))
}

/// The radiance that a surface scatters towards `wo` by its glossy lobes, without direct light: the mean of `params.samples` rays, whose random
/// numbers are those of `stream`. `far`: length of rays, metres.
pub fn along_lobes(
    scene: (&World, &LightField),
    surface: (&Surface, Vec3),
    (params, far): (&LightFieldParams, f32),
    stream: u32,
) -> Rgb {
    let ray = |s| along_lobe(scene, surface, (params, far), &mut Sampler::new(stream, s));
    let sum: Rgb = (0..params.samples).map(ray).filter(|c| c.is_finite()).sum();
    sum / params.samples as f32
}

/// One of them.
fn along_lobe(
    (world, field): (&World, &LightField),
    surface: (&Surface, Vec3),
    (params, far): (&LightFieldParams, f32),
    sampler: &mut Sampler,
) -> Rgb {
    let Some((ray, sample)) = lobe_ray(world, surface, far, sampler) else { return Rgb::ZERO };
    let (probe, t, is_lost) = match trace(field, &ray, params.search, params.thickness) {
        Found::Surface { probe, t, .. } => (probe, t, false),
        Found::Lost { probe, t } => (probe, t, true),
        Found::Nothing => return Rgb::ZERO,
    };
    let to_end = ray.at(t) - field.places.position(probe);
    let light = &field.light[probe];
    // Where a ray is lost, the probe sees something before that place in its direction; nothing better is known.
    let level = if is_lost || sample.delta || params.footprint == 0.0 {
        0.0
    } else {
        // Solid angle of the sample at its origin, and what it covers at its end as the probe sees it.
        let omega = params.footprint / (sample.pdf * params.samples as f32);
        let covered = omega * t * t / to_end.length_squared().max(f32::MIN_POSITIVE);
        let texel = 4.0 * PI / (light.size * light.size) as f32;
        0.5 * (covered / texel).max(1.0).log2()
    };
    sample.weight * light.about(to_end, level)
}
