//! Smooth and rough metals (Mitsuba's `conductor` and `roughconductor`).

use super::microfacet::Distribution;
use crate::math::Rgb;
use crate::scene::Texture;

/// A smooth metal.
#[derive(Debug, Clone)]
pub struct Conductor {
    /// Real part of the index of refraction, over that of the outside. Zero with a zero `k`: a perfect mirror (`none`).
    pub eta: Rgb,
    /// Imaginary part of the index of refraction, over that of the outside.
    pub k: Rgb,
    /// Factor on the reflection. Mitsuba: 1.
    pub specular_reflectance: Texture,
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
