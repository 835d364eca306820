//! Perfect mirror rays: what a surface would reflect if it were a mirror (§4.1, §5).
//!
//! The same function fills the probes' reflected map and the novel view's, so that equal geometry gives equal positions.

use super::gbuffer::GBuffer;
use crate::base::math::reflect;
use crate::material::Surface;
use crate::transport::World;
use bytemuck::Zeroable;
use glam::Vec3;
use rayon::prelude::*;

/// Stands for the environment among material indices: the mirror ray left the scene.
pub const SKY: u16 = u16::MAX - 1;
/// No reflection at all: the texel or pixel sees no surface.
pub const NOTHING: u16 = u16::MAX;

/// What a mirror at a surface point shows.
#[derive(Debug, Clone, Copy, PartialEq, Zeroable)]
pub struct Reflected {
    /// World position of the reflected hit; the unit direction towards it where `material` is [`SKY`].
    pub point: Vec3,
    /// Material of the reflected hit, [`SKY`] or [`NOTHING`].
    pub material: u16,
}

impl Reflected {
    /// Where there is no reflector.
    pub const NONE: Self = Self { point: Vec3::ZERO, material: NOTHING };

    /// Whether the reflected light comes from infinity.
    pub fn is_sky(&self) -> bool {
        self.material == SKY
    }

    /// Unit direction of the reflected ray that leaves `reflector`.
    pub fn direction_from(&self, reflector: Vec3) -> Vec3 {
        if self.is_sky() { self.point } else { (self.point - reflector).try_normalize().unwrap_or(Vec3::Y) }
    }

    /// Distance d_r from `reflector` to the reflected hit; infinite for the environment.
    pub fn distance_from(&self, reflector: Vec3) -> f32 {
        if self.is_sky() { f32::INFINITY } else { self.point.distance(reflector) }
    }
}

/// The mirror hits of a view's glossy pixels; [`Reflected::NONE`] for the others.
pub fn mirror_pass(world: &World, view: &GBuffer) -> Vec<Reflected> {
    view.pixels
        .par_iter()
        .with_min_len(view.size()[0])
        .map(|pixel| match pixel {
            Some(p) if p.alpha.is_some() => mirror_hit(world, &p.surface, p.wo),
            _ => Reflected::NONE,
        })
        .collect()
}

/// Unit direction in which `surface`, as a mirror, sends the view from `wo` (unit, away from the surface) on.
pub fn mirror_direction(surface: &Surface, wo: Vec3) -> Vec3 {
    let ng = if surface.ng.dot(wo) < 0.0 { -surface.ng } else { surface.ng };
    let mut d = reflect(wo, surface.facing_normal(wo));
    if d.dot(ng) <= 0.0 {
        // The interpolated normal bends the ray into the surface.
        d = reflect(wo, ng);
    }
    d.try_normalize().unwrap_or(ng)
}

/// Traces the mirror ray of `surface` for a viewer at direction `wo`.
pub fn mirror_hit(world: &World, surface: &Surface, wo: Vec3) -> Reflected {
    let d = mirror_direction(surface, wo);
    match world.closest(&surface.spawn(d)) {
        Some(hit) => {
            let geometry = &world.scene.geometry;
            Reflected { point: world.point(&hit), material: geometry.object(hit.triangle).material as u16 }
        }
        None => Reflected { point: d, material: SKY },
    }
}
