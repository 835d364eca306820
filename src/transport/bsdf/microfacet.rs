//! Microfacet normal distributions, shadowing and visible-normal sampling.

use serde::{Deserialize, Serialize};

/// Smallest alpha that a distribution is evaluated with (Mitsuba's floor).
pub const ALPHA_MIN: f32 = 1e-4;

/// Family of microfacet normal distributions.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Distribution {
    /// Gaussian slopes; Mitsuba's default.
    #[default]
    Beckmann,
    /// Trowbridge-Reitz.
    Ggx,
}
