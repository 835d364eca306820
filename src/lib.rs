//! reprobe bakes glossy global illumination into light probes and reprojects it into new views.
//!
//! The method is Rodriguez et al. 2020, "Glossy Probe Reprojection for Interactive Global Illumination".
//! Data flows through the modules in this order:
//!
//! - [`scene`]: a Mitsuba file becomes triangles, materials, textures, emitters and cameras.
//! - [`transport`]: BVH, BSDFs, emitter sampling and the path tracer that every bake uses.
//! - [`surface`]: principal curvatures and the paraboloids fitted from them (§4.3).
//! - [`probe`]: placement, resolution map, quasi-harmonic map, bake, and the probe file (§4).
//! - [`lightmap`]: the diffuse half, L(S|D)*DE.
//! - [`render`]: G-buffer, mirror rays, perturbation, gather, footprint, filter, composite (§5, §6).
//! - [`gpu`]: adapters, and kernels that are twins of CPU functions.
//! - [`metric`]: RMSE, SSIM, FLIP and the report.
//! - [`io`]: EXR layers, atomic writes, provenance.

pub mod base;
pub mod exchange;
pub mod export;
pub mod gpu;
pub mod io;
pub mod lightmap;
pub mod material;
pub mod method;
pub mod metric;
pub mod plan;
pub mod probe;
pub mod scene;
pub mod surface;
pub mod transport;
pub mod view;

pub use base::error::{Error, Result};
