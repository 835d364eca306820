//! Watertight ray-triangle intersection (Woop, Benthin and Wald 2013).
//!
//! The triangle is moved and sheared so that the ray becomes the z axis from the origin; three 2-D edge functions then tell
//! whether it goes through. Two triangles compute the function of a shared edge from the same numbers, up to its sign, so
//! no ray slips between them: an edge function of exactly zero counts as inside for both.
//!
//! Ours: the distance is the barycentric mean of the corners' depths, so that it lies between them whatever the scale.

use crate::base::ray::Ray;
#[cfg(test)]
use glam::Vec3;

/// A ray made ready for triangles.
#[derive(Clone, Copy)]
pub struct Shear {
    /// Origin, its axes permuted: the axis along which the ray is longest comes last.
    pub origin: [f32; 3],
    /// The permutation.
    pub axes: [usize; 3],
    /// d_x / d_z, d_y / d_z and 1 / d_z of the permuted direction.
    pub shear: [f32; 3],
}

impl Shear {
    /// Prepares a ray.
    pub fn new(ray: &Ray) -> Self {
        let d = ray.d.abs();
        let z = if d.x > d.y && d.x > d.z {
            0
        } else if d.y > d.z {
            1
        } else {
            2
        };
        let axes = [(z + 1) % 3, (z + 2) % 3, z];
        let inv = 1.0 / ray.d[z];
        Self { origin: axes.map(|a| ray.o[a]), axes, shear: [ray.d[axes[0]] * inv, ray.d[axes[1]] * inv, inv] }
    }

    /// Distance along the ray, and barycentric weights of `b` and `c`, where the line of the ray meets the triangle.
    /// The eight-wide form takes the same steps in the same order; this one is its oracle.
    #[cfg(test)]
    pub fn intersect(&self, corners: [Vec3; 3]) -> Option<(f32, f32, f32)> {
        let [kx, ky, kz] = self.axes;
        let [sx, sy, sz] = self.shear;
        let [a, b, c] = corners.map(|p| {
            let z = p[kz] - self.origin[2];
            [p[kx] - self.origin[0] - sx * z, p[ky] - self.origin[1] - sy * z, z]
        });
        let u = c[0] * b[1] - c[1] * b[0];
        let v = a[0] * c[1] - a[1] * c[0];
        let w = b[0] * a[1] - b[1] * a[0];
        let inside = (u >= 0.0 && v >= 0.0 && w >= 0.0) || (u <= 0.0 && v <= 0.0 && w <= 0.0);
        let det = u + v + w;
        if !inside || det == 0.0 {
            return None;
        }
        let inv = 1.0 / det;
        let (u, v, w) = (u * inv, v * inv, w * inv);
        Some(((u * a[2] + v * b[2] + w * c[2]) * sz, v, w))
    }
}
