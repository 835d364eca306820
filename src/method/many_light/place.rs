//! Where a virtual point light lies.

use crate::base::ray::Hit;
use crate::material::Surface;
use crate::transport::World;
use glam::Vec2;

/// A light's place, which follows its triangle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Place {
    /// Triangle.
    pub triangle: u32,
    /// Weights of its second and third vertex.
    pub barycentric: Vec2,
    /// Whether it is the side that the shading normal points away from.
    pub back: bool,
}

impl Place {
    /// The surface there in a frame's world.
    pub fn surface(&self, world: &World) -> Surface {
        world.surface(&Hit { t: 0.0, triangle: self.triangle, u: self.barycentric.x, v: self.barycentric.y })
    }

    /// 1 on the side of the shading normal, -1 behind.
    pub fn side(&self) -> f32 {
        if self.back { -1.0 } else { 1.0 }
    }
}
