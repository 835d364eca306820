//! Baking a probe: reflector, mirror-reflected and glossy maps at the resolution that its parameterisation gives (§4.1, §4.2.2, §6.1).

use super::gpu::paths::ProbePaths;
use crate::Result;
use crate::base::math::{Rgb, hash_words, luminance};
use crate::base::progress::Progress;
use crate::base::ray::{Hit, Ray};
use crate::gpu::{PathStart, SampleSum};
use crate::lightmap::LightMap;
use crate::material::Surface;
use crate::material::bsdf::{Lobes, Query};
use crate::probe::file::{NO_TRIANGLE, Probe, Texel};
use crate::probe::parameter_map::ParameterMap;
use crate::transport::path::{KnownDiffuse, PathParams, scattered};
use crate::transport::{Sampler, World};
use crate::view::gbuffer::is_glossy;
use crate::view::mirror::mirror_hit;
use crate::view::mirror_light::mirror_light;
use glam::{Vec2, Vec3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::ops::Range;
use std::sync::atomic::{AtomicU64, Ordering};

/// The paper's factor on alpha at the first vertex (§6.1).
pub const PAPER_ROUGHNESS_SCALE: f32 = 0.5;

/// Parameters of a bake.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BakeParams {
    /// Paths a texel; the most, where `error` is given. *Paper* (§7): 2048.
    pub spp: u32,
    /// Standard error at which a texel is done, in units of its luminance plus [`ERROR_FLOOR`]; `None` gives each `spp` paths. *Ours*.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub error: Option<f32>,
    /// Multiplies alpha at the first vertex. *Paper* (§6.1): 0.5, [`PAPER_ROUGHNESS_SCALE`]. *Ours*: 1, the material's own:
    /// what the paths have integrated the filter need not guess, and what it then blurs is noise (`footprint.roughness_scale`).
    pub roughness_scale: f32,
    /// Spread the samples over the texel's solid angle, as far as it shows the reflector that its centre shows, in place of
    /// sending all through the centre. *Ours*. A spread texel mixes what a mirror shows on both sides of an edge, and the gather
    /// then finds a bright colour where the geometry maps promise a dark surface; so it is off by default.
    pub spread: bool,
}

impl Default for BakeParams {
    fn default() -> Self {
        Self { spp: 2048, error: None, roughness_scale: 1.0, spread: false }
    }
}

/// Paths of every texel, from whose variance adaptive sampling decides how many more it takes.
const PILOT: u32 = 8;

/// Luminance below which errors matter less than in proportion.
pub const ERROR_FLOOR: f32 = 0.01;

/// The reflector and mirror-reflected maps of a probe; its glossy map is black as yet.
pub fn probe_geometry(world: &World, position: Vec3, map: ParameterMap) -> Probe {
    let size = map.size;
    let texels = (0..size[0] * size[1])
        .into_par_iter()
        .with_min_len(size[0] as usize)
        .map(|i| {
            let wo = -direction(&map, i, Vec2::splat(0.5));
            match world.intersect(&Ray::new(position, -wo)) {
                Some(s) => Texel::new(s.triangle, s.barycentric, mirror_hit(world, &s, wo)),
                None => Texel::EMPTY,
            }
        })
        .collect();
    Probe { position, size, texels, map }
}

/// Direction through a texel at `offset` in [0, 1)² of it.
fn direction(map: &ParameterMap, texel: u32, offset: Vec2) -> Vec3 {
    let width = map.size[0];
    map.direction_from_texel(Vec2::new((texel % width) as f32, (texel / width) as f32) + offset)
}

/// What all probes of a bake share.
#[derive(Clone, Copy)]
pub struct Bake<'a> {
    /// The scene.
    pub world: &'a World,
    /// Parameters.
    pub params: &'a BakeParams,
    /// Seed of all random numbers.
    pub seed: u32,
    /// Diffuse light of the scene, read where a path leaves the glossy chain. *Ours*: the paper traces on.
    pub lightmap: Option<&'a LightMap>,
    /// Where the paths are followed; `None` for the CPU.
    pub gpu: Option<&'a ProbePaths>,
}

/// What was traced for a probe.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Traced {
    /// Texels that see a glossy surface and are wanted.
    pub texels: u64,
    /// Their paths.
    pub paths: u64,
}

/// Sums over the paths of one texel.
#[derive(Clone, Copy, Default)]
struct Sums {
    paths: u32,
    color: Rgb,
    /// Of luminance, and its square.
    moments: [f64; 2],
}

impl Sums {
    fn and(self, other: Self) -> Self {
        Self {
            paths: self.paths + other.paths,
            color: self.color + other.color,
            moments: [self.moments[0] + other.moments[0], self.moments[1] + other.moments[1]],
        }
    }
}

/// What the centre of a texel sees: where its paths begin.
struct Centre {
    texel: u32,
    hit: Hit,
    stream: u32,
}

/// Fills the glossy map: L(S|D)*S+E with the first vertex' roughness reduced. Texels for which `wanted` does not hold stay black.
/// The random stream of a texel is a hash of (seed, probe index, texel), so that no thread count changes a bit.
///
/// Adaptive sampling decides from the first [`PILOT`] paths of a texel and of its neighbours together. Stopping as soon as the texel's own
/// paths agree would favour those that have missed a rare bright path so far.
///
/// # Errors
/// What goes wrong on a GPU.
pub fn bake_glossy(
    bake: &Bake,
    probe: &mut Probe,
    index: u32,
    wanted: &(dyn Fn(u32) -> bool + Sync),
    progress: &dyn Progress,
) -> Result<Traced> {
    let most = bake.params.spp;
    let centres = centres(bake, probe, index, wanted);
    let sums = match bake.params.error {
        None => trace(bake, probe, &centres, &|_| 0..most, Some(progress))?,
        Some(error) => {
            let first = trace(bake, probe, &centres, &|_| 0..PILOT.min(most), None)?;
            let mut pilot = vec![None; probe.texels.len()];
            for (centre, sums) in centres.iter().zip(&first) {
                pilot[centre.texel as usize] = Some(*sums);
            }
            let width = probe.map.size[0];
            let paths: Vec<u32> = centres.iter().map(|c| paths_for(error, most, &pilot, c.texel, width)).collect();
            let rest = trace(bake, probe, &centres, &|i| PILOT.min(most)..paths[i], Some(progress))?;
            first.into_iter().zip(rest).map(|(first, rest)| first.and(rest)).collect()
        }
    };
    let mut traced = Traced::default();
    let mirrored: Vec<Option<Rgb>> = centres.par_iter().map(|centre| mirrored(bake, probe, centre)).collect();
    for ((centre, sums), mirrored) in centres.iter().zip(sums).zip(mirrored) {
        let texel = &mut probe.texels[centre.texel as usize];
        texel.set_glossy(sums.color / sums.paths as f32);
        texel.set_mirrored(mirrored.unwrap_or(Rgb::ZERO));
        traced.texels += 1;
        traced.paths += u64::from(sums.paths);
    }
    Ok(traced)
}

impl Bake<'_> {
    /// Whether texels tell what perfect mirrors show of the light map: where all their paths go through one point, and read that map.
    pub fn tells_mirrored(&self) -> bool {
        self.lightmap.is_some() && !self.params.spread
    }
}

/// What a texel's perfect mirror shows of the light map's light.
fn mirrored(bake: &Bake, probe: &Probe, centre: &Centre) -> Option<Rgb> {
    let map = bake.lightmap.filter(|_| bake.tells_mirrored())?;
    let wo = -direction(&probe.map, centre.texel, Vec2::splat(0.5));
    let surface = bake.world.surface(&centre.hit);
    let alpha = bake.world.scene.materials[surface.material as usize].bsdf.alpha(&surface)?;
    (alpha == 0.0).then(|| mirror_light(bake.world, map, &surface, wo).1)
}

/// The wanted texels whose centres see a glossy surface.
fn centres(bake: &Bake, probe: &Probe, index: u32, wanted: &(dyn Fn(u32) -> bool + Sync)) -> Vec<Centre> {
    let Probe { position, texels, map, .. } = probe;
    let sees = |i: &u32| texels[*i as usize].triangle != NO_TRIANGLE && wanted(*i);
    let centre = |texel| {
        let d = direction(map, texel, Vec2::splat(0.5));
        let hit = bake.world.closest(&Ray::new(*position, d))?;
        let stream = hash_words(&[bake.seed, index, texel]);
        is_glossy(bake.world, &bake.world.surface(&hit), -d).then_some(Centre { texel, hit, stream })
    };
    (0..texels.len() as u32).into_par_iter().filter(sees).filter_map(centre).collect()
}

/// Sums over the samples `range(i)` of each of the centres. Tells `progress` of as many units as the map has rows.
fn trace(
    bake: &Bake,
    probe: &Probe,
    centres: &[Centre],
    range: &(dyn Fn(usize) -> Range<u32> + Sync),
    progress: Option<&dyn Progress>,
) -> Result<Vec<Sums>> {
    let all: u64 = (0..centres.len()).map(|i| range(i).len() as u64).sum();
    let rows = Rows { rows: u64::from(probe.map.size[1]), all, done: AtomicU64::new(0), progress };
    let sums = match bake.gpu {
        None => {
            let texel = |(i, centre)| {
                let sums = glossy_texel(bake, probe, centre, range(i));
                rows.advance(sums.paths.into());
                sums
            };
            centres.par_iter().enumerate().map(texel).collect()
        }
        Some(gpu) => {
            let starts: Vec<PathStart> = centres
                .iter()
                .enumerate()
                .map(|(i, centre)| {
                    let Range { start: first, end } = range(i);
                    let Hit { triangle, u, v, .. } = centre.hit;
                    let wo = -direction(&probe.map, centre.texel, Vec2::splat(0.5));
                    let stream = centre.stream;
                    PathStart { triangle, u, v, stream, wo: wo.into(), first, end, padding: [0; 3] }
                })
                .collect();
            let sums = gpu.sums(&starts, &|paths| rows.advance(paths as u64))?;
            let of = |(start, sum): (&PathStart, SampleSum)| Sums {
                paths: start.end.saturating_sub(start.first),
                color: sum.color(),
                moments: [luminance(sum.color()), sum.squares].map(f64::from),
            };
            starts.iter().zip(sums).map(of).collect()
        }
    };
    rows.finish();
    Ok(sums)
}

/// Tells of paths in rows of the probe, whatever they are.
struct Rows<'a> {
    rows: u64,
    all: u64,
    done: AtomicU64,
    progress: Option<&'a dyn Progress>,
}

impl Rows<'_> {
    fn advance(&self, paths: u64) {
        let before = self.done.fetch_add(paths, Ordering::Relaxed);
        let reached = |done: u64| (done.min(self.all) as f64 / self.all.max(1) as f64 * self.rows as f64) as u64;
        self.tell(reached(before + paths) - reached(before));
    }

    /// A probe without paths has rows all the same.
    fn finish(&self) {
        if self.all == 0 {
            self.tell(self.rows);
        }
    }

    fn tell(&self, rows: u64) {
        if let Some(progress) = self.progress.filter(|_| rows > 0) {
            progress.advance(rows);
        }
    }
}

/// Paths that bring a texel's standard error down to `error`, by the variance of its pilot paths and its neighbours' about their texels'
/// means.
fn paths_for(error: f32, most: u32, pilot: &[Option<Sums>], i: u32, width: u32) -> u32 {
    let height = pilot.len() as u32 / width;
    let (x, y) = (i % width, i / width);
    let (mut squares, mut degrees, mut sum, mut paths) = (0.0, 0.0, 0.0, 0.0);
    for row in y.saturating_sub(1)..=(y + 1).min(height - 1) {
        for column in [(x + width - 1) % width, x, (x + 1) % width] {
            let Some(s) = &pilot[(row * width + column) as usize] else { continue };
            let n = f64::from(s.paths);
            squares += (s.moments[1] - s.moments[0] * s.moments[0] / n).max(0.0);
            degrees += n - 1.0;
            sum += s.moments[0];
            paths += n;
        }
    }
    if degrees == 0.0 {
        return most;
    }
    let allowed = f64::from(error) * (sum / paths + f64::from(ERROR_FLOOR));
    ((squares / degrees / (allowed * allowed)).ceil() as u32).clamp(PILOT.min(most), most)
}

/// Sums over those of the texel's paths.
fn glossy_texel(bake: &Bake, probe: &Probe, of: &Centre, samples: Range<u32>) -> Sums {
    let Bake { world, params, .. } = *bake;
    let query = Query { lobes: Lobes::NON_DIFFUSE, roughness_scale: params.roughness_scale };
    let (centre, to_centre) = (world.surface(&of.hit), direction(&probe.map, of.texel, Vec2::splat(0.5)));
    let known = bake.lightmap.map(|map| |s: &Surface, wo: Vec3| map.diffuse_radiance(&world.scene, s, wo));
    let mut sums = Sums::default();
    for sample in samples {
        let mut sampler = Sampler::new(of.stream, sample);
        let offset = sampler.next_2d();
        let (mut surface, mut wo) = (centre, -to_centre);
        if params.spread {
            let d = direction(&probe.map, of.texel, offset);
            let seen = world.intersect(&Ray::new(probe.position, d));
            if let Some(s) = seen.filter(|s| s.object == centre.object && is_glossy(world, s, -d)) {
                (surface, wo) = (s, -d);
            }
        }
        let known = known.as_ref().map(|known| known as KnownDiffuse);
        let color = scattered(world, &surface, wo, query, known, &PathParams::default(), &mut sampler);
        let y = f64::from(luminance(color));
        sums = sums.and(Sums { paths: 1, color, moments: [y, y * y] });
    }
    sums
}
