//! Shape plugins.

use super::Builder;
use super::attribute::Current;
use super::round::{cylinder, described, is_stretched, sphere, uniform};
use crate::base::math::Rgb;
use crate::exchange::mitsuba::params::Params;
use crate::exchange::mitsuba::tree::{Kind, Node};
use crate::material::bsdf::{Bsdf, Diffuse};
use crate::material::{Material, Texture};
use crate::scene::mesh::{Mesh, append, swaps_corners};
use crate::scene::{Emitter, primitives};
use crate::{Error, Result};
use glam::{DMat4, DVec3};
use std::sync::Arc;

const KNOWN: &str = "obj, ply, serialized, rectangle, cube, sphere, disk, cylinder, merge, shapegroup, instance";

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
        let round = match self.crowd.get(&(node as *const Node)) {
            Some(&cells) => self.round_space(p)?.map(|(kind, to_world)| (kind, to_world, cells)),
            None => None,
        };
        let (mesh, to_world) = match round {
            Some((kind, to_world, cells)) => (Ok(kind.mesh(cells)), to_world),
            None if node.plugin == "sphere" => (self.mesh(p), uniform(&self.placed(p)?)),
            None => (self.mesh(p), self.placed(p)?),
        };
        let flip = p.bool("flip_normals", false)? != (node.plugin == "sphere" && self.is_inside_out(p)?);
        let face = p.bool("face_normals", false)?;
        // An instance that mirrors takes the sides with it; where the file has normals, `append` does so anyway.
        let by_winding = mesh.as_ref().is_ok_and(|m| face || m.normals.is_empty());
        let flip = flip != (by_winding && self.instance_mirrors());
        let swapped = mesh.as_ref().is_ok_and(|m| swaps_corners(m, &to_world.as_mat4(), flip, face));
        self.current = Some(Current { node, swapped });
        let material = match p.children(Kind::Bsdf)?.as_slice() {
            [] if !p.children(Kind::Emitter)?.is_empty() => Ok(self.lamp_material()),
            [] => Ok(self.default_material()),
            [bsdf] => self.material(bsdf, &name),
            [_, second, ..] => return Err(second.at.error(format!("{}: a shape has one bsdf", node.plugin))),
        };
        let emitter = match p.children(Kind::Emitter)?.as_slice() {
            [] => Ok(None),
            [light] => self.area_emitter(light).map(Some),
            [_, second, ..] => return Err(second.at.error(format!("{}: a shape has one emitter", node.plugin))),
        };
        self.current = None;
        let emitter = self.or_left_out(emitter, "its light is left out").map(Option::flatten);
        let (mesh, (material, emitter)) = Error::both(mesh, Error::both(material, emitter))?;
        if mesh.triangles.is_empty() {
            params.warn(node.at.warning(format!("\"{name}\" has no faces: nothing of it is seen")));
            params.finish(&mut self.scene.warnings);
            emitter.map(|_| self.scene.emitters.pop());
            return Ok(());
        }
        params.finish(&mut self.scene.warnings);
        let g = self.scene.geometry_mut();
        // A bit of a triangle's index is the tree's.
        let most = u32::MAX as usize / 2;
        if g.positions.len() + mesh.positions.len() > most || g.triangles.len() + mesh.triangles.len() > most {
            return Err(node.at.error(format!("the scene has more than {most} vertices or triangles")));
        }
        if let Some((kind, to_world, cells)) = round {
            let (first, object) = (g.triangles.len() as u32, g.objects.len() as u32);
            g.rounds.push(described(kind, to_world, cells, flip, first, object));
        }
        append(g, mesh, to_world.as_mat4(), flip, face && round.is_none(), name, material, emitter);
        Ok(())
    }

    /// Whether a sphere's normals point inwards: Mitsuba takes a mirrored one for one of negative radius, and its other shapes not.
    fn is_inside_out(&self, p: &mut Params<'a>) -> Result<bool> {
        if is_stretched(&self.placed(p)?) {
            let message = "a sphere keeps its shape, as in Mitsuba: it is scaled as along x in all directions";
            p.warn(p.at("to_world").warning(message));
        }
        let mirrored = p.transform("to_world")?.determinant() < 0.0;
        Ok(mirrored != (p.f32("radius", 1.0)? < 0.0))
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
                let (center, radius) = sphere(p)?;
                primitives::sphere(center.as_vec3(), radius as f32)
            }
            "cylinder" => {
                let (p0, p1, radius) = cylinder(p)?;
                primitives::cylinder(p0, p1, radius as f32)
            }
            _ => return Err(Self::unknown(p.node, "shape", KNOWN)),
        })
    }

    /// `to_world`, in the units that the command line asks for.
    pub(super) fn placed(&self, p: &mut Params<'a>) -> Result<DMat4> {
        Ok(DMat4::from_scale(DVec3::splat(f64::from(self.unit_scale))) * self.within_instance(p)?)
    }

    /// What a shape that emits gets without a scattering model: it reflects nothing, in Mitsuba too.
    fn lamp_material(&mut self) -> u32 {
        *self.lamp_material.get_or_insert_with(|| {
            let bsdf = Bsdf::Diffuse(Diffuse { reflectance: Texture::Constant(Rgb::ZERO) });
            self.scene.materials.push(Material { name: "lamp".into(), bsdf, opacity: None });
            self.scene.materials.len() as u32 - 1
        })
    }

    fn area_emitter(&mut self, node: &'a Node) -> Result<u32> {
        if node.plugin != "area" {
            return Err(node.at.unsupported(format!("found the emitter \"{}\" in a shape, expected area", node.plugin)));
        }
        let mut params = self.params(node);
        params.accept(&["sampling_weight"]);
        let radiance = self.textured(&mut params, "radiance", 1.0)?;
        if matches!(radiance, Texture::Attribute(_)) {
            params.warn(node.at.warning("area: of a mesh_attribute the mean is taken"));
        }
        params.finish(&mut self.scene.warnings);
        let object = self.scene.geometry.objects.len() as u32;
        self.scene.emitters.push(Emitter::Area { object, radiance });
        Ok(self.scene.emitters.len() as u32 - 1)
    }
}
