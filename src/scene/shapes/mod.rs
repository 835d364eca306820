//! Shape plugins: each becomes a [`Mesh`].

use glam::{Vec2, Vec3};

/// One shape's triangles before they join the scene, in world space (or in local space where a loader's doc says so).
#[derive(Debug, Default, Clone)]
pub struct Mesh {
    /// Vertex positions.
    pub positions: Vec<Vec3>,
    /// Unit vertex normals; empty where the shape has none (it is then shaded with face normals).
    pub normals: Vec<Vec3>,
    /// Texture coordinates; empty where the shape has none.
    pub uvs: Vec<Vec2>,
    /// Vertex indices.
    pub triangles: Vec<[u32; 3]>,
}
