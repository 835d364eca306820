//! Shape plugins.

use super::Builder;
use crate::Result;
use crate::exchange::mitsuba::params::Params;
use crate::exchange::mitsuba::tree::{Kind, Node};
use crate::scene::mesh::Mesh;
use crate::scene::{Emitter, mesh as shapes, primitives};
use glam::{DMat4, DVec3, Vec3};
use std::sync::Arc;

const KNOWN: &str = "obj, ply, serialized, rectangle, cube, sphere, disk, cylinder";

impl<'a> Builder<'a> {
    /// Adds a shape with its material and its light.
    pub(super) fn shape(&mut self, node: &'a Node) -> Result<()> {
        let mut params = self.params(node);
        let p = &mut params;
        let name = match (&node.id, p.has("filename")) {
            (Some(id), _) => id.clone(),
            (None, true) => p.file()?.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default(),
            (None, false) => node.plugin.clone(),
        };
        let mesh = self.mesh(p)?;
        let to_world = self.placed(p)?;
        // Mitsuba takes a mirrored sphere for one of negative radius, and its other shapes not.
        let inside_out = node.plugin == "sphere" && to_world.determinant() < 0.0;
        let flip = p.bool("flip_normals", false)? != inside_out;
        let face = p.bool("face_normals", false)?;
        let material = match p.children(Kind::Bsdf)?.as_slice() {
            [] => self.default_material(),
            [bsdf] => self.material(bsdf, &name)?,
            [_, second, ..] => return Err(second.at.error(format!("{}: a shape has one bsdf", node.plugin))),
        };
        let emitter = match p.children(Kind::Emitter)?.as_slice() {
            [] => None,
            [light] => Some(self.area_emitter(light)?),
            [_, second, ..] => return Err(second.at.error(format!("{}: a shape has one emitter", node.plugin))),
        };
        params.finish(&mut self.scene.warnings);
        let g = &mut self.scene.geometry;
        // A bit of a triangle's index is the tree's.
        let most = u32::MAX as usize / 2;
        if g.positions.len() + mesh.positions.len() > most || g.triangles.len() + mesh.triangles.len() > most {
            return Err(node.at.error(format!("the scene has more than {most} vertices or triangles")));
        }
        shapes::append(g, mesh, to_world.as_mat4(), flip, face, name, material, emitter);
        Ok(())
    }

    fn mesh(&mut self, p: &mut Params<'a>) -> Result<Mesh> {
        Ok(match p.node.plugin.as_str() {
            plugin @ ("obj" | "ply" | "serialized") => {
                p.file()?;
                if plugin == "serialized" {
                    p.integer("shape_index", 0, 0, i64::from(u32::MAX))?;
                }
                let mut mesh = Arc::unwrap_or_clone(self.assets.mesh(p.node)?);
                // OBJ files are turned when they are read, as Mitsuba does by default.
                if p.bool("flip_tex_coords", plugin == "obj")? != (plugin == "obj") {
                    mesh.flip_v();
                }
                mesh
            }
            "rectangle" => primitives::rectangle(),
            "cube" => primitives::cube(),
            "disk" => primitives::disk(),
            "sphere" => {
                let center = p.vector("center")?.unwrap_or(Vec3::ZERO);
                primitives::sphere(center, p.positive("radius", 1.0)?)
            }
            "cylinder" => {
                let (p0, p1) = (p.vector("p0")?.unwrap_or(Vec3::ZERO), p.vector("p1")?.unwrap_or(Vec3::Z));
                if p0 == p1 {
                    return Err(p.at("p1").error("cylinder: p0 and p1 are the same point"));
                }
                primitives::cylinder(p0, p1, p.positive("radius", 1.0)?)
            }
            _ => return Err(Self::unknown(p.node, "shape", KNOWN)),
        })
    }

    /// `to_world`, in the units that the command line asks for.
    pub(super) fn placed(&self, p: &mut Params<'a>) -> Result<DMat4> {
        Ok(DMat4::from_scale(DVec3::splat(f64::from(self.unit_scale))) * p.transform("to_world")?)
    }

    fn area_emitter(&mut self, node: &'a Node) -> Result<u32> {
        if node.plugin != "area" {
            return Err(node.at.error(format!("found the emitter \"{}\" in a shape, expected area", node.plugin)));
        }
        let mut params = self.params(node);
        params.accept(&["sampling_weight"]);
        let radiance = self.textured(&mut params, "radiance", 1.0)?;
        params.finish(&mut self.scene.warnings);
        let object = self.scene.geometry.objects.len() as u32;
        self.scene.emitters.push(Emitter::Area { object, radiance });
        Ok(self.scene.emitters.len() as u32 - 1)
    }
}
