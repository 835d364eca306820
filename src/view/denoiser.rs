//! The choice of a denoiser (`--denoise`): our own filter, which is always there, or a network, which not every machine has.
//!
//! The choice is made before anything is rendered and stands in the frames' provenance, so that frames of one are never taken for those of
//! the other.

use crate::base::math::Rgb;
use crate::base::named::{Parameters, apply, words};
use crate::scene::Camera;
use crate::transport::World;
use crate::view::denoise::{DenoiseParams, GUIDE_SAMPLES, Guide, filter_layer, guides};
use crate::view::layers::LayerImages;
use crate::view::oidn::{self, Oidn, OidnParams, Quality};
use crate::{Error, Result};
use serde::{Deserialize, Serialize};
use serde_json::Value;

/// What a denoiser is called on a command line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Our own ([`crate::view::denoise`]).
    Filter,
    /// Open Image Denoise ([`crate::view::oidn`]).
    Oidn,
}

words!(Kind { Oidn "oidn", Filter "filter" });

/// A denoiser with its parameters.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase", deny_unknown_fields)]
pub enum Denoiser {
    /// Our own.
    Filter(DenoiseParams),
    /// Open Image Denoise.
    Oidn {
        /// The library's version: another one gives other pictures.
        version: [u32; 3],
        /// How it is used.
        params: OidnParams,
    },
}

impl Denoiser {
    /// The one that is asked for, with the parameters that `sets` (NAME=VALUE) names; where none is, Open Image Denoise if the machine has it and
    /// else the filter, whose parameters `sets` has then.
    pub fn choose(wanted: Option<Kind>, sets: &[String]) -> Result<Self> {
        let filter = || Ok(Self::Filter(apply(&DenoiseParams::default(), sets)?));
        let oidn = |library: &Oidn| Ok(Self::Oidn { version: library.version, params: apply(&OidnParams::default(), sets)? });
        match wanted {
            Some(Kind::Filter) => filter(),
            Some(Kind::Oidn) => {
                let why_not = |why| Error::Request(format!("--denoise oidn: {why}; --denoise filter needs nothing"));
                oidn(Oidn::found().map_err(why_not)?)
            }
            None if !sets.is_empty() => filter(),
            None => Oidn::found().map_or_else(|_| filter(), oidn),
        }
    }

    /// The same at another quality; the filter has but one.
    pub fn at(self, quality: Quality) -> Self {
        match self {
            Self::Filter(_) => self,
            Self::Oidn { version, params } => Self::Oidn { version, params: OidnParams { quality, ..params } },
        }
    }

    /// That of a method's parameters; `None` where its frames are left as they are.
    pub fn among(parameters: &Value) -> Option<Self> {
        serde_json::from_value(parameters.get("denoise")?.clone()).ok()
    }

    /// Greatest alpha of surfaces that are guided by what they show as mirrors.
    pub fn mirror_alpha(&self) -> f32 {
        match self {
            Self::Filter(params) => params.mirror_alpha,
            Self::Oidn { params, .. } => params.mirror_alpha,
        }
    }

    /// Camera rays for a pixel's guides, in a frame of `spp` samples.
    pub fn guide_samples(&self, spp: u32) -> u32 {
        match self {
            Self::Filter(_) => spp.clamp(1, GUIDE_SAMPLES),
            Self::Oidn { params, .. } => params.guide_samples,
        }
    }

    /// Guides of the diffuse and of the glossy layer of a frame of `spp` samples, by its seed and number, on the CPU.
    pub fn guides(&self, world: &World, camera: &Camera, spp: u32, [seed, frame]: [u32; 2]) -> [Vec<Guide>; 2] {
        guides(world, camera, self.mirror_alpha(), self.guide_samples(spp), seed, frame)
    }

    /// Layers of the same guides without their noise, on the CPU.
    pub fn denoise_layers<const N: usize>(&self, layers: [&[Rgb]; N], guides: &[Guide], width: usize) -> Result<[Vec<Rgb>; N]> {
        match self {
            Self::Filter(params) => Ok(layers.map(|layer| filter_layer(layer, guides, width, params))),
            Self::Oidn { params, .. } => oidn::denoise_layers(layers, guides, width, params.quality),
        }
    }

    /// The diffuse and the glossy layer without their noise, on the CPU; emission has none.
    pub fn denoise(&self, layers: &LayerImages, guides: &[Vec<Guide>; 2], width: usize) -> Result<LayerImages> {
        let [diffuse] = self.denoise_layers([&layers.diffuse], &guides[0], width)?;
        let [glossy] = self.denoise_layers([&layers.glossy], &guides[1], width)?;
        Ok(LayerImages { emission: layers.emission.clone(), diffuse, glossy })
    }
}

impl Parameters for Denoiser {
    fn validate(&self) -> Result<()> {
        match self {
            Self::Filter(params) => params.validate(),
            Self::Oidn { params, .. } => params.validate(),
        }
    }
}

impl std::fmt::Display for Denoiser {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        match self {
            Self::Filter(_) => write!(f, "{}", Kind::Filter),
            Self::Oidn { version: [major, minor, patch], .. } => write!(f, "{} {major}.{minor}.{patch}", Kind::Oidn),
        }
    }
}
