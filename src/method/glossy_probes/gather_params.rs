//! Parameters of the gather (§5.2), and its bounds.

use super::perturb::PerturbParams;
use crate::Result;
use crate::base::named::within;
use serde::{Deserialize, Serialize};

/// Most samples to each side of a search's centre.
pub const MAX_RADIUS: i32 = 15;

/// Side of a tile of pixels: what their searches read of a probe, some 100 KB, fits into a core's cache.
pub(crate) const TILE: usize = 16;

/// How much worse than its anchor a pixel's sample may be before it is searched for in full: a factor, and an addend.
pub(crate) const ANCHOR_TOLERANCE: (f32, f32) = (3.0, 0.1);

/// Most levels of a search.
pub const MAX_LEVELS: usize = 8;

/// One level of the neighbour search: (2 radius + 1)² samples.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SearchLevel {
    /// Samples to each side of the centre, [`MAX_RADIUS`] at the most.
    pub radius: i32,
    /// Distance between samples, texels of an undistorted map; scaled by the map's derivative.
    pub step: f32,
}

/// When a neighbouring texel's colour may be blended in.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum BilinearRule {
    /// Never: the nearest texel's colour alone.
    Nearest,
    /// On the same reflecting object. *Paper*.
    SameReflector,
    /// On the same reflecting object, showing the same reflected material: does not bleed over edges seen in mirrors.
    SameReflectorAndReflected,
}

/// Parameters of the gather.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GatherParams {
    /// The search, coarse to fine. *Paper* (§5.2): 7x7 at 4 texels, then 3x3 at 2 texels. *Ours*: then 3x3 at 1 texel, which finds
    /// thin reflectors.
    pub search: Vec<SearchLevel>,
    /// Of the pixels, one in so many each way is searched for in full; those between begin where these ended, with the finest
    /// level alone, unless that is much worse. *Paper*: 1, each. *Ours*: 4, a quarter of the time for the same error.
    #[serde(default = "every_pixel")]
    pub anchors: usize,
    /// s_a, the factor on the energy where the reflected materials differ. *Paper*: 10.
    pub material_penalty: f32,
    /// s_e, the factor on how much the reflectors' roughness differs, |α - α'| / (α + α'), which is added to the energy (Eq. 1). *Paper*: 0;
    /// its §8 names the term. *Ours*: 1.
    #[serde(default)]
    pub roughness_penalty: f32,
    /// φ, the falloff of a sample's weight with its energy (Eq. 2). *Paper*: 8. *Ours*: 128.
    pub falloff: f32,
    /// The power of t_i that counts as a probe's weight: below 1, the nearest probe outweighs the others less, and all still come
    /// and go without a jump. *Paper*: 1. *Ours*: 0.5.
    #[serde(default = "as_it_is")]
    pub trilinear_power: f32,
    /// How many of the eight nearest probes are asked, those of largest weight first. *Paper*: 8.
    pub probes: usize,
    /// How the reflection point is predicted (§5.1).
    pub perturb: PerturbParams,
    /// Which texels bilinear interpolation may blend.
    pub bilinear: BilinearRule,
    /// Divide the lobe's directional albedo out of a probe's sample and multiply the view's in. *Paper*: no. *Ours*: yes.
    pub albedo_ratio: bool,
}

/// What sets of probes say that were baked before there were anchors.
fn every_pixel() -> usize {
    1
}

/// The same of the weights' power.
fn as_it_is() -> f32 {
    1.0
}

impl Default for GatherParams {
    fn default() -> Self {
        let paper = Self::paper();
        let finest = SearchLevel { radius: 1, step: 1.0 };
        Self {
            search: [paper.search, vec![finest]].concat(),
            anchors: 4,
            falloff: 128.0,
            trilinear_power: 0.5,
            bilinear: BilinearRule::SameReflectorAndReflected,
            albedo_ratio: true,
            roughness_penalty: 1.0,
            perturb: PerturbParams::default(),
            ..paper
        }
    }
}

impl GatherParams {
    /// The paper's text.
    pub fn paper() -> Self {
        Self {
            search: vec![SearchLevel { radius: 3, step: 4.0 }, SearchLevel { radius: 1, step: 2.0 }],
            anchors: 1,
            material_penalty: 10.0,
            roughness_penalty: 0.0,
            falloff: 8.0,
            trilinear_power: 1.0,
            probes: 8,
            perturb: PerturbParams::paper(),
            bilinear: BilinearRule::SameReflector,
            albedo_ratio: false,
        }
    }

    /// An error where a parameter is out of its range.
    pub fn validate(&self) -> Result<()> {
        within("gather.search: levels", self.search.len(), 1..=MAX_LEVELS)?;
        for (i, level) in self.search.iter().enumerate() {
            within(&format!("gather.search.{i}.radius"), level.radius, 0..=MAX_RADIUS)?;
            within(&format!("gather.search.{i}.step"), level.step, 0.0..=1024.0)?;
        }
        within("gather.anchors", self.anchors, 1..=TILE)?;
        within("gather.material_penalty", self.material_penalty, 0.0..=1e9)?;
        within("gather.roughness_penalty", self.roughness_penalty, 0.0..=1e9)?;
        within("gather.falloff", self.falloff, 0.0..=1e9)?;
        within("gather.trilinear_power", self.trilinear_power, 0.0..=16.0)?;
        within("gather.probes", self.probes, 1..=8)?;
        self.perturb.validate()
    }

    /// A probe's weight at equal energy, for its trilinear weight t_i.
    pub fn probe_weight(&self, t: f32) -> f32 {
        t.powf(self.trilinear_power).max(MIN_WEIGHT)
    }
}

/// Least weight: a probe at the far side of the cell still serves a pixel that no other serves.
const MIN_WEIGHT: f32 = 1e-6;
