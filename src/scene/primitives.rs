//! Mitsuba's analytic shapes as triangles, in local space, with Mitsuba's texture coordinates and outward sides.
//!
//! Ours: round shapes are tessellated. Their rims lie a little outside the true radius, so that the area, and with it the
//! power of an emitter, is the true one; radii are then off by at most 1.2e-3 (disk), 1.5e-3 (sphere) and 4e-4 (cylinder)
//! of themselves. Normals are exact at vertices. Texture coordinates are linear within a triangle; next to a disk's centre
//! and a sphere's poles they are off by up to half a segment.

use super::mesh::Mesh;
use crate::base::math::Basis;
use glam::{Vec2, Vec3};
use std::f32::consts::{PI, TAU};

/// Segments round a disk, and rings from its centre to its rim.
pub const DISK: (u32, u32) = (96, 6);
/// Meridians of a sphere, and steps from pole to pole.
pub const SPHERE: (u32, u32) = (128, 64);
/// Segments round a cylinder.
pub const CYLINDER: u32 = 128;

/// The square [-1, 1]² in the plane z = 0, facing +Z; uv from (0, 0) to (1, 1).
pub fn rectangle() -> Mesh {
    let uvs = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(Vec2::from);
    Mesh {
        positions: uvs.iter().map(|uv| (*uv * 2.0 - 1.0).extend(0.0)).collect(),
        normals: vec![Vec3::Z; 4],
        uvs: uvs.to_vec(),
        triangles: vec![[0, 1, 2], [2, 3, 0]],
    }
}

/// The cube [-1, 1]³, facing outwards; each face has the whole uv square.
pub fn cube() -> Mesh {
    // Each face's normal, and the position of its corner of uv (0, 1); the next corners follow anticlockwise.
    let faces = [
        (Vec3::NEG_Y, Vec3::new(1.0, -1.0, -1.0)),
        (Vec3::Y, Vec3::new(1.0, 1.0, -1.0)),
        (Vec3::X, Vec3::new(1.0, -1.0, -1.0)),
        (Vec3::Z, Vec3::new(1.0, -1.0, 1.0)),
        (Vec3::NEG_X, Vec3::new(-1.0, -1.0, 1.0)),
        (Vec3::NEG_Z, Vec3::new(1.0, 1.0, -1.0)),
    ];
    let mut mesh = Mesh::default();
    for (n, corner) in faces {
        let first = mesh.positions.len() as u32;
        let mut in_plane = corner - n;
        for uv in [[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]] {
            mesh.positions.push(n + in_plane);
            mesh.normals.push(n);
            mesh.uvs.push(Vec2::from(uv));
            in_plane = n.cross(in_plane);
        }
        mesh.triangles.push([first, first + 1, first + 2]);
        mesh.triangles.push([first + 3, first, first + 2]);
    }
    mesh
}

/// The unit disk in the plane z = 0, facing +Z; u = radius, v = angle from +X over a full turn.
pub fn disk() -> Mesh {
    let (segments, rings) = DISK;
    let step = TAU / segments as f32;
    let rim = (step / step.sin()).sqrt();
    grid(segments, rings, |i, j| {
        // At the centre, each segment's vertex looks along its middle.
        let phi = (i as f32 + if j == 0 { 0.5 } else { 0.0 }) * step;
        let r = j as f32 / rings as f32;
        (Vec3::new(phi.cos(), phi.sin(), 0.0) * (r * rim), Vec3::Z, Vec2::new(r, phi / TAU))
    })
}

/// A sphere, facing outwards (inwards where `radius` is negative); u = longitude from +X over a full turn,
/// v = polar angle from +Z over a half.
///
/// Mitsuba takes a mirroring `to_world` for a negative radius, unlike its other shapes: the caller flips normals then.
pub fn sphere(center: Vec3, radius: f32) -> Mesh {
    let (segments, rings) = SPHERE;
    let mut mesh = grid(segments, rings, |i, j| {
        let pole = j == 0 || j == rings;
        let phi = (i as f32 + if pole { 0.5 } else { 0.0 }) * (TAU / segments as f32);
        let theta = j as f32 * (PI / rings as f32);
        let (sin, cos) = if j == rings { (0.0, -1.0) } else { theta.sin_cos() };
        let n = Vec3::new(sin * phi.cos(), sin * phi.sin(), cos);
        (n, n, Vec2::new(phi / TAU, theta / PI))
    });
    let area: f64 = mesh
        .triangles
        .iter()
        .map(|t| {
            let [a, b, c] = t.map(|i| mesh.positions[i as usize].as_dvec3());
            (b - a).cross(c - a).length() / 2.0
        })
        .sum();
    let scale = (4.0 * std::f64::consts::PI / area).sqrt() as f32 * radius.abs();
    for p in &mut mesh.positions {
        *p = center + *p * scale;
    }
    if radius < 0.0 {
        turn(&mut mesh);
        mesh.normals.iter_mut().for_each(|n| *n = -*n);
    }
    mesh
}

/// An open tube from `p0` to `p1`, facing outwards; u = angle over a full turn, v = 0 at `p0` and 1 at `p1`.
/// Empty where the two ends coincide.
pub fn cylinder(p0: Vec3, p1: Vec3, radius: f32) -> Mesh {
    let Some(axis) = (p1 - p0).try_normalize() else { return Mesh::default() };
    let frame = Basis::from_normal(axis);
    let half_step = PI / CYLINDER as f32;
    let rim = radius * (half_step / half_step.sin());
    let mut mesh = grid(CYLINDER, 1, |i, j| {
        let phi = i as f32 * (TAU / CYLINDER as f32);
        let n = frame.s * phi.cos() + frame.t * phi.sin();
        (p0.lerp(p1, j as f32) + n * rim, n, Vec2::new(phi / TAU, j as f32))
    });
    turn(&mut mesh);
    mesh
}

/// A (segments + 1) x (rings + 1) grid of vertices, its first and last column on the same line. Triangles without area,
/// at poles, are left out. Faces +n where d/dring x d/dsegment does.
pub(super) fn grid(segments: u32, rings: u32, vertex: impl Fn(u32, u32) -> (Vec3, Vec3, Vec2)) -> Mesh {
    let mut mesh = Mesh::default();
    for j in 0..=rings {
        for i in 0..=segments {
            // The last column repeats the first one's position bit for bit, so that the seam has no gap.
            let (p, n, uv) = vertex(i, j);
            let (p, n) = if i == segments { (vertex(0, j).0, vertex(0, j).1) } else { (p, n) };
            mesh.positions.push(p);
            mesh.normals.push(n);
            mesh.uvs.push(uv);
        }
    }
    let at = |i: u32, j: u32| j * (segments + 1) + i;
    let same = |i: u32, j: u32| mesh.positions[at(i, j) as usize] == mesh.positions[at(i + 1, j) as usize];
    for j in 0..rings {
        for i in 0..segments {
            if !same(i, j + 1) {
                mesh.triangles.push([at(i, j), at(i, j + 1), at(i + 1, j + 1)]);
            }
            if !same(i, j) {
                mesh.triangles.push([at(i, j), at(i + 1, j + 1), at(i + 1, j)]);
            }
        }
    }
    mesh
}

/// Reverses the winding.
pub(super) fn turn(mesh: &mut Mesh) {
    mesh.triangles.iter_mut().for_each(|t| t.swap(1, 2));
}

#[cfg(test)]
mod tests {
    use super::*;

    fn area(mesh: &Mesh) -> f64 {
        let corner = |i: u32| mesh.positions[i as usize].as_dvec3();
        mesh.triangles.iter().map(|t| (corner(t[1]) - corner(t[0])).cross(corner(t[2]) - corner(t[0])).length() / 2.0).sum()
    }

    #[test]
    fn areas_are_those_of_the_round_shapes() {
        use std::f64::consts::PI;
        let cases = [
            (rectangle(), 4.0),
            (cube(), 24.0),
            (disk(), PI),
            (sphere(Vec3::ONE, 0.5), PI),
            (sphere(Vec3::ONE, -2.0), 16.0 * PI),
            (cylinder(Vec3::ZERO, Vec3::new(0.0, 3.0, 0.0), 0.5), 3.0 * PI),
        ];
        for (mesh, expected) in cases {
            assert!((area(&mesh) / expected - 1.0).abs() < 1e-5, "{} {expected}", area(&mesh));
        }
    }

    #[test]
    fn winding_agrees_with_the_normals() {
        for mesh in [rectangle(), cube(), disk(), sphere(Vec3::ONE, 0.5), sphere(Vec3::Y, -0.5), cylinder(Vec3::X, Vec3::Z, 0.1)]
        {
            for t in &mesh.triangles {
                let n = crate::scene::normals::unit_normal(t.map(|i| mesh.positions[i as usize])).expect("has area");
                assert!(t.iter().all(|&i| n.dot(mesh.normals[i as usize]) > 0.99), "{n} {t:?}");
            }
        }
    }

    /// The point of a mesh's triangle that is nearest to `p` among their corners and centres, with its uv.
    fn uv_at(mesh: &Mesh, p: Vec3) -> Vec2 {
        let mean = |a: [Vec3; 3]| (a[0] + a[1] + a[2]) / 3.0;
        let t = mesh
            .triangles
            .iter()
            .min_by(|a, b| {
                let d = |t: &[u32; 3]| mean(t.map(|i| mesh.positions[i as usize])).distance(p);
                d(a).total_cmp(&d(b))
            })
            .unwrap();
        mean(t.map(|i| mesh.uvs[i as usize].extend(0.0))).truncate()
    }

    /// Points and texture coordinates from rays at Mitsuba 3.9.1's shapes.
    #[test]
    fn texture_coordinates_are_those_of_mitsuba() {
        let z = |x: f32, y: f32| Vec3::new(x, y, (1.0 - x * x - y * y).max(0.0).sqrt());
        let tube = |a, b| cylinder(a, b, 0.5);
        let cases = [
            (disk(), Vec3::new(0.3, 0.2, 0.0), [0.360_555, 0.093_583_5], 0.06),
            (sphere(Vec3::ZERO, 1.0), z(0.3, 0.2), [0.093_583_5, 0.117_413], 0.01),
            (sphere(Vec3::ZERO, 1.0), Vec3::new(0.3, 0.932_738, 0.2), [0.200_473, 0.435_906], 0.01),
            (tube(Vec3::ZERO, Vec3::Z * 2.0), Vec3::new(0.489_898, 0.1, 1.33), [0.032_047_1, 0.666_7], 0.01),
            (tube(Vec3::ZERO, Vec3::X * 2.0), Vec3::new(1.33, 0.1, 0.489_898), [0.467_953, 0.666_7], 0.01),
            (tube(Vec3::ZERO, Vec3::Y * 2.0), Vec3::new(0.1, 1.33, 0.489_898), [0.782_047, 0.666_7], 0.01),
            (rectangle(), Vec3::new(1.0 / 3.0, -1.0 / 3.0, 0.0), [2.0 / 3.0, 1.0 / 3.0], 1e-5),
            (cube(), Vec3::new(1.0 / 3.0, 1.0 / 3.0, 1.0), [2.0 / 3.0, 2.0 / 3.0], 1e-5),
        ];
        for (mesh, p, uv, tolerance) in cases {
            let found = uv_at(&mesh, p);
            assert!((found - Vec2::from(uv)).abs().max_element() < tolerance, "{p}: {found}, Mitsuba {uv:?}");
        }
    }

    /// Position, normal and uv of corners of Mitsuba 3.9.1's cube.
    #[test]
    fn cube_corners_are_those_of_mitsuba() {
        let cube = cube();
        for (i, p, uv) in [
            (1, [1.0, -1.0, 1.0], [1.0, 1.0]),
            (5, [-1.0, 1.0, -1.0], [1.0, 1.0]),
            (10, [1.0, 1.0, 1.0], [1.0, 0.0]),
            (15, [-1.0, -1.0, 1.0], [0.0, 0.0]),
            (18, [-1.0, 1.0, -1.0], [1.0, 0.0]),
            (23, [-1.0, 1.0, -1.0], [0.0, 0.0]),
        ] {
            assert_eq!((cube.positions[i], cube.uvs[i]), (Vec3::from(p), Vec2::from(uv)), "{i}");
        }
    }
}
