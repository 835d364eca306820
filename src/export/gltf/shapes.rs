//! Triangles of one shape with both sets of texture coordinates.

use super::writer::Writer;
use crate::base::math::Rgb;
use crate::lightmap::LightMap;
use crate::scene::Geometry;
use glam::{Vec2, Vec3};
use serde_json::{Value, json};
use std::collections::HashMap;

/// Attributes by vertex.
pub struct Shape {
    positions: Vec<Vec3>,
    normals: Vec<Vec3>,
    uvs: Vec<Vec2>,
    /// Second coordinates, in [0, 1]² where light lies on them.
    second: Vec<Vec2>,
    triangles: Vec<[u32; 3]>,
}

/// What the second texture coordinates are.
#[derive(Clone, Copy)]
pub enum Second<'a> {
    /// There are none.
    None,
    /// Those that the scene came with.
    Own,
    /// Places in a light map.
    Map(&'a LightMap),
}

/// Those of a shape's triangles whose backs the light map lights.
pub fn lit_behind(geometry: &Geometry, object: usize, map: &LightMap) -> Vec<u32> {
    let is_lit = |triangle: &u32| map.lookup(*triangle, Vec2::splat(1.0 / 3.0), true) != Rgb::ZERO;
    geometry.objects[object].triangles.clone().filter(is_lit).collect()
}

/// Some of a shape's triangles. Vertices are split where faces are flat and where charts of the light map part; `turned` shows the back.
pub fn shape(geometry: &Geometry, object: usize, triangles: &[u32], second: Second, turned: bool) -> Shape {
    let of = &geometry.objects[object];
    let mut shape =
        Shape { positions: Vec::new(), normals: Vec::new(), uvs: Vec::new(), second: Vec::new(), triangles: Vec::new() };
    let mut numbers: HashMap<(u32, [u32; 2], [u32; 3]), u32> = HashMap::new();
    for &triangle in triangles {
        let corners = geometry.triangles[triangle as usize];
        let flat = geometry.area_normal(triangle).try_normalize().unwrap_or(Vec3::Y);
        let places = match second {
            Second::None => None,
            Second::Own => geometry.light_corners(triangle),
            Second::Map(map) => map.places(triangle),
        };
        let places = places.unwrap_or([Vec2::ZERO; 3]);
        let mut written = [0, 1, 2].map(|k| {
            let vertex = corners[k];
            let normal = match of.face_normals {
                true => flat,
                false => geometry.normals[vertex as usize].try_normalize().unwrap_or(flat),
            };
            let normal = if turned { -normal } else { normal };
            let key = (vertex, places[k].to_array().map(f32::to_bits), normal.to_array().map(f32::to_bits));
            *numbers.entry(key).or_insert_with(|| {
                shape.positions.push(geometry.positions[vertex as usize]);
                shape.normals.push(normal);
                shape.uvs.push(geometry.uvs[vertex as usize]);
                shape.second.push(places[k]);
                shape.positions.len() as u32 - 1
            })
        });
        if turned {
            written.swap(1, 2);
        }
        shape.triangles.push(written);
    }
    if matches!(second, Second::None) {
        shape.second.clear();
        // The format has no second coordinates without first ones.
        if !of.has_uvs {
            shape.uvs.clear();
        }
    }
    shape
}

impl Shape {
    /// Writes it as a mesh of one primitive; returns its number.
    pub fn write(&self, writer: &mut Writer, name: &str, material: usize) -> usize {
        let mut attributes = json!({ "POSITION": writer.positions(&self.positions), "NORMAL": writer.directions(&self.normals) });
        let mut add = |name: &str, uvs: &[Vec2]| {
            if !uvs.is_empty() {
                attributes[name] = json!(writer.coordinates(uvs));
            }
        };
        add("TEXCOORD_0", &self.uvs);
        add("TEXCOORD_1", &self.second);
        let indices = writer.triangles(&self.triangles);
        let primitive: Value = json!({ "attributes": attributes, "indices": indices, "material": material });
        writer.push("meshes", json!({ "name": name, "primitives": [primitive] }))
    }
}
