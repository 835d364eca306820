//! Files: EXR layers, JSON, pictures, diagrams and videos, atomic writes, provenance, checksums.

pub mod atomic;
pub mod canvas;
pub mod exr;
pub mod jobs;
pub mod json;
pub mod layer;
pub mod picture;
pub mod png;
pub mod primaries;
pub mod provenance;
mod seal;
pub mod sheet;
mod subsampled;
mod text;
pub mod video;

pub use exr::{ExrImage, Samples};
pub use provenance::Provenance;
pub use seal::{HEAD, is_sealed};
pub use text::read_text;
