//! The GPU, by wgpu: adapters, and compute kernels that are twins of CPU functions.
//!
//! A kernel's WGSL lies in `shaders/`, and what it is (its file, its twin, its bindings, the structs and the workgroup that it shares with
//! Rust) in a record beside what binds its buffers (`spec.rs`). `contract/` holds the two against each other, without a GPU. Results are the
//! CPU's but for rounding. Kernels run in dispatches of a second at the most, so that no driver takes the device for hung.

pub mod camera;
pub(crate) mod commands;
mod device;
pub(crate) mod follow;
pub(crate) mod kernel;
pub(crate) mod pace;
mod paths;
pub(crate) mod rays;
pub(crate) mod resident;
pub(crate) mod scene;
pub(crate) mod source;
pub(crate) mod spec;
pub mod view;

pub use device::{Adapter, Checks, Choice, Gpu, adapters};
pub(crate) use follow::SampleSum;
pub use paths::Paths;
pub use rays::RayTracer;
pub use scene::GpuScene;
