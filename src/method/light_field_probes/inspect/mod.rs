//! What light field probes look like, and what becomes of one ray among them: pictures for people who look for a fault.

mod drawing;
pub mod hits;
pub mod maps;
pub mod way;

pub use drawing::{COLOURS, draw};
