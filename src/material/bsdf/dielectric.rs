//! Smooth dielectrics: an interface and a thin sheet (Mitsuba's `dielectric` and `thindielectric`).

use super::{At, BsdfSample, Lobes, Model, Query, Scatter, Surface, fresnel, positive_ratio};
use crate::Result;
use crate::base::math::Rgb;
use crate::material::Texture;
use glam::Vec3;

/// What the dielectrics share in a scene file.
#[derive(Debug, Clone, serde::Serialize)]
pub struct DielectricParams {
    /// Index of refraction of the inside. Mitsuba: bk7, 1.5046.
    pub int_ior: f32,
    /// Index of refraction of the outside. Mitsuba: air, 1.000277.
    pub ext_ior: f32,
    /// Factor on the reflection. Mitsuba: 1.
    pub specular_reflectance: Texture,
    /// Factor on the transmission. Mitsuba: 1.
    pub specular_transmittance: Texture,
}

impl DielectricParams {
    /// Reflection and transmission together, for the share `r` that is reflected.
    pub(super) fn albedo(&self, s: &Surface, r: f32) -> Rgb {
        self.specular_reflectance.at(s) * r + self.specular_transmittance.at(s) * (1.0 - r)
    }
}

/// A smooth interface between two media.
#[derive(Debug, Clone, serde::Serialize)]
pub struct Dielectric {
    /// Parameters as given.
    pub params: DielectricParams,
    pub(crate) eta: f32,
}

impl Dielectric {
    /// Refuses indices of refraction that are not positive and finite.
    pub fn new(params: DielectricParams) -> Result<Self> {
        let eta = positive_ratio("dielectric", params.int_ior, params.ext_ior)?;
        Ok(Self { params, eta })
    }
}

/// The model at a point, seen from either side.
#[derive(Clone, Copy)]
pub(super) struct DielectricAt<'a> {
    model: &'a Dielectric,
    s: &'a Surface,
    wi: Vec3,
}

impl DielectricAt<'_> {
    pub(super) fn sample(&self, u: f32) -> BsdfSample {
        let (wi, params) = (self.wi, &self.model.params);
        let f = fresnel::dielectric(wi.z, self.model.eta);
        if u < f.r {
            return BsdfSample::mirrored(wi, params.specular_reflectance.at(self.s), f.r);
        }
        // Radiance is compressed by the squared ratio of the indices.
        let weight = params.specular_transmittance.at(self.s) * (f.eta_ti * f.eta_ti);
        let wo = fresnel::refract(wi, Vec3::Z, &f);
        BsdfSample { wo, weight, pdf: 1.0 - f.r, delta: true, eta: f.eta_it }
    }
}

impl Scatter for Dielectric {
    fn at<'a>(&'a self, s: &'a Surface, wi: Vec3, query: Query) -> At<'a> {
        let seen = wi.z != 0.0 && query.lobes.contains(Lobes::NON_DIFFUSE);
        At::some(seen.then_some(DielectricAt { model: self, s, wi }), Model::Dielectric)
    }

    fn lobes(&self) -> Lobes {
        Lobes::NON_DIFFUSE
    }

    fn glossy_albedo(&self, s: &Surface, wi: Vec3, _query: Query) -> Rgb {
        self.params.albedo(s, fresnel::dielectric(wi.z, self.eta).r)
    }

    fn alpha(&self, _s: &Surface) -> Option<f32> {
        Some(0.0)
    }

    fn is_transmissive(&self) -> bool {
        true
    }
}

/// A thin sheet: light passes straight through.
#[derive(Debug, Clone, serde::Serialize)]
pub struct ThinDielectric {
    /// Parameters as given.
    pub params: DielectricParams,
    pub(crate) eta: f32,
}

impl ThinDielectric {
    /// Refuses indices of refraction that are not positive and finite.
    pub fn new(params: DielectricParams) -> Result<Self> {
        let eta = positive_ratio("thindielectric", params.int_ior, params.ext_ior)?;
        Ok(Self { params, eta })
    }

    /// Reflected share, all reflections between the two faces included: r + t r t + t r³ t + ...
    fn reflected(&self, w: Vec3) -> f32 {
        let r = fresnel::dielectric(w.z.abs(), self.eta).r;
        2.0 * r / (1.0 + r)
    }
}

/// The model at a point, seen from either side.
#[derive(Clone, Copy)]
pub(super) struct ThinDielectricAt<'a> {
    model: &'a ThinDielectric,
    s: &'a Surface,
    wi: Vec3,
}

impl ThinDielectricAt<'_> {
    pub(super) fn sample(&self, u: f32) -> BsdfSample {
        let r = self.model.reflected(self.wi);
        if u < r {
            return BsdfSample::mirrored(self.wi, self.model.params.specular_reflectance.at(self.s), r);
        }
        let weight = self.model.params.specular_transmittance.at(self.s);
        BsdfSample { wo: -self.wi, weight, pdf: 1.0 - r, delta: true, eta: 1.0 }
    }
}

impl Scatter for ThinDielectric {
    fn at<'a>(&'a self, s: &'a Surface, wi: Vec3, query: Query) -> At<'a> {
        let seen = wi.z != 0.0 && query.lobes.contains(Lobes::NON_DIFFUSE);
        At::some(seen.then_some(ThinDielectricAt { model: self, s, wi }), Model::ThinDielectric)
    }

    fn lobes(&self) -> Lobes {
        Lobes::NON_DIFFUSE
    }

    fn glossy_albedo(&self, s: &Surface, wi: Vec3, _query: Query) -> Rgb {
        self.params.albedo(s, self.reflected(wi))
    }

    fn alpha(&self, _s: &Surface) -> Option<f32> {
        Some(0.0)
    }

    fn is_transmissive(&self) -> bool {
        true
    }
}
