//! Glossy probe reprojection (Rodriguez et al. 2020): what is baked into probes, and how frames are made of them.
//!
//! The bake, in the order in which data flows: [`seen`] casts the buffers from which [`resmap`], with [`dct`], decides how much resolution
//! each direction deserves (§4.2.1); [`quasi_harmonic`] turns that into a deformed lat-long mesh, and [`qhmap`] into the probe's
//! parameterisation (§4.2.2); [`bake`] fills the texels (§4.1), all of them or those that [`wanted`] names.
//!
//! A frame, pass by pass: [`renderer`] is the table of contents (§5, §6), and [`tiles`] has the passes before the filter. [`rays`] may be joined
//! with it.

pub mod bake;
mod between;
mod blend;
pub mod candidates;
mod cholesky;
pub mod coverage;
pub mod dct;
mod denoise;
pub mod filter;
pub mod footprint;
pub mod gather;
pub mod gather_params;
pub mod gpu;
pub mod inspect;
pub mod lattice;
pub mod perturb;
mod perturb_lanes;
pub mod previous;
pub mod qhmap;
pub mod quasi_harmonic;
pub mod rays;
pub mod renderer;
pub mod resmap;
mod row;
pub mod samples;
pub mod search;
pub mod seen;
pub mod shown;
pub mod tiles;
pub mod wanted;
pub mod whole;
mod window;

pub use row::{METHOD, resolve};

use crate::Result;
use crate::base::named::{Parameters, within};
use crate::view::MOST_SUPERSAMPLES;
use crate::view::denoiser::Denoiser;
use coverage::CoverageParams;
use filter::FilterParams;
use footprint::FootprintParams;
use gather::GatherParams;
use rays::RaysParams;
use serde::{Deserialize, Serialize};

/// All parameters of the method at run time.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GlossyProbeParams {
    /// N x N rays a pixel through all passes, averaged at the end.
    pub supersample: u32,
    /// §5.2.
    pub gather: GatherParams,
    /// Perfect mirrors take the light that the light map knows along the mirror ray, and the rest from probes. *Paper*: no.
    /// *Ours*: yes.
    pub mirror_light: bool,
    /// §6.1; `None` leaves the gathered colours unfiltered.
    pub footprint: Option<FootprintParams>,
    /// §6.2, §6.3.
    pub filter: FilterParams,
    /// Rays along edges.
    pub coverage: CoverageParams,
    /// Rays along lobes, joined with the probes.
    #[serde(default)]
    pub rays: RaysParams,
    /// Takes the noise out of those; `None` for nothing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub denoise: Option<Denoiser>,
}

impl Default for GlossyProbeParams {
    fn default() -> Self {
        Self {
            supersample: 1,
            gather: GatherParams::default(),
            mirror_light: true,
            footprint: Some(FootprintParams::default()),
            filter: FilterParams::default(),
            coverage: CoverageParams::default(),
            rays: RaysParams::default(),
            denoise: None,
        }
    }
}

impl GlossyProbeParams {
    /// The paper's text in every choice.
    pub fn paper() -> Self {
        Self {
            supersample: 1,
            gather: GatherParams::paper(),
            mirror_light: false,
            footprint: Some(FootprintParams::paper()),
            filter: FilterParams::paper(),
            coverage: CoverageParams { rays: 0 },
            rays: RaysParams::default(),
            denoise: None,
        }
    }
}

impl Parameters for GlossyProbeParams {
    fn validate(&self) -> Result<()> {
        within("supersample", self.supersample, 1..=MOST_SUPERSAMPLES)?;
        self.gather.validate()?;
        self.footprint.as_ref().map_or(Ok(()), FootprintParams::validate)?;
        self.filter.validate()?;
        self.coverage.validate()?;
        self.rays.validate()?;
        self.denoise.map_or(Ok(()), |denoise| denoise.validate())
    }
}
