//! What every method that renders views shares: G-buffer, mirror rays and their light, layers, auxiliary layers.

pub mod aov;
pub mod composite;
pub mod gbuffer;
pub mod layers;
pub mod mirror;
pub mod mirror_light;
