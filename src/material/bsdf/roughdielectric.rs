//! A rough interface between two media (Mitsuba's `roughdielectric`; Walter et al. 2007).

use super::dielectric::DielectricParams;
use super::microfacet::{Distribution, Microfacets};
use super::{At, BsdfSample, Lobes, Model, Query, Scatter, Surface, fresnel, positive_ratio, scalar};
use crate::Result;
use crate::base::math::{Rgb, reflect};
use crate::material::Texture;
use glam::{Vec2, Vec3};

/// The model.
#[derive(Debug, Clone, serde::Serialize)]
pub struct RoughDielectric {
    /// Parameters as given.
    pub params: DielectricParams,
    /// Microfacet alpha along the tangent. Mitsuba: 0.1.
    pub alpha_u: Texture,
    /// Microfacet alpha along the bitangent.
    pub alpha_v: Texture,
    /// Microfacet family.
    pub distribution: Distribution,
    pub(crate) eta: f32,
}

/// The facet normal that turns `wi` into `wo`, on the side of +z, with d(solid angle of m) / d(solid angle of wo).
/// `eta` is inside over outside. `None` where no facet does.
pub(super) fn facet(wi: Vec3, wo: Vec3, eta: f32) -> Option<(Vec3, f32)> {
    let reflection = wi.z * wo.z > 0.0;
    let eta = if wi.z > 0.0 { eta } else { 1.0 / eta };
    let m = (wi + wo * if reflection { 1.0 } else { eta }).try_normalize()?;
    let m = if m.z < 0.0 { -m } else { m };
    let (i, o) = (wi.dot(m), wo.dot(m));
    // Each direction must see the side of the facet that it sees of the surface.
    if i * wi.z <= 0.0 || o * wo.z <= 0.0 {
        return None;
    }
    let jacobian = if reflection { 0.25 / o.abs() } else { (eta * eta * o).abs() / (i + eta * o).powi(2) };
    jacobian.is_finite().then_some((m, jacobian))
}

impl RoughDielectric {
    /// Refuses indices of refraction that are not positive and finite.
    pub fn new(params: DielectricParams, alpha_u: Texture, alpha_v: Texture, distribution: Distribution) -> Result<Self> {
        let eta = positive_ratio("roughdielectric", params.int_ior, params.ext_ior)?;
        Ok(Self { params, alpha_u, alpha_v, distribution, eta })
    }

    fn facets(&self, s: &Surface, query: Query) -> Microfacets {
        let alpha = Vec2::new(scalar(&self.alpha_u, s), scalar(&self.alpha_v, s));
        Microfacets::new(self.distribution, alpha * query.roughness_scale)
    }
}

/// The model at a point, seen from either side.
#[derive(Clone, Copy)]
pub(super) struct RoughDielectricAt<'a> {
    model: &'a RoughDielectric,
    s: &'a Surface,
    wi: Vec3,
    facets: Microfacets,
}

impl RoughDielectricAt<'_> {
    pub(super) fn eval_pdf(&self, wo: Vec3) -> (Rgb, f32) {
        let (wi, facets, params) = (self.wi, &self.facets, &self.model.params);
        if wo.z == 0.0 {
            return (Rgb::ZERO, 0.0);
        }
        let Some((m, jacobian)) = facet(wi, wo, self.model.eta) else { return (Rgb::ZERO, 0.0) };
        let f = fresnel::dielectric(wi.dot(m), self.model.eta);
        // D G1(wi) (wi·m)/cos wi · dm/dwo: density of the facet; G1(wo) is left for the value.
        let visible = facets.d(m) * facets.g1_over_cos(wi, m) * wi.dot(m).abs() * jacobian;
        let (share, colour) = if wi.z * wo.z > 0.0 {
            (f.r, params.specular_reflectance.at(self.s))
        } else {
            (1.0 - f.r, params.specular_transmittance.at(self.s) * (f.eta_ti * f.eta_ti))
        };
        (colour * (share * visible * facets.g1(wo, m)), share * visible)
    }

    pub(super) fn sample(&self, u: f32, v: Vec2) -> Option<BsdfSample> {
        let wi = self.wi;
        let m = self.facets.sample(if wi.z > 0.0 { wi } else { -wi }, v);
        let f = fresnel::dielectric(wi.dot(m), self.model.eta);
        let reflection = u < f.r;
        let wo = if reflection { reflect(wi, m) } else { fresnel::refract(wi, m, &f) }.normalize_or_zero();
        if reflection != (wi.z * wo.z > 0.0) {
            return None;
        }
        let (value, pdf) = self.eval_pdf(wo);
        let sample = BsdfSample::reflected(wo, value / pdf, pdf)?;
        Some(BsdfSample { eta: if reflection { 1.0 } else { f.eta_it }, ..sample })
    }
}

impl Scatter for RoughDielectric {
    fn at<'a>(&'a self, s: &'a Surface, wi: Vec3, query: Query) -> At<'a> {
        let seen = wi.z != 0.0 && query.lobes.contains(Lobes::NON_DIFFUSE);
        let at = || RoughDielectricAt { model: self, s, wi, facets: self.facets(s, query) };
        At::some(seen.then(at), Model::RoughDielectric)
    }

    fn lobes(&self) -> Lobes {
        Lobes::NON_DIFFUSE
    }

    fn glossy_albedo(&self, s: &Surface, wi: Vec3, _query: Query) -> Rgb {
        self.params.albedo(s, fresnel::dielectric(wi.z, self.eta).r)
    }

    fn alpha(&self, s: &Surface) -> Option<f32> {
        Some(self.facets(s, Query::default()).mean_alpha())
    }

    fn is_transmissive(&self) -> bool {
        true
    }
}
