//! Materials and emission of what the scene has already.

use super::Last;
use super::entry::{Attribute, Entry, Result};
use crate::base::math::Rgb;
use crate::scene::animation::{ChangedMaterial, Emission};
use crate::scene::{Geometry, Scene};
use serde_json::Value;
use std::collections::BTreeMap;
use std::sync::Arc;

const ALBEDO: Attribute = Attribute::albedo("albedo");
const ROUGHNESS: Attribute = Attribute::number("roughness", 1.0);
const RADIANCE: Attribute = Attribute::light("radiance");

/// Names that an error lists.
const LISTED: usize = 8;

/// Reads `materials`.
pub fn materials(list: &[Value], scene: &Scene, last: &mut Last) -> Result<Vec<ChangedMaterial>> {
    let mut names = Names::of(scene.materials.iter().map(|m| m.name.as_str()), "material");
    let mut changed = Vec::new();
    for (i, value) in list.iter().enumerate() {
        let entry = Entry::new(value, format!("materials[{i}]"), &[ALBEDO, ROUGHNESS], &["id"])?;
        let (place, id) = (&entry.place, entry.text("id")?);
        let indices = names.take(id, place)?;
        let (albedo, roughness) = (entry.track(ALBEDO)?, entry.track(ROUGHNESS)?);
        if albedo.is_none() && roughness.is_none() {
            return Err(format!("{place}: found neither \"albedo\" nor \"roughness\""));
        }
        for &index in &indices {
            let mut bsdf = scene.materials[index as usize].bsdf.clone();
            if albedo.is_some() && !bsdf.set_albedo(Rgb::splat(0.5)) {
                return Err(format!("{place}: albedo: the material \"{id}\" has no diffuse reflectance"));
            }
            if roughness.is_some() && !bsdf.set_roughness(0.5) {
                return Err(format!("{place}: roughness: the material \"{id}\" is of no rough model, like roughplastic"));
            }
        }
        last.note(&entry);
        changed.push(ChangedMaterial { indices, albedo, roughness });
    }
    Ok(changed)
}

/// Reads `emission`; with the scene's triangles where shapes emit that did not.
pub fn emission(list: &[Value], scene: &Scene, last: &mut Last) -> Result<(Vec<Emission>, Option<Arc<Geometry>>)> {
    let objects = &scene.geometry.objects;
    let mut names = Names::of(objects.iter().map(|o| o.name.as_str()), "shape");
    let mut emission = Vec::new();
    let mut dark = Vec::new();
    for (i, value) in list.iter().enumerate() {
        let entry = Entry::new(value, format!("emission[{i}]"), &[RADIANCE], &["shape"])?;
        let radiance = entry.required(RADIANCE)?;
        for object in names.take(entry.text("shape")?, &entry.place)? {
            let emitter = objects[object as usize].emitter.unwrap_or_else(|| {
                dark.push(object);
                (scene.emitters.len() + dark.len()) as u32 - 1
            });
            emission.push(Emission { object, emitter, radiance: radiance.clone() });
        }
        last.note(&entry);
    }
    let relit = || {
        let mut geometry = Geometry::clone(&scene.geometry);
        for e in &emission {
            geometry.objects[e.object as usize].emitter = Some(e.emitter);
        }
        Arc::new(geometry)
    };
    let relit = (!dark.is_empty()).then(relit);
    Ok((emission, relit))
}

/// What has which name, and which names were used.
struct Names<'a> {
    what: &'a str,
    indices: BTreeMap<&'a str, Vec<u32>>,
    /// In the scene's order, each once.
    order: Vec<&'a str>,
    used: BTreeMap<&'a str, String>,
}

impl<'a> Names<'a> {
    fn of(names: impl Iterator<Item = &'a str>, what: &'a str) -> Self {
        let mut this = Self { what, indices: BTreeMap::new(), order: Vec::new(), used: BTreeMap::new() };
        for (index, name) in (0..).zip(names) {
            let indices = this.indices.entry(name).or_default();
            if indices.is_empty() {
                this.order.push(name);
            }
            indices.push(index);
        }
        this
    }

    /// All of a name, which no entry has named before.
    fn take(&mut self, name: &str, place: &str) -> Result<Vec<u32>> {
        let what = self.what;
        let Some((name, indices)) = self.indices.get_key_value(name) else {
            let more = if self.order.len() > LISTED { ", ..." } else { "" };
            let known = self.order[..self.order.len().min(LISTED)].join(", ");
            return Err(format!("{place}: the scene has no {what} \"{name}\"; there are {known}{more}"));
        };
        match self.used.insert(name, place.into()) {
            Some(before) => Err(format!("{place}: the {what} \"{name}\" is that of {before}, too")),
            None => Ok(indices.clone()),
        }
    }
}
