//! The methods that the paper compares itself with (§7.3), one file each, as strong as their sources let them be.
//!
//! All take the G-buffer of a view and return its glossy layer, at the view's size; emission and diffuse layers are those of
//! [`crate::view::composite`]. Path tracing has a file of its own ([`crate::method::path_trace`]); here is its denoiser.

pub mod denoise;
pub mod image_space_gather;
pub mod lightmap_rt;
pub mod ulr;

use super::gbuffer::Pixel;
use crate::material::bsdf::{Lobes, Query};

/// The lobes that make the glossy layer, at the material's own roughness.
pub(crate) const GLOSSY: Query = Query { lobes: Lobes::NON_DIFFUSE, roughness_scale: 1.0 };

/// Pixels that have a glossy layer at all.
fn glossy(pixel: &Option<Pixel>) -> Option<&Pixel> {
    pixel.as_ref().filter(|p| p.alpha.is_some())
}
