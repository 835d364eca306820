//! glTF 2.0, `.gltf` or `.glb`: what Blender and most other programs write.
//!
//! Metallic-roughness becomes our `principled`; surfaces are seen from both sides. What a path tracer has no use for (occlusion, tangents)
//! is passed over, and what it lacks is told.

mod accessor;
mod file;
mod materials;
mod meshes;
mod nodes;
mod textures;

use super::{LoadOptions, MAX_TRIANGLES, finish};
use crate::base::math::Rgb;
use crate::material::texture::Attribute;
use crate::material::{Material, Texture};
use crate::scene::mesh::append;
use crate::scene::{Emitter, Scene};
use crate::{Error, Result};
use file::File;
use glam::DMat4;
use gltf_json::mesh::Primitive;
use gltf_json::scene::Node;
use materials::{Look, Reader};
use meshes::Part;
use std::path::Path;
use std::sync::Arc;
use textures::Textures;

/// Loads the bytes of a glTF file.
pub fn decode(path: &Path, bytes: &[u8], options: &LoadOptions) -> Result<Scene> {
    if let Some((name, _)) = options.defines.first() {
        return Err(Error::input(path, format!("-D {name}: a glTF file has no parameters")));
    }
    let mut warnings = Vec::new();
    let file = File::open(path, bytes, options.skip_unsupported, &mut warnings)?;
    let looks = looks(&file, options.allow_truncated, &mut warnings)?;
    finish::in_metres(path, options.unit_scale, |unit_scale| {
        let scene = Scene { path: path.to_owned(), warnings: warnings.clone(), unit_scale, ..Scene::default() };
        Builder { file: &file, looks: &looks, unit_scale: unit_scale.0, scene, shared: vec![None; 2 * looks.len()] }.scene()
    })
}

/// What each material looks like, and last the one of primitives without any.
fn looks(file: &File, allow_truncated: bool, warnings: &mut Vec<String>) -> Result<Vec<Look>> {
    let mut textures = Textures::default();
    let default = gltf_json::Material::default();
    let all = |textures: &mut Textures, warnings: &mut Vec<String>| {
        let materials = file.root.materials.iter().chain([&default]).enumerate();
        let look = |(i, material): (usize, &gltf_json::Material)| {
            Reader { file, textures, warnings }.look(material, &name(&material.name, "material", i))
        };
        Error::gather(materials.map(look).collect::<Vec<_>>())
    };
    all(&mut textures, warnings)?;
    textures.read(file, allow_truncated, warnings)?;
    all(&mut textures, warnings)
}

fn name(given: &Option<String>, what: &str, number: usize) -> String {
    given.clone().unwrap_or_else(|| format!("{what}.{number}"))
}

/// Builds a scene node by node.
struct Builder<'a> {
    file: &'a File,
    looks: &'a [Look],
    unit_scale: f32,
    scene: Scene,
    /// The scene's material of each look, for upright texture coordinates and for mirrored ones.
    shared: Vec<Option<u32>>,
}

impl Builder<'_> {
    fn scene(mut self) -> Result<Scene> {
        let placed = nodes::placed(self.file, self.unit_scale)?;
        self.count(&placed.shown)?;
        let added = placed.shown.iter().map(|&i| {
            let (node, to_world) = (&self.file.root.nodes[i], &placed.to_world[i]);
            self.mesh(node, i, &placed.to_world)?;
            self.light(node, to_world)?;
            self.camera(node, to_world)
        });
        Error::gather(added.collect::<Vec<_>>())?;
        let path = self.file.path.display();
        // Of a model by itself, glowing parts are not what it is to be seen by.
        let is_model = self.scene.sensor.is_none() && self.scene.emitters.iter().all(|e| matches!(e, Emitter::Area { .. }));
        if self.scene.emitters.is_empty() || is_model {
            let what = if self.scene.emitters.is_empty() { "no light" } else { "no camera, and no light but what glows" };
            self.scene.warnings.push(format!("{path} has {what}: the same white light comes from all sides"));
            self.scene.emitters.push(Emitter::Constant { radiance: Rgb::ONE });
        }
        if self.scene.sensor.is_none() {
            self.stand_back();
            self.scene.warnings.push(format!("{path} has no camera: one looks at all of it from before"));
        }
        Ok(self.scene)
    }

    /// An error where the triangles or their vertices would be too many, before the first is read.
    fn count(&self, shown: &[usize]) -> Result<()> {
        type Count = fn(&gltf_json::Root, &Primitive) -> u64;
        let counts: [(&str, Count, usize); 2] = [
            ("triangles", meshes::triangle_count, MAX_TRIANGLES),
            // Primitives may share the vertices that each then has a copy of.
            ("vertices", meshes::vertex_count, 3 * MAX_TRIANGLES),
        ];
        let root = &self.file.root;
        for (what, count, most) in counts {
            let of = |primitives: &[Primitive]| primitives.iter().map(|p| count(root, p)).fold(0, u64::saturating_add);
            let of_mesh: Vec<u64> = root.meshes.iter().map(|mesh| of(&mesh.primitives)).collect();
            let of_node = |i: &usize| root.nodes[*i].mesh.and_then(|mesh| of_mesh.get(mesh.value())).copied().unwrap_or(0);
            let all = shown.iter().map(of_node).fold(0, u64::saturating_add);
            if all > most as u64 {
                return Err(self.file.error(format!("the scene has {all} {what}, expected at most {most}")));
            }
        }
        Ok(())
    }

    fn mesh(&mut self, node: &Node, number: usize, placed: &[DMat4]) -> Result<()> {
        let Some(index) = node.mesh else { return Ok(()) };
        let mesh = self.file.get(index, "mesh")?;
        let weights = node.weights.as_ref().or(mesh.weights.as_ref()).map_or(&[][..], Vec::as_slice);
        for (i, primitive) in mesh.primitives.iter().enumerate() {
            let own = node.name.clone().or_else(|| mesh.name.clone());
            let name = format!("{}{}", name(&own, "node", number), if i > 0 { format!(".{i}") } else { String::new() });
            let look = primitive.material.map_or(self.looks.len() - 1, |m| m.value());
            let Some(of) = self.looks.get(look).filter(|_| primitive.material.is_none() || look + 1 < self.looks.len()) else {
                return Err(self.file.error(format!("mesh {}: there is no material {look}", index.value())));
            };
            let Some(mut part) = meshes::part(self.file, primitive, of.set, weights)? else {
                self.scene.warnings.push(format!("{}: \"{name}\" has no triangles", self.file.path.display()));
                continue;
            };
            let to_world = self.bent(node, primitive, placed, &mut part)?.unwrap_or(placed[number]);
            match of.normals {
                Some(_) => {
                    let [upright, mirrored] = meshes::by_handedness(part);
                    self.append(upright, to_world, name.clone(), (look, false))?;
                    self.append(mirrored, to_world, name, (look, true))?;
                }
                None => self.append(part, to_world, name, (look, false))?,
            }
        }
        Ok(())
    }

    /// Bends a mesh with its skin, if it has one, which is placed by its joints alone.
    fn bent(&self, node: &Node, primitive: &Primitive, placed: &[DMat4], part: &mut Part) -> Result<Option<DMat4>> {
        let Some(skin) = node.skin else { return Ok(None) };
        let skin = self.file.get(skin, "skin")?;
        meshes::bend(self.file, primitive, skin, placed, &mut part.mesh)?;
        Ok(Some(DMat4::IDENTITY))
    }

    fn append(&mut self, part: Part, to_world: DMat4, name: String, (look, mirrored): (usize, bool)) -> Result<()> {
        let Part { mesh, colors, light_uvs } = part;
        let geometry = &self.scene.geometry;
        if mesh.triangles.is_empty() {
            return Ok(());
        }
        let to_world = to_world.as_mat4();
        if !to_world.is_finite() {
            return Err(self.file.error(format!("\"{name}\" stands at no finite place")));
        }
        let object = geometry.objects.len() as u32;
        let of = &self.looks[look];
        let colors = if of.plain { colors } else { Vec::new() };
        let material = match colors.iter().any(|c| *c != Rgb::ONE) {
            true => {
                let values = colors.iter().map(|c| *c * of.base()).collect();
                let attribute =
                    Attribute { first_triangle: geometry.triangles.len() as u32, values, corners: mesh.triangles.clone() };
                self.material(look, mirrored, Some(Texture::Attribute(Arc::new(attribute))))?
            }
            false => match self.shared[2 * look + usize::from(mirrored)] {
                Some(material) => material,
                None => self.material(look, mirrored, None)?,
            },
        };
        let emitter = of.emission.clone().map(|radiance| {
            self.scene.emitters.push(Emitter::Area { object, radiance });
            self.scene.emitters.len() as u32 - 1
        });
        // Without normals faces are flat, and a mirroring transform turns their winding round.
        let flat = mesh.normals.is_empty();
        let flip = flat && to_world.determinant() < 0.0;
        let geometry = self.scene.geometry_mut();
        append(geometry, mesh, to_world, flip, flat, name, material, emitter);
        geometry.set_last_light_uvs(light_uvs);
        Ok(())
    }

    /// A new material of the scene.
    fn material(&mut self, look: usize, mirrored: bool, colors: Option<Texture>) -> Result<u32> {
        let number = self.scene.materials.len() as u32;
        if colors.is_none() {
            self.shared[2 * look + usize::from(mirrored)] = Some(number);
        }
        let given = self.file.root.materials.get(look).and_then(|m| m.name.clone());
        let bsdf = self.looks[look].bsdf(mirrored, colors).map_err(|e| self.file.error(e.to_string()))?;
        self.scene.materials.push(Material {
            name: name(&given, "material", look),
            bsdf,
            opacity: self.looks[look].opacity.clone(),
        });
        Ok(number)
    }
}
