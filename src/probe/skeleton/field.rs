//! Distances to the nearest surface on a grid of voxels ([Wang et al. 2019] §3.1).
//!
//! *Paper*: OpenVDB makes the field. *Ours*: exact distances around every triangle, then the nearest triangles handed on from voxel to
//! voxel by fast sweeping (as in Bridson's level sets), so that open and crossing triangles do no harm. The field itself has no sign:
//! which side is inside is asked of the free space ([`super::space`]). Round shapes count by their meshes.

use super::voxels::Voxels;
use crate::scene::Geometry;
use glam::{UVec3, Vec3};
use rayon::prelude::*;

/// Layers of voxels that one thread starts.
const SLAB: usize = 4;
/// No triangle yet.
const NONE: u32 = u32::MAX;

/// Distance to the nearest surface at the middle of each voxel.
#[derive(Debug, Clone)]
pub struct Field {
    /// The voxels.
    pub voxels: Voxels,
    /// Metres, not negative; infinite in a scene without triangles.
    pub distance: Vec<f32>,
}

impl Field {
    /// The field of the triangles for which `keep` holds.
    pub fn of(geometry: &Geometry, keep: &dyn Fn(u32) -> bool, voxels: Voxels) -> Self {
        let finite = |t: &[Vec3; 3]| t.iter().all(|p| p.is_finite());
        let triangles: Vec<[Vec3; 3]> =
            (0..geometry.triangles.len() as u32).filter(|&t| keep(t)).map(|t| geometry.corners(t)).filter(finite).collect();
        let mut squares = vec![f32::INFINITY; voxels.len()];
        let mut nearest = vec![NONE; voxels.len()];
        let layer = (voxels.counts.x * voxels.counts.y) as usize;
        squares.par_chunks_mut(layer * SLAB).zip(nearest.par_chunks_mut(layer * SLAB)).enumerate().for_each(|(i, (s, n))| {
            around_triangles(&voxels, &triangles, i * SLAB, s, n);
        });
        for order in 0..8 {
            sweep(&voxels, &triangles, order, &mut squares, &mut nearest);
        }
        Self { voxels, distance: squares.into_iter().map(f32::sqrt).collect() }
    }

    /// Distance at `p` between the middles of voxels (trilinear), metres; outside the box that of its border.
    pub fn at(&self, p: Vec3) -> f32 {
        let corners = self.voxels.corners(p);
        let t = ((p - self.voxels.centre_at(corners[0])) / self.voxels.edge).clamp(Vec3::ZERO, Vec3::ONE);
        let mut sum = 0.0;
        for (k, c) in corners.into_iter().enumerate() {
            let share = |axis: usize| if k >> axis & 1 == 1 { t[axis] } else { 1.0 - t[axis] };
            let weight = share(0) * share(1) * share(2);
            // A weight of zero times infinity is no number.
            if weight > 0.0 {
                sum += weight * self.distance[self.voxels.index(c)];
            }
        }
        sum
    }

    /// Change of the distance along each axis by central differences, one-sided at the border: of length 1 where one surface is
    /// nearest, shorter where several are.
    pub fn gradient(&self, i: usize) -> Vec3 {
        let c = self.voxels.coordinates(i);
        let along = |axis: usize| {
            let (mut low, mut high) = (c, c);
            low[axis] = c[axis].saturating_sub(1);
            high[axis] = (c[axis] + 1).min(self.voxels.counts[axis] - 1);
            let steps = (high[axis] - low[axis]).max(1) as f32;
            (self.distance[self.voxels.index(high)] - self.distance[self.voxels.index(low)]) / (steps * self.voxels.edge)
        };
        Vec3::new(along(0), along(1), along(2))
    }
}

/// Exact distances in the voxels that triangles touch, and in those next to them, for some layers from `first` on. Triangles outside the
/// box start from its border.
fn around_triangles(voxels: &Voxels, triangles: &[[Vec3; 3]], first: usize, squares: &mut [f32], nearest: &mut [u32]) {
    let layer = (voxels.counts.x * voxels.counts.y) as usize;
    let end = (first + squares.len() / layer) as u32;
    for (t, corners) in triangles.iter().enumerate() {
        let [a, b, c] = *corners;
        let low = voxels.nearest(a.min(b).min(c) - voxels.edge);
        let high = voxels.nearest(a.max(b).max(c) + voxels.edge);
        let layers = low.z.max(first as u32)..(high.z + 1).min(end);
        if layers.is_empty() {
            continue;
        }
        let normal = (b - a).cross(c - a).normalize_or_zero();
        let inside = voxels.contains(a.min(b).min(c)) && voxels.contains(a.max(b).max(c));
        for z in layers {
            for y in low.y..=high.y {
                for x in low.x..=high.x {
                    let place = UVec3::new(x, y, z);
                    let p = voxels.centre_at(place);
                    // A large slanted triangle is far from most of its box.
                    if inside && normal.dot(p - a).abs() > 2.0 * voxels.edge {
                        continue;
                    }
                    let i = voxels.index(place) - first * layer;
                    let square = p.distance_squared(closest_point(p, corners));
                    if square < squares[i] {
                        (squares[i], nearest[i]) = (square, t as u32);
                    }
                }
            }
        }
    }
}

/// One sweep over all voxels, from the corner that the bits of `order` say to the opposite one: each takes over the nearest triangle of the
/// seven voxels before it where that is nearer than its own.
fn sweep(voxels: &Voxels, triangles: &[[Vec3; 3]], order: u32, squares: &mut [f32], nearest: &mut [u32]) {
    let backwards = [order & 1 == 1, order & 2 == 2, order & 4 == 4];
    let place = |axis: usize, k: u32| if backwards[axis] { voxels.counts[axis] - 1 - k } else { k };
    for kz in 0..voxels.counts.z {
        for ky in 0..voxels.counts.y {
            for kx in 0..voxels.counts.x {
                let k = [kx, ky, kz];
                let here = UVec3::new(place(0, kx), place(1, ky), place(2, kz));
                let i = voxels.index(here);
                for before in 1..8u32 {
                    let step = [before & 1, before >> 1 & 1, before >> 2];
                    if (0..3).any(|axis| step[axis] > k[axis]) {
                        continue;
                    }
                    let there = UVec3::from_array(std::array::from_fn(|axis| place(axis, k[axis] - step[axis])));
                    let t = nearest[voxels.index(there)];
                    if t == NONE || t == nearest[i] {
                        continue;
                    }
                    let p = voxels.centre_at(here);
                    let square = p.distance_squared(closest_point(p, &triangles[t as usize]));
                    if square < squares[i] {
                        (squares[i], nearest[i]) = (square, t);
                    }
                }
            }
        }
    }
}

/// The point of a triangle that is nearest to `p` (Ericson, Real-Time Collision Detection, 5.1.5).
fn closest_point(p: Vec3, &[a, b, c]: &[Vec3; 3]) -> Vec3 {
    let (ab, ac, ap) = (b - a, c - a, p - a);
    let (d1, d2) = (ab.dot(ap), ac.dot(ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return a;
    }
    let bp = p - b;
    let (d3, d4) = (ab.dot(bp), ac.dot(bp));
    if d3 >= 0.0 && d4 <= d3 {
        return b;
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return a + ab * ratio(d1, d1 - d3);
    }
    let cp = p - c;
    let (d5, d6) = (ab.dot(cp), ac.dot(cp));
    if d6 >= 0.0 && d5 <= d6 {
        return c;
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return a + ac * ratio(d2, d2 - d6);
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0 {
        return b + (c - b) * ratio(d4 - d3, (d4 - d3) + (d5 - d6));
    }
    let sum = va + vb + vc;
    a + ab * ratio(vb, sum) + ac * ratio(vc, sum)
}

/// A quotient that is 0 for triangles without extent.
fn ratio(x: f32, y: f32) -> f32 {
    if y == 0.0 { 0.0 } else { x / y }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lightmap::testing;

    fn field(geometry: &Geometry, lower: Vec3, upper: Vec3, resolution: u32) -> Field {
        Field::of(geometry, &|_| true, Voxels::in_box(lower, upper, resolution).unwrap())
    }

    #[test]
    fn a_box_has_its_analytic_distances_inside_and_outside() {
        let mut geometry = Geometry::default();
        let half = Vec3::new(1.0, 0.6, 0.8);
        testing::cuboid(&mut geometry, -half, half);
        let field = field(&geometry, Vec3::splat(-2.0), Vec3::splat(2.0), 40);
        for i in 0..field.voxels.len() {
            let q = field.voxels.centre(i).abs() - half;
            let expected = (q.max(Vec3::ZERO).length() + q.max_element().min(0.0)).abs();
            assert!(
                (field.distance[i] - expected).abs() < 1e-4,
                "{}: {} not {expected}",
                field.voxels.centre(i),
                field.distance[i]
            );
        }
        let gradient = field.gradient(field.voxels.index(field.voxels.nearest(Vec3::new(1.7, 0.0, 0.0))));
        assert!(gradient.abs_diff_eq(Vec3::X, 1e-3), "{gradient}");
    }

    #[test]
    fn a_sphere_s_distance_is_that_to_its_radius() {
        let mut geometry = Geometry::default();
        testing::sphere(&mut geometry, Vec3::ZERO, 1.0, 32);
        let field = field(&geometry, Vec3::splat(-1.5), Vec3::splat(1.5), 30);
        for i in 0..field.voxels.len() {
            let expected = (field.voxels.centre(i).length() - 1.0).abs();
            assert!((field.distance[i] - expected).abs() < 6e-3, "{} not {expected}", field.distance[i]);
        }
        assert!((field.at(Vec3::new(0.0, 0.47, 0.0)) - 0.53).abs() < 0.02);
    }

    #[test]
    fn what_lies_outside_the_box_counts_too() {
        let mut geometry = Geometry::default();
        testing::quad(&mut geometry, Vec3::new(-5.0, 3.0, -5.0), Vec3::Z * 10.0, Vec3::X * 10.0);
        testing::quad(&mut geometry, Vec3::new(-1.0, -9.0, -1.0), Vec3::Z, Vec3::X);
        let field = field(&geometry, Vec3::splat(-1.0), Vec3::ONE, 10);
        for i in 0..field.voxels.len() {
            assert!((field.distance[i] - (3.0 - field.voxels.centre(i).y)).abs() < 1e-4);
        }
    }

    #[test]
    fn brute_force_agrees_on_scattered_triangles() {
        let random = |i: u32, k: u32| crate::base::math::unit(crate::base::math::hash_words(&[i, k])) * 2.0 - 1.0;
        let mut geometry = Geometry::default();
        for i in 0..40 {
            let p = |k: u32| Vec3::new(random(i, k), random(i, k + 1), random(i, k + 2));
            let corners = [p(0), p(0) + p(3) * 0.4, p(0) + p(6) * 0.4];
            testing::object(&mut geometry, &corners, None, &[[0, 1, 2]]);
        }
        let field = field(&geometry, Vec3::splat(-1.2), Vec3::splat(1.2), 32);
        let mut wrong = 0;
        for i in 0..field.voxels.len() {
            let p = field.voxels.centre(i);
            let expected = (0..40).map(|t| p.distance(closest_point(p, &geometry.corners(t)))).fold(f32::INFINITY, f32::min);
            assert!((field.distance[i] - expected).abs() < 0.2 * field.voxels.edge, "{} not {expected}", field.distance[i]);
            wrong += usize::from((field.distance[i] - expected).abs() > 1e-5);
        }
        assert!(wrong < field.voxels.len() / 200, "{wrong} of {}", field.voxels.len());
    }
}
