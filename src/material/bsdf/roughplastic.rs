//! A rough dielectric coating over a diffuse base (Mitsuba's `roughplastic`).
//!
//! The base sees the light that the coating lets through, averaged over its facets: a table over the cosine, and the
//! share of the base's own light that the coating throws back. Both belong to the material's alpha;
//! [`Query::roughness_scale`] changes the specular lobe alone.

use super::albedo::{gauss_legendre, lobe_albedo, reflected_mean, transmitted_mean};
use super::microfacet::{ALPHA_MIN, Distribution, Microfacets};
use super::plastic::{Colours, PlasticParams};
use super::warp::{cosine_hemisphere, cosine_hemisphere_pdf};
use super::{BsdfSample, Lobes, Query, Scatter, Surface, fresnel, positive_ratio};
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

    /// Value and density for a view above the surface; `t_i` = transmitted(wi).
    fn eval_pdf_with(&self, colours: &Colours, t_i: f32, wi: Vec3, wo: Vec3, query: Query) -> (Rgb, f32) {
        if wo.z <= 0.0 {
            return (Rgb::ZERO, 0.0);
        }
        let p = colours.specular_probability(1.0 - t_i, query);
        let (mut value, mut density) = (Rgb::ZERO, 0.0);
        if query.lobes.contains(Lobes::NON_DIFFUSE) {
            let facets = self.facets(query);
            let m = (wi + wo).normalize_or_zero();
            let visible = 0.25 * facets.d(m) * facets.g1_over_cos(wi, m);
            if visible > 0.0 {
                let f = fresnel::dielectric(wi.dot(m), self.eta).r;
                value += colours.specular * (f * visible * facets.g1(wo, m));
                density += p * visible;
            }
        }
        if query.lobes.contains(Lobes::DIFFUSE) {
            let cosine = cosine_hemisphere_pdf(wo);
            let base = self.params.base(colours.diffuse, self.eta, self.internal_reflectance);
            value += base * (t_i * self.transmitted(wo) * cosine);
            density += (1.0 - p) * cosine;
        }
        (value, density)
    }
}

impl Scatter for RoughPlastic {
    fn eval_pdf(&self, s: &Surface, wi: Vec3, wo: Vec3, query: Query) -> (Rgb, f32) {
        if wi.z <= 0.0 || wo.z <= 0.0 {
            return (Rgb::ZERO, 0.0);
        }
        self.eval_pdf_with(&self.params.at(s), self.transmitted(wi), wi, wo, query)
    }

    fn sample(&self, s: &Surface, wi: Vec3, u: f32, v: Vec2, query: Query) -> Option<BsdfSample> {
        if wi.z <= 0.0 {
            return None;
        }
        let (t_i, colours) = (self.transmitted(wi), self.params.at(s));
        let p = colours.specular_probability(1.0 - t_i, query);
        let wo = if u < p { reflect(wi, self.facets(query).sample(wi, v)).normalize_or_zero() } else { cosine_hemisphere(v) };
        let (value, pdf) = self.eval_pdf_with(&colours, t_i, wi, wo, query);
        BsdfSample::reflected(wo, value / pdf, pdf)
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
