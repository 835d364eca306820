//! Light field probes: octahedral maps of radiance, distance and normals, through which rays are followed (McGuire, Mara, Nowrouzezahrai and
//! Luebke 2017, *Real-Time Global Illumination Using Precomputed Light Field Probes*; Wang et al. 2019, *Fast Non-uniform Radiance Probe
//! Placement and Tracing*).
//!
//! A frame has its direct light from rays in the scene, and its indirect light from the probes alone: the glossy layer by rays along the
//! lobes that are followed from probe to probe ([`trace`]; of probes in no grid [`octree`] says which), the diffuse layer by the irradiance of the probes around, weighted by what they
//! see ([`ambient`]).

pub mod ambient;
pub mod bake;
pub mod field;
pub mod gpu;
pub mod hits;
pub mod inspect;
pub mod lobe;
pub mod march;
pub mod octree;
pub mod probe;
pub mod pyramid;
pub mod relight;
mod row;
pub mod shade;
pub mod store;
#[cfg(test)]
mod tests;
pub mod trace;

pub use row::METHOD;

use crate::Result;
use crate::base::named::{Parameters, within};
use crate::view::MOST_SUPERSAMPLES;
use march::Search;
use serde::{Deserialize, Serialize};

/// How frames are made of light field probes.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LightFieldParams {
    /// N x N rays a pixel through the G-buffer.
    pub supersample: u32,
    /// Rays along the glossy lobe, a pixel of the G-buffer. *Paper* (Rodriguez 2020, Table 1): 8.
    pub samples: u32,
    /// Samples of direct light, a pixel of the G-buffer; 0 leaves it out.
    pub direct_samples: u32,
    /// How a probe's map is searched.
    pub search: Search,
    /// How far behind a surface, in texels, a ray still counts as at it.
    pub thickness: f32,
    /// Share of a ray's footprint over which radiance is averaged; 0 takes single texels.
    pub footprint: f32,
}

impl Default for LightFieldParams {
    fn default() -> Self {
        Self { supersample: 1, samples: 8, direct_samples: 8, search: Search::HiZ, thickness: 1.0, footprint: 1.0 }
    }
}

impl Parameters for LightFieldParams {
    fn validate(&self) -> Result<()> {
        within("supersample", self.supersample, 1..=MOST_SUPERSAMPLES)?;
        within("samples", self.samples, 1..=1 << 16)?;
        within("direct_samples", self.direct_samples, 0..=1 << 16)?;
        within("thickness", self.thickness, 0.0..=1000.0)?;
        within("footprint", self.footprint, 0.0..=16.0)
    }
}
