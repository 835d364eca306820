//! Files: EXR layers, atomic writes, provenance.

pub mod atomic;
pub mod exr;
pub mod jobs;
pub mod picture;
pub mod primaries;
pub mod provenance;
mod subsampled;
mod text;

pub use exr::{ExrImage, Samples};
pub use provenance::Provenance;
pub use text::read_text;
