//! What is baked, and how frames are made of it.

use super::compress::CompressParams;
use super::harmonics::{MAX_ORDER, terms};
use super::interpolate::Interpolation;
use super::transport::{Gather, Kept};
use crate::Result;
use crate::base::named::{Parameters, within};
use crate::lightmap::AtlasParams;
use crate::view::MOST_SUPERSAMPLES;
use serde::{Deserialize, Serialize};

/// What is baked.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TransportParams {
    /// Order of the probes' harmonics. *Paper*: 7; 4 for `sh1`.
    pub sh_order: u32,
    /// What a receiver keeps of its light.
    pub receiver: Kept,
    /// How the probes' radiance comes to it.
    pub interpolation: Interpolation,
    /// Where receivers lie.
    pub atlas: AtlasParams,
    /// Rays over a receiver's hemisphere.
    pub rays: u32,
    /// Rays by which a frame's light comes to a probe. *Paper*: 8000.
    pub relight_rays: u32,
    /// Radius of a probe's support, metres; by default what lets ten of them cover a receiver on average.
    pub radius: Option<f32>,
    /// Between receivers in free space, metres; without any by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub volume: Option<f32>,
    /// How the operator is compressed.
    pub compress: CompressParams,
}

impl Default for TransportParams {
    fn default() -> Self {
        let atlas = AtlasParams { texel: None, budget: 300_000 };
        Self {
            sh_order: 7,
            receiver: Kept::Irradiance,
            interpolation: Interpolation::Visible,
            atlas,
            rays: 512,
            relight_rays: 8000,
            radius: None,
            volume: None,
            compress: CompressParams::default(),
        }
    }
}

impl TransportParams {
    /// What receivers gather with.
    pub fn gather(&self) -> Gather {
        Gather::new(self.rays, self.sh_order, self.receiver, self.interpolation)
    }

    /// Harmonics of a probe.
    pub fn terms(&self) -> usize {
        terms(self.sh_order)
    }
}

impl Parameters for TransportParams {
    fn validate(&self) -> Result<()> {
        within("--sh-order", self.sh_order, 0..=MAX_ORDER)?;
        within("--rays", self.rays, 1..=1 << 16)?;
        within("--relight-rays", self.relight_rays, 1..=1 << 20)?;
        within("--texels", self.atlas.budget, 1..=1 << 26)?;
        if let Some(radius) = self.radius {
            within("--radius", radius, f32::MIN_POSITIVE..=1e6)?;
        }
        if let Some(spacing) = self.volume {
            within("--volume", spacing, 1e-4..=1e6)?;
        }
        within("--error", self.compress.error, 0.0..=1.0)?;
        within("--most-terms", self.compress.most_terms, 1..=1024)?;
        within("most_receivers", self.compress.most_receivers, 2..=1 << 16)
    }
}

/// How frames are made of radiance probes.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RadianceProbeParams {
    /// N x N rays a pixel through the G-buffer.
    pub supersample: u32,
    /// Samples of direct light, a pixel of the G-buffer; 0 leaves it out.
    pub direct_samples: u32,
    /// Paths along the glossy lobes, a pixel of the G-buffer, lit by the receivers' light where they meet diffuse surfaces; with 0 the glossy
    /// layer is what receivers that keep sh1 say, and black with others. *Ours*: the paper's frames have no other reflections.
    pub gloss_samples: u32,
    /// Samples of direct light, a receiver.
    pub map_samples: u32,
    /// How often light goes from the receivers to the probes and back; among walls of albedo .7, four times would leave a sixth of it out.
    pub bounces: u32,
    /// Whether it goes on from the light of the frame before. *Paper* (§4.2): yes, and once a frame. *Ours*: frames are lit by themselves, so that
    /// light that is switched on is there at once, and any frame can be made alone.
    pub feedback: bool,
}

impl Default for RadianceProbeParams {
    fn default() -> Self {
        Self { supersample: 1, direct_samples: 8, gloss_samples: 0, map_samples: 4, bounces: 12, feedback: false }
    }
}

impl Parameters for RadianceProbeParams {
    fn validate(&self) -> Result<()> {
        within("supersample", self.supersample, 1..=MOST_SUPERSAMPLES)?;
        within("direct_samples", self.direct_samples, 0..=1 << 16)?;
        within("gloss_samples", self.gloss_samples, 0..=1 << 16)?;
        within("map_samples", self.map_samples, 1..=1 << 16)?;
        within("bounces", self.bounces, 0..=64)
    }
}
