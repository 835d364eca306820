//! Lights and objects that the file adds.

use super::Last;
use super::entry::{Attribute, Entry, Result, Width, kind};
use crate::Error;
use crate::exchange::mesh::{obj, ply, serialized};
use crate::scene::animation::light::Light;
use crate::scene::animation::object::MovingObject;
use crate::scene::animation::track::Track;
use crate::scene::mesh::Mesh;
use crate::scene::{Scene, primitives};
use glam::{DVec3, Vec3};
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Most triangles of all objects together: some 1 GB.
const MAX_TRIANGLES: usize = 4_000_000;

const POSITION: Attribute = Attribute::vector("position");
const TARGET: Attribute = Attribute::vector("target");
const UP: Attribute = Attribute::vector("up");
const DIRECTION: Attribute = Attribute::vector("direction");
const ROTATION: Attribute = Attribute::vector("rotation");
const INTENSITY: Attribute = Attribute::light("intensity");
const IRRADIANCE: Attribute = Attribute::light("irradiance");
const RADIANCE: Attribute = Attribute::light("radiance");
const CUTOFF: Attribute = Attribute::number("cutoff_angle", 180.0);
const BEAM: Attribute = Attribute::number("beam_width", 180.0);
const ALBEDO: Attribute = Attribute::albedo("albedo");
const RECTANGLE: Attribute = Attribute::lengths("size", Width::Two);
const BOX: Attribute = Attribute::lengths("size", Width::Three);
const RADIUS: Attribute = Attribute::lengths("radius", Width::One);
const SCALE: Attribute = Attribute::lengths("scale", Width::One);

/// Reads `lights`.
pub fn lights(list: &[Value], last: &mut Last) -> Result<Vec<Light>> {
    list.iter().enumerate().map(|(i, value)| light(value, format!("lights[{i}]"), last)).collect()
}

fn light(value: &Value, place: String, last: &mut Last) -> Result<Light> {
    let kind = kind(value, &place, &["point", "spot", "directional", "area"])?;
    let attributes: &[Attribute] = match kind {
        "point" => &[POSITION, INTENSITY],
        "spot" => &[POSITION, TARGET, INTENSITY, CUTOFF, BEAM],
        "directional" => &[DIRECTION, IRRADIANCE],
        _ => &[POSITION, TARGET, UP, RECTANGLE, RADIANCE],
    };
    let entry = Entry::new(value, place, attributes, &["type"])?;
    last.note(&entry);
    Ok(match kind {
        "point" => Light::Point { position: entry.required(POSITION)?, intensity: entry.required(INTENSITY)? },
        "spot" => Light::Spot {
            position: entry.required(POSITION)?,
            target: entry.required(TARGET)?,
            intensity: entry.required(INTENSITY)?,
            // Mitsuba's.
            cutoff: entry.track(CUTOFF)?.unwrap_or_else(|| Track::still(DVec3::splat(20.0))),
            beam: entry.track(BEAM)?,
        },
        "directional" => Light::Directional { direction: entry.required(DIRECTION)?, irradiance: entry.required(IRRADIANCE)? },
        _ => Light::Area {
            position: entry.required(POSITION)?,
            target: entry.required(TARGET)?,
            up: entry.track(UP)?.unwrap_or_else(|| Track::still(DVec3::Y)),
            size: entry.required(RECTANGLE)?,
            radiance: entry.required(RADIANCE)?,
        },
    })
}

/// What `objects` holds.
pub struct Objects {
    pub objects: Vec<MovingObject>,
    /// The mesh files, each once.
    pub files: Vec<PathBuf>,
}

/// Reads `objects` of the file at `path`, and the meshes that they name.
pub fn objects(list: &[Value], path: &Path, scene: &Scene, last: &mut Last) -> crate::Result<Objects> {
    let bad = |message: String| Error::input(path, message);
    let mut found = Objects { objects: Vec::new(), files: Vec::new() };
    let mut meshes = BTreeMap::new();
    let (mut triangles, mut vertices) = (0, 0);
    for (i, value) in list.iter().enumerate() {
        let place = format!("objects[{i}]");
        let kind = kind(value, &place, &["sphere", "box", "mesh"]).map_err(bad)?;
        let fixed: &[&str] = match kind {
            "sphere" => &["type", "radius"],
            "box" => &["type", "size"],
            _ => &["type", "filename", "scale"],
        };
        let entry = Entry::new(value, place, &[POSITION, ROTATION, ALBEDO], fixed).map_err(bad)?;
        last.note(&entry);
        let (mesh, scale) = match kind {
            "sphere" => {
                let radius = entry.required_value(RADIUS).map_err(bad)?.x;
                (Arc::new(primitives::sphere(Vec3::ZERO, radius as f32)), DVec3::ONE)
            }
            "box" => (Arc::new(primitives::cube()), 0.5 * entry.required_value(BOX).map_err(bad)?),
            _ => {
                let scale = entry.value(SCALE).map_err(bad)?.unwrap_or(DVec3::ONE);
                let file = path.with_file_name(entry.text("filename").map_err(bad)?);
                if !meshes.contains_key(&file) {
                    meshes.insert(file.clone(), read(&file).map_err(|e| bad(format!("{}: {e}", entry.place)))?);
                    found.files.push(file.clone());
                }
                (meshes[&file].clone(), scale)
            }
        };
        (triangles, vertices) = (triangles + mesh.triangles.len(), vertices + mesh.positions.len());
        if triangles > MAX_TRIANGLES {
            let message = format!("{}: {triangles} triangles with those before, expected at most {MAX_TRIANGLES}", entry.place);
            return Err(bad(message));
        }
        found.objects.push(moving(&entry, mesh, scale).map_err(bad)?);
    }
    // A bit of a triangle's index is the tree's; a few are left for lights.
    let most = u32::MAX as usize / 2 - 10_000;
    let own = &scene.geometry;
    if own.triangles.len() + triangles > most || own.positions.len() + vertices > most {
        return Err(bad(format!("objects: with them the scene has more than {most} vertices or triangles")));
    }
    Ok(found)
}

fn moving(entry: &Entry, mesh: Arc<Mesh>, scale: DVec3) -> Result<MovingObject> {
    Ok(MovingObject {
        mesh,
        scale,
        position: entry.required(POSITION)?,
        rotation: entry.track(ROTATION)?.unwrap_or_else(|| Track::still(DVec3::ZERO)),
        albedo: entry.track(ALBEDO)?.unwrap_or_else(|| Track::still(DVec3::splat(0.5))),
    })
}

fn read(file: &Path) -> crate::Result<Arc<Mesh>> {
    let extension = file.extension().map(|e| e.to_string_lossy().to_ascii_lowercase()).unwrap_or_default();
    let read = match extension.as_str() {
        "obj" => obj::load(file)?,
        "ply" => ply::load(file)?,
        "serialized" => serialized::load(file, 0)?,
        other => {
            return Err(Error::Request(format!("{}: expected an obj, ply or serialized file, not .{other}", file.display())));
        }
    };
    match read.mesh.triangles.is_empty() {
        true => Err(Error::input(file, "the mesh has no faces")),
        false => Ok(Arc::new(read.mesh)),
    }
}
