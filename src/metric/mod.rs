//! TODO
/// See the module.
pub mod flip;
/// See the module.
pub mod report;
/// See the module.
pub mod rmse;
/// See the module.
pub mod ssim;
