//! Intel's Open Image Denoise: a network in the place of our own filter, from a library that is found at run time.
//!
//! *Paper* (§7.3.1): its path tracer is denoised by OptiX's network, of which this is the like for a CPU. The library's output does not depend on
//! the number of threads, but on its version, and in the last bits on the instructions that the processor has.
//! *Ours*: the network runs on each layer, with the guides of [`crate::view::denoise::guides`], so that it sees through mirrors, and their
//! noise is taken out first. Dividing the layers by their albedo, as the filter does, was farther from the reference (docs/results.md).
//!
//! In: a layer and its guides, linear. Out: the layer.

mod library;
mod places;

pub use library::Oidn;

use crate::Result;
use crate::base::math::Rgb;
use crate::base::named::{Parameters, within};
use crate::view::denoise::{GUIDE_SAMPLES, Guide};
use glam::Vec3;
use serde::{Deserialize, Serialize};

/// Which of its networks the library takes: a frame of 480 x 270 is a matter of 100, 180 and 410 ms on two cores.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Quality {
    /// The smallest.
    Fast,
    /// In between.
    Balanced,
    /// The largest, and nearest where there are few samples.
    #[default]
    High,
}

/// How layers are given to the network.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OidnParams {
    /// Camera rays that a pixel's guides are the mean of.
    pub guide_samples: u32,
    /// Greatest alpha at which the glossy layer is guided by what the mirror shows.
    pub mirror_alpha: f32,
    /// Network for the layers.
    #[serde(default)]
    pub quality: Quality,
}

impl Default for OidnParams {
    fn default() -> Self {
        Self { guide_samples: GUIDE_SAMPLES, mirror_alpha: 0.02, quality: Quality::High }
    }
}

impl Parameters for OidnParams {
    fn validate(&self) -> Result<()> {
        within("guide_samples", self.guide_samples, 1..=GUIDE_SAMPLES)?;
        within("mirror_alpha", self.mirror_alpha, 0.0..=1.0)
    }
}

/// Layers of images `width` pixels wide with the same guides, without their noise.
///
/// # Errors
/// The library is not there, or fails.
pub fn denoise_layers<const N: usize>(
    layers: [&[Rgb]; N],
    guides: &[Guide],
    width: usize,
    quality: Quality,
) -> Result<[Vec<Rgb>; N]> {
    let oidn = Oidn::found()?;
    let albedo: Vec<Vec3> = guides.iter().map(|g| g.albedo.clamp(Rgb::ZERO, Rgb::ONE)).collect();
    let normal: Vec<Vec3> = guides.iter().map(|g| g.normal).collect();
    // The few rays of the guides leave noise in them, which goes first. The largest network does it no better.
    let albedo = oidn.filtered(&[(c"albedo", &albedo)], &[], Quality::Fast, width)?;
    let normal = oidn.filtered(&[(c"normal", &normal)], &[], Quality::Fast, width)?;
    // Where no ray of the guides met a surface that has the layer, there is none to denoise.
    let pixel = |((&noisy, clean), g): ((&Rgb, Rgb), &Guide)| if g.factor == Rgb::ZERO { noisy } else { clean };
    let mut all = [const { Vec::new() }; N];
    for (denoised, layer) in all.iter_mut().zip(layers) {
        let images: [(_, &[Vec3]); 3] = [(c"color", layer), (c"albedo", &albedo), (c"normal", &normal)];
        let clean = oidn.filtered(&images, &[c"hdr", c"cleanAux"], quality, width)?;
        *denoised = layer.iter().zip(clean).zip(guides).map(pixel).collect();
    }
    Ok(all)
}
