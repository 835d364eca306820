//! Lambertian reflection (Mitsuba's `diffuse`).

use super::warp::{cosine_hemisphere, cosine_hemisphere_pdf};
use super::{BsdfSample, Lobes, Query, Scatter, Surface};
use crate::base::math::Rgb;
use crate::material::Texture;
use glam::{Vec2, Vec3};

/// A Lambertian reflector, black from behind.
#[derive(Debug, Clone, serde::Serialize)]
pub struct Diffuse {
    /// Albedo.
    pub reflectance: Texture,
}

impl Scatter for Diffuse {
    fn eval_pdf(&self, s: &Surface, wi: Vec3, wo: Vec3, query: Query) -> (Rgb, f32) {
        if wi.z <= 0.0 || wo.z <= 0.0 || !query.lobes.contains(Lobes::DIFFUSE) {
            return (Rgb::ZERO, 0.0);
        }
        let pdf = cosine_hemisphere_pdf(wo);
        (self.reflectance.at(s) * pdf, pdf)
    }

    fn sample(&self, s: &Surface, wi: Vec3, _u: f32, v: Vec2, query: Query) -> Option<BsdfSample> {
        if wi.z <= 0.0 || !query.lobes.contains(Lobes::DIFFUSE) {
            return None;
        }
        let wo = cosine_hemisphere(v);
        BsdfSample::reflected(wo, self.reflectance.at(s), cosine_hemisphere_pdf(wo))
    }

    fn prefetch(&self, s: &Surface) {
        self.reflectance.prefetch(s);
    }

    fn lobes(&self) -> Lobes {
        Lobes::DIFFUSE
    }

    fn diffuse_out(&self, s: &Surface, wi: Vec3) -> Rgb {
        if wi.z > 0.0 { self.reflectance.at(s) } else { Rgb::ZERO }
    }

    fn diffuse_in(&self, _s: &Surface, wo: Vec3) -> f32 {
        if wo.z > 0.0 { 1.0 } else { 0.0 }
    }

    fn diffuse_albedo(&self, s: &Surface, wi: Vec3) -> Rgb {
        self.diffuse_out(s, wi)
    }
}
