//! The GPU, by wgpu: adapters, and compute kernels that are twins of CPU functions.
//!
//! A kernel's WGSL lies in `shaders/` under its twin's name and shares its structs with a `#[repr(C)]` type here. Results are the CPU's
//! but for rounding. Kernels run in dispatches of a second at the most, so that no driver takes the device for hung.

mod camera;
mod commands;
mod denoise;
mod device;
mod follow;
mod kernel;
#[cfg(test)]
mod layout;
mod light;
mod pace;
mod path_trace;
mod probe;
mod rays;
mod render;
mod scene;

pub use denoise::{Denoiser, GpuGuides};
pub use device::{Adapter, Choice, Gpu, adapters};
pub(crate) use follow::{PathStart, SampleSum};
pub use light::{LightPaths, LightStart};
pub use path_trace::PathTracer;
pub use probe::ProbePaths;
pub use rays::RayTracer;
pub use render::{BaselineFrame, Filter, ImageSpaceGather, LightmapRt, Renderer, Ulr};
pub use scene::GpuScene;
