//! Files: EXR layers, atomic writes, provenance.

pub mod atomic;
pub mod exr;
pub mod picture;
pub mod provenance;

pub use exr::{ExrImage, Samples};
pub use provenance::Provenance;
