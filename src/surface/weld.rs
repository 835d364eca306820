//! One object as a mesh without seams, and who touches whom in it.
//!
//! Files split vertices where texture coordinates or normals jump; a discrete operator needs the surface whole.
//! *Ours*: vertices at exactly the same position are one if their normals agree to within a few degrees; a crease stays split, and is
//! then a boundary of the mesh.

use crate::scene::{Geometry, Object};
use glam::Vec3;

/// An object's triangles over welded vertices.
#[derive(Debug, Default, Clone)]
pub struct WeldedMesh {
    /// Vertex positions.
    pub positions: Vec<Vec3>,
    /// Unit vertex normals (zero where the file's cancel out).
    pub normals: Vec<Vec3>,
    /// Triangles of three different vertices and an area above zero.
    pub triangles: Vec<[u32; 3]>,
    /// The welded vertex of each of the object's vertices, counted from the object's first.
    pub welded: Vec<u32>,
}

/// The triangles about each vertex (compressed rows).
pub struct Rings {
    start: Vec<u32>,
    triangles: Vec<u32>,
}

impl WeldedMesh {
    /// Welds an object's vertices whose positions agree and whose normals differ by less than the angle of cosine `min_cos`.
    pub fn new(geometry: &Geometry, object: &Object, min_cos: f32) -> Self {
        let (first, last) = (object.vertices.start as usize, object.vertices.end as usize);
        let positions = &geometry.positions[first..last];
        let normals = &geometry.normals[first..last];
        // Adding zero turns -0 into +0, so that equal positions have equal bits.
        let key = |i: u32| (positions[i as usize] + Vec3::ZERO).to_array().map(f32::to_bits);
        let mut order: Vec<([u32; 3], u32)> = (0..positions.len() as u32).map(|i| (key(i), i)).collect();
        order.sort_unstable();
        let mut mesh = Self { welded: vec![0; positions.len()], ..Self::default() };
        let mut sums: Vec<Vec3> = Vec::new();
        let mut seeds: Vec<Vec3> = Vec::new();
        for group in order.chunk_by(|a, b| a.0 == b.0) {
            let begin = mesh.positions.len();
            for &(_, i) in group {
                let n = normals[i as usize];
                let found = (begin..mesh.positions.len()).find(|&w| seeds[w].dot(n) >= min_cos);
                let w = found.unwrap_or_else(|| {
                    mesh.positions.push(positions[i as usize]);
                    sums.push(Vec3::ZERO);
                    seeds.push(n);
                    mesh.positions.len() - 1
                });
                sums[w] += n;
                mesh.welded[i as usize] = w as u32;
            }
        }
        mesh.normals = sums.into_iter().map(Vec3::normalize_or_zero).collect();
        let range = object.triangles.start as usize..object.triangles.end as usize;
        for t in &geometry.triangles[range] {
            let [a, b, c] = t.map(|i| mesh.welded[i as usize - first]);
            let [pa, pb, pc] = [a, b, c].map(|i| mesh.positions[i as usize]);
            let area = (pb - pa).cross(pc - pa).length_squared();
            if a != b && b != c && c != a && area > 0.0 && area.is_finite() {
                mesh.triangles.push([a, b, c]);
            }
        }
        mesh
    }

    /// The triangles about each vertex.
    pub fn rings(&self) -> Rings {
        let mut start = vec![0u32; self.positions.len() + 1];
        for &v in self.triangles.iter().flatten() {
            start[v as usize + 1] += 1;
        }
        for i in 1..start.len() {
            start[i] += start[i - 1];
        }
        let mut next = start.clone();
        let mut triangles = vec![0u32; self.triangles.len() * 3];
        for (t, corners) in self.triangles.iter().enumerate() {
            for &v in corners {
                triangles[next[v as usize] as usize] = t as u32;
                next[v as usize] += 1;
            }
        }
        Rings { start, triangles }
    }

    /// The edges opposite vertex `v` in its triangles, as (next, previous) vertex in winding order.
    pub fn ring<'a>(&'a self, rings: &'a Rings, v: u32) -> impl Iterator<Item = (u32, u32)> + 'a {
        let range = rings.start[v as usize] as usize..rings.start[v as usize + 1] as usize;
        rings.triangles[range].iter().map(move |&t| {
            let [a, b, c] = self.triangles[t as usize];
            if a == v {
                (b, c)
            } else if b == v {
                (c, a)
            } else {
                (a, b)
            }
        })
    }
}

/// Whether the edges opposite a vertex close to one cycle: the surface is a disk about it. `ring` gets sorted.
pub fn is_interior(ring: &mut [(u32, u32)]) -> bool {
    if ring.len() < 3 {
        return false;
    }
    ring.sort_unstable();
    if ring.windows(2).any(|w| w[0].0 == w[1].0) {
        return false;
    }
    let first = ring[0].0;
    let mut at = ring[0].1;
    for step in 1..=ring.len() {
        if at == first {
            return step == ring.len();
        }
        match ring.binary_search_by_key(&at, |e| e.0) {
            Ok(i) => at = ring[i].1,
            Err(_) => return false,
        }
    }
    false
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_closed_cycle_is_interior_and_nothing_else_is() {
        assert!(is_interior(&mut [(1, 2), (3, 1), (2, 3)]));
        assert!(!is_interior(&mut [(1, 2), (2, 3)]), "open fan");
        assert!(!is_interior(&mut [(1, 2), (2, 3), (3, 4)]), "open fan of three");
        assert!(!is_interior(&mut [(1, 2), (2, 3), (3, 1), (4, 5), (5, 6), (6, 4)]), "two fans in one point");
        assert!(!is_interior(&mut [(1, 2), (1, 3), (3, 1)]), "three triangles on an edge");
    }

    #[test]
    fn a_uv_seam_is_welded_and_a_crease_is_not() {
        let geometry = Geometry {
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::X, Vec3::new(1.0, 1.0, 0.0), Vec3::Y, Vec3::X, -Vec3::ZERO],
            normals: vec![Vec3::Z, Vec3::Z, Vec3::Z, Vec3::Z, Vec3::Z, Vec3::Z, Vec3::X, Vec3::Z],
            triangles: vec![[0, 1, 2], [3, 4, 5]],
            ..Geometry::default()
        };
        let object = Object {
            name: String::new(),
            triangles: 0..2,
            vertices: 0..8,
            material: 0,
            emitter: None,
            face_normals: false,
            has_uvs: false,
        };
        let mesh = WeldedMesh::new(&geometry, &object, 40f32.to_radians().cos());
        assert_eq!(mesh.welded[1], mesh.welded[3]);
        assert_eq!(mesh.welded[2], mesh.welded[5]);
        assert_eq!(mesh.welded[0], mesh.welded[7], "minus zero is zero");
        assert_ne!(mesh.welded[1], mesh.welded[6]);
        assert_eq!(mesh.positions.len(), 5);
        assert_eq!(mesh.triangles.len(), 2);
    }
}
