//! From the plugin tree to a [`Scene`].

mod attribute;
mod bsdf;
mod emitter;
mod group;
mod integrator;
mod round;
mod sensor;
mod shape;
mod sunsky;
mod texture;

use super::assets::{Assets, ids, walk};
use super::params::{Ids, Params};
use super::tree::{Kind, Node, Param, Parsed, Value};
use super::{json, xml};
use crate::exchange::{LoadOptions, finish};
use crate::io::text;
use crate::scene::Scene;
use crate::{Error, Result};
use attribute::Current;
use glam::DMat4;
use round::Crowd;
use std::collections::BTreeMap;
use std::path::Path;

/// Most scattering models and textures in a scene: references to references could multiply without end.
const MAX_BUILT: usize = 200_000;

/// Loads the bytes of a Mitsuba XML file, or of its JSON form (a file named `.json`).
pub fn decode(path: &Path, bytes: Vec<u8>, options: &LoadOptions) -> Result<Scene> {
    let Parsed { children, mut warnings } = match path.extension().is_some_and(|e| e.eq_ignore_ascii_case("json")) {
        true => json::parse(path, &text(path, bytes)?, &options.defines)?,
        false => xml::parse(path, &bytes, &options.defines)?,
    };
    let ids = ids(&children)?;
    let assets = Assets::load(&children, options.allow_truncated)?;
    warnings.extend_from_slice(assets.warnings());
    finish::in_metres(path, options.unit_scale, |unit_scale| {
        let scene = Scene { path: path.to_owned(), warnings: warnings.clone(), unit_scale, ..Scene::default() };
        built(scene, (&children, &ids, &assets), options.skip_unsupported)
    })
}

/// Fills an empty scene with what stands under it in its file.
fn built(scene: Scene, (children, ids, assets): (&[Param], &Ids, &Assets), skip_unsupported: bool) -> Result<Scene> {
    let path = scene.path.clone();
    let mut builder = Builder {
        ids,
        children,
        assets,
        unit_scale: scene.unit_scale.0,
        skip_unsupported,
        scene,
        materials: BTreeMap::new(),
        default_material: None,
        lamp_material: None,
        built: 0,
        environments: 0,
        current: None,
        of_one_shape: false,
        instance: None,
        groups: 0,
        grouped: 0,
        crowd: Crowd::new(),
    };
    builder.crowd = builder.crowd();
    builder.count_copies(children)?;
    let mut results = vec![builder.foreign(children)];
    for child in children {
        match &child.value {
            Value::Plugin(node) => results.push(builder.top_level_or_nothing(node)),
            other => {
                builder.scene.warnings.push(child.at.warning(format!("{} directly under the scene is ignored", other.describe())))
            }
        }
    }
    Error::gather(results).map_err(|e| hint(e, &path))?;
    Ok(builder.scene)
}

/// Says of several errors which file they are about, and of what is not supported that it can be left out.
fn hint(e: Error, path: &Path) -> Error {
    let message = match &e {
        e if e.is_unsupported() => format!("{e}\n(--skip-unsupported leaves out what is not supported)"),
        Error::Many(_) => e.to_string(),
        _ => return e,
    };
    match e {
        Error::Unsupported { path, line, message } => {
            Error::at_line(path, line, format!("{message} (--skip-unsupported leaves it out)"))
        }
        _ => Error::input(path, message),
    }
}

/// Builds a scene plugin by plugin.
struct Builder<'a> {
    ids: &'a Ids<'a>,
    /// What stands directly under the scene.
    children: &'a [Param],
    assets: &'a Assets,
    unit_scale: f32,
    skip_unsupported: bool,
    scene: Scene,
    /// Material of each scattering model that stands by itself, by its place in memory: looked up, never listed.
    materials: BTreeMap<*const Node, u32>,
    default_material: Option<u32>,
    /// Of emitting shapes without a scattering model.
    lamp_material: Option<u32>,
    /// Scattering models and textures so far.
    built: usize,
    /// Environment emitters so far; Mitsuba allows one.
    environments: usize,
    /// The shape whose material is being built.
    current: Option<Current<'a>>,
    /// Whether what is being built is of one shape alone.
    of_one_shape: bool,
    /// `to_world` of the instance that is being added.
    instance: Option<DMat4>,
    /// Groups around the shape that is being added.
    groups: usize,
    /// Shapes in groups so far.
    grouped: usize,
    /// Round shapes that are too many for fine meshes.
    crowd: Crowd,
}

impl<'a> Builder<'a> {
    fn params(&self, node: &'a Node) -> Params<'a> {
        Params::new(node, self.ids)
    }

    /// Every plugin that has no place here, wherever it stands.
    fn foreign(&mut self, children: &'a [Param]) -> Result<()> {
        let mut found = Vec::new();
        walk(children, &mut |node| found.extend((node.kind == Kind::Unsupported).then_some(node)));
        let told = found.into_iter().map(|node| {
            let error = node.at.unsupported(format!(
                "unknown plugin \"{}\": participating media and their parts are not supported",
                node.plugin
            ));
            self.or_left_out(Err::<(), _>(error), "it is left out").map(|_| ())
        });
        Error::gather(told.collect::<Vec<_>>()).map(|_| ())
    }

    /// What was built, or nothing and a warning where it is not supported and may be left out; `instead` says what becomes of it.
    fn or_left_out<T>(&mut self, built: Result<T>, instead: &str) -> Result<Option<T>> {
        match built {
            Err(Error::Many(several)) if self.skip_unsupported && several.iter().all(Error::is_unsupported) => {
                self.scene.warnings.extend(several.iter().map(|e| format!("{e}: {instead}")));
                Ok(None)
            }
            Err(e) if self.skip_unsupported && e.is_unsupported() => {
                self.scene.warnings.push(format!("{e}: {instead}"));
                Ok(None)
            }
            built => built.map(Some),
        }
    }

    /// Adds a plugin, unless it may be left out.
    fn top_level_or_nothing(&mut self, node: &'a Node) -> Result<()> {
        let emitters = self.scene.emitters.len();
        let added = self.top_level(node);
        if self.or_left_out(added, "it is left out")?.is_none() {
            self.scene.emitters.truncate(emitters);
        }
        Ok(())
    }

    fn top_level(&mut self, node: &'a Node) -> Result<()> {
        match node.kind {
            Kind::Shape => self.shapes(node),
            Kind::Bsdf => {
                let before = self.scene.materials.len();
                self.material(node, "")?;
                // One that is made anew for each shape stands for nothing here.
                if !self.materials.contains_key(&(node as *const Node)) {
                    self.scene.materials.truncate(before);
                }
                Ok(())
            }
            Kind::Emitter => self.emitter(node),
            Kind::Sensor if self.scene.sensor.is_none() => self.sensor(node),
            Kind::Sensor => {
                self.scene.warnings.push(node.at.warning("a second sensor is ignored: the first is the scene's own"));
                Ok(())
            }
            // A texture acts where something refers to it; still, a wrong one should not pass.
            Kind::Texture => self.texture(node).map(|_| ()),
            Kind::Integrator => self.integrator(node),
            Kind::Film | Kind::Other | Kind::Unsupported => Ok(()),
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
        node.at.unsupported(format!("unknown {what} plugin \"{}\": expected one of {known}", node.plugin))
    }
}
