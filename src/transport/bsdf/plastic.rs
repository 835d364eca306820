//! A smooth dielectric coating over a diffuse base (Mitsuba's `plastic`).

use super::warp::{cosine_hemisphere, cosine_hemisphere_pdf};
use super::{BsdfSample, Lobes, Query, Scatter, Surface, fresnel, positive_ratio};
use crate::Result;
use crate::math::Rgb;
use crate::scene::Texture;
use glam::{Vec2, Vec3};

/// What `plastic` and `roughplastic` share in a scene file.
#[derive(Debug, Clone)]
pub struct PlasticParams {
    /// Index of refraction of the inside. Mitsuba: polypropylene, 1.49.
    pub int_ior: f32,
    /// Index of refraction of the outside. Mitsuba: air, 1.000277.
    pub ext_ior: f32,
    /// Whether internal reflections saturate the colour of the base.
    pub nonlinear: bool,
    /// Albedo of the base. Mitsuba: 0.5.
    pub diffuse_reflectance: Texture,
    /// Factor on the specular reflection. Mitsuba: 1.
    pub specular_reflectance: Texture,
}

impl PlasticParams {
    /// Radiance of the base, per irradiance that reaches it through the coating and over the two transmissions:
    /// albedo · Σ (internal reflections) / eta².
    pub(super) fn base(&self, s: &Surface, eta: f32, internal_reflectance: f32) -> Rgb {
        let albedo = self.diffuse_reflectance.eval(s.uv);
        let lost = if self.nonlinear { albedo * internal_reflectance } else { Rgb::splat(internal_reflectance) };
        albedo / ((Rgb::ONE - lost) * (eta * eta))
    }

    /// Probability of drawing the specular lobe, of which the coating reflects the share `reflected` at `wi`.
    /// Mitsuba's rule, with the colours at the point in place of their means over the textures.
    pub(super) fn specular_probability(&self, s: &Surface, reflected: f32, query: Query) -> f32 {
        if query.lobes != Lobes::ALL {
            return if query.lobes.contains(Lobes::NON_DIFFUSE) { 1.0 } else { 0.0 };
        }
        let specular = self.specular_reflectance.eval(s.uv).element_sum() * reflected;
        let diffuse = self.diffuse_reflectance.eval(s.uv).element_sum() * (1.0 - reflected);
        if specular > 0.0 { specular / (specular + diffuse) } else { 0.0 }
    }
}

/// The model, with what its parameters imply.
#[derive(Debug, Clone)]
pub struct Plastic {
    /// Parameters as given.
    pub params: PlasticParams,
    eta: f32,
    internal_reflectance: f32,
}

impl Plastic {
    /// Refuses indices of refraction that are not positive and finite.
    pub fn new(params: PlasticParams) -> Result<Self> {
        let eta = positive_ratio("plastic", params.int_ior, params.ext_ior)?;
        Ok(Self { params, eta, internal_reflectance: fresnel::diffuse_reflectance(1.0 / eta) })
    }

    fn reflected(&self, w: Vec3) -> f32 {
        fresnel::dielectric(w.z, self.eta).r
    }
}

impl Scatter for Plastic {
    fn eval_pdf(&self, s: &Surface, wi: Vec3, wo: Vec3, query: Query) -> (Rgb, f32) {
        if wi.z <= 0.0 || wo.z <= 0.0 || !query.lobes.contains(Lobes::DIFFUSE) {
            return (Rgb::ZERO, 0.0);
        }
        let f_i = self.reflected(wi);
        let pdf = cosine_hemisphere_pdf(wo);
        let value = self.params.base(s, self.eta, self.internal_reflectance) * ((1.0 - f_i) * (1.0 - self.reflected(wo)) * pdf);
        (value, pdf * (1.0 - self.params.specular_probability(s, f_i, query)))
    }

    fn sample(&self, s: &Surface, wi: Vec3, u: f32, v: Vec2, query: Query) -> Option<BsdfSample> {
        if wi.z <= 0.0 {
            return None;
        }
        let f_i = self.reflected(wi);
        let p = self.params.specular_probability(s, f_i, query);
        if u < p {
            let weight = self.params.specular_reflectance.eval(s.uv) * (f_i / p);
            return Some(BsdfSample::mirrored(wi, weight, p));
        }
        let wo = cosine_hemisphere(v);
        let (value, pdf) = self.eval_pdf(s, wi, wo, query);
        BsdfSample::reflected(wo, value / pdf, pdf)
    }

    fn lobes(&self) -> Lobes {
        Lobes::ALL
    }

    fn diffuse_out(&self, s: &Surface, wi: Vec3) -> Rgb {
        if wi.z <= 0.0 {
            return Rgb::ZERO;
        }
        self.params.base(s, self.eta, self.internal_reflectance) * (1.0 - self.reflected(wi))
    }

    fn diffuse_in(&self, _s: &Surface, wo: Vec3) -> f32 {
        if wo.z > 0.0 { 1.0 - self.reflected(wo) } else { 0.0 }
    }

    fn diffuse_albedo(&self, s: &Surface, wi: Vec3) -> Rgb {
        self.diffuse_out(s, wi) * (1.0 - fresnel::diffuse_reflectance(self.eta))
    }

    fn glossy_albedo(&self, s: &Surface, wi: Vec3, _query: Query) -> Rgb {
        if wi.z <= 0.0 {
            return Rgb::ZERO;
        }
        self.params.specular_reflectance.eval(s.uv) * self.reflected(wi)
    }

    fn alpha(&self, _s: &Surface) -> Option<f32> {
        Some(0.0)
    }
}
