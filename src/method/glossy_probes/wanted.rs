//! Which texels the views of a camera path fetch: a bake for that path alone can leave the others out.
//!
//! *Ours*: gathering needs the geometry maps only to choose its texels, and these cost two rays a texel. So the gather runs first,
//! on probes whose glossy map is still black, and the bake then fills just the texels that it read.

use super::bake::probe_geometry;
use super::candidates::NearCandidates;
use super::gather::{GatherParams, footprint_texels};
use super::search::{best_samples, tiles};
use crate::Result;
use crate::base::progress::Progress;
use crate::probe::file::Probe;
use crate::probe::parameter_map::ParameterMap;
use crate::probe::places::Places;
use crate::scene::Camera;
use crate::scene::camera::ALL_DEPTHS;
use crate::surface::CurvatureMap;
use crate::transport::World;
use crate::view::gbuffer::gbuffer;
use crate::view::mirror::mirror_pass;
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
pub struct Served {
    /// blake3 of each camera's numbers, hex.
    pub cameras: Vec<String>,
    /// Rays a pixel, along one side.
    pub supersample: u32,
    /// How the texels are chosen; what is then made of their colours is set to the paper's.
    pub gather: GatherParams,
    /// Other choices whose texels are there as well.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub alternatives: Vec<GatherParams>,
}

/// `gather` without what only decides what is made of the texels.
fn choice(gather: &GatherParams) -> GatherParams {
    let GatherParams { falloff, trilinear_power, bilinear, albedo_ratio, .. } = GatherParams::paper();
    GatherParams { falloff, trilinear_power, bilinear, albedo_ratio, ..gather.clone() }
}

/// Whether the texels of one choice are among those of another: that of as many probes or more, all else alike.
fn includes(whole: &GatherParams, part: &GatherParams) -> bool {
    part.probes <= whole.probes && GatherParams { probes: part.probes, ..whole.clone() } == *part
}

impl Served {
    /// The views of `cameras`.
    pub fn new(cameras: &[Camera], supersample: u32, gather: &GatherParams) -> Self {
        let hash = |c: &Camera| {
            let mut hash = blake3::Hasher::new();
            hash.update(bytemuck::cast_slice(&c.to_world.to_cols_array()));
            hash.update(&c.fov_x.to_le_bytes());
            if c.shift != glam::Vec2::ZERO || c.clip != ALL_DEPTHS {
                hash.update(bytemuck::cast_slice(&c.shift.to_array())).update(bytemuck::cast_slice(&c.clip));
            }
            hash.update(bytemuck::cast_slice(&c.size));
            hash.finalize().to_hex().to_string()
        };
        Self { cameras: cameras.iter().map(hash).collect(), supersample, gather: choice(gather), alternatives: Vec::new() }
    }

    /// Takes the texels of another choice too.
    pub fn or(mut self, gather: &GatherParams) -> Self {
        let gather = choice(gather);
        if !self.has(&gather) {
            self.alternatives.push(gather);
        }
        self
    }

    fn choices(&self) -> impl Iterator<Item = &GatherParams> {
        std::iter::once(&self.gather).chain(&self.alternatives)
    }

    fn has(&self, gather: &GatherParams) -> bool {
        self.choices().any(|whole| includes(whole, gather))
    }

    /// Whether a bake for these views has all texels that `other` needs.
    pub fn serve(&self, other: &Served) -> bool {
        self.supersample == other.supersample
            && other.choices().all(|gather| self.has(gather))
            && other.cameras.iter().all(|c| self.cameras.contains(c))
    }
}

/// Runs the gather of every view on the probes' geometry, of which only what the view at hand uses is in memory.
pub fn wanted_texels(
    world: &World,
    curvature: &CurvatureMap,
    places: &Places,
    map: &dyn Fn(usize) -> Result<ParameterMap>,
    cameras: &[Camera],
    views: &Served,
    progress: &dyn Progress,
) -> Result<Wanted> {
    let mut wanted: BTreeMap<usize, Vec<AtomicBool>> = BTreeMap::new();
    let mut probes: BTreeMap<usize, Probe> = BTreeMap::new();
    let mut candidates = NearCandidates::default();
    progress.start("texels that the views use", cameras.len() as u64);
    for camera in cameras {
        let most = views.choices().map(|gather| gather.probes).max().unwrap_or(1);
        let near = places.nearest(camera.position(), most);
        probes.retain(|index, _| near.iter().any(|(i, _)| i == index));
        for &(index, _) in &near {
            if let Entry::Vacant(entry) = probes.entry(index) {
                let probe = entry.insert(probe_geometry(world, places.position(index), map(index)?));
                wanted.entry(index).or_insert_with(|| probe.texels.iter().map(|_| AtomicBool::new(false)).collect());
            }
        }
        let near: Vec<_> = near.iter().map(|&(index, weight)| (index, &probes[&index], weight)).collect();
        let weighted = candidates.of(world, &near, None, false);
        let fine = Camera { size: camera.size.map(|s| s * views.supersample), ..camera.clone() };
        let view = gbuffer(world, curvature, &fine);
        let reflected = mirror_pass(world, &view);
        tiles(&view, &reflected).par_iter().for_each(|tile| {
            for gather in views.choices() {
                // The nearest come first.
                let probes = &weighted[..weighted.len().min(gather.probes.clamp(1, 8))];
                for samples in best_samples(fine.position(), &reflected, (tile.as_slice(), view.size()[0]), probes, gather) {
                    for (k, w) in probes.iter().enumerate() {
                        let Some(sample) = samples.of(k) else { continue };
                        for texel in footprint_texels(w.probe, sample.texel) {
                            wanted[&w.index][texel].store(true, Ordering::Relaxed);
                        }
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

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    #[test]
    fn a_set_serves_fewer_probes_and_its_alternatives_and_nothing_else() {
        let camera = Camera::look_at(Vec3::ZERO, Vec3::Z, Vec3::Y, 1.0, [8, 8]);
        let base = GatherParams::default();
        let views = |gather: &GatherParams| Served::new(std::slice::from_ref(&camera), 1, gather);
        let (one, every) = (GatherParams { probes: 1, ..base.clone() }, GatherParams { anchors: 1, ..base.clone() });
        assert!(views(&base).serve(&views(&one)) && !views(&one).serve(&views(&base)));
        assert!(!views(&base).serve(&views(&every)));
        let both = views(&base).or(&every).or(&one);
        assert!(both.serve(&views(&every)) && both.serve(&views(&GatherParams { probes: 4, ..every.clone() })));
        assert_eq!(both.alternatives.len(), 1, "what is there already is not asked for again");
        assert!(!views(&every).serve(&both) && views(&GatherParams { falloff: 1.0, ..base }).serve(&views(&one)));
        // Sets that were baked before there were alternatives say nothing of them.
        let text = serde_json::to_string(&views(&one)).unwrap();
        assert!(!text.contains("alternatives") && serde_json::from_str::<Served>(&text).unwrap() == views(&one));
    }
}
