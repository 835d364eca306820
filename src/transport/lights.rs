//! Emitter sampling for next-event estimation.

use super::Surface;
use crate::math::Rgb;
use crate::scene::Scene;
use glam::{Vec2, Vec3};

/// Sampling distributions of a scene's emitters.
pub struct Lights {}

/// A direction towards an emitter.
#[derive(Debug, Clone, Copy)]
pub struct LightSample {
    /// Unit direction from the reference point.
    pub wi: Vec3,
    /// Distance to the emitter; infinite for environments.
    pub distance: f32,
    /// Radiance over pdf.
    pub weight: Rgb,
    /// Density in solid angle, emitter choice included; 1 for a delta emitter.
    pub pdf: f32,
    /// Whether no BSDF sample can find it (point, spot, directional).
    pub delta: bool,
}

impl Lights {
    /// Prepares the emitters of a scene.
    pub fn new(_scene: &Scene) -> Self {
        todo!()
    }

    /// Draws an emitter and a direction to it from `p`. `u` chooses the emitter, `v` the point. Visibility is the caller's.
    pub fn sample(&self, _scene: &Scene, _p: Vec3, _u: f32, _v: Vec2) -> Option<LightSample> {
        todo!()
    }

    /// Density with which [`Lights::sample`] from `p` finds the emitting point `s`.
    pub fn pdf_surface(&self, _scene: &Scene, _p: Vec3, _s: &Surface) -> f32 {
        todo!()
    }

    /// Density with which [`Lights::sample`] finds the environment in direction `d`.
    pub fn pdf_environment(&self, _scene: &Scene, _d: Vec3) -> f32 {
        todo!()
    }

    /// Radiance of the environment from direction `d` (pointing away from the scene).
    pub fn environment(&self, _scene: &Scene, _d: Vec3) -> Rgb {
        todo!()
    }

    /// Radiance that an emitting surface sends to the side of `w` (unit, away from the surface); zero from behind.
    pub fn emitted(&self, _scene: &Scene, _s: &Surface, _w: Vec3) -> Rgb {
        todo!()
    }
}
