//! The GPU, by wgpu: adapters, and compute kernels that are twins of CPU functions.
//!
//! A kernel's WGSL lies in `shaders/`, and what it is (its file, its twin, its bindings, the structs and the workgroup that it shares with
//! Rust) in a record beside what binds its buffers (`spec.rs`). `contract/` holds the two against each other, without a GPU. Results are the
//! CPU's but for rounding. Kernels run in dispatches of a second at the most, so that no driver takes the device for hung.

mod camera;
mod commands;
#[cfg(test)]
mod contract;
mod denoise;
mod device;
mod follow;
mod kernel;
mod light;
mod pace;
mod path_trace;
mod probe;
mod rays;
mod render;
pub(crate) mod scene;
mod source;
mod spec;

pub use denoise::{Denoiser, GpuGuides};
pub use device::{Adapter, Checks, Choice, Gpu, adapters};
pub(crate) use follow::{PathStart, SampleSum};
pub use light::{LightPaths, LightStart};
pub use path_trace::PathTracer;
pub use probe::ProbePaths;
pub use rays::RayTracer;
pub use render::{BaselineFrame, Filter, ImageSpaceGather, LightmapRt, Renderer, Ulr};
pub use scene::GpuScene;
