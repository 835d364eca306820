//! glTF 2.0 as one binary file: a scene with its light map on the second texture coordinates.
//!
//! Those are the ones that the scene came with where they are laid out for a light map (`layout`), else places in the map's atlas.
//!
//! No ratified extension has light maps. `MX_lightmap` (of nodes, RGBM) is the one here, with ambient occlusion, or else the map's relative luminance, as
//! occlusion for viewers that do not know it.

mod layout;
mod light;
mod looks;
mod pixels;
mod points;
mod shapes;
mod writer;

use crate::base::math::Rgb;
use crate::io::Provenance;
use crate::lightmap::LightMap;
use crate::scene::{Camera, Emitter, Scene};
use crate::{Error, Result};
use glam::{Affine3A, DMat3, DMat4, DQuat, Mat4, Quat, Vec3};
use layout::{Layout, Place};
use light::Light;
use serde_json::{Map, Value, json};
use shapes::Second;
use std::collections::BTreeMap;
use std::io::Read;
use std::path::Path;
use writer::Writer;

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
    /// Shapes whose light lies on the second texture coordinates that they came with.
    pub kept: usize,
    /// Textures of light that those share.
    pub pages: usize,
}

/// What was baked for a scene, on one layout of texels.
#[derive(Clone, Copy, Default)]
pub struct Bakes<'a> {
    /// Light.
    pub light: Option<&'a LightMap>,
    /// Ambient occlusion, 1 in the open.
    pub openness: Option<&'a LightMap>,
}

impl<'a> Bakes<'a> {
    /// Either of them, for where its texels lie.
    fn any(&self) -> Option<&'a LightMap> {
        self.light.or(self.openness)
    }
}

/// What tells materials apart: the scene's, the emitter, whether both sides are seen.
type Kind = (u32, Option<u32>, bool);

/// Materials that were written, one a kind and place of its light, whose occlusion is theirs.
#[derive(Default)]
struct Materials {
    looks: BTreeMap<Kind, Value>,
    numbers: BTreeMap<(Kind, Place), usize>,
}

impl Materials {
    /// The number of one, which is written where it is not there yet.
    fn number(
        &mut self,
        writer: &mut Writer,
        scene: &Scene,
        (kind, place): (Kind, Place),
        light: &Light,
        warnings: &mut Vec<String>,
    ) -> Result<usize> {
        if let Some(number) = self.numbers.get(&(kind, place)) {
            return Ok(*number);
        }
        let mut json = match self.looks.get(&kind) {
            Some(json) => json.clone(),
            None => {
                let json = looks::material(writer, scene, kind, warnings)?;
                self.looks.insert(kind, json.clone());
                json
            }
        };
        if let Some(occlusion) = light.occlusion(place) {
            json["occlusionTexture"] = occlusion;
        }
        let number = writer.push("materials", json);
        self.numbers.insert((kind, place), number);
        Ok(number)
    }
}

/// Writes a scene, and what was baked for it.
pub fn glb(scene: &Scene, bakes: Bakes, provenance: &Value) -> Result<Exported> {
    let (mut warnings, mut writer) = (Vec::new(), Writer::default());
    let geometry = &scene.geometry;
    let is_two_sided = |object: usize| scene.materials[geometry.objects[object].material as usize].bsdf.is_two_sided();
    let behind = |object: usize| match bakes.light {
        Some(map) if is_two_sided(object) => shapes::lit_behind(geometry, object, map),
        _ => Vec::new(),
    };
    let backs: Vec<Vec<u32>> = (0..geometry.objects.len()).map(behind).collect();
    let layout = Layout::of(geometry, bakes.any(), &mut warnings);
    let light = Light::write(&mut writer, geometry, bakes, &layout, &backs)?;
    let (mut materials, mut roots) = (Materials::default(), Vec::new());
    for (object, of) in geometry.objects.iter().enumerate() {
        let (place, backs) = (layout.places[object], &backs[object]);
        let second = match (place, bakes.any()) {
            (Place::Atlas, Some(map)) => Second::Map(map),
            _ if of.triangles.clone().all(|t| geometry.light_corners(t).is_some()) => Second::Own,
            _ => Second::None,
        };
        // A texel lights both sides of what it lies on: where each has its own, each is a shape that is seen from before alone.
        let kind = (of.material, of.emitter, is_two_sided(object) && backs.is_empty());
        let material = materials.number(&mut writer, scene, (kind, place), &light, &mut warnings)?;
        let fronts: Vec<u32> = of.triangles.clone().collect();
        for (triangles, is_back) in [(&fronts, false), (backs, true)] {
            if triangles.is_empty() {
                continue;
            }
            let shape = shapes::shape(geometry, object, triangles, second, is_back);
            let mut node = json!({ "mesh": shape.write(&mut writer, &of.name, material), "name": of.name });
            if let Some(light) = light.of(place, is_back) {
                node["extensions"] = json!({ "MX_lightmap": light });
                writer.uses("MX_lightmap");
            }
            roots.push(writer.push("nodes", node));
        }
    }
    let lights = lights(&mut writer, &scene.emitters, &mut roots, &mut warnings);
    if let Some(camera) = &scene.sensor {
        roots.extend(sensor(&mut writer, camera));
    }
    warnings.sort();
    warnings.dedup();
    let (count, behind) = (materials.numbers.len(), backs.iter().map(Vec::len).sum());
    let kept = layout.places.iter().filter(|place| matches!(place, Place::Page(_))).count();
    writer.push("scenes", json!({ "nodes": roots }));
    let asset = json!({ "generator": concat!("reprobe ", env!("CARGO_PKG_VERSION")), "version": "2.0", "extras": { "provenance": provenance } });
    let mut extensions = Map::new();
    if !lights.is_empty() {
        extensions.insert("KHR_lights_punctual".into(), json!({ "lights": lights }));
    }
    let bytes = writer.finish(asset, Value::Object(extensions))?;
    Ok(Exported { bytes, warnings, materials: count, behind, kept, pages: layout.pages.len() })
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
