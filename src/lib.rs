//! reprobe bakes glossy global illumination into light probes and reprojects it into new views.
//!
//! The method is Rodriguez et al. 2020, "Glossy Probe Reprojection for Interactive Global Illumination".
//! Data flows through the modules in this order:
//!
//! - [`exchange`]: a scene file (Mitsuba's XML or JSON, glTF) becomes a [`scene`]: triangles, [`material`]s, emitters and cameras.
//! - [`transport`]: BVH, emitter sampling and the path tracer that every bake uses.
//! - [`surface`]: principal curvatures and the paraboloids fitted from them (§4.3).
//! - [`lightmap`]: the diffuse half, L(S|D)*DE.
//! - [`probe`] and [`view`]: what all methods share of probes and of frames.
//! - [`method`]: the table of methods, each with its bakes and passes; the paper's is `glossy_probes` (§4 to §6).
//! - [`gpu`]: adapters, and kernels that are twins of CPU functions.
//! - [`metric`]: RMSE, SSIM, FLIP and the report.
//! - [`plan`]: stages that read and write files, pipelines of them; [`export`]: what other programs read.
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
