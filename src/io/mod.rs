//! Files: EXR layers, JSON, pictures, diagrams and videos, atomic writes, provenance, checksums.

pub mod atomic;
pub mod canvas;
pub mod exr;
mod flat;
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

pub use exr::ExrImage;
pub use flat::Samples;
pub use provenance::Provenance;
pub use seal::{HEAD, is_sealed};
pub use text::{read, read_named, read_text, text};

/// Whether so many bytes of a file may hold so many of pixels: what claims to is asked before room is made for it. Of what images are packed
/// with, deflate shrinks most, to a 1032nd.
pub fn could_hold(file: usize, pixels: u64) -> bool {
    pixels <= 2000 * file as u64
}
