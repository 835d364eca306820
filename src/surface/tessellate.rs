//! Refines large flat triangles, so that the discrete operator finds vertices with a whole ring about them.
//!
//! Paper: §4.3, "we tessellate large planar objects with only a few large triangles" (Fig. 5b, d); the text gives no numbers.
//! Ours: a triangle is flat if its vertex normals are its own normal; the edges of flat triangles are halved, again and again,
//! while they are long against their object. Halving works on edges, so the mesh stays without cracks, and the new vertices
//! lie on the surface. Straight edges of curved surfaces (a cylinder's) stay: the blunt triangles that cutting them
//! leaves cost the estimate more than the longer ring does (tried: 11 % low).

use super::weld::WeldedMesh;
use glam::Vec3;
use std::collections::HashMap;

/// When to refine.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TessellationParams {
    /// An object with more triangles than this is fine enough as it is.
    pub max_triangles: usize,
    /// An edge is long from this fraction of the diagonal of its object's bounding box.
    pub long_edge: f32,
    /// A triangle is flat if its vertex normals are within this angle of its own, degrees.
    pub flat_degrees: f32,
}

impl Default for TessellationParams {
    fn default() -> Self {
        Self { max_triangles: 2000, long_edge: 0.1, flat_degrees: 1.0 }
    }
}

/// Halves long flat edges until none is left. New vertices come after the old ones, which keep their numbers.
pub fn tessellate(mesh: &mut WeldedMesh, params: &TessellationParams) {
    if mesh.triangles.len() > params.max_triangles {
        return;
    }
    let (lo, hi) = mesh.positions.iter().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(lo, hi), &p| (lo.min(p), hi.max(p)));
    let limit = (hi - lo).length() * params.long_edge;
    // Written so that an infinite or undefined size refines nothing.
    if !(limit > 0.0 && limit.is_finite()) {
        return;
    }
    let min_cos = params.flat_degrees.to_radians().cos();
    // An edge is at most 1 / long_edge limits long, so this many halvings end below the limit.
    let rounds = (1.0 / params.long_edge.clamp(1e-3, 1.0)).log2().ceil() as u32;
    for _ in 0..rounds {
        // The middles of the edges to cut. The map is only looked up, never walked: its order does not reach the result.
        let mut middle: HashMap<(u32, u32), u32> = HashMap::new();
        let old = std::mem::take(&mut mesh.triangles);
        for t in &old {
            if !is_flat(mesh, t, min_cos) {
                continue;
            }
            for (a, b) in edges(t) {
                let (pa, pb) = (mesh.positions[a as usize], mesh.positions[b as usize]);
                if pa.distance(pb) > limit {
                    middle.entry((a.min(b), a.max(b))).or_insert_with(|| {
                        mesh.positions.push((pa + pb) * 0.5);
                        mesh.normals.push((mesh.normals[a as usize] + mesh.normals[b as usize]).normalize_or_zero());
                        mesh.positions.len() as u32 - 1
                    });
                }
            }
        }
        let mut new = Vec::with_capacity(old.len() * 2);
        for t in &old {
            let cut = edges(t).map(|(a, b)| middle.get(&(a.min(b), a.max(b))).copied());
            divide(*t, cut, &mut new);
        }
        let done = new.len() == old.len();
        mesh.triangles = new;
        if done {
            break;
        }
    }
}

fn edges(&[a, b, c]: &[u32; 3]) -> [(u32, u32); 3] {
    [(a, b), (b, c), (c, a)]
}

fn is_flat(mesh: &WeldedMesh, t: &[u32; 3], min_cos: f32) -> bool {
    let [a, b, c] = t.map(|i| mesh.positions[i as usize]);
    let normal = (b - a).cross(c - a).normalize_or_zero();
    t.iter().all(|&i| mesh.normals[i as usize].dot(normal).abs() >= min_cos)
}

/// One triangle, cut at the middles of its edges ab, bc, ca.
fn divide([a, b, c]: [u32; 3], cut: [Option<u32>; 3], out: &mut Vec<[u32; 3]>) {
    match cut {
        [None, None, None] => out.push([a, b, c]),
        [Some(m), None, None] => out.extend([[a, m, c], [m, b, c]]),
        [Some(m), Some(n), None] => out.extend([[m, b, n], [a, m, n], [a, n, c]]),
        [Some(m), Some(n), Some(o)] => out.extend([[a, m, o], [m, b, n], [o, n, c], [m, n, o]]),
        // The remaining cases are these, turned by one corner.
        [x, y, z] => divide([b, c, a], [y, z, x], out),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn area(mesh: &WeldedMesh) -> f32 {
        let corner = |i: u32| mesh.positions[i as usize];
        mesh.triangles.iter().map(|&[a, b, c]| (corner(b) - corner(a)).cross(corner(c) - corner(a)).z * 0.5).sum()
    }

    #[test]
    fn a_quad_gets_fine_and_keeps_its_area_and_its_corners() {
        let corners = vec![Vec3::ZERO, Vec3::X * 4.0, Vec3::new(4.0, 3.0, 0.0), Vec3::Y * 3.0];
        let mut mesh = WeldedMesh {
            positions: corners.clone(),
            normals: vec![Vec3::Z; 4],
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            welded: Vec::new(),
        };
        tessellate(&mut mesh, &TessellationParams::default());
        assert_eq!(mesh.positions[..4], corners);
        assert!((area(&mesh) - 12.0).abs() < 1e-4);
        let longest = mesh
            .triangles
            .iter()
            .flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)])
            .map(|(a, b)| mesh.positions[a as usize].distance(mesh.positions[b as usize]))
            .fold(0.0, f32::max);
        assert!(longest <= 0.5, "{longest}");
        // No cracks: every edge inside the quad is shared by two triangles.
        let rings = mesh.rings();
        for v in 0..mesh.positions.len() as u32 {
            let p = mesh.positions[v as usize];
            let inside = p.x > 1e-4 && p.x < 4.0 - 1e-4 && p.y > 1e-4 && p.y < 3.0 - 1e-4;
            let mut ring: Vec<_> = mesh.ring(&rings, v).collect();
            assert_eq!(crate::surface::weld::is_interior(&mut ring), inside, "{p}");
        }
    }

    #[test]
    fn a_curved_edge_is_left_alone() {
        let mut mesh = WeldedMesh {
            positions: vec![Vec3::X, Vec3::Y, Vec3::Z],
            normals: vec![Vec3::X, Vec3::Y, Vec3::Z],
            triangles: vec![[0, 1, 2]],
            welded: Vec::new(),
        };
        tessellate(&mut mesh, &TessellationParams::default());
        assert_eq!(mesh.triangles.len(), 1);
    }
}
