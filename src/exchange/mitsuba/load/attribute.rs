//! `mesh_attribute`: a texture that a shape's own file gives, vertex by vertex or face by face.

use super::Builder;
use crate::Result;
use crate::base::math::Rgb;
use crate::exchange::mitsuba::params::Params;
use crate::exchange::mitsuba::tree::Node;
use crate::material::Texture;
use crate::material::texture::Attribute;
use std::sync::Arc;

/// The shape whose material is being built.
#[derive(Clone, Copy)]
pub(super) struct Current<'a> {
    pub node: &'a Node,
    /// Whether its triangles join the scene with their second and third corner swapped.
    pub swapped: bool,
}

impl<'a> Builder<'a> {
    /// The values of the current shape. A material that uses them is of that shape alone.
    pub(super) fn mesh_attribute(&mut self, p: &mut Params<'a>) -> Result<Texture> {
        let Some(name) = p.text("name")? else { return Err(p.node.at.error("mesh_attribute has no \"name\"")) };
        let scale = p.f32("scale", 1.0)?;
        self.of_one_shape = true;
        // By itself, it waits for a shape that refers to it.
        let Some(Current { node, swapped }) = self.current else { return Ok(Texture::Constant(Rgb::splat(0.5))) };
        let attributes = self.assets.attributes(node);
        let Some(found) = attributes.iter().find(|a| a.name == name) else {
            let known: Vec<&str> = attributes.iter().map(|a| a.name.as_str()).collect();
            let known = if known.is_empty() { "none".to_owned() } else { known.join(", ") };
            let shape = format!("the {} at line {}", node.plugin, node.at.line);
            return Err(p.at("name").error(format!("{shape} has no attribute \"{name}\": it has {known}")));
        };
        let corners = match found.is_of_faces() {
            true => Vec::new(),
            false => {
                self.assets.mesh(node)?.triangles.iter().map(|&[a, b, c]| if swapped { [a, c, b] } else { [a, b, c] }).collect()
            }
        };
        let first_triangle = self.scene.geometry.triangles.len() as u32;
        let values = found.values.iter().map(|v| v * scale).collect();
        Ok(Texture::Attribute(Arc::new(Attribute { first_triangle, values, corners })))
    }
}
