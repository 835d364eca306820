//! The differential geometry of a hit.

use super::{Hit, Ray};
use crate::math::Frame;
use crate::scene::Scene;
use glam::{Vec2, Vec3};

/// A point on a surface with all that a BSDF asks for.
#[derive(Debug, Clone, Copy)]
pub struct Surface {
    /// World position (from the barycentrics, not from the ray).
    pub p: Vec3,
    /// Unit geometric normal, as the winding says; it need not face the viewer.
    pub ng: Vec3,
    /// Shading frame: `n` interpolated (or `ng` for face normals), `s` along `dp_du`.
    pub frame: Frame,
    /// Texture coordinate; the barycentrics where the object has none.
    pub uv: Vec2,
    /// Change of position with u.
    pub dp_du: Vec3,
    /// Change of position with v.
    pub dp_dv: Vec3,
    /// Distance along the ray.
    pub t: f32,
    /// Triangle index.
    pub triangle: u32,
    /// Barycentric weights of the second and third vertex.
    pub barycentric: Vec2,
    /// Object index.
    pub object: u32,
    /// Material index.
    pub material: u32,
    /// Emitter index.
    pub emitter: Option<u32>,
}

impl Surface {
    /// The surface that `hit` lies on.
    pub fn new(_scene: &Scene, _hit: &Hit) -> Self {
        todo!()
    }

    /// A ray that leaves along the unit direction `d` and does not meet its own surface again.
    pub fn spawn(&self, _d: Vec3) -> Ray {
        todo!()
    }

    /// A ray from here to `target` that ends just before it.
    pub fn spawn_to(&self, _target: Vec3) -> Ray {
        todo!()
    }
}
