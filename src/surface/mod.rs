//! TODO
/// See the module.
pub mod curvature;
/// See the module.
pub mod paraboloid;
/// See the module.
pub mod tessellate;
