//! From the plugin tree to a [`Scene`].

mod bsdf;
mod emitter;
mod sensor;
mod shape;
mod texture;

use super::assets::{Assets, ids};
use super::params::{Ids, Params};
use super::tree::{Kind, Node, Value};
use super::{hash, json, xml};
use crate::scene::Scene;
use crate::{Error, Result};
use std::collections::BTreeMap;
use std::path::Path;

/// Most scattering models and textures in a scene: references to references could multiply without end.
const MAX_BUILT: usize = 200_000;

/// What the command line says about loading.
#[derive(Debug, Clone)]
pub struct LoadOptions {
    /// Multiplies all lengths (`--unit-scale`).
    pub unit_scale: f32,
    /// Values for the scene's `$name` parameters, over its `default`s.
    pub defines: Vec<(String, String)>,
}

impl Default for LoadOptions {
    fn default() -> Self {
        Self { unit_scale: 1.0, defines: Vec::new() }
    }
}

/// Loads a Mitsuba XML file, or its JSON form (a file named `.json`).
pub fn load(path: &Path, options: &LoadOptions) -> Result<Scene> {
    let is_json = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("json"));
    let children = if is_json { json::parse(path)? } else { xml::parse(path, &options.defines)? };
    let ids = ids(&children)?;
    let assets = Assets::load(&children)?;
    let hash = hash::scene(&children, &ids, &assets, options.unit_scale);
    let mut builder = Builder {
        ids: &ids,
        assets: &assets,
        unit_scale: options.unit_scale,
        scene: Scene { hash, path: path.to_owned(), ..Scene::default() },
        materials: BTreeMap::new(),
        default_material: None,
        built: 0,
        environments: 0,
    };
    if is_json && !options.defines.is_empty() {
        builder.scene.warnings.push(format!("{}: JSON scenes have no parameters: --define is ignored", path.display()));
    }
    for child in &children {
        match &child.value {
            Value::Plugin(node) => builder.top_level(node)?,
            other => {
                builder.scene.warnings.push(child.at.warning(format!("{} directly under the scene is ignored", other.describe())))
            }
        }
    }
    let mut scene = builder.scene;
    if scene.geometry.triangles.is_empty() {
        return Err(Error::input(path, "the scene has no triangles"));
    }
    let area: f64 = (0..scene.geometry.triangles.len() as u32).map(|t| f64::from(scene.geometry.area_normal(t).length())).sum();
    if !(area > 0.0 && area.is_finite()) {
        return Err(Error::input(path, format!("all triangles together have an area of {}: expected more than 0", area / 2.0)));
    }
    if scene.emitters.is_empty() {
        scene.warnings.push(format!("{}: the scene has no emitter, so every image of it is black", path.display()));
    }
    Ok(scene)
}

/// Builds a scene plugin by plugin.
struct Builder<'a> {
    ids: &'a Ids<'a>,
    assets: &'a Assets,
    unit_scale: f32,
    scene: Scene,
    /// Material of each scattering model that stands by itself, by its place in memory: looked up, never listed.
    materials: BTreeMap<*const Node, u32>,
    default_material: Option<u32>,
    /// Scattering models and textures so far.
    built: usize,
    /// Environment emitters so far; Mitsuba allows one.
    environments: usize,
}

impl<'a> Builder<'a> {
    fn params(&self, node: &'a Node) -> Params<'a> {
        Params::new(node, self.ids)
    }

    fn top_level(&mut self, node: &'a Node) -> Result<()> {
        match node.kind {
            Kind::Shape => self.shape(node),
            Kind::Bsdf => self.material(node, "").map(|_| ()),
            Kind::Emitter => self.emitter(node),
            Kind::Sensor if self.scene.sensor.is_none() => self.sensor(node),
            Kind::Sensor => {
                self.scene.warnings.push(node.at.warning("a second sensor is ignored: the first is the scene's own"));
                Ok(())
            }
            // A texture acts where something refers to it; still, a wrong one should not pass.
            Kind::Texture => self.texture(node).map(|_| ()),
            Kind::Integrator => {
                let depth = self.params(node).integer("max_depth", -1, -1, i64::from(u32::MAX))?;
                self.scene.max_depth = u32::try_from(depth).ok();
                Ok(())
            }
            Kind::Film | Kind::Other => Ok(()),
        }
    }

    /// Counts what is built, lest references multiply without end.
    fn count(&mut self, node: &Node) -> Result<()> {
        self.built += 1;
        if self.built > MAX_BUILT {
            return Err(node.at.error(format!("the scene has more than {MAX_BUILT} scattering models and textures")));
        }
        Ok(())
    }

    fn unknown(node: &Node, what: &str, known: &str) -> Error {
        node.at.error(format!("unknown {what} plugin \"{}\": expected one of {known}", node.plugin))
    }
}
