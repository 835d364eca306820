//! glTF 2.0 as one binary file: a scene with its light map on the second texture coordinates.
//!
//! No ratified extension has light maps. `MX_lightmap` (of nodes, RGBM) is the one here, with ambient occlusion, or else the map's relative luminance, as
//! occlusion for viewers that do not know it.

mod looks;
mod pixels;
mod shapes;
mod writer;

use crate::base::math::{Rgb, luminance};
use crate::io::Provenance;
use crate::lightmap::LightMap;
use crate::scene::{Camera, Emitter, Scene};
use crate::{Error, Result};
use glam::{Affine3A, DMat3, DMat4, DQuat, Mat4, Quat, Vec3};
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;
use std::io::Read;
use std::path::Path;
use writer::Writer;

/// Share of the map's texels that are as bright as occlusion's white, or brighter.
const BRIGHT: f32 = 0.05;

/// Where a GLB file's JSON starts, and how ours does.
const JSON_AT: usize = 20;
const OURS: &[u8] = br#"{"asset":{"generator":"reprobe "#;

/// A GLB file, and what of the scene is not in it.
pub struct Exported {
    /// The file.
    pub bytes: Vec<u8>,
    /// One line each.
    pub warnings: Vec<String>,
    /// Materials in it.
    pub materials: usize,
    /// Triangles whose backs are lit: they are in it twice, once for each side.
    pub behind: usize,
}

/// What was baked for a scene, on one layout of texels.
#[derive(Clone, Copy, Default)]
pub struct Bakes<'a> {
    /// Light.
    pub light: Option<&'a LightMap>,
    /// Ambient occlusion, 1 in the open.
    pub openness: Option<&'a LightMap>,
}

/// Writes a scene, and what was baked for it.
pub fn glb(scene: &Scene, bakes: Bakes, provenance: &Value) -> Result<Exported> {
    let mut warnings = Vec::new();
    let mut writer = Writer::default();
    let (lightmap, layout) = (bakes.light, bakes.light.or(bakes.openness));
    let light = lightmap.map(|map| Light::write(&mut writer, map)).transpose()?;
    let (mut materials, mut roots, mut behind) = (BTreeMap::new(), Vec::new(), 0);
    for (object, of) in scene.geometry.objects.iter().enumerate() {
        let bsdf = &scene.materials[of.material as usize].bsdf;
        let backs = match lightmap {
            Some(map) if bsdf.is_two_sided() => shapes::lit_behind(&scene.geometry, object, map),
            _ => Vec::new(),
        };
        behind += backs.len();
        // A texel lights both sides of what it lies on: where each has its own, each is a shape that is seen from before alone.
        let both_sides = bsdf.is_two_sided() && backs.is_empty();
        let key = (of.material, of.emitter, both_sides);
        let material = match materials.get(&key) {
            Some(material) => *material,
            None => {
                let written = looks::material(&mut writer, scene, key, &mut warnings)?;
                materials.insert(key, written);
                written
            }
        };
        for (triangles, is_back) in [(of.triangles.clone().collect(), false), (backs, true)] {
            if triangles.is_empty() {
                continue;
            }
            let shape = shapes::shape(&scene.geometry, object, &triangles, layout, is_back);
            let mut node = json!({ "mesh": shape.write(&mut writer, &of.name, material), "name": of.name });
            if let Some(light) = &light {
                node["extensions"] = json!({ "MX_lightmap": light.of(is_back) });
            }
            roots.push(writer.push("nodes", node));
        }
    }
    if light.is_some() {
        writer.uses("MX_lightmap");
    }
    if let Some(occlusion) = occlusion(&mut writer, bakes)? {
        writer.occlude(occlusion);
    }
    let lights = lights(&mut writer, &scene.emitters, &mut roots, &mut warnings);
    if let Some(camera) = &scene.sensor {
        roots.extend(sensor(&mut writer, camera));
    }
    warnings.sort();
    warnings.dedup();
    let count = materials.len();
    writer.push("scenes", json!({ "nodes": roots }));
    let asset = json!({ "generator": concat!("reprobe ", env!("CARGO_PKG_VERSION")), "version": "2.0", "extras": { "provenance": provenance } });
    let mut extensions = Map::new();
    if !lights.is_empty() {
        extensions.insert("KHR_lights_punctual".into(), json!({ "lights": lights }));
    }
    Ok(Exported { bytes: writer.finish(asset, Value::Object(extensions))?, warnings, materials: count, behind })
}

/// Whether a file that begins like this was written by [`glb`].
pub fn is_ours(start: &[u8]) -> bool {
    start.get(JSON_AT..).is_some_and(|json| json.starts_with(OURS))
}

/// Where a GLB file of ours came from, if that is what it is; its meshes stay unread.
pub fn read_provenance(path: &Path) -> Result<Option<Provenance>> {
    let fail = |e| Error::io(path, e);
    let bad = |what: String| Error::input(path, format!("not a readable GLB file: {what}"));
    let mut file = std::fs::File::open(path).map_err(fail)?;
    let mut head = Vec::new();
    file.by_ref().take((JSON_AT + OURS.len()) as u64).read_to_end(&mut head).map_err(fail)?;
    if !(head.starts_with(b"glTF") && is_ours(&head)) {
        return Ok(None);
    }
    // What the file's words promise may be more than there is.
    let length = u64::from(u32::from_le_bytes([head[12], head[13], head[14], head[15]]));
    let mut text = head.split_off(JSON_AT);
    file.take(length.saturating_sub(text.len() as u64)).read_to_end(&mut text).map_err(fail)?;
    let document: Value = serde_json::from_slice(&text).map_err(|e| bad(e.to_string()))?;
    let found = &document["asset"]["extras"]["provenance"];
    serde_json::from_value(found.clone()).map_err(|e| bad(format!("asset.extras.provenance: {e}")))
}

/// The textures of a light map.
struct Light {
    front: usize,
    back: Option<usize>,
    intensity: f32,
}

/// Of a texture whose charts must not mix with what lies beyond its edges.
fn sampler() -> Value {
    json!({ "magFilter": 9729, "minFilter": 9729, "wrapS": 33071, "wrapT": 33071 })
}

/// Writes the texture of occlusion, of what says most of it.
fn occlusion(writer: &mut Writer, bakes: Bakes) -> Result<Option<usize>> {
    let (map, white, name) = match bakes {
        Bakes { openness: Some(map), .. } => (map, 1.0, "ambient occlusion"),
        Bakes { light: Some(map), .. } => {
            let mut bright: Vec<f32> = map.front.iter().map(|p| luminance(*p)).filter(|l| *l > 0.0).collect();
            bright.sort_unstable_by(f32::total_cmp);
            let white = bright.get((bright.len() as f32 * (1.0 - BRIGHT)) as usize).copied().unwrap_or(1.0);
            (map, white, "relative irradiance")
        }
        _ => return Ok(None),
    };
    let size = map.size.map(|n| n as usize);
    let shares: Vec<f32> = map.front.iter().take(size[0] * size[1]).map(|p| luminance(*p) / white).collect();
    Ok(Some(writer.texture(&pixels::occlusion(&shares, size)?, name, sampler())))
}

impl Light {
    fn write(writer: &mut Writer, map: &LightMap) -> Result<Self> {
        let size = map.size.map(|n| n as usize);
        let all = || map.front.iter().chain(map.back.iter().flatten());
        let largest = all().map(|p| p.max_element()).fold(0.0, f32::max);
        let intensity = (largest / pixels::RGBM_RANGE).max(1.0);
        let mut texture = |pixels: &[Rgb], name: &str| -> Result<usize> {
            let picture: Vec<Rgb> = pixels.iter().take(size[0] * size[1]).map(|p| *p / intensity).collect();
            Ok(writer.texture(&pixels::rgbm(&picture, size)?, name, sampler()))
        };
        let front = texture(&map.front, "irradiance")?;
        let back = map.back.as_ref().map(|back| texture(back, "irradiance of backs")).transpose()?;
        Ok(Self { front, back, intensity })
    }

    fn of(&self, turned: bool) -> Value {
        let index = self.back.filter(|_| turned).unwrap_or(self.front);
        json!({ "lightMapTexture": { "index": index, "texCoord": 1 }, "intensity": self.intensity })
    }
}

/// Writes the nodes of the lights that have a place; returns the lights.
fn lights(writer: &mut Writer, emitters: &[Emitter], roots: &mut Vec<usize>, warnings: &mut Vec<String>) -> Vec<Value> {
    let mut lights = Vec::new();
    for emitter in emitters {
        match light(emitter) {
            Some((light, to_world)) => {
                writer.uses("KHR_lights_punctual");
                lights.push(light);
                let extension = json!({ "KHR_lights_punctual": { "light": lights.len() - 1 } });
                roots.push(writer.push("nodes", placed(json!({ "extensions": extension }), &to_world)));
            }
            None if matches!(emitter, Emitter::Area { .. }) => {}
            None => warnings.push("light from the environment, of a sun's disc or a projector is left out: glTF has none".into()),
        }
    }
    lights
}

/// A light of `KHR_lights_punctual`, and where it stands.
fn light(emitter: &Emitter) -> Option<(Value, DMat4)> {
    let of = |color: Rgb, kind: &str| {
        let strength = color.max_element().max(f32::MIN_POSITIVE);
        json!({ "type": kind, "color": (color / strength).to_array(), "intensity": strength })
    };
    let towards = |d: Vec3| DMat4::from_quat(DQuat::from_rotation_arc(glam::DVec3::NEG_Z, d.as_dvec3().normalize()));
    let at = |p: Vec3| DMat4::from_translation(p.as_dvec3());
    Some(match emitter {
        Emitter::Point { position, intensity } => (of(*intensity, "point"), at(*position)),
        Emitter::Directional { direction, irradiance } => (of(*irradiance, "directional"), towards(*direction)),
        Emitter::Spot { position, direction, intensity, cutoff_rad, beam_rad, .. } => {
            let mut light = of(*intensity, "spot");
            let outer = cutoff_rad.min(std::f32::consts::FRAC_PI_2);
            light["spot"] = json!({ "innerConeAngle": beam_rad.min(outer * 0.9999), "outerConeAngle": outer });
            (light, at(*position) * towards(*direction))
        }
        _ => return None,
    })
}

/// A camera's node; orthographic and shifted ones are taken for what their middle sees.
fn sensor(writer: &mut Writer, camera: &Camera) -> Option<usize> {
    let [width, height] = camera.size.map(|n| n as f32);
    let entry = match camera.orthographic {
        Some(half) => {
            json!({ "type": "orthographic", "orthographic": { "xmag": half.x, "ymag": half.y * height / width, "znear": 0.01, "zfar": 1000.0 } })
        }
        None => {
            let yfov = 2.0 * ((0.5 * camera.fov_x).tan() * height / width).atan();
            json!({ "type": "perspective", "perspective": { "yfov": yfov, "aspectRatio": width / height, "znear": 0.01 } })
        }
    };
    let Affine3A { matrix3, translation } = camera.to_world;
    let [x, y, z] = [matrix3.x_axis, matrix3.y_axis, matrix3.z_axis].map(|axis| Vec3::from(axis).as_dvec3());
    let turn = DMat3::from_cols(-x, y, -z);
    if turn.determinant() <= 0.0 {
        return None;
    }
    let to_world = DMat4::from_rotation_translation(DQuat::from_mat3(&turn), Vec3::from(translation).as_dvec3());
    let camera = writer.push("cameras", entry);
    Some(writer.push("nodes", placed(json!({ "camera": camera }), &to_world)))
}

/// A node with its place.
fn placed(mut node: Value, to_world: &DMat4) -> Value {
    let (_, rotation, translation): (_, Quat, Vec3) = Mat4::to_scale_rotation_translation(&to_world.as_mat4());
    node["rotation"] = json!(rotation.normalize().to_array());
    node["translation"] = json!(translation.to_array());
    node
}
