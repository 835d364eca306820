//! What runs from what: the stages as typed values that read files and write files, pipelines of them, and evaluations of many methods.
//!
//! A [`Stage`] is what a subcommand is, and can be run from Rust as well: it checks its options before it reads anything, calls the pure
//! functions of the rooms below, and writes outputs whole or not at all. [`pipeline`] strings stages together; [`variant`] and [`evaluation`]
//! do so for many methods at once.

pub mod budget;
pub mod carried;
pub mod context;
pub mod evaluation;
pub mod frames;
mod lights;
pub mod option;
pub mod overwrite;
pub mod pipeline;
pub mod settings;
pub mod stage;
pub mod stages;
pub mod timings;
pub mod variant;
pub mod views;

pub use context::{Context, Listener, Outcome};
pub use stage::Stage;
