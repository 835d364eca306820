//! A smooth dielectric coating over a diffuse base (Mitsuba's `plastic`).

use super::warp::{cosine_hemisphere, cosine_hemisphere_pdf};
use super::{At, BsdfSample, Lobes, Model, Query, Scatter, Surface, fresnel, positive_ratio};
use crate::Result;
use crate::base::math::Rgb;
use crate::material::Texture;
use glam::{Vec2, Vec3};

/// What `plastic` and `roughplastic` share in a scene file.
#[derive(Debug, Clone, serde::Serialize)]
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

/// A plastic at a point, for one viewer.
#[derive(Clone, Copy)]
pub(super) struct Coated {
    /// Factor on the specular reflection.
    pub specular: Rgb,
    /// Radiance of the base per irradiance through the coating.
    pub base: Rgb,
    /// Of drawing the specular lobe.
    pub probability: f32,
}

impl PlasticParams {
    /// At a point, for a viewer to whom the coating sends the share `reflected`; `eta` and `internal_reflectance` as for [`Self::base`].
    pub(super) fn at(&self, s: &Surface, eta: f32, internal_reflectance: f32, reflected: f32, query: Query) -> Coated {
        let (diffuse, specular) = (self.diffuse_reflectance.at(s), self.specular_reflectance.at(s));
        let base = self.base(diffuse, eta, internal_reflectance);
        Coated { specular, base, probability: specular_probability([specular, diffuse], reflected, query) }
    }

    /// Radiance of a base of albedo `diffuse`, per irradiance that reaches it through the coating and over the two
    /// transmissions: albedo · Σ (internal reflections) / eta².
    pub(super) fn base(&self, diffuse: Rgb, eta: f32, internal_reflectance: f32) -> Rgb {
        let lost = if self.nonlinear { diffuse * internal_reflectance } else { Rgb::splat(internal_reflectance) };
        diffuse / ((Rgb::ONE - lost) * (eta * eta))
    }
}

/// Probability of drawing the specular lobe, of which the coating reflects the share `reflected` at `wi`.
/// Mitsuba's rule, with the colours at the point (specular, diffuse) in place of their means over the textures.
fn specular_probability([specular, diffuse]: [Rgb; 2], reflected: f32, query: Query) -> f32 {
    if query.lobes != Lobes::ALL {
        return if query.lobes.contains(Lobes::NON_DIFFUSE) { 1.0 } else { 0.0 };
    }
    let (specular, diffuse) = (specular.element_sum() * reflected, diffuse.element_sum() * (1.0 - reflected));
    if specular > 0.0 { specular / (specular + diffuse) } else { 0.0 }
}

/// The model, with what its parameters imply.
#[derive(Debug, Clone, serde::Serialize)]
pub struct Plastic {
    /// Parameters as given.
    pub params: PlasticParams,
    pub(crate) eta: f32,
    pub(crate) internal_reflectance: f32,
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

/// The model at a point, seen from above.
#[derive(Clone, Copy)]
pub(super) struct PlasticAt<'a> {
    model: &'a Plastic,
    wi: Vec3,
    query: Query,
    /// Share of the light to `wi` that the coating reflects.
    reflected: f32,
    coated: Coated,
}

impl PlasticAt<'_> {
    pub(super) fn first_diffuse(&self) -> f32 {
        self.coated.probability
    }

    pub(super) fn eval_pdf(&self, wo: Vec3) -> (Rgb, f32) {
        if wo.z <= 0.0 || !self.query.lobes.contains(Lobes::DIFFUSE) {
            return (Rgb::ZERO, 0.0);
        }
        let pdf = cosine_hemisphere_pdf(wo);
        let value = self.coated.base * ((1.0 - self.reflected) * (1.0 - self.model.reflected(wo)) * pdf);
        (value, pdf * (1.0 - self.coated.probability))
    }

    pub(super) fn sample(&self, u: f32, v: Vec2) -> Option<BsdfSample> {
        let Coated { specular, probability, .. } = self.coated;
        if u < probability {
            return Some(BsdfSample::mirrored(self.wi, specular * (self.reflected / probability), probability));
        }
        let wo = cosine_hemisphere(v);
        let (value, pdf) = self.eval_pdf(wo);
        BsdfSample::reflected(wo, value / pdf, pdf)
    }
}

impl Scatter for Plastic {
    fn at<'a>(&'a self, s: &'a Surface, wi: Vec3, query: Query) -> At<'a> {
        let seen = (wi.z > 0.0).then(|| {
            let reflected = self.reflected(wi);
            let coated = self.params.at(s, self.eta, self.internal_reflectance, reflected, query);
            PlasticAt { model: self, wi, query, reflected, coated }
        });
        At::some(seen, Model::Plastic)
    }

    fn prefetch(&self, s: &Surface) {
        self.params.diffuse_reflectance.prefetch(s);
    }

    fn lobes(&self) -> Lobes {
        Lobes::ALL
    }

    fn diffuse_out(&self, s: &Surface, wi: Vec3) -> Rgb {
        if wi.z <= 0.0 {
            return Rgb::ZERO;
        }
        let albedo = self.params.diffuse_reflectance.at(s);
        self.params.base(albedo, self.eta, self.internal_reflectance) * (1.0 - self.reflected(wi))
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
        self.params.specular_reflectance.at(s) * self.reflected(wi)
    }

    fn alpha(&self, _s: &Surface) -> Option<f32> {
        Some(0.0)
    }
}
