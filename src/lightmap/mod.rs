//! TODO
/// See the module.
pub mod atlas;
/// See the module.
pub mod bake;
/// See the module.
pub mod lookup;
