//! Mesh files.

pub mod obj;
pub mod ply;
pub mod serialized;

use crate::base::math::Rgb;
use crate::scene::mesh::{self, Mesh};

/// What a mesh file holds.
#[derive(Debug, Default, Clone)]
pub struct MeshFile {
    /// Its triangles.
    pub mesh: Mesh,
    /// Values of its vertices or faces, for `mesh_attribute` textures.
    pub attributes: Vec<MeshAttribute>,
}

impl MeshFile {
    /// `Err` with what is wrong where a triangle asks for a vertex that is not there, or a number is not finite.
    fn check(&self) -> std::result::Result<(), String> {
        mesh::check(&self.mesh)?;
        for MeshAttribute { name, values } in &self.attributes {
            if let Some(i) = values.iter().position(|v| !v.is_finite()) {
                return Err(format!("{name} {i} is {}, expected finite numbers", values[i]));
            }
        }
        Ok(())
    }
}

/// Values of a mesh's vertices or triangles.
#[derive(Debug, Clone, PartialEq)]
pub struct MeshAttribute {
    /// As Mitsuba calls it: `vertex_color`, `face_color`, `vertex_` or `face_` and a name of the file's.
    pub name: String,
    /// One value a vertex, or one a triangle where the name begins with `face_`. A single number is all three.
    pub values: Vec<Rgb>,
}

impl MeshAttribute {
    /// Whether it has one value a triangle, not a vertex.
    pub fn is_of_faces(&self) -> bool {
        self.name.starts_with("face_")
    }
}
