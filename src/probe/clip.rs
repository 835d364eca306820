//! The part of a scene that lies in a box: what is behind a window, or a ground that goes on for miles, takes no texels from a room.

use crate::scene::{Geometry, Object};
use glam::{Vec2, Vec3};

/// Triangles cut to a box.
#[derive(Debug, Default)]
pub struct Clipped {
    /// Objects as in the scene, without what lies outside.
    pub geometry: Geometry,
    /// The scene's triangle that each is a part of.
    pub source: Vec<u32>,
}

/// Cuts the triangles for which `keep` holds to the box from `lower` to `upper`. Those of round shapes stay whole, as rays meet the shape.
pub fn clip(geometry: &Geometry, keep: &dyn Fn(u32) -> bool, lower: Vec3, upper: Vec3) -> Clipped {
    let mut out = Clipped::default();
    for (o, object) in geometry.objects.iter().enumerate() {
        let (first, first_vertex) = (out.source.len() as u32, out.geometry.positions.len() as u32);
        for t in object.triangles.clone().filter(|&t| keep(t)) {
            let corners = geometry.corners(t);
            let (low, high) = (corners[0].min(corners[1]).min(corners[2]), corners[0].max(corners[1]).max(corners[2]));
            if !(low.cmple(upper).all() && high.cmpge(lower).all()) {
                continue;
            }
            let is_inside = low.cmpge(lower).all() && high.cmple(upper).all();
            let whole = is_inside || geometry.round(t).is_some();
            let polygon = if whole { corners.to_vec() } else { cut(&corners, lower, upper) };
            let normals = geometry.triangles[t as usize].map(|i| geometry.normals.get(i as usize).copied().unwrap_or(Vec3::Y));
            let start = out.geometry.positions.len() as u32;
            for p in &polygon {
                let b = barycentric(&corners, *p);
                let normal = normals[0] * (1.0 - b.x - b.y) + normals[1] * b.x + normals[2] * b.y;
                out.geometry.positions.push(*p);
                out.geometry.normals.push(normal.normalize_or(Vec3::Y));
                out.geometry.uvs.push(Vec2::ZERO);
            }
            for k in 2..polygon.len() as u32 {
                out.geometry.triangles.push([start, start + k - 1, start + k]);
                out.geometry.triangle_object.push(o as u32);
                out.source.push(t);
            }
        }
        let (triangles, vertices) = (first..out.source.len() as u32, first_vertex..out.geometry.positions.len() as u32);
        out.geometry.objects.push(Object { triangles, vertices, ..object.clone() });
    }
    out
}

/// The part of a triangle in a box (Sutherland-Hodgman), without corners where nothing is left.
fn cut(corners: &[Vec3; 3], lower: Vec3, upper: Vec3) -> Vec<Vec3> {
    let mut polygon = corners.to_vec();
    for axis in 0..3 {
        polygon = half(&polygon, axis, lower[axis], 1.0);
        polygon = half(&polygon, axis, upper[axis], -1.0);
    }
    if polygon.len() < 3 { Vec::new() } else { polygon }
}

/// The part of a polygon on one side of a plane across an axis.
fn half(polygon: &[Vec3], axis: usize, at: f32, sign: f32) -> Vec<Vec3> {
    let mut out = Vec::with_capacity(polygon.len() + 1);
    for (i, &a) in polygon.iter().enumerate() {
        let b = polygon[(i + 1) % polygon.len()];
        let (da, db) = (sign * (a[axis] - at), sign * (b[axis] - at));
        if da >= 0.0 {
            out.push(a);
        }
        if (da >= 0.0) != (db >= 0.0) {
            // From the same end whichever way an edge runs, so that neighbours get the same point.
            let (inside, outside, d, e) = if da >= 0.0 { (a, b, da, db) } else { (b, a, db, da) };
            let mut p = inside + (outside - inside) * (d / (d - e));
            p[axis] = at;
            out.push(p);
        }
    }
    out
}

/// Barycentric weights of a triangle's second and third corner at a point of its plane, clamped to the triangle.
pub fn barycentric(&[a, b, c]: &[Vec3; 3], p: Vec3) -> Vec2 {
    let (e, f, d) = (b - a, c - a, p - a);
    let (ee, ef, ff) = (e.length_squared(), e.dot(f), f.length_squared());
    let (de, df) = (d.dot(e), d.dot(f));
    let weights = Vec2::new(ff * de - ef * df, ee * df - ef * de) / (ee * ff - ef * ef);
    if !weights.is_finite() {
        return Vec2::splat(1.0 / 3.0);
    }
    let w = weights.clamp(Vec2::ZERO, Vec2::ONE);
    w / (w.x + w.y).max(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lightmap::testing;

    #[test]
    fn a_ground_is_cut_to_the_box_and_what_is_outside_goes() {
        let mut geometry = Geometry::default();
        testing::quad(&mut geometry, Vec3::new(-100.0, 0.0, -100.0), Vec3::Z * 200.0, Vec3::X * 200.0);
        testing::cuboid(&mut geometry, Vec3::splat(-0.2), Vec3::splat(0.2));
        testing::cuboid(&mut geometry, Vec3::splat(5.0), Vec3::splat(6.0));
        let clipped = clip(&geometry, &|_| true, Vec3::new(-1.0, -1.0, -2.0), Vec3::new(3.0, 1.0, 2.0));
        let area = |o: usize| {
            let triangles = clipped.geometry.objects[o].triangles.clone();
            triangles.map(|t| 0.5 * clipped.geometry.area_normal(t).length()).sum::<f32>()
        };
        assert!((area(0) - 16.0).abs() < 1e-3 && (area(1) - 6.0 * 0.16).abs() < 1e-5 && area(2) == 0.0, "{}", area(0));
        for t in 0..clipped.source.len() as u32 {
            let (part, whole) = (clipped.geometry.area_normal(t), geometry.area_normal(clipped.source[t as usize]));
            assert!(part.length() < 1e-6 || part.normalize().dot(whole.normalize()) > 0.999);
            assert_eq!(clipped.geometry.object(t).name, geometry.object(clipped.source[t as usize]).name);
        }
        let none = clip(&geometry, &|_| false, Vec3::splat(-9.0), Vec3::splat(9.0));
        assert!(none.source.is_empty() && none.geometry.objects.len() == 3);
    }

    #[test]
    fn barycentrics_of_a_triangle_s_points() {
        let corners = [Vec3::new(1.0, 2.0, 3.0), Vec3::new(2.0, 2.5, 3.0), Vec3::new(1.0, 4.0, 2.0)];
        for b in [Vec2::ZERO, Vec2::X, Vec2::Y, Vec2::new(0.2, 0.5)] {
            let p = corners[0] + (corners[1] - corners[0]) * b.x + (corners[2] - corners[0]) * b.y;
            assert!((barycentric(&corners, p) - b).length() < 1e-5);
        }
    }
}
