//! Smooth and rough metals (Mitsuba's `conductor` and `roughconductor`).

use super::albedo::lobe_albedo;
use super::microfacet::{Distribution, Microfacets};
use super::{At, BsdfSample, Lobes, Model, Query, Scatter, Surface, fresnel, scalar};
use crate::base::math::{Rgb, reflect};
use crate::material::Texture;
use glam::{Vec2, Vec3};

/// A smooth metal.
#[derive(Debug, Clone, serde::Serialize)]
pub struct Conductor {
    /// Real part of the index of refraction, over that of the outside. Zero: a perfect mirror (`none`).
    pub eta: Rgb,
    /// Imaginary part of the index of refraction, over that of the outside.
    pub k: Rgb,
    /// Factor on the reflection. Mitsuba: 1.
    pub specular_reflectance: Texture,
}

impl Conductor {
    /// What is reflected at a cosine, where `specular_reflectance` is this.
    fn reflected(&self, specular: Rgb, cos: f32) -> Rgb {
        specular * fresnel::conductor(cos, self.eta, self.k)
    }
}

/// The model at a point, seen from above.
#[derive(Clone, Copy)]
pub(super) struct ConductorAt<'a> {
    model: &'a Conductor,
    s: &'a Surface,
    wi: Vec3,
}

impl ConductorAt<'_> {
    pub(super) fn sample(&self) -> BsdfSample {
        BsdfSample::mirrored(self.wi, self.model.glossy_albedo(self.s, self.wi, Query::default()), 1.0)
    }
}

impl Scatter for Conductor {
    fn at<'a>(&'a self, s: &'a Surface, wi: Vec3, query: Query) -> At<'a> {
        let seen = wi.z > 0.0 && query.lobes.contains(Lobes::NON_DIFFUSE);
        At::some(seen.then_some(ConductorAt { model: self, s, wi }), Model::Conductor)
    }

    fn lobes(&self) -> Lobes {
        Lobes::NON_DIFFUSE
    }

    fn glossy_albedo(&self, s: &Surface, wi: Vec3, _query: Query) -> Rgb {
        if wi.z <= 0.0 {
            return Rgb::ZERO;
        }
        self.reflected(self.specular_reflectance.at(s), wi.z)
    }

    fn alpha(&self, _s: &Surface) -> Option<f32> {
        Some(0.0)
    }
}

/// A rough metal.
#[derive(Debug, Clone, serde::Serialize)]
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
        let alpha = Vec2::new(scalar(&self.alpha_u, s), scalar(&self.alpha_v, s));
        Microfacets::new(self.distribution, alpha * query.roughness_scale)
    }
}

/// The model at a point, seen from above.
#[derive(Clone, Copy)]
pub(super) struct RoughConductorAt<'a> {
    metal: &'a Conductor,
    wi: Vec3,
    facets: Microfacets,
    /// What multiplies the Fresnel term.
    specular: Rgb,
}

impl RoughConductorAt<'_> {
    fn fresnel(&self, m: Vec3) -> Rgb {
        self.metal.reflected(self.specular, self.wi.dot(m))
    }

    pub(super) fn eval_pdf(&self, wo: Vec3) -> (Rgb, f32) {
        if wo.z <= 0.0 {
            return (Rgb::ZERO, 0.0);
        }
        let (wi, facets) = (self.wi, &self.facets);
        let m = (wi + wo).normalize_or_zero();
        let pdf = 0.25 * facets.d(m) * facets.g1_over_cos(wi, m);
        (self.fresnel(m) * (pdf * facets.g1(wo, m)), pdf)
    }

    pub(super) fn sample(&self, v: Vec2) -> Option<BsdfSample> {
        let (wi, facets) = (self.wi, &self.facets);
        let m = facets.sample(wi, v);
        let wo = reflect(wi, m).normalize_or_zero();
        if wo.z <= 0.0 {
            return None;
        }
        // D and G1(wi) of value and density cancel.
        let weight = self.fresnel(m) * facets.g1(wo, m);
        BsdfSample::reflected(wo, weight, 0.25 * facets.d(m) * facets.g1_over_cos(wi, m))
    }
}

impl Scatter for RoughConductor {
    fn at<'a>(&'a self, s: &'a Surface, wi: Vec3, query: Query) -> At<'a> {
        let seen = wi.z > 0.0 && query.lobes.contains(Lobes::NON_DIFFUSE);
        let specular = || self.metal.specular_reflectance.at(s);
        let at = || RoughConductorAt { metal: &self.metal, wi, facets: self.facets(s, query), specular: specular() };
        At::some(seen.then(at), Model::RoughConductor)
    }

    fn lobes(&self) -> Lobes {
        Lobes::NON_DIFFUSE
    }

    fn glossy_albedo(&self, s: &Surface, wi: Vec3, query: Query) -> Rgb {
        if wi.z <= 0.0 {
            return Rgb::ZERO;
        }
        let (energy, cos) = lobe_albedo(self.distribution, self.facets(s, query).alpha_towards(wi), wi.z);
        self.metal.reflected(self.metal.specular_reflectance.at(s), cos) * energy
    }

    fn alpha(&self, s: &Surface) -> Option<f32> {
        Some(self.facets(s, Query::default()).mean_alpha())
    }
}
