//! Principal curvatures and directions at every vertex of the scene.
//!
//! *Paper* (§4.3): for each object, tessellate what is flat and coarse, estimate by Meyer et al. 2003, average with the neighbours whose
//! normals lie within 40 degrees, weighted by the normals' dot product and leaving boundary vertices out, hand back to the scene's vertices.
//! *Reading*: what is averaged is the curvature tensor, the vertex's own with weight 1; a vertex on the boundary takes its neighbours' mean.
//! *Ours*: a boundary vertex without an inner neighbour takes its curvature from the normals ([`meyer::from_normals`]);
//! objects with face normals are sets of planes, since a plane is what their mirror rays see: curvature 0.
//!
//! In: triangles with unit vertex normals. Out: curvature in 1/m, signed as [`Curvature`] says, relative to the vertex normal.

use super::meyer;
use super::paraboloid::Curvature;
use super::tessellate::{TessellationParams, tessellate};
use super::weld::{Rings, WeldedMesh, is_interior};
use crate::base::math::Basis;
use crate::base::progress::Progress;
use crate::scene::{Geometry, Object};
use glam::{Vec2, Vec3};
use rayon::prelude::*;

/// How curvature is estimated.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CurvatureParams {
    /// Vertices at one place are one vertex if their normals differ by less than this, degrees. *Ours*: enough for the rounding of files,
    /// less than the creases and facets that a file splits on purpose: mirror rays see no bend there.
    pub weld_degrees: f32,
    /// Neighbours are averaged if their normals differ by less than this, degrees. *Paper* (§4.3): 40.
    pub regularize_degrees: f32,
    /// Refinement of coarse flat parts.
    pub tessellation: TessellationParams,
}

impl Default for CurvatureParams {
    fn default() -> Self {
        Self { weld_degrees: 5.0, regularize_degrees: 40.0, tessellation: TessellationParams::default() }
    }
}

/// Curvature at each vertex of a scene; all three are as long as [`Geometry::positions`].
#[derive(Debug, Clone, Default, PartialEq)]
pub struct CurvatureMap {
    /// Larger principal curvature, 1/m; positive where convex seen from the vertex normal's side.
    pub k1: Vec<f32>,
    /// Smaller principal curvature, 1/m.
    pub k2: Vec<f32>,
    /// Unit tangent of `k1`; that of `k2` is n x d1.
    pub d1: Vec<Vec3>,
}

/// The curvature of every vertex of a scene.
pub fn curvature(geometry: &Geometry, params: &CurvatureParams, progress: &dyn Progress) -> CurvatureMap {
    progress.start("curvature", geometry.positions.len() as u64);
    let objects: Vec<Vec<Curvature>> = geometry
        .objects
        .par_iter()
        .map(|object| {
            let result = object_curvature(geometry, object, params);
            progress.advance(object.vertices.len() as u64);
            result
        })
        .collect();
    progress.finish();
    let count = geometry.positions.len();
    let mut map = CurvatureMap::flat(count);
    for (object, values) in geometry.objects.iter().zip(objects) {
        for (i, c) in object.vertices.clone().zip(values) {
            let i = i as usize;
            (map.k1[i], map.k2[i], map.d1[i]) = (c.k1, c.k2, c.d1);
        }
    }
    map
}

/// The curvature of each vertex of one object.
fn object_curvature(geometry: &Geometry, object: &Object, params: &CurvatureParams) -> Vec<Curvature> {
    let vertices = object.vertices.start as usize..object.vertices.end as usize;
    if object.face_normals {
        return vec![Curvature { k1: 0.0, k2: 0.0, d1: Vec3::X, d2: Vec3::Y }; vertices.len()];
    }
    let mut mesh = WeldedMesh::new(geometry, object, params.weld_degrees.to_radians().cos());
    let scene_vertices = mesh.positions.len();
    tessellate(&mut mesh, &params.tessellation);
    let rings = mesh.rings();
    let raw: Vec<Option<Curvature>> =
        (0..mesh.positions.len() as u32).into_par_iter().map(|v| estimate(&mesh, &rings, v)).collect();
    let min_cos = params.regularize_degrees.to_radians().cos();
    // What tessellation added has done its work: only the vertices that were there before are averaged and handed back.
    let averaged: Vec<Curvature> =
        (0..scene_vertices as u32).into_par_iter().map(|v| regularize(&mesh, &rings, &raw, v, min_cos)).collect();
    let own = |(i, normal): (usize, &Vec3)| {
        let c = averaged[mesh.welded[i] as usize];
        let frame = Basis::from_normal_and_tangent(*normal, c.d1);
        Curvature { d1: frame.s, d2: frame.t, ..c }
    };
    geometry.normals[vertices].iter().enumerate().map(own).collect()
}

/// Meyer's estimate where the vertex has a whole ring and a normal.
fn estimate(mesh: &WeldedMesh, rings: &Rings, v: u32) -> Option<Curvature> {
    let mut ring: Vec<_> = mesh.ring(rings, v).collect();
    let normal = mesh.normals[v as usize];
    if normal == Vec3::ZERO || !is_interior(&mut ring) {
        return None;
    }
    let corners: Vec<_> = ring.iter().map(|&(a, b)| (mesh.positions[a as usize], mesh.positions[b as usize])).collect();
    Some(meyer::curvature(mesh.positions[v as usize], normal, &corners))
}

/// Mean of the tensors of a vertex and its neighbours.
fn regularize(mesh: &WeldedMesh, rings: &Rings, raw: &[Option<Curvature>], v: u32, min_cos: f32) -> Curvature {
    let normal = mesh.normals[v as usize];
    if normal == Vec3::ZERO {
        return Curvature { k1: 0.0, k2: 0.0, d1: Vec3::X, d2: Vec3::Y };
    }
    let frame = Basis::from_normal(normal);
    let mut sum = [0.0f32; 3];
    let mut total = 0.0;
    let mut add = |c: &Option<Curvature>, weight: f32| {
        if let Some(c) = c {
            let tensor = c.tensor(&frame);
            (0..3).for_each(|i| sum[i] += tensor[i] * weight);
            total += weight;
        }
    };
    add(&raw[v as usize], 1.0);
    for (a, b) in mesh.ring(rings, v) {
        // Each neighbour of a whole ring comes twice, once from either side.
        for j in [a, b] {
            let cos = normal.dot(mesh.normals[j as usize]);
            if cos > min_cos {
                add(&raw[j as usize], 0.5 * cos);
            }
        }
    }
    if total > 0.0 {
        return Curvature::from_tensor(&frame, sum.map(|x| x / total));
    }
    let corner = |i: u32| (mesh.positions[i as usize], mesh.normals[i as usize]);
    meyer::from_normals(normal, mesh.ring(rings, v).map(|(a, b)| [corner(v), corner(a), corner(b)]))
}

impl CurvatureMap {
    /// No curvature at any of a scene's `count` vertices: for methods that do not ask for it.
    pub fn flat(count: usize) -> Self {
        Self { k1: vec![0.0; count], k2: vec![0.0; count], d1: vec![Vec3::X; count] }
    }

    /// Curvature at the point of `triangle` with the weights `barycentric` of its second and third vertex, relative to the unit
    /// shading normal `normal` there: where that was turned to face the viewer, against the vertex normals, the signs turn too.
    /// Interpolates the tensor, not the directions, which may jump.
    pub fn at(&self, geometry: &Geometry, triangle: u32, barycentric: Vec2, normal: Vec3) -> Curvature {
        let corners = geometry.triangles[triangle as usize].map(|i| i as usize);
        if geometry.object(triangle).face_normals || corners.iter().all(|&i| self.k1[i] == 0.0 && self.k2[i] == 0.0) {
            return Curvature::plane(normal);
        }
        let frame = Basis::from_normal(normal);
        let weights = [1.0 - barycentric.x - barycentric.y, barycentric.x, barycentric.y];
        let mut sum = [0.0f32; 3];
        let mut side = 0.0;
        for (i, weight) in corners.into_iter().zip(weights) {
            let c = Curvature { k1: self.k1[i], k2: self.k2[i], d1: self.d1[i], d2: Vec3::ZERO };
            let tensor = c.tensor(&frame);
            (0..3).for_each(|j| sum[j] += tensor[j] * weight);
            side += geometry.normals[i].dot(normal) * weight;
        }
        let sign = if side < 0.0 { -1.0 } else { 1.0 };
        Curvature::from_tensor(&frame, sum.map(|x| x * sign))
    }
}
