//! TODO
pub mod aov;
/// See the module.
pub mod composite;
/// See the module.
pub mod filter;
/// See the module.
pub mod footprint;
/// See the module.
pub mod gather;
/// See the module.
pub mod gbuffer;
/// See the module.
pub mod mirror;
pub mod path_trace;
/// See the module.
pub mod perturb;
