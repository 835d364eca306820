//! TODO
/// See the module.
pub mod bake;
/// See the module.
pub mod file;
/// See the module.
pub mod placement;
/// See the module.
pub mod qhmap;
/// See the module.
pub mod resmap;
