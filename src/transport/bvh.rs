//! Closest-hit and any-hit queries over the scene's triangles.

use super::{Hit, Ray};
use crate::scene::Scene;

/// Acceleration structure over the triangles of a scene (all, or the opaque ones only).
pub struct Bvh {}

impl Bvh {
    /// Builds over the triangles for which `keep` holds.
    pub fn build(_scene: &Scene, _keep: &dyn Fn(u32) -> bool) -> Self {
        todo!()
    }

    /// First hit in [t_min, t_max]. Alpha-masked triangles are passed where a hash of ray and triangle says so.
    pub fn closest(&self, _scene: &Scene, _ray: &Ray) -> Option<Hit> {
        todo!()
    }

    /// Whether anything lies in [t_min, t_max].
    pub fn occluded(&self, _scene: &Scene, _ray: &Ray) -> bool {
        todo!()
    }
}
