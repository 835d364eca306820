//! The bake: the mean of E_T over the visible part of every texel, front and back.
//!
//! Ours: sides that face into a solid, and backs that no light reaches, are left out chart by chart. The work is one list
//! of texels in blocks of [`BLOCK`], each a function of scene, parameters and seed alone: blocks can be done in any order,
//! by any number of threads or machines, kept, and put together later. A first pass traces a few paths a texel in full; paths
//! of the second read diffuse light from its map, one bounce away, where the mean over many texels hides their noise.

use super::adjacency::adjacency;
use super::parts::{Record, Store};
use super::solid::{Orientation, mark_solids};
use super::texels::Texels;
use super::visible::{View, Visibility, facing};
use super::{Atlas, AtlasParams, LightMap, fill, lookup, seam};
use crate::math::{Rgb, hash_words};
use crate::progress::Progress;
use crate::scene::{Emitter, Scene};
use crate::transport::bsdf::Lobes;
use crate::transport::path::{KnownDiffuse, PathParams, transmitted_irradiance};
use crate::transport::{Sampler, Surface, World};
use crate::{Error, Result};
use glam::{Vec2, Vec3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Texels a block.
pub const BLOCK: usize = 4096;

/// Samples that decide what a texel sees, and whether a back is lit at all.
const FIRST_SAMPLES: u32 = 16;

/// Texels of a chart's back that are asked whether it is lit. All of most charts; of a large wall so many that a lit patch
/// of a four-thousandth of it is found. All of kitchen's dark backs would take longer than a draft.
const LIT_TEXELS: usize = 4096;

/// Most sample points tried for each one that counts, in a texel that is hidden in part.
const TRIES: u32 = 4;

/// Most regions of a texel that are told apart.
const MAX_REGIONS: usize = 4;

/// The value comes from samples in the open.
const OPEN: u32 = 1;
/// The value comes from samples pressed against other geometry.
const CONTACT: u32 = 2;
/// A dark part of the texel was left out.
const SPLIT: u32 = 4;

/// All parameters of a bake but the seed.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BakeParams {
    /// Samples a texel. Paper, §7.2: 2048; ours by default 256.
    pub spp: u32,
    /// Texel size.
    pub atlas: AtlasParams,
    /// Path length and roulette.
    pub path: PathParams,
    /// Samples a texel of the first pass; 0: there is none, and every path is traced in full.
    pub first_spp: u32,
}

impl Default for BakeParams {
    fn default() -> Self {
        Self { spp: 256, atlas: AtlasParams::default(), path: PathParams::default(), first_spp: 0 }
    }
}

/// E_T in an atlas's layout.
#[derive(Debug, Clone, PartialEq)]
pub struct Baked {
    /// On the side of the shading normal, rows from the top.
    pub front: Vec<Rgb>,
    /// Behind, where any back is lit.
    pub back: Option<Vec<Rgb>>,
}

/// A bake that is ready to start: what is sampled where.
pub struct Plan<'a> {
    world: &'a World,
    params: BakeParams,
    seed: u32,
    /// The atlas.
    pub atlas: Atlas,
    texels: Texels,
    orientation: Orientation,
    /// Charts with a front and a back to bake.
    active: Vec<[bool; 2]>,
    /// Texel and whether its back is meant.
    items: Vec<(u32, bool)>,
}

/// One pass over all texels.
#[derive(Clone, Copy)]
pub struct Pass<'a> {
    /// Samples a texel.
    spp: u32,
    seed: u32,
    /// Where paths read diffuse light.
    known: Option<&'a LightMap>,
}

impl<'a> Plan<'a> {
    /// Cuts the charts, finds the solids, and leaves out the sides that nobody sees or no light reaches.
    pub fn new(world: &'a World, params: &BakeParams, seed: u32) -> Result<Self> {
        if params.spp == 0 {
            return Err(Error::Request("--spp 0: expected at least 1".into()));
        }
        let scene = &world.scene;
        let bsdf = |object: usize| &scene.materials[scene.geometry.objects[object].material as usize].bsdf;
        let diffuse = |o: usize| bsdf(o).lobes().contains(Lobes::DIFFUSE) && !bsdf(o).is_transmissive();
        let atlas = Atlas::build(&scene.geometry, &diffuse, &params.atlas)?;
        let texels = Texels::new(&scene.geometry, &atlas);
        let orientation = solids(scene);
        let mut plan = Self { world, params: *params, seed, atlas, texels, orientation, active: Vec::new(), items: Vec::new() };
        plan.active = plan.active_sides();
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
        (spp > 0).then(|| Pass { spp, seed: hash_words(&[self.seed, spp]), known: None })
    }

    /// The pass whose map counts; its paths read diffuse light from `known` and are traced in full without it.
    pub fn second_pass<'k>(&self, known: Option<&'k LightMap>) -> Pass<'k> {
        Pass { spp: self.params.spp, seed: self.seed, known }
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

    fn block(&self, block: u32) -> &[(u32, bool)] {
        self.items.chunks(BLOCK).nth(block as usize).unwrap_or_default()
    }

    /// Bakes a pass's blocks for which `mine` holds and which `store` does not have yet; returns how many it had.
    pub fn run(&self, pass: &Pass, store: &dyn Store, mine: &dyn Fn(u32) -> bool, progress: &dyn Progress) -> Result<u32> {
        let blocks: Vec<u32> = (0..self.blocks()).filter(|&b| mine(b)).collect();
        progress.start("Light map", blocks.iter().map(|&b| self.block(b).len() as u64).sum());
        let mut found = 0;
        for b in blocks {
            let items = self.block(b);
            if self.has(store, b) {
                found += 1;
                progress.advance(items.len() as u64);
                continue;
            }
            let records: Vec<Record> = items
                .par_iter()
                .map(|&(texel, back)| {
                    let record = self.texel(pass, texel as usize, back);
                    progress.advance(1);
                    record
                })
                .collect();
            store.put(b, &records)?;
        }
        progress.finish();
        Ok(found)
    }

    /// Whether `store` has a finished block.
    pub fn has(&self, store: &dyn Store, block: u32) -> bool {
        store.has(block, self.block(block).len())
    }

    /// The finished map, ready for lookups.
    pub fn map(&self, store: &dyn Store) -> Result<LightMap> {
        let Baked { front, back } = self.assemble(store)?;
        Ok(lookup::sides(&self.world.scene.geometry, &self.atlas, front, back))
    }

    /// Puts the blocks together: gutters, texels that nobody sees, seams.
    pub fn assemble(&self, store: &dyn Store) -> Result<Baked> {
        let mut sides = [Side::new(self), Side::new(self)];
        for b in 0..self.blocks() {
            let items = self.block(b);
            let records = store
                .get(b, items.len())
                .ok_or_else(|| Error::Request(format!("block {b} of the light map is missing: bake it again")))?;
            for (&(texel, back), r) in items.iter().zip(&records) {
                let side = &mut sides[back as usize];
                let pixel = self.texels.pixel[texel as usize] as usize;
                side.pixels[pixel] = Rgb::from_array([r[0], r[1], r[2]].map(f32::from_bits));
                side.flags[pixel] = r[3];
            }
        }
        let [front, back] = sides;
        let has_back = self.backs() > 0;
        Ok(Baked { front: self.finish(front, false), back: has_back.then(|| self.finish(back, true)) })
    }

    fn finish(&self, mut side: Side, back: bool) -> Vec<Rgb> {
        self.lighten_hidden(&mut side, back);
        let valid: Vec<bool> = side.flags.iter().map(|f| f & (OPEN | CONTACT) != 0).collect();
        fill::dilate(&self.atlas, &mut side.pixels, &valid);
        let active = |chart: u32| self.active[chart as usize][back as usize];
        seam::close(&self.world.scene.geometry, &self.atlas, &mut side.pixels, &valid, &active);
        side.pixels
    }

    /// Texels in the dark behind a wall, and texels pressed against something, take the light of their neighbours in the
    /// open, so that interpolation up to a wall or a foot does not reach into the dark. Those further in keep their own:
    /// they may be seen through a crack.
    fn lighten_hidden(&self, side: &mut Side, back: bool) {
        let width = self.atlas.size[0] as i64;
        let mut texel_at = vec![u32::MAX; side.pixels.len()];
        for (i, &pixel) in self.texels.pixel.iter().enumerate() {
            texel_at[pixel as usize] = i as u32;
        }
        let visibility = self.visibility();
        let centre = |texel: usize| visibility.sample(texel, Vec2::splat(0.5));
        let changes: Vec<(usize, Rgb)> = (0..self.texels.len())
            .into_par_iter()
            .filter_map(|i| {
                let pixel = self.texels.pixel[i] as usize;
                let pressed = side.flags[pixel] & CONTACT != 0;
                let void = side.flags[pixel] & OPEN != 0 && side.pixels[pixel] == Rgb::ZERO;
                if !pressed && !void {
                    return None;
                }
                let in_the_open = |&p: &usize| {
                    let chart = |t: u32| self.texels.chart[t as usize];
                    side.flags.get(p).is_some_and(|f| f & OPEN != 0)
                        && chart(texel_at[p]) == self.texels.chart[i]
                        && (pressed
                            || side.pixels[p] != Rgb::ZERO
                                && (side.flags[p] & SPLIT != 0
                                    || !visibility.together(&centre(i), &centre(texel_at[p] as usize), back)))
                };
                let around = [-width - 1, -width, 1 - width, -1, 1, width - 1, width, width + 1];
                let lit: Vec<usize> = around.into_iter().map(|d| (pixel as i64 + d) as usize).filter(in_the_open).collect();
                (!lit.is_empty()).then(|| (pixel, lit.iter().map(|&p| side.pixels[p]).sum::<Rgb>() / lit.len() as f32))
            })
            .collect();
        for (pixel, value) in changes {
            side.pixels[pixel] = value;
        }
    }

    fn visibility(&self) -> Visibility<'_> {
        Visibility { world: self.world, atlas: &self.atlas, texels: &self.texels, orientation: &self.orientation }
    }

    /// Sample `i` of a texel: its place and the rest of its random numbers.
    fn draw(&self, pass: &Pass, texel: usize, back: bool, i: u32) -> (Surface, Sampler) {
        let stream = hash_words(&[pass.seed, u32::from(back), self.texels.pixel[texel]]);
        let mut sampler = Sampler::new(stream, i);
        (self.visibility().sample(texel, sampler.next_2d()), sampler)
    }

    fn light(&self, pass: &Pass, surface: &Surface, back: bool, mut sampler: Sampler) -> Rgb {
        let known = pass.known.map(|map| |s: &Surface, wo: Vec3| map.diffuse_radiance(&self.world.scene, s, wo));
        let known = known.as_ref().map(|known| known as KnownDiffuse);
        // The path starts with a set of dimensions of its own, whether the view was tested or not.
        transmitted_irradiance(self.world, surface, back, known, &self.params.path, &mut sampler)
    }

    /// One texel's value and flags.
    fn texel(&self, pass: &Pass, texel: usize, back: bool) -> Record {
        let visibility = self.visibility();
        let first: Vec<_> = (0..FIRST_SAMPLES).map(|i| self.draw(pass, texel, back, i)).collect();
        let views: Vec<View> = first.iter().map(|(s, sampler)| visibility.view(s, back, &mut sampler.clone())).collect();
        let best = views.iter().max().copied().unwrap_or(View::Inside);
        if best == View::Inside {
            return record(Rgb::ZERO, 0);
        }
        let plain = views.iter().all(|&v| v == best)
            && (best == View::Contact || first[1..].iter().all(|(s, _)| visibility.together(&first[0].0, s, back)));
        if !plain {
            return self.hidden_in_part(pass, texel, back, best);
        }
        let sum: Rgb = (0..pass.spp)
            .map(|i| {
                let (surface, sampler) = self.draw(pass, texel, back, i);
                self.light(pass, &surface, back, sampler)
            })
            .sum();
        record(sum / pass.spp as f32, if best == View::Open { OPEN } else { CONTACT })
    }

    /// A texel of which some samples are hidden, or lie in several regions: see [`super::visible`].
    fn hidden_in_part(&self, pass: &Pass, texel: usize, back: bool, wanted: View) -> Record {
        struct Region {
            at: Surface,
            sum: Rgb,
            count: u32,
        }
        let visibility = self.visibility();
        let mut regions: Vec<Region> = Vec::new();
        let mut count = 0;
        for i in 0..pass.spp.saturating_mul(TRIES).max(FIRST_SAMPLES) {
            let (surface, mut sampler) = self.draw(pass, texel, back, i);
            if visibility.view(&surface, back, &mut sampler) != wanted {
                continue;
            }
            let mut region = regions.iter().position(|r| visibility.together(&r.at, &surface, back));
            if region.is_none() && regions.len() < MAX_REGIONS {
                regions.push(Region { at: surface, sum: Rgb::ZERO, count: 0 });
                region = Some(regions.len() - 1);
            }
            let Some(region) = region else { continue };
            regions[region].sum += self.light(pass, &surface, back, sampler);
            regions[region].count += 1;
            count += 1;
            if count >= pass.spp {
                break;
            }
        }
        let flag = if wanted == View::Open { OPEN } else { CONTACT };
        let mut lit: Vec<&Region> = regions.iter().filter(|r| r.sum != Rgb::ZERO).collect();
        let split = if lit.len() < regions.len() && !lit.is_empty() { SPLIT } else { 0 };
        if lit.len() > 1 {
            let near: Vec<bool> = lit.iter().map(|r| visibility.near_sensor(&r.at, back)).collect();
            if near.contains(&true) {
                let mut keep = near.iter();
                lit.retain(|_| *keep.next().unwrap_or(&true));
            }
        }
        // The largest; the first of equals.
        let chosen = lit.into_iter().rev().max_by_key(|r| r.count);
        record(chosen.map_or(Rgb::ZERO, |r| r.sum / r.count as f32), flag | split)
    }

    /// Which sides of each chart are baked: not those that face into a solid, not the backs of one-sided materials,
    /// and not backs that get no light at all from the first samples of their texels.
    fn active_sides(&self) -> Vec<[bool; 2]> {
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
                [seen(false), two_sided && seen(true) && lit()]
            })
            .collect()
    }
}

/// One side of the atlas in the making.
struct Side {
    pixels: Vec<Rgb>,
    flags: Vec<u32>,
}

impl Side {
    fn new(plan: &Plan) -> Self {
        let n = (plan.atlas.size[0] * plan.atlas.size[1]) as usize;
        Self { pixels: vec![Rgb::ZERO; n], flags: vec![0; n] }
    }
}

fn record(value: Rgb, flags: u32) -> Record {
    [value.x.to_bits(), value.y.to_bits(), value.z.to_bits(), flags]
}

/// The solids of a scene. Masked objects have holes and transmissive ones let light in: they are none.
fn solids(scene: &Scene) -> Orientation {
    let geometry = &scene.geometry;
    let mut occupied: Vec<Vec3> = scene.sensor.iter().map(|s| s.position()).collect();
    for emitter in &scene.emitters {
        match emitter {
            Emitter::Area { object, .. } => {
                let Some(o) = geometry.objects.get(*object as usize) else { continue };
                // Points just before the emitting side, so that a lamp's own surface does not hold them.
                for t in o.triangles.clone().step_by(o.triangles.len().div_ceil(16).max(1)) {
                    let [a, b, c] = geometry.corners(t);
                    let n = geometry.area_normal(t);
                    occupied.push((a + b + c) / 3.0 + n.normalize_or_zero() * (1e-3 * n.length().sqrt()));
                }
            }
            Emitter::Point { position, .. } | Emitter::Spot { position, .. } => occupied.push(*position),
            Emitter::Envmap { .. } | Emitter::Constant { .. } | Emitter::Directional { .. } => {}
        }
    }
    let mut orientation = vec![0; geometry.triangles.len()];
    for (i, o) in geometry.objects.iter().enumerate() {
        let material = &scene.materials[o.material as usize];
        if material.opacity.is_none() && !material.bsdf.is_transmissive() {
            mark_solids(geometry, &adjacency(geometry, i), &occupied, &mut orientation);
        }
    }
    orientation
}
