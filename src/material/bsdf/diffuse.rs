//! Lambertian reflection (Mitsuba's `diffuse`).

use super::warp::{cosine_hemisphere, cosine_hemisphere_pdf};
use super::{At, BsdfSample, Lobes, Model, Query, Scatter, Surface};
use crate::base::math::Rgb;
use crate::material::Texture;
use glam::{Vec2, Vec3};

/// A Lambertian reflector, black from behind.
#[derive(Debug, Clone, serde::Serialize)]
pub struct Diffuse {
    /// Albedo.
    pub reflectance: Texture,
}

/// The model at a point, seen from above: its albedo.
#[derive(Clone, Copy)]
pub(super) struct DiffuseAt(Rgb);

impl DiffuseAt {
    pub(super) fn eval_pdf(&self, wo: Vec3) -> (Rgb, f32) {
        let pdf = cosine_hemisphere_pdf(wo);
        (self.0 * pdf, pdf)
    }

    pub(super) fn sample(&self, v: Vec2) -> Option<BsdfSample> {
        let wo = cosine_hemisphere(v);
        BsdfSample::reflected(wo, self.0, cosine_hemisphere_pdf(wo))
    }
}

impl Scatter for Diffuse {
    fn at<'a>(&'a self, s: &'a Surface, wi: Vec3, query: Query) -> At<'a> {
        let seen = wi.z > 0.0 && query.lobes.contains(Lobes::DIFFUSE);
        At::some(seen.then(|| DiffuseAt(self.reflectance.at(s))), Model::Diffuse)
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
