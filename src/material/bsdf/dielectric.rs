//! Smooth dielectrics: an interface and a thin sheet (Mitsuba's `dielectric` and `thindielectric`).

use super::{BsdfSample, Lobes, Query, Scatter, Surface, fresnel, positive_ratio};
use crate::Result;
use crate::base::math::Rgb;
use crate::material::Texture;
use glam::{Vec2, Vec3};

/// What the dielectrics share in a scene file.
#[derive(Debug, Clone)]
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
        self.specular_reflectance.eval(s.uv) * r + self.specular_transmittance.eval(s.uv) * (1.0 - r)
    }
}

/// A smooth interface between two media.
#[derive(Debug, Clone)]
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

impl Scatter for Dielectric {
    fn eval_pdf(&self, _s: &Surface, _wi: Vec3, _wo: Vec3, _query: Query) -> (Rgb, f32) {
        (Rgb::ZERO, 0.0)
    }

    fn sample(&self, s: &Surface, wi: Vec3, u: f32, _v: Vec2, query: Query) -> Option<BsdfSample> {
        if !query.lobes.contains(Lobes::NON_DIFFUSE) || wi.z == 0.0 {
            return None;
        }
        let f = fresnel::dielectric(wi.z, self.eta);
        if u < f.r {
            return Some(BsdfSample::mirrored(wi, self.params.specular_reflectance.eval(s.uv), f.r));
        }
        // Radiance is compressed by the squared ratio of the indices.
        let weight = self.params.specular_transmittance.eval(s.uv) * (f.eta_ti * f.eta_ti);
        let wo = fresnel::refract(wi, Vec3::Z, &f);
        Some(BsdfSample { wo, weight, pdf: 1.0 - f.r, delta: true, eta: f.eta_it })
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
#[derive(Debug, Clone)]
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

impl Scatter for ThinDielectric {
    fn eval_pdf(&self, _s: &Surface, _wi: Vec3, _wo: Vec3, _query: Query) -> (Rgb, f32) {
        (Rgb::ZERO, 0.0)
    }

    fn sample(&self, s: &Surface, wi: Vec3, u: f32, _v: Vec2, query: Query) -> Option<BsdfSample> {
        if !query.lobes.contains(Lobes::NON_DIFFUSE) || wi.z == 0.0 {
            return None;
        }
        let r = self.reflected(wi);
        Some(if u < r {
            BsdfSample::mirrored(wi, self.params.specular_reflectance.eval(s.uv), r)
        } else {
            let weight = self.params.specular_transmittance.eval(s.uv);
            BsdfSample { wo: -wi, weight, pdf: 1.0 - r, delta: true, eta: 1.0 }
        })
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
