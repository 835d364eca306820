//! Small geometry for the tests.

use crate::scene::{Geometry, Object};
use glam::{Vec2, Vec3};

/// Adds an object; without normals it has face normals.
pub fn object(g: &mut Geometry, positions: &[Vec3], normals: Option<&[Vec3]>, triangles: &[[u32; 3]]) {
    let (v0, t0) = (g.positions.len() as u32, g.triangles.len() as u32);
    g.positions.extend(positions);
    match normals {
        Some(n) => g.normals.extend(n),
        None => g.normals.extend(vec![Vec3::Y; positions.len()]),
    }
    g.uvs.extend(vec![Vec2::ZERO; positions.len()]);
    g.triangles.extend(triangles.iter().map(|t| t.map(|i| i + v0)));
    g.triangle_object.extend(vec![g.objects.len() as u32; triangles.len()]);
    g.objects.push(Object {
        name: format!("object {}", g.objects.len()),
        triangles: t0..g.triangles.len() as u32,
        vertices: v0..g.positions.len() as u32,
        material: 0,
        emitter: None,
        face_normals: normals.is_none(),
        has_uvs: false,
    });
}

/// A parallelogram that faces `a` x `b`.
pub fn quad(g: &mut Geometry, corner: Vec3, a: Vec3, b: Vec3) {
    object(g, &[corner, corner + a, corner + a + b, corner + b], None, &[[0, 1, 2], [0, 2, 3]]);
}

/// A closed box that faces outwards.
pub fn cuboid(g: &mut Geometry, lo: Vec3, hi: Vec3) {
    let p: Vec<Vec3> = (0..8).map(|i| Vec3::select(glam::BVec3::new(i & 1 > 0, i & 2 > 0, i & 4 > 0), hi, lo)).collect();
    let quads = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    let triangles: Vec<[u32; 3]> = quads.iter().flat_map(|q| [[q[0], q[1], q[2]], [q[0], q[2], q[3]]]).collect();
    object(g, &p, None, &triangles);
}

/// A smooth sphere of n x 2n quads, outwards.
pub fn sphere(g: &mut Geometry, centre: Vec3, radius: f32, n: u32) {
    let mut normals = Vec::new();
    for j in 0..=n {
        for i in 0..=2 * n {
            let (theta, phi) =
                (j as f32 / n as f32 * std::f32::consts::PI, (i % (2 * n)) as f32 / n as f32 * std::f32::consts::PI);
            let sin = if j == 0 || j == n { 0.0 } else { theta.sin() };
            normals.push(Vec3::new(sin * phi.sin(), theta.cos(), sin * phi.cos()));
        }
    }
    let positions: Vec<Vec3> = normals.iter().map(|&m| centre + m * radius).collect();
    let mut triangles = Vec::new();
    for j in 0..n {
        for i in 0..2 * n {
            let (a, b) = (j * (2 * n + 1) + i, (j + 1) * (2 * n + 1) + i);
            if j + 1 < n {
                triangles.push([a, b, b + 1]);
            }
            if j > 0 {
                triangles.push([a, b + 1, a + 1]);
            }
        }
    }
    object(g, &positions, Some(&normals), &triangles);
}

/// A ramp about the Y axis, between radius 1 and 2, that climbs 0.5 a turn and faces up.
pub fn spiral(g: &mut Geometry, turns: f32) {
    let n = (turns * 32.0) as u32;
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    for i in 0..=n {
        let turn = i as f32 / 32.0;
        let (sin, cos) = (turn * std::f32::consts::TAU).sin_cos();
        positions.push(Vec3::new(sin, 0.5 * turn, cos));
        positions.push(Vec3::new(2.0 * sin, 0.5 * turn, 2.0 * cos));
        if i < n {
            triangles.extend([[2 * i, 2 * i + 1, 2 * i + 3], [2 * i, 2 * i + 3, 2 * i + 2]]);
        }
    }
    let normals = vec![Vec3::Y; positions.len()];
    object(g, &positions, Some(&normals), &triangles);
}

/// A unit square of four quads whose back is modelled too, on the same vertices.
pub fn doubled_sheet(g: &mut Geometry) {
    let p: Vec<Vec3> = (0..9).map(|i| Vec3::new((i % 3) as f32, 0.0, (i / 3) as f32) * 0.5).collect();
    let mut triangles = Vec::new();
    for q in [0u32, 1, 3, 4] {
        triangles.extend([[q, q + 3, q + 4], [q, q + 4, q + 1], [q + 4, q + 3, q], [q + 1, q + 4, q]]);
    }
    object(g, &p, None, &triangles);
}
