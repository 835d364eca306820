//! The local second-order model of a reflector.
//!
//! *Paper* (§4.3): "the principal curvatures allow us to locally represent the surface by a paraboloid using the curvature
//! directions as axes".
//!
//! Sign: a curvature is positive where the surface bends away from its normal (a sphere with outward normals has
//! k1 = k2 = 1/R), so that moving by `s` along a principal direction turns the normal by `k s` towards that direction,
//! and the paraboloid is z = -(k1 u² + k2 v²) / 2.

use crate::base::math::{Basis, major_axis};
use glam::{Mat2, Vec2, Vec3};

/// Principal curvatures and directions at a point; (d1, d2, n) is a right-handed orthonormal frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Curvature {
    /// Larger principal curvature, 1/m; positive where the surface is convex seen from the normal's side.
    pub k1: f32,
    /// Smaller principal curvature, 1/m.
    pub k2: f32,
    /// Unit direction of `k1`.
    pub d1: Vec3,
    /// Unit direction of `k2`; n x d1.
    pub d2: Vec3,
}

impl Curvature {
    /// A plane with unit normal `n`.
    pub fn plane(n: Vec3) -> Self {
        let frame = Basis::from_normal(n);
        Self { k1: 0.0, k2: 0.0, d1: frame.s, d2: frame.t }
    }

    /// The curvature whose tensor in the tangents of `frame` is `[[xx, xy], [xy, yy]]`.
    pub fn from_tensor(frame: &Basis, [xx, xy, yy]: [f32; 3]) -> Self {
        let mean = 0.5 * (xx + yy);
        let half = 0.5 * (xx - yy);
        let radius = half.hypot(xy);
        let along = major_axis(half, xy, radius);
        let d1 = frame.s * along.x + frame.t * along.y;
        Self { k1: mean + radius, k2: mean - radius, d1, d2: frame.n.cross(d1) }
    }

    /// The tensor `[xx, xy, yy]` in the tangents of `frame`, after a turn of the tangent plane onto that of `frame`.
    /// Inverse of [`Curvature::from_tensor`].
    pub fn tensor(&self, frame: &Basis) -> [f32; 3] {
        let along = Vec2::new(self.d1.dot(frame.s), self.d1.dot(frame.t)).try_normalize().unwrap_or(Vec2::X);
        let Vec2 { x: c, y: s } = along;
        let (k1, k2) = (self.k1, self.k2);
        [k1 * c * c + k2 * s * s, (k1 - k2) * c * s, k1 * s * s + k2 * c * c]
    }

    /// [`Curvature::tensor`] as a matrix.
    pub fn matrix(&self, frame: &Basis) -> Mat2 {
        let [xx, xy, yy] = self.tensor(frame);
        Mat2::from_cols_array(&[xx, xy, xy, yy])
    }

    /// Whether the surface is a plane to second order.
    pub fn is_flat(&self) -> bool {
        self.k1 == 0.0 && self.k2 == 0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tensor_round_trips_in_any_frame() {
        for i in 0..50 {
            let n = crate::base::math::direction_from_lat_long(Vec2::new((i as f32 * 0.618).fract(), (i as f32 + 0.5) / 50.0));
            let frame = Basis::from_normal(n);
            let angle = i as f32;
            let d1 = frame.s * angle.cos() + frame.t * angle.sin();
            let c = Curvature { k1: 2.0, k2: -1.0, d1, d2: n.cross(d1) };
            let other = Basis::from_normal_and_tangent(n, Vec3::new(0.2, 0.3, -0.9));
            let back = Curvature::from_tensor(&other, c.tensor(&other));
            assert!((back.k1 - 2.0).abs() < 1e-5 && (back.k2 + 1.0).abs() < 1e-5);
            assert!(back.d1.dot(d1).abs() > 1.0 - 1e-5, "{} {}", back.d1, d1);
            assert!((back.d1.cross(back.d2) - n).length() < 1e-5);
        }
    }
}
