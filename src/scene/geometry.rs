//! Triangles of all shapes in one set of arrays.

use super::Round;
use glam::{Vec2, Vec3};

/// World-space triangles of all objects. Vertices are not shared between objects.
#[derive(Debug, Default, Clone)]
pub struct Geometry {
    /// Vertex positions.
    pub positions: Vec<Vec3>,
    /// Unit shading normals, one a vertex; for objects with face normals they are unused.
    pub normals: Vec<Vec3>,
    /// Texture coordinates, one a vertex; zero where the file has none.
    pub uvs: Vec<Vec2>,
    /// Second texture coordinates, as a file has them for light maps, which nothing but an export reads: [`Self::light_corners`]. One a vertex,
    /// NaN for vertices without; those past the end have none either.
    pub light_uvs: Vec<Vec2>,
    /// Vertex indices of each triangle.
    pub triangles: Vec<[u32; 3]>,
    /// The object that each triangle belongs to.
    pub triangle_object: Vec<u32>,
    /// The objects, one a shape, in file order.
    pub objects: Vec<Object>,
    /// Round shapes that rays meet as such, not as their meshes; ascending by triangles.
    pub rounds: Vec<Round>,
}

/// One shape of the scene file.
#[derive(Debug, Clone, serde::Serialize)]
pub struct Object {
    /// The shape's id, or its file's stem.
    #[serde(skip)]
    pub name: String,
    /// Its triangles in [`Geometry::triangles`].
    pub triangles: std::ops::Range<u32>,
    /// Its vertices in [`Geometry::positions`].
    pub vertices: std::ops::Range<u32>,
    /// Index into `Scene::materials`.
    pub material: u32,
    /// Index into `Scene::emitters`.
    pub emitter: Option<u32>,
    /// Shade with the geometric normal (`face_normals`). A file without normals has smooth ones otherwise.
    pub face_normals: bool,
    /// Whether the file gave texture coordinates.
    pub has_uvs: bool,
}

impl Geometry {
    /// Corners of a triangle.
    pub fn corners(&self, triangle: u32) -> [Vec3; 3] {
        self.triangles[triangle as usize].map(|i| self.positions[i as usize])
    }

    /// Second texture coordinates of a triangle's corners, where it has any.
    pub fn light_corners(&self, triangle: u32) -> Option<[Vec2; 3]> {
        let [a, b, c] = self.triangles[triangle as usize].map(|i| self.light_uvs.get(i as usize).filter(|uv| uv.is_finite()));
        Some([*a?, *b?, *c?])
    }

    /// Gives second texture coordinates to the last vertices, as many as there are of them.
    pub fn set_last_light_uvs(&mut self, light_uvs: Vec<Vec2>) {
        if let Some(before) = self.positions.len().checked_sub(light_uvs.len())
            && !light_uvs.is_empty()
        {
            self.light_uvs.resize(before, Vec2::NAN);
            self.light_uvs.extend(light_uvs);
        }
    }

    /// The object of a triangle.
    pub fn object(&self, triangle: u32) -> &Object {
        &self.objects[self.triangle_object[triangle as usize] as usize]
    }

    /// The round shape that a triangle belongs to, as an index into [`Geometry::rounds`].
    pub fn round(&self, triangle: u32) -> Option<u32> {
        let after = self.rounds.partition_point(|r| r.first <= triangle);
        let index = after.checked_sub(1)?;
        let object = &self.objects[self.rounds[index].object as usize];
        object.triangles.contains(&triangle).then_some(index as u32)
    }

    /// A copy that so many more vertices and triangles fit in without being moved.
    pub fn with_room(&self, vertices: usize, triangles: usize) -> Self {
        fn copy<T: Clone>(list: &[T], more: usize) -> Vec<T> {
            let mut copy = Vec::with_capacity(list.len() + more);
            copy.extend_from_slice(list);
            copy
        }
        Self {
            positions: copy(&self.positions, vertices),
            normals: copy(&self.normals, vertices),
            uvs: copy(&self.uvs, vertices),
            light_uvs: self.light_uvs.clone(),
            triangles: copy(&self.triangles, triangles),
            triangle_object: copy(&self.triangle_object, triangles),
            objects: self.objects.clone(),
            rounds: self.rounds.clone(),
        }
    }

    /// Geometric normal times twice the area. `flipNormals` is already in the winding.
    pub fn area_normal(&self, triangle: u32) -> Vec3 {
        let [a, b, c] = self.corners(triangle);
        (b - a).cross(c - a)
    }

    /// Shading normals at a triangle's corners, where `ng` is its unit geometric normal.
    pub fn shading_normals(&self, triangle: u32, ng: Vec3) -> [Vec3; 3] {
        if self.object(triangle).face_normals {
            return [ng; 3];
        }
        self.triangles[triangle as usize].map(|i| self.normals[i as usize])
    }

    /// Lower and upper corner of everything; (inf, -inf) for an empty scene.
    pub fn bounds(&self) -> (Vec3, Vec3) {
        self.positions.iter().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(lo, hi), &p| (lo.min(p), hi.max(p)))
    }
}
