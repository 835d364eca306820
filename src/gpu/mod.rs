//! The GPU, by wgpu: adapters, and compute kernels that are twins of CPU functions.
//!
//! A kernel's WGSL lies in `shaders/` under its twin's name and shares its structs with a `#[repr(C)]` type here. Results are the CPU's
//! but for rounding. Kernels run in dispatches of a second at the most, so that no driver takes the device for hung.

pub mod camera;
pub(crate) mod commands;
mod device;
pub(crate) mod follow;
pub(crate) mod kernel;
#[cfg(test)]
pub(crate) mod layout;
pub(crate) mod pace;
mod paths;
mod rays;
pub(crate) mod resident;
pub(crate) mod scene;
pub mod view;

pub use device::{Adapter, Choice, Gpu, adapters};
pub(crate) use follow::SampleSum;
pub use paths::Paths;
pub use rays::RayTracer;
pub use scene::GpuScene;
