//! Which texels the views of a camera path fetch: a bake for that path alone can leave the others out.
//!
//! *Ours*. Gathering needs the geometry maps only to choose its texels, and these cost two rays a texel. So the gather runs first,
//! on probes whose glossy map is still black, and the bake then fills just the texels that it read.

use super::bake::probe_geometry;
use super::file::Probe;
use super::placement::ProbeGrid;
use super::qhmap::ParameterMap;
use crate::Result;
use crate::progress::Progress;
use crate::render::candidates::NearCandidates;
use crate::render::gather::{GatherParams, best_samples, footprint_texels, tiles};
use crate::render::gbuffer::gbuffer;
use crate::render::glossy_probes::nearest_probes;
use crate::render::mirror::mirror_pass;
use crate::scene::Camera;
use crate::surface::CurvatureMap;
use crate::transport::World;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::sync::atomic::{AtomicBool, Ordering};

/// Which texels of which probes are fetched: a flag a texel, by the probe's index.
pub type Wanted = BTreeMap<usize, Vec<bool>>;

/// The views that a partial bake serves.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Views {
    /// blake3 of each camera's numbers, hex.
    pub cameras: Vec<String>,
    /// Rays a pixel, along one side.
    pub supersample: u32,
    /// How the texels are chosen; what is then made of their colours is set to the paper's.
    pub gather: GatherParams,
}

impl Views {
    /// The views of `cameras`.
    pub fn new(cameras: &[Camera], supersample: u32, gather: &GatherParams) -> Self {
        let hash = |c: &Camera| {
            let mut hash = blake3::Hasher::new();
            hash.update(bytemuck::cast_slice(&c.to_world.to_cols_array()));
            hash.update(&c.fov_x.to_le_bytes());
            hash.update(bytemuck::cast_slice(&c.size));
            hash.finalize().to_hex().to_string()
        };
        let GatherParams { falloff, bilinear, albedo_ratio, .. } = GatherParams::paper();
        let gather = GatherParams { falloff, bilinear, albedo_ratio, ..gather.clone() };
        Self { cameras: cameras.iter().map(hash).collect(), supersample, gather }
    }

    /// Whether a bake for these views has all texels that `other` needs.
    pub fn serve(&self, other: &Views) -> bool {
        self.supersample == other.supersample
            && self.gather == other.gather
            && other.cameras.iter().all(|c| self.cameras.contains(c))
    }
}

/// Runs the gather of every view on the probes' geometry, of which only what the view at hand uses is in memory.
pub fn wanted_texels(
    world: &World,
    curvature: &CurvatureMap,
    grid: &ProbeGrid,
    map: &dyn Fn(usize) -> Result<ParameterMap>,
    cameras: &[Camera],
    views: &Views,
    progress: &dyn Progress,
) -> Result<Wanted> {
    let mut wanted: BTreeMap<usize, Vec<AtomicBool>> = BTreeMap::new();
    let mut probes: BTreeMap<usize, Probe> = BTreeMap::new();
    let mut candidates = NearCandidates::default();
    progress.start("texels that the views use", cameras.len() as u64);
    for camera in cameras {
        let near = nearest_probes(grid, camera.position(), views.gather.probes);
        probes.retain(|index, _| near.iter().any(|(i, _)| i == index));
        for &(index, _) in &near {
            if let Entry::Vacant(entry) = probes.entry(index) {
                let probe = entry.insert(probe_geometry(world, grid.position(index), map(index)?));
                wanted.entry(index).or_insert_with(|| probe.texels.iter().map(|_| AtomicBool::new(false)).collect());
            }
        }
        let near: Vec<_> = near.iter().map(|&(index, weight)| (index, &probes[&index], weight)).collect();
        let weighted = candidates.of(world, &near, None);
        let fine = Camera { size: camera.size.map(|s| s * views.supersample), ..camera.clone() };
        let view = gbuffer(world, curvature, &fine);
        let reflected = mirror_pass(world, &view);
        tiles(&view, &reflected).par_iter().for_each(|tile| {
            for samples in best_samples(fine.position(), &reflected, (tile.as_slice(), view.size()[0]), &weighted, &views.gather)
            {
                for (w, sample) in weighted.iter().zip(samples) {
                    let Some(sample) = sample else { continue };
                    for texel in footprint_texels(w.probe, sample.texel) {
                        wanted[&w.index][texel].store(true, Ordering::Relaxed);
                    }
                }
            }
        });
        progress.advance(1);
    }
    progress.finish();
    let flags = |flags: Vec<AtomicBool>| flags.into_iter().map(AtomicBool::into_inner).collect();
    Ok(wanted.into_iter().map(|(index, texels)| (index, flags(texels))).collect())
}
