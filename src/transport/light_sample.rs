//! What emitter sampling yields.

use crate::base::math::Rgb;
use crate::base::ray::Ray;
use crate::material::Surface;
use glam::Vec3;

/// A direction towards an emitter.
#[derive(Debug, Clone, Copy)]
pub struct LightSample {
    /// Unit direction from the reference point.
    pub wi: Vec3,
    /// Distance to the emitter; infinite for environments.
    pub distance: f32,
    /// The emitting point; meaningless where the distance is infinite.
    pub point: Vec3,
    /// Radiance over pdf.
    pub weight: Rgb,
    /// Density in solid angle, emitter choice included; 1 for a delta emitter.
    pub pdf: f32,
    /// Whether no BSDF sample can find it (point, spot, directional).
    pub delta: bool,
}

impl LightSample {
    /// The ray from a surface that tells whether something stands before the emitter.
    #[inline]
    pub fn shadow_ray(&self, surface: &Surface) -> Ray {
        if self.distance.is_finite() { surface.spawn_to(self.point) } else { surface.spawn(self.wi) }
    }
}
