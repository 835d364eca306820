//! Smooth and rough metals (Mitsuba's `conductor` and `roughconductor`).

use super::albedo::lobe_albedo;
use super::microfacet::{Distribution, Microfacets};
use super::{BsdfSample, Lobes, Query, Scatter, Surface, fresnel, scalar};
use crate::base::math::{Rgb, reflect};
use crate::material::Texture;
use glam::{Vec2, Vec3};

/// A smooth metal.
#[derive(Debug, Clone)]
pub struct Conductor {
    /// Real part of the index of refraction, over that of the outside. Zero: a perfect mirror (`none`).
    pub eta: Rgb,
    /// Imaginary part of the index of refraction, over that of the outside.
    pub k: Rgb,
    /// Factor on the reflection. Mitsuba: 1.
    pub specular_reflectance: Texture,
}

impl Scatter for Conductor {
    fn eval_pdf(&self, _s: &Surface, _wi: Vec3, _wo: Vec3, _query: Query) -> (Rgb, f32) {
        (Rgb::ZERO, 0.0)
    }

    fn sample(&self, s: &Surface, wi: Vec3, _u: f32, _v: Vec2, query: Query) -> Option<BsdfSample> {
        if wi.z <= 0.0 || !query.lobes.contains(Lobes::NON_DIFFUSE) {
            return None;
        }
        Some(BsdfSample::mirrored(wi, self.glossy_albedo(s, wi, query), 1.0))
    }

    fn lobes(&self) -> Lobes {
        Lobes::NON_DIFFUSE
    }

    fn glossy_albedo(&self, s: &Surface, wi: Vec3, _query: Query) -> Rgb {
        if wi.z <= 0.0 {
            return Rgb::ZERO;
        }
        self.specular_reflectance.eval(s.uv) * fresnel::conductor(wi.z, self.eta, self.k)
    }

    fn alpha(&self, _s: &Surface) -> Option<f32> {
        Some(0.0)
    }
}

/// A rough metal.
#[derive(Debug, Clone)]
pub struct RoughConductor {
    /// The metal.
    pub metal: Conductor,
    /// Microfacet alpha along the tangent. Mitsuba: 0.1.
    pub alpha_u: Texture,
    /// Microfacet alpha along the bitangent.
    pub alpha_v: Texture,
    /// Microfacet family.
    pub distribution: Distribution,
}

impl RoughConductor {
    fn facets(&self, s: &Surface, query: Query) -> Microfacets {
        let alpha = Vec2::new(scalar(&self.alpha_u, s.uv), scalar(&self.alpha_v, s.uv));
        Microfacets::new(self.distribution, alpha * query.roughness_scale)
    }

    fn fresnel(&self, s: &Surface, cos: f32) -> Rgb {
        self.metal.specular_reflectance.eval(s.uv) * fresnel::conductor(cos, self.metal.eta, self.metal.k)
    }
}

impl Scatter for RoughConductor {
    fn eval_pdf(&self, s: &Surface, wi: Vec3, wo: Vec3, query: Query) -> (Rgb, f32) {
        if wi.z <= 0.0 || wo.z <= 0.0 || !query.lobes.contains(Lobes::NON_DIFFUSE) {
            return (Rgb::ZERO, 0.0);
        }
        let facets = self.facets(s, query);
        let m = (wi + wo).normalize_or_zero();
        let pdf = 0.25 * facets.d(m) * facets.g1_over_cos(wi, m);
        (self.fresnel(s, wi.dot(m)) * (pdf * facets.g1(wo, m)), pdf)
    }

    fn sample(&self, s: &Surface, wi: Vec3, _u: f32, v: Vec2, query: Query) -> Option<BsdfSample> {
        if wi.z <= 0.0 || !query.lobes.contains(Lobes::NON_DIFFUSE) {
            return None;
        }
        let facets = self.facets(s, query);
        let m = facets.sample(wi, v);
        let wo = reflect(wi, m).normalize_or_zero();
        if wo.z <= 0.0 {
            return None;
        }
        // D and G1(wi) of value and density cancel.
        let weight = self.fresnel(s, wi.dot(m)) * facets.g1(wo, m);
        BsdfSample::reflected(wo, weight, 0.25 * facets.d(m) * facets.g1_over_cos(wi, m))
    }

    fn lobes(&self) -> Lobes {
        Lobes::NON_DIFFUSE
    }

    fn glossy_albedo(&self, s: &Surface, wi: Vec3, query: Query) -> Rgb {
        if wi.z <= 0.0 {
            return Rgb::ZERO;
        }
        let (energy, cos) = lobe_albedo(self.distribution, self.facets(s, query).alpha_towards(wi), wi.z);
        self.fresnel(s, cos) * energy
    }

    fn alpha(&self, s: &Surface) -> Option<f32> {
        Some(self.facets(s, Query::default()).mean_alpha())
    }
}
