//! Light that a path's rays meet, weighted against the emitter samples that could have found it (Veach 1997, §9.2).

use super::World;
use super::light_tree::Receiver;
use crate::base::math::Rgb;
use crate::material::Surface;
use crate::material::bsdf::BsdfSample;
use glam::Vec3;

/// How a ray was found.
#[derive(Debug, Clone, Copy)]
pub(super) struct Found {
    /// Density with which its direction was drawn at its origin.
    pub(super) pdf: f32,
    /// No emitter sample competes with it.
    pub(super) delta: bool,
    /// It has been by way of a plane mirror ([`super::mirrors`]).
    pub(super) mirrored: bool,
}

impl Found {
    /// A camera's ray.
    pub(super) const SEEN: Self = Self { pdf: 1.0, delta: true, mirrored: false };

    pub(super) fn by(sample: &BsdfSample) -> Self {
        Self { pdf: sample.pdf, delta: sample.delta, mirrored: false }
    }
}

/// Radiance that a ray in direction `d` meets where it leaves the scene, and its weight against emitter sampling.
pub(super) fn environment_met(world: &World, d: Vec3, from: &Receiver, found: Found) -> (Rgb, f32) {
    let light = world.lights.environment(d);
    if light == Rgb::ZERO {
        return (light, 0.0);
    }
    let other = if found.delta || found.mirrored { 0.0 } else { world.lights.pdf_environment(from, d) };
    (light, power_heuristic(found.pdf, other))
}

/// Radiance that an emitting surface sends along a ray, to `wo`, and its weight against emitter sampling for `from`.
pub(super) fn emission_met(world: &World, surface: &Surface, wo: Vec3, from: &Receiver, found: Found) -> (Rgb, f32) {
    let light = world.lights.emitted(&world.scene, surface, wo);
    let other = match found {
        Found { delta: true, .. } => 0.0,
        Found { mirrored: true, .. } => world.lights.pdf_near(&world.scene, from, surface),
        _ => world.lights.pdf_surface(&world.scene, from, surface),
    };
    (light, power_heuristic(found.pdf, other))
}

/// Weight of a sample of density `a` where another technique would have found it with density `b`.
pub(super) fn power_heuristic(a: f32, b: f32) -> f32 {
    let ratio = b / a;
    1.0 / (1.0 + ratio * ratio)
}
