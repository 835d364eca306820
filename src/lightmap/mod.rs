//! The diffuse light map, L(S|D)*DE: E_T(x) = ∫ T_in(ω) L(ω) cos θ dω over an atlas of charts.
//!
//! *Paper* (§3, §5): "a standard light map" is taken as given, so everything here is *Ours*:
//! - [`adjacency`]: which triangles of an object meet, and whether the surface is smooth there.
//! - [`chart`]: patches that one plane shows without folds.
//! - [`pack`] and [`atlas`]: their places in one image, with gutters.
//! - [`texels`]: what part of each texel the surface covers, and sample points on it.
//! - [`solid`] and [`visible`]: samples inside or behind other geometry.
//! - [`bake`]: the integral, in blocks that can be kept ([`parts`]) and taken up again; [`adaptive`]: how many samples a texel takes.
//! - [`links`] and [`denoise`]: which texels lie beside one another on a surface, and the filter that takes the noise out of them; [`sites`]: those
//!   of a bake.
//! - `finish`, [`fill`] and [`seam`]: gutters, texels without a value, and chart borders on smooth surfaces.
//! - [`receivers`]: points of texels where others than the bake gather light.
//! - [`lookup`]: the file, and a bilinear lookup for a triangle and its barycentrics.
//!
//! The diffuse layer of a pixel is `diffuse_out(view) · E_T / π` with the albedo texture at full resolution.

pub mod adaptive;
pub mod adjacency;
pub mod atlas;
pub mod bake;
#[cfg(test)]
mod bake_tests;
pub mod chart;
mod choice;
pub mod denoise;
pub mod fill;
mod finish;
mod gather;
pub mod links;
pub mod lookup;
pub mod pack;
pub mod parts;
pub mod receivers;
pub mod seam;
pub mod sites;
pub mod solid;
#[cfg(test)]
pub(crate) mod testing;
pub mod texels;
pub mod visible;

pub use atlas::{Atlas, AtlasParams};
pub use bake::{Baked, First, LightMapParams, Plan};
pub use denoise::DenoiseParams;
pub use lookup::LightMap;
