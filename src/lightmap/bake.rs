//! The bake: the mean of E_T over the visible part of every texel, front and back.
//!
//! *Ours*: sides that face into a solid, and backs that no light reaches, are left out chart by chart. The work is one list
//! of texels in blocks of [`BLOCK`], each a function of scene, parameters and seed alone: blocks can be done in any order,
//! by any number of threads or machines, kept, and put together later. A first pass traces a few paths a texel in full; paths
//! of the second read diffuse light from its map, one bounce away, where the mean over many texels hides their noise.

use super::denoise::DenoiseParams;
use super::parts::Store;
use super::solid::{Orientation, solids};
use super::texels::Texels;
use super::visible::{Sight, Visibility, facing};
use super::{Atlas, AtlasParams, LightMap};
use crate::base::math::{Rgb, hash_words};
use crate::base::named::{Parameters, within};
use crate::base::progress::Progress;
use crate::io::jobs::{Done, Shard, complete};
use crate::material::Surface;
use crate::material::bsdf::Lobes;
use crate::scene::Scene;
use crate::transport::World;
use crate::transport::follow::{Follow, OnCpu, Purpose};
use crate::transport::path::{KnownDiffuse, PathParams};
use crate::{Error, Result};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Texels a block.
pub const BLOCK: usize = 4096;

/// Blocks that a GPU bakes at once.
const GPU_BLOCKS: usize = 16;

/// Samples that decide what a texel sees, whether a back is lit at all, and how many more a texel takes.
pub(super) const FIRST_SAMPLES: u32 = 16;

/// Texels of a chart's back that are asked whether it is lit. All of most charts; of a large wall so many that a lit patch
/// of a four-thousandth of it is found. All of kitchen's dark backs would take longer than a draft.
const LIT_TEXELS: usize = 4096;

/// The value comes from samples in the open.
pub(super) const OPEN: u32 = 1;
/// The value comes from samples pressed against other geometry.
pub(super) const CONTACT: u32 = 2;
/// A dark part of the texel was left out.
pub(super) const SPLIT: u32 = 4;
/// Some of its samples do not count: what is told of the texel holds near one that does.
pub(super) const PART: u32 = 8;

/// All parameters of a bake but the seed.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LightMapParams {
    /// Samples a texel; the most, where `error` is given. *Paper* (§7.2): 2048. *Ours*: 256.
    pub spp: u32,
    /// Standard error at which a texel is done, in units of its luminance plus [`DIM`](super::adaptive::DIM); `None` gives each `spp` samples.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub error: Option<f32>,
    /// Texel size.
    pub atlas: AtlasParams,
    /// Path length and roulette.
    pub path: PathParams,
    /// Samples a texel of the first pass; 0: there is none, and every path is traced in full.
    pub first_spp: u32,
    /// How the noise is taken out of the finished texels; `None`: it stays. The map of the first pass keeps its own, so that what the second
    /// reads has no bias of a filter.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub denoise: Option<DenoiseParams>,
    /// Metres within which what a ray meets blocks it: the map is ambient occlusion, and no light. `None`: it is light.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ao: Option<f32>,
}

impl Default for LightMapParams {
    fn default() -> Self {
        let (atlas, path) = Default::default();
        Self { spp: 256, error: None, atlas, path, first_spp: 0, denoise: None, ao: None }
    }
}

impl LightMapParams {
    /// Refuses what cannot be baked.
    pub fn validate(&self) -> Result<()> {
        if let Some(distance) = self.ao {
            within("--ao", distance, 1e-6..=1e9)?;
            if self.first_spp > 0 {
                return Err(Error::Request("--first-spp: --ao has no use for it: its rays have one segment".into()));
            }
        }
        self.error.map_or(Ok(()), |e| within("--error", e, f32::MIN_POSITIVE..=1e9))?;
        match (self.spp, &self.denoise) {
            (0, _) => Err(Error::Request("--spp 0: expected at least 1".into())),
            (1, Some(_)) => Err(Error::Request("--denoise: one sample tells nothing of its noise; give --spp 2 or more".into())),
            (_, denoise) => denoise.as_ref().map_or(Ok(()), Parameters::validate),
        }
    }
}

/// E_T, or how open each texel is, in an atlas's layout.
#[derive(Debug, Clone, PartialEq)]
pub struct Baked {
    /// On the side of the shading normal, rows from the top.
    pub front: Vec<Rgb>,
    /// Behind, where any back is lit.
    pub back: Option<Vec<Rgb>>,
    /// Samples that count, of a texel side on average.
    pub samples: f64,
}

/// A bake that is ready to start: what is sampled where.
pub struct Plan<'a> {
    pub(super) world: &'a World,
    pub(super) params: LightMapParams,
    seed: u32,
    /// The atlas.
    pub atlas: Atlas,
    pub(super) texels: Texels,
    orientation: Orientation,
    /// Charts with a front and a back to bake.
    pub(super) active: Vec<[bool; 2]>,
    /// Texel and whether its back is meant.
    pub(super) items: Vec<(u32, bool)>,
}

/// One pass over all texels.
#[derive(Clone, Copy)]
pub struct Pass<'a> {
    /// Samples a texel; the most, where there is an error to reach.
    pub(super) spp: u32,
    pub(super) error: Option<f32>,
    pub(super) seed: u32,
    /// Where paths read diffuse light, and what is known of the texels.
    pub(super) known: Option<&'a First>,
    /// Where they are followed; `None` for the CPU.
    device: Option<&'a dyn Follow>,
    /// How the noise is taken out of the finished texels, if it is.
    pub(super) denoise: Option<DenoiseParams>,
}

/// What a first pass has found.
pub struct First {
    /// Its map, from which paths of the second read diffuse light.
    pub map: LightMap,
    /// What each pixel's front and back see, where that is the same for all of their samples.
    pub(super) sights: Vec<[Option<Sight>; 2]>,
}

impl First {
    /// What all samples of a pixel's side see; `None` where it is not the same.
    pub(super) fn sight(&self, pixel: u32, back: bool) -> Option<Sight> {
        self.sights[pixel as usize][usize::from(back)]
    }
}

impl<'a> Pass<'a> {
    /// The same pass, its paths followed on a device, whose scene has the light map that they read.
    pub fn on(self, device: Option<&'a dyn Follow>) -> Self {
        Self { device, ..self }
    }
}

impl<'a> Plan<'a> {
    /// Cuts the charts, finds the solids, and leaves out the sides that nobody sees or no light reaches.
    pub fn new(world: &'a World, params: &LightMapParams, seed: u32) -> Result<Self> {
        Self::of_sides(world, params, seed, false)
    }

    /// As [`Plan::new`], for light that is not known yet: backs count whether the scene's own lights reach them or not.
    pub fn for_any_light(world: &'a World, atlas: AtlasParams) -> Result<Self> {
        Self::of_sides(world, &LightMapParams { atlas, ..LightMapParams::default() }, 0, true)
    }

    fn of_sides(world: &'a World, params: &LightMapParams, seed: u32, any_light: bool) -> Result<Self> {
        params.validate()?;
        let scene = &world.scene;
        let atlas = atlas_of(scene, &params.atlas)?;
        let texels = Texels::new(&scene.geometry, &atlas);
        let orientation = solids(scene);
        let mut plan = Self { world, params: *params, seed, atlas, texels, orientation, active: Vec::new(), items: Vec::new() };
        plan.active = plan.active_sides(any_light);
        for back in [false, true] {
            let active = |&t: &u32| plan.active[plan.texels.chart[t as usize] as usize][back as usize];
            let list = (0..plan.texels.len() as u32).filter(active).map(|t| (t, back));
            plan.items.extend(list.collect::<Vec<_>>());
        }
        Ok(plan)
    }

    /// The pass that traces a few paths in full, for the second to read its map; `None` if the second shall do without.
    pub fn first_pass(&self) -> Option<Pass<'static>> {
        let spp = self.params.first_spp;
        let seed = hash_words(&[self.seed, spp]);
        (spp > 0).then(|| Pass { spp, error: None, seed, denoise: None, ..self.second_pass(None) })
    }

    /// The pass whose map counts; its paths read diffuse light from the `known` map and are traced in full without one.
    pub fn second_pass<'k>(&self, known: Option<&'k First>) -> Pass<'k> {
        let LightMapParams { spp, error, denoise, .. } = self.params;
        Pass { spp, error, seed: self.seed, known, device: None, denoise }
    }

    /// Whether it bakes light, and not ambient occlusion.
    pub fn is_light(&self) -> bool {
        self.params.ao.is_none()
    }

    /// Texel sides to bake.
    pub fn len(&self) -> usize {
        self.items.len()
    }

    /// Whether there is nothing to bake.
    pub fn is_empty(&self) -> bool {
        self.items.is_empty()
    }

    /// Texel sides that are backs.
    pub fn backs(&self) -> usize {
        self.items.iter().filter(|i| i.1).count()
    }

    /// Number of blocks.
    pub fn blocks(&self) -> u32 {
        self.items.len().div_ceil(BLOCK) as u32
    }

    pub(super) fn block(&self, block: u32) -> &[(u32, bool)] {
        self.items.chunks(BLOCK).nth(block as usize).unwrap_or_default()
    }

    /// Bakes a pass's blocks that are `shard`'s and that `store` does not have yet; once all are there, `seal` follows.
    pub fn run(
        &self,
        pass: &Pass,
        store: &dyn Store,
        shard: Option<Shard>,
        progress: &dyn Progress,
        seal: impl FnOnce() -> Result<()>,
    ) -> Result<Done> {
        let blocks: Vec<usize> = (0..self.blocks() as usize).collect();
        let is_kept = |b: usize| self.has(store, b as u32);
        complete(&blocks, shard, &is_kept, |todo| self.bake_blocks(pass, store, todo, progress), seal)
    }

    fn bake_blocks(&self, pass: &Pass, store: &dyn Store, todo: &[usize], progress: &dyn Progress) -> Result<()> {
        progress.start("Light map", todo.iter().map(|&b| self.block(b as u32).len() as u64).sum());
        let known = pass.known.map(|first| |s: &Surface, wo| first.map.diffuse_radiance(&self.world.scene, s, wo));
        let known = known.as_ref().map(|known| known as KnownDiffuse);
        let purpose = self.params.ao.map_or(Purpose::Irradiance, Purpose::Openness);
        let on_cpu = OnCpu { world: self.world, purpose, known, params: self.params.path };
        let device = pass.device.unwrap_or(&on_cpu);
        // A GPU is fed with many texels at once.
        for group in todo.chunks(if pass.device.is_some() { GPU_BLOCKS } else { 1 }) {
            let items: Vec<(u32, bool)> = group.iter().flat_map(|&b| self.block(b as u32)).copied().collect();
            let records = self.bake_texels(device, pass, &items, progress)?;
            for (&b, records) in group.iter().zip(records.chunks(BLOCK)) {
                store.put(b as u32, records)?;
            }
        }
        progress.finish();
        Ok(())
    }

    /// Whether `store` has a finished block.
    pub fn has(&self, store: &dyn Store, block: u32) -> bool {
        store.has(block, self.block(block).len())
    }

    pub(super) fn visibility(&self) -> Visibility<'_> {
        Visibility { world: self.world, atlas: &self.atlas, texels: &self.texels, orientation: &self.orientation }
    }

    /// Which sides of each chart are baked: not those that face into a solid, not the backs of one-sided materials,
    /// and not backs that get no light at all from the first samples of their texels, unless any light may come.
    fn active_sides(&self, any_light: bool) -> Vec<[bool; 2]> {
        let mut range = vec![(usize::MAX, 0); self.atlas.charts.len()];
        for (i, &c) in self.texels.chart.iter().enumerate() {
            let r: &mut (usize, usize) = &mut range[c as usize];
            *r = (r.0.min(i), i + 1);
        }
        let pass = &self.second_pass(None);
        (0..self.atlas.charts.len())
            .into_par_iter()
            .map(|c| {
                let (start, end) = range[c];
                if start >= end {
                    return [false; 2];
                }
                let seen = |back: bool| {
                    let (surface, _) = self.draw(pass, start, back, 0);
                    let outwards = f32::from(self.orientation[surface.triangle as usize]);
                    outwards * facing(&surface, back).dot(surface.ng) >= 0.0
                };
                let object = self.world.scene.geometry.object(self.atlas.charts[c].triangles[0]);
                let two_sided = self.world.scene.materials[object.material as usize].bsdf.is_two_sided();
                let lit = || {
                    (start..end).into_par_iter().step_by((end - start).div_ceil(LIT_TEXELS)).any(|t| {
                        (0..FIRST_SAMPLES).any(|i| {
                            let (surface, sampler) = self.draw(pass, t, true, i);
                            self.light(pass, &surface, true, sampler) != Rgb::ZERO
                        })
                    })
                };
                [seen(false), two_sided && seen(true) && (any_light || lit())]
            })
            .collect()
    }
}

/// The atlas of a scene's surfaces with a diffuse lobe. The same scene and parameters give the same atlas.
pub fn atlas_of(scene: &Scene, params: &AtlasParams) -> Result<Atlas> {
    let bsdf = |object: usize| &scene.materials[scene.geometry.objects[object].material as usize].bsdf;
    let diffuse = |o: usize| bsdf(o).lobes().contains(Lobes::DIFFUSE) && !bsdf(o).is_transmissive();
    Atlas::build(&scene.geometry, &diffuse, params)
}
