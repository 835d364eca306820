//! Which triangles of one object meet along an edge, and whether the shading is smooth across it.
//!
//! Vertices are welded by position first: files repeat them along texture seams and creases.
//! *Ours*: where more than two triangles share an edge (a sheet modelled with both its sides),
//! those whose normals agree best are paired, so that each side stays one surface.

use crate::scene::Geometry;
use glam::Vec3;
use std::collections::HashMap;

/// No triangle.
pub const NONE: u32 = u32::MAX;

/// Cosine of the angle up to which two shading normals count as one (2.6 degrees).
const SMOOTH_COS: f32 = 0.999;

/// The neighbours of an object's triangles. Edge `e` goes from corner `e` to corner `e + 1`.
#[derive(Debug, Clone, Default)]
pub struct Adjacency {
    /// The object's first triangle: index 0 of the arrays.
    pub first: u32,
    /// Neighbour (global triangle index) and its edge across each edge; ([`NONE`], 0) at borders.
    pub across: Vec<[(u32, u8); 3]>,
    /// Whether shading normals agree along each edge.
    pub smooth: Vec<[bool; 3]>,
    /// Unit geometric normals; zero for degenerate triangles.
    pub normals: Vec<Vec3>,
    /// Areas.
    pub areas: Vec<f32>,
}

/// Welds and pairs the triangles of `geometry.objects[object]`.
pub fn adjacency(geometry: &Geometry, object: usize) -> Adjacency {
    let o = &geometry.objects[object];
    let (first, count) = (o.triangles.start, o.triangles.len());
    let mut welded: HashMap<[u32; 3], u32> = HashMap::new();
    let mut ids = Vec::with_capacity(count);
    let (mut normals, mut areas) = (Vec::with_capacity(count), Vec::with_capacity(count));
    for t in o.triangles.clone() {
        ids.push(geometry.triangles[t as usize].map(|v| {
            // Adding zero makes one of the two zeros.
            let key = (geometry.positions[v as usize] + Vec3::ZERO).to_array().map(f32::to_bits);
            let next = welded.len() as u32;
            *welded.entry(key).or_insert(next)
        }));
        let n = geometry.area_normal(t);
        normals.push(n.try_normalize().unwrap_or(Vec3::ZERO));
        areas.push(0.5 * n.length());
    }
    // One entry an edge: its welded ends (lower first), then whether it runs from the lower one, triangle and edge.
    let mut edges = Vec::with_capacity(3 * count);
    for (t, id) in ids.iter().enumerate() {
        if normals[t] == Vec3::ZERO || id[0] == id[1] || id[1] == id[2] || id[2] == id[0] {
            continue;
        }
        for e in 0..3u8 {
            let (a, b) = (id[e as usize], id[(e as usize + 1) % 3]);
            edges.push(((a.min(b), a.max(b)), a < b, t as u32, e));
        }
    }
    edges.sort_unstable();
    let mut adjacency = Adjacency { first, across: vec![[(NONE, 0); 3]; count], smooth: vec![[false; 3]; count], normals, areas };
    for group in edges.chunk_by(|a, b| a.0 == b.0) {
        let split = group.partition_point(|x| !x.1);
        let (backward, forward) = group.split_at(split);
        let mut free: Vec<_> = backward.iter().collect();
        for &(_, _, t, e) in forward {
            let score = |x: u32| adjacency.normals[t as usize].dot(adjacency.normals[x as usize]);
            let best = (0..free.len()).max_by(|&a, &b| score(free[a].2).total_cmp(&score(free[b].2)).then(b.cmp(&a)));
            let Some(best) = best else { break };
            let &(_, _, t2, e2) = free.remove(best);
            adjacency.across[t as usize][e as usize] = (first + t2, e2);
            adjacency.across[t2 as usize][e2 as usize] = (first + t, e);
            let smooth = is_smooth(geometry, o.face_normals, &adjacency.normals, first, (t, e), (t2, e2));
            adjacency.smooth[t as usize][e as usize] = smooth;
            adjacency.smooth[t2 as usize][e2 as usize] = smooth;
        }
    }
    adjacency
}

fn is_smooth(geometry: &Geometry, face_normals: bool, normals: &[Vec3], first: u32, a: (u32, u8), b: (u32, u8)) -> bool {
    if face_normals {
        return normals[a.0 as usize].dot(normals[b.0 as usize]) > SMOOTH_COS;
    }
    let normal = |t: u32, corner: u8| {
        let v = geometry.triangles[(first + t) as usize][corner as usize % 3];
        geometry.normals.get(v as usize).copied().unwrap_or_default()
    };
    // The edges run in opposite directions: the start of one is the end of the other.
    normal(a.0, a.1).dot(normal(b.0, b.1 + 1)) > SMOOTH_COS && normal(a.0, a.1 + 1).dot(normal(b.0, b.1)) > SMOOTH_COS
}
