//! Light that arrives at a point from a node, and what a receiver makes of it.

use crate::base::math::Rgb;
use glam::Vec3;

/// Light that arrives from a node, or from a part of it.
pub struct Arrival {
    /// Unit direction towards it.
    pub direction: Vec3,
    /// Solid angle, its cosine included.
    pub solid_angle: f32,
    /// Radiance.
    pub radiance: Rgb,
}

/// What a receiver makes of light: adds up.
pub trait Received: Default + Copy {
    /// With `scale` times the other.
    fn add(&mut self, other: &Self, scale: f32);
    /// How much it is, for choosing among nodes.
    fn weight(&self) -> f32;
}
