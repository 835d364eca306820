//! Folders of light field probes. Each probe has `NNNN.exr`, what it sees (`distance`, `normal`, `direct`, `albedo`, `facing`),
//! `NNNN_light.exr`, the radiance of all bounces, and `NNNN_ambient.exr`, irradiance and the moments of distance. Where they stand in no
//! grid, `octree.json` says which of them see a place. `set.json` comes last.

use super::bake::{LightFieldBakeParams, Seen};
use super::field::{LightField, no_surfels};
use super::march::Map;
use super::octree::Octree;
use super::probe::{Ambient, LEAST_LIGHT, Light, Surfels};
use crate::base::math::Rgb;
use crate::base::octahedral::pack;
use crate::io::{ExrImage, Provenance, json};
use crate::probe::places::Places;
use crate::probe::set::{ProbeSet, read_member};
use crate::probe::store::read_set_of;
use crate::scene::Scene;
use crate::{Error, Result};
use glam::{Vec2, Vec3};
use half::f16;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// `set.json` of such a folder.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LightFieldSet {
    /// What was baked.
    pub bake: LightFieldBakeParams,
    /// Where the probes stand. Blocked ones have no files.
    #[serde(alias = "grid")]
    pub places: Places,
    /// Content hashes of each probe's files, in the order of [`files`].
    pub files: Vec<[String; 3]>,
    /// That of the octree's file; empty where the probes stand in a grid.
    #[serde(default)]
    pub octree: String,
    /// Where it came from: the same in every file.
    pub provenance: Provenance,
}

/// The files of probe `index`: what it sees, radiance, ambient light.
pub fn files(folder: &Path, index: usize) -> [PathBuf; 3] {
    ["", "_light", "_ambient"].map(|ending| folder.join(format!("{index:04}{ending}.exr")))
}

impl LightFieldSet {
    /// The subcommand that writes it.
    const STAGE: &str = "bake-lightfield";

    /// Reads `set.json`.
    pub fn read(folder: &Path) -> Result<Self> {
        let path = ProbeSet::path(folder);
        read_set_of::<Self>(folder, Self::STAGE)?
            .filter(|set| set.files.len() == set.places.len())
            .ok_or_else(|| Error::input(&path, "is not of light field probes: expected a folder that bake-lightfield wrote"))
    }

    /// The [`files`] of a probe that is not blocked.
    pub fn images(&self, folder: &Path, index: usize) -> Result<[ExrImage; 3]> {
        let [seen, light, around] = files(folder, index);
        let (size, ambient) = (self.bake.size as usize, self.bake.ambient_size as usize);
        let read = |path, size| member(path, size, &self.provenance);
        Ok([read(&seen, size)?, read(&light, size)?, read(&around, ambient)?])
    }
}

/// Memory that a probe takes, bytes: surfaces, bounds of their distances and radiance with their levels, and ambient light.
pub fn probe_bytes(bake: &LightFieldBakeParams) -> usize {
    let [texels, ambient] = [bake.size, bake.ambient_size].map(|n| (n * n) as usize);
    // A level has a quarter of the texels of the one before, down to 1 or to LEAST_LIGHT along an edge.
    let levels = |least: usize| (4 * texels - least * least) / 3;
    let surfaces = texels * size_of::<(f32, u32)>() + levels(1) * size_of::<f32>();
    surfaces + levels(LEAST_LIGHT) * size_of::<[f16; 3]>() + ambient * size_of::<(Rgb, Vec2)>()
}

impl LightField {
    /// Reads a folder that was baked from `scene`.
    pub fn load(folder: &Path, scene: &Scene) -> Result<Self> {
        let set = LightFieldSet::read(folder)?;
        set.provenance.check_scene(&ProbeSet::path(folder), &scene.hash)?;
        let size = set.bake.size as usize;
        let read = |i: usize| {
            if set.places.is_blocked(i) {
                return Ok((Map::new(no_surfels()), Light::new(&[Rgb::ZERO], 1), Ambient::dark()));
            }
            let (paths, [seen, light, around]) = (files(folder, i), set.images(folder, i)?);
            let surfels = surfels(&paths[0], &seen)?;
            let light = light.rgb(&paths[1], "radiance")?;
            Ok((Map::new(surfels), Light::new(&light, size), ambient(&paths[2], &around)?))
        };
        let all: Vec<(Map, Light, Ambient)> = (0..set.places.len()).into_par_iter().map(read).collect::<Result<_>>()?;
        let octree = match set.places {
            Places::Grid(_) => None,
            Places::List(_) => Some(read_octree(folder, set.places.len())?),
        };
        let mut field = Self { places: set.places, octree, maps: Vec::new(), light: Vec::new(), ambient: Vec::new() };
        for (map, light, ambient) in all {
            field.maps.push(map);
            field.light.push(light);
            field.ambient.push(ambient);
        }
        Ok(field)
    }
}

/// The file of a set without a grid that says which probes see a place.
pub fn octree_path(folder: &Path) -> PathBuf {
    folder.join("octree.json")
}

fn read_octree(folder: &Path, probes: usize) -> Result<Octree> {
    let path = octree_path(folder);
    let text = std::fs::read_to_string(&path).map_err(|e| Error::io(&path, e))?;
    let octree: Octree = json::parse(&path, &text)?;
    octree.check(probes).map_err(|e| Error::input(&path, e.to_string()))?;
    Ok(octree)
}

/// A square file of the set.
fn member(path: &Path, size: usize, provenance: &Provenance) -> Result<ExrImage> {
    read_member(path, Some([size as u32; 2]), provenance)
}

fn vectors(path: &Path, image: &ExrImage, name: &str) -> Result<Vec<Vec3>> {
    let axis = |c: &str| image.f32(path, &format!("{name}.{c}"));
    let (x, y, z) = (axis("X")?, axis("Y")?, axis("Z")?);
    Ok((0..x.len()).map(|i| Vec3::new(x[i], y[i], z[i]).normalize_or(Vec3::Y)).collect())
}

fn surfels(path: &Path, image: &ExrImage) -> Result<Surfels> {
    let distance = image.f32(path, "distance")?;
    if let Some(d) = distance.iter().find(|d| d.is_nan() || **d < 0.0) {
        return Err(Error::input(path, format!("channel \"distance\" holds {d}, expected metres of at least 0")));
    }
    let normal = vectors(path, image, "normal")?.into_iter().map(pack).collect();
    Ok(Surfels { size: image.width, distance, normal })
}

fn ambient(path: &Path, image: &ExrImage) -> Result<Ambient> {
    let (first, second) = (image.f32(path, "moment.1")?, image.f32(path, "moment.2")?);
    let moments = first.into_iter().zip(second).map(|(a, b)| Vec2::new(a, b)).collect();
    Ok(Ambient { size: image.width, irradiance: image.rgb(path, "irradiance")?, moments })
}

impl Seen {
    /// As a file.
    pub fn to_image(&self, provenance: &Provenance) -> ExrImage {
        let n = self.surfels.size;
        let mut image = ExrImage::new(n, n).with_f32("distance", self.surfels.distance.clone());
        let normals: Vec<Vec3> = self.surfels.normal.iter().map(|&bits| crate::base::octahedral::unpack(bits)).collect();
        for (name, vectors) in [("normal", &normals), ("facing", &self.facing)] {
            for (k, axis) in ["X", "Y", "Z"].into_iter().enumerate() {
                image = image.with_f16(&format!("{name}.{axis}"), vectors.iter().map(|v| v[k]));
            }
        }
        for (name, colors) in [("direct", &self.direct), ("albedo", &self.albedo)] {
            image = with_colors(image, name, colors);
        }
        image.with_provenance(provenance.clone())
    }

    /// Reads what [`Seen::to_image`] made.
    pub fn read(path: &Path, size: usize, provenance: &Provenance) -> Result<Self> {
        let image = member(path, size, provenance)?;
        Ok(Self {
            surfels: surfels(path, &image)?,
            direct: image.rgb(path, "direct")?,
            albedo: image.rgb(path, "albedo")?,
            facing: vectors(path, &image, "facing")?,
        })
    }
}

fn with_colors(mut image: ExrImage, name: &str, colors: &[Rgb]) -> ExrImage {
    for (k, c) in ["R", "G", "B"].into_iter().enumerate() {
        image = image.with_f16(&format!("{name}.{c}"), colors.iter().map(|color| color[k]));
    }
    image
}

/// Writes a probe's radiance and ambient light.
pub fn write_light(folder: &Path, index: usize, radiance: &[Rgb], ambient: &Ambient, provenance: &Provenance) -> Result<()> {
    let n = (radiance.len() as f64).sqrt() as usize;
    let [_, light, around] = files(folder, index);
    with_colors(ExrImage::new(n, n), "radiance", radiance).with_provenance(provenance.clone()).write(&light)?;
    let moment = |k: usize| ambient.moments.iter().map(|m| m[k]).collect();
    ExrImage::new(ambient.size, ambient.size)
        .with_rgb("irradiance", &ambient.irradiance)
        .with_f32("moment.1", moment(0))
        .with_f32("moment.2", moment(1))
        .with_provenance(provenance.clone())
        .write(&around)
}
