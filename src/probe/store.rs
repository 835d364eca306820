//! A folder of baked probes, read as they are needed.

use super::file::{BakedSet, Probe};
use super::parameter_map::{ParameterMap, map_paths};
use super::set::read_member;
use crate::io::provenance::hash_of;
use crate::io::{Provenance, json};
use crate::scene::Scene;
use crate::{Error, Result};
use glam::Vec3;
use rayon::prelude::*;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Name of the file that says that a set is whole.
pub const SET_FILE: &str = "set.json";

/// A probe folder, and those of its probes that are in memory.
pub struct ProbeStore<Served> {
    folder: PathBuf,
    /// The folder's `set.json`.
    pub set: BakedSet<Served>,
    /// Content hash of `set.json`.
    pub hash: String,
    triangles: usize,
    materials: usize,
    resident: BTreeMap<usize, (u64, Arc<Probe>)>,
    capacity: usize,
    clock: u64,
}

impl<Served: DeserializeOwned> ProbeStore<Served> {
    /// Opens a folder that was baked from `scene`; keeps at most `capacity` probes (at least 8) in memory.
    pub fn open(folder: &Path, scene: &Scene, capacity: usize) -> Result<Self> {
        let path = folder.join(SET_FILE);
        let text = read_set(folder, "bake-probes")?;
        let set: BakedSet<Served> = json::parse(&path, &text)?;
        set.provenance.check_scene(&path, &scene.hash)?;
        if set.files.len() != set.places.len() {
            return Err(Error::input(&path, format!("{} files for {} probes", set.files.len(), set.places.len())));
        }
        Ok(Self {
            folder: folder.into(),
            hash: hash_of(text.as_bytes()),
            set,
            triangles: scene.geometry.triangles.len(),
            materials: scene.materials.len(),
            resident: BTreeMap::new(),
            capacity: capacity.max(8),
            clock: 0,
        })
    }

    /// The probe of an index; read from disk if it is not in memory, in place of the one used longest ago.
    pub fn probe(&mut self, index: usize) -> Result<Arc<Probe>> {
        self.clock += 1;
        if let Some((used, probe)) = self.resident.get_mut(&index) {
            *used = self.clock;
            return Ok(probe.clone());
        }
        let probe = Arc::new(self.read(index)?);
        self.keep(index, probe.clone());
        Ok(probe)
    }

    /// Several of them; those that are not in memory are read side by side.
    pub fn probes(&mut self, indices: &[usize]) -> Result<Vec<Arc<Probe>>>
    where
        Served: Sync,
    {
        self.clock += 1;
        let mut missing = Vec::new();
        for &index in indices {
            match self.resident.get_mut(&index) {
                Some((used, _)) => *used = self.clock,
                None => missing.push(index),
            }
        }
        let read: Vec<Result<Probe>> = missing.par_iter().map(|&index| self.read(index)).collect();
        for (index, probe) in missing.into_iter().zip(read) {
            self.keep(index, Arc::new(probe?));
        }
        indices.iter().map(|&index| self.probe(index)).collect()
    }

    /// Keeps a probe in place of the one used longest ago.
    fn keep(&mut self, index: usize, probe: Arc<Probe>) {
        if self.resident.len() >= self.capacity
            && let Some(oldest) = self.resident.iter().min_by_key(|(_, (used, _))| *used).map(|(i, _)| *i)
        {
            self.resident.remove(&oldest);
        }
        self.resident.insert(index, (self.clock, probe));
    }

    fn read(&self, index: usize) -> Result<Probe> {
        let [forward, path] = map_paths(&self.folder, index);
        if self.set.files[index].is_empty() {
            return Err(Error::input(
                &path,
                "was not baked: the set serves the views of one camera path; bake it again for these",
            ));
        }
        let [forward_image, image] =
            [read_member(&forward, None, &self.set.provenance)?, read_member(&path, None, &self.set.provenance)?];
        let map = ParameterMap::from_images((&forward, &forward_image), (&path, &image))?.without_inverse();
        let [width, height] = self.set.size.map(|s| s as usize);
        if (image.width, image.height) != (width, height) {
            let message = format!("{} x {} texels, but {SET_FILE} says {width} x {height}", image.width, image.height);
            return Err(Error::input(&path, message));
        }
        let position: Vec3 = self.set.places.position(index);
        Probe::from_image(&path, &image, map, position, self.triangles, self.materials)
    }

    /// Bytes of the probes in memory.
    pub fn resident_bytes(&self) -> usize {
        self.resident.values().map(|(_, p)| p.bytes()).sum()
    }
}

/// The text of a folder's `set.json`, which `stage` should have written.
pub fn read_set(folder: &Path, stage: &str) -> Result<String> {
    let path = folder.join(SET_FILE);
    std::fs::read_to_string(&path).map_err(|e| {
        let is_missing = e.kind() == std::io::ErrorKind::NotFound;
        let hint = if is_missing { format!(" (the bake is not finished: run {stage} again)") } else { String::new() };
        Error::input(&path, format!("{e}{hint}"))
    })
}

/// What every `set.json` says.
#[derive(Deserialize)]
struct Source {
    provenance: Provenance,
}

/// Where a folder's `set.json` came from, whichever stage wrote it; `stages` are those that may have.
pub fn set_provenance(folder: &Path, stages: &str) -> Result<Provenance> {
    let text = read_set(folder, stages)?;
    Ok(json::parse::<Source>(&folder.join(SET_FILE), &text)?.provenance)
}

/// A folder's `set.json`, which `stage` must have written; `None` where another stage did.
pub fn read_set_of<T: DeserializeOwned>(folder: &Path, stage: &str) -> Result<Option<T>> {
    let path = folder.join(SET_FILE);
    let text = read_set(folder, stage)?;
    let is_ours = json::parse::<Source>(&path, &text)?.provenance.stage == stage;
    is_ours.then(|| json::parse(&path, &text)).transpose()
}

/// Content hash of what [`read_set`] reads.
pub fn set_hash(folder: &Path, stage: &str) -> Result<String> {
    Ok(hash_of(read_set(folder, stage)?.as_bytes()))
}

/// Writes `set.json`: the last step of a bake.
pub fn write_set(folder: &Path, set: &BakedSet<impl Serialize>) -> Result<()> {
    json::write(&folder.join(SET_FILE), set)
}
