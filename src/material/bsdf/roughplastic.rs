//! A rough dielectric coating over a diffuse base (Mitsuba's `roughplastic`).
//!
//! The base sees the light that the coating lets through, averaged over its facets: a table over the cosine, and the
//! share of the base's own light that the coating throws back. Both belong to the material's alpha;
//! [`Query::roughness_scale`] changes the specular lobe alone.

use super::albedo::{gauss_legendre, lobe_albedo, reflected_mean, transmitted_mean};
use super::microfacet::{ALPHA_MIN, Distribution, Microfacets};
use super::plastic::{Coated, PlasticParams};
use super::warp::{cosine_hemisphere, cosine_hemisphere_pdf};
use super::{At, BsdfSample, Lobes, Model, Query, Scatter, Surface, fresnel, positive_ratio};
use crate::base::math::{Rgb, reflect};
use crate::{Error, Result};
use glam::{Vec2, Vec3};

/// Cosines at which the transmittance is tabulated, evenly from 0 to 1 (Mitsuba's count; it shows at grazing angles).
pub(crate) const COSINES: usize = 64;
/// Nodes of the quadrature behind an entry, each way; internal reflection has a kink at the critical angle.
const EXTERNAL_NODES: usize = 32;
const INTERNAL_NODES: usize = 24;

/// The model, with its tables of transmittance.
#[derive(Debug, Clone, serde::Serialize)]
pub struct RoughPlastic {
    /// Parameters as given.
    pub params: PlasticParams,
    /// Microfacet alpha. Mitsuba: 0.1.
    pub alpha: f32,
    /// Microfacet family.
    pub distribution: Distribution,
    pub(crate) eta: f32,
    #[serde(skip)]
    pub(crate) transmittance: [f32; COSINES],
    pub(crate) internal_reflectance: f32,
    /// 2 ∫ transmittance cos dcos.
    pub(crate) mean_transmittance: f32,
}

impl RoughPlastic {
    /// Refuses indices of refraction that are not positive and finite; raises `alpha` to [`ALPHA_MIN`].
    pub fn new(params: PlasticParams, alpha: f32, distribution: Distribution) -> Result<Self> {
        let eta = positive_ratio("roughplastic", params.int_ior, params.ext_ior)?;
        if !alpha.is_finite() {
            return Err(Error::Request(format!("roughplastic: alpha is {alpha}, expected a number")));
        }
        let alpha = alpha.max(ALPHA_MIN);
        let facets = Microfacets::new(distribution, Vec2::splat(alpha));
        let cosine = |i: usize| (i as f32 / (COSINES - 1) as f32).max(1e-6);
        let (external, internal) = (gauss_legendre(EXTERNAL_NODES), gauss_legendre(INTERNAL_NODES));
        let transmittance: [f32; COSINES] = std::array::from_fn(|i| transmitted_mean(&facets, cosine(i), &external, eta));
        // Mitsuba's own quadrature over the cosine: the plain mean of the nodes.
        let mean = |f: &dyn Fn(usize) -> f32| (0..COSINES).map(|i| f(i) * cosine(i)).sum::<f32>() * 2.0 / COSINES as f32;
        let internal_reflectance =
            mean(&|i| reflected_mean(&facets, cosine(i), &internal, |c| Vec2::X * fresnel::dielectric(c, 1.0 / eta).r).x);
        let mean_transmittance = mean(&|i| transmittance[i]);
        Ok(Self { params, alpha, distribution, eta, transmittance, internal_reflectance, mean_transmittance })
    }

    fn transmitted(&self, w: Vec3) -> f32 {
        let x = w.z.clamp(0.0, 1.0) * (COSINES - 1) as f32;
        let i = (x as usize).min(COSINES - 2);
        let (a, b) = (self.transmittance[i], self.transmittance[i + 1]);
        a + (b - a) * (x - i as f32)
    }

    fn facets(&self, query: Query) -> Microfacets {
        Microfacets::new(self.distribution, Vec2::splat(self.alpha * query.roughness_scale))
    }
}

/// The model at a point, seen from above.
#[derive(Clone, Copy)]
pub(super) struct RoughPlasticAt<'a> {
    model: &'a RoughPlastic,
    wi: Vec3,
    query: Query,
    facets: Microfacets,
    /// Share of the light from the base that gets out to `wi`.
    transmitted: f32,
    coated: Coated,
}

impl RoughPlasticAt<'_> {
    pub(super) fn first_diffuse(&self) -> f32 {
        self.coated.probability
    }

    pub(super) fn eval_pdf(&self, wo: Vec3) -> (Rgb, f32) {
        if wo.z <= 0.0 {
            return (Rgb::ZERO, 0.0);
        }
        let (wi, facets, Coated { specular, base, probability: p }) = (self.wi, &self.facets, self.coated);
        let (mut value, mut density) = (Rgb::ZERO, 0.0);
        if self.query.lobes.contains(Lobes::NON_DIFFUSE) {
            let m = (wi + wo).normalize_or_zero();
            let visible = 0.25 * facets.d(m) * facets.g1_over_cos(wi, m);
            if visible > 0.0 {
                let f = fresnel::dielectric(wi.dot(m), self.model.eta).r;
                value += specular * (f * visible * facets.g1(wo, m));
                density += p * visible;
            }
        }
        if self.query.lobes.contains(Lobes::DIFFUSE) {
            let cosine = cosine_hemisphere_pdf(wo);
            value += base * (self.transmitted * self.model.transmitted(wo) * cosine);
            density += (1.0 - p) * cosine;
        }
        (value, density)
    }

    pub(super) fn sample(&self, u: f32, v: Vec2) -> Option<BsdfSample> {
        let wo = if u < self.coated.probability {
            reflect(self.wi, self.facets.sample(self.wi, v)).normalize_or_zero()
        } else {
            cosine_hemisphere(v)
        };
        let (value, pdf) = self.eval_pdf(wo);
        BsdfSample::reflected(wo, value / pdf, pdf)
    }
}

impl Scatter for RoughPlastic {
    fn at<'a>(&'a self, s: &'a Surface, wi: Vec3, query: Query) -> At<'a> {
        let seen = (wi.z > 0.0).then(|| {
            let transmitted = self.transmitted(wi);
            let coated = self.params.at(s, self.eta, self.internal_reflectance, 1.0 - transmitted, query);
            RoughPlasticAt { model: self, wi, query, facets: self.facets(query), transmitted, coated }
        });
        At::some(seen, Model::RoughPlastic)
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
        self.params.base(albedo, self.eta, self.internal_reflectance) * self.transmitted(wi)
    }

    fn diffuse_in(&self, _s: &Surface, wo: Vec3) -> f32 {
        if wo.z > 0.0 { self.transmitted(wo) } else { 0.0 }
    }

    fn diffuse_albedo(&self, s: &Surface, wi: Vec3) -> Rgb {
        self.diffuse_out(s, wi) * self.mean_transmittance
    }

    fn glossy_albedo(&self, s: &Surface, wi: Vec3, query: Query) -> Rgb {
        if wi.z <= 0.0 {
            return Rgb::ZERO;
        }
        let (energy, cos) = lobe_albedo(self.distribution, self.alpha * query.roughness_scale, wi.z);
        self.params.specular_reflectance.at(s) * (energy * fresnel::dielectric(cos, self.eta).r)
    }

    fn alpha(&self, _s: &Surface) -> Option<f32> {
        Some(self.alpha)
    }
}
