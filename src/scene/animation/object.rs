//! Shapes that a file adds to a scene.

use super::track::Track;
use crate::scene::Geometry;
use crate::scene::mesh::{Mesh, append};
use glam::{DMat4, DVec3};
use std::sync::Arc;

/// A shape that moves as a whole. Positions are in the file's units, rotations in degrees.
#[derive(Debug, Clone)]
pub struct MovingObject {
    /// In its own space.
    pub mesh: Arc<Mesh>,
    /// Factors on its size along its own axes.
    pub scale: DVec3,
    /// Where its origin is.
    pub position: Track,
    /// About x, then y, then z, before it is moved.
    pub rotation: Track,
    /// Diffuse reflectance.
    pub albedo: Track,
}

impl MovingObject {
    /// Adds it to a scene's triangles as it is at a time, in metres.
    pub fn add(&self, time: f64, unit_scale: f32, geometry: &mut Geometry, (name, material): (String, u32)) {
        let [x, y, z] = self.rotation.at(time).to_array().map(f64::to_radians);
        let turned = DMat4::from_rotation_z(z) * DMat4::from_rotation_y(y) * DMat4::from_rotation_x(x);
        let placed = DMat4::from_translation(self.position.at(time)) * turned * DMat4::from_scale(self.scale);
        let to_world = DMat4::from_scale(DVec3::splat(unit_scale.into())) * placed;
        append(geometry, (*self.mesh).clone(), to_world.as_mat4(), false, false, name, material, None);
    }
}
