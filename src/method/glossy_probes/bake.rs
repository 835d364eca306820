//! Baking a probe: reflector, mirror-reflected and glossy maps at the resolution that its parameterisation gives (§4.1, §4.2.2, §6.1).

use super::denoise::denoised;
use crate::base::math::{Rgb, hash_words};
use crate::base::named::{Parameters, within};
use crate::base::progress::Progress;
use crate::base::ray::{Hit, Ray};
use crate::lightmap::denoise::Light;
use crate::lightmap::{DenoiseParams, LightMap};
use crate::material::Surface;
use crate::material::bsdf::{Lobes, Query};
use crate::probe::file::{NO_TRIANGLE, Probe, Texel};
use crate::probe::parameter_map::ParameterMap;
use crate::transport::World;
use crate::transport::follow::{Elsewhere, Follow, OnCpu, PathStart, PathSum, Purpose, samples_to_error};
use crate::transport::path::{KnownDiffuse, PathParams};
use crate::view::gbuffer::is_glossy;
use crate::view::mirror::mirror_hit;
use crate::view::mirror_light::mirror_light;
use crate::{Error, Result};
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
pub struct ProbeBakeParams {
    /// Paths a texel; the most, where `error` is given. *Paper* (§7): 2048.
    pub spp: u32,
    /// Standard error at which a texel is done, in units of its luminance plus [`ERROR_FLOOR`]; `None` gives each `spp` paths. *Ours*.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub error: Option<f32>,
    /// Multiplies alpha at the first vertex. *Paper* (§6.1): 0.5, [`PAPER_ROUGHNESS_SCALE`]. *Ours*: 1, the material's own:
    /// what the paths have integrated the filter need not guess, and what it then blurs is noise (`footprint.roughness_scale`).
    pub roughness_scale: f32,
    /// Spread the samples over the texel's solid angle, as far as it shows the reflector that its centre shows, in place of
    /// sending all through the centre. *Ours*: a spread texel mixes what a mirror shows on both sides of an edge, and the gather
    /// then finds a bright colour where the geometry maps promise a dark surface; so it is off by default.
    pub spread: bool,
    /// How the noise is taken out of a probe's texels; `None`: it stays. *Ours*.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub denoise: Option<DenoiseParams>,
}

impl Default for ProbeBakeParams {
    fn default() -> Self {
        Self { spp: 2048, error: None, roughness_scale: 1.0, spread: false, denoise: None }
    }
}

impl ProbeBakeParams {
    /// What the paths of a texel are followed for.
    pub fn query(&self) -> Query {
        Query { lobes: Lobes::NON_DIFFUSE, roughness_scale: self.roughness_scale }
    }
}

impl Parameters for ProbeBakeParams {
    fn validate(&self) -> Result<()> {
        within("spp", self.spp, 1..=1 << 24)?;
        if let Some(denoise) = &self.denoise {
            denoise.validate()?;
            if self.spp == 1 {
                return Err(Error::Request("--denoise: one path tells nothing of its noise; give --spp 2 or more".into()));
            }
        }
        self.error.map_or(Ok(()), |e| within("error", e, f32::MIN_POSITIVE..=1e9))?;
        within("roughness_scale", self.roughness_scale, f32::MIN_POSITIVE..=1.0)
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
    pub params: &'a ProbeBakeParams,
    /// Seed of all random numbers.
    pub seed: u32,
    /// Diffuse light of the scene, read where a path leaves the glossy chain. *Ours*: the paper traces on.
    pub lightmap: Option<&'a LightMap>,
    /// Where the paths are followed, made for [`ProbeBakeParams::query`] and [`PathParams::default`]; `None` for the CPU.
    pub device: Option<&'a dyn Follow>,
}

/// What was traced for a probe.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Traced {
    /// Texels that see a glossy surface and are wanted.
    pub texels: u64,
    /// Their paths.
    pub paths: u64,
}

/// Sums over the paths of one texel, and how many they were.
#[derive(Clone, Copy, Default)]
struct Sums {
    paths: u32,
    of: PathSum,
}

impl Sums {
    fn and(self, other: Self) -> Self {
        Self { paths: self.paths + other.paths, of: self.of + other.of }
    }

    /// The mean, and the variance of its luminance; of one path that is not known.
    fn light(&self) -> Light {
        let n = f64::from(self.paths);
        let variance = (self.of.squares - self.of.luminance * self.of.luminance / n).max(0.0) / (n * (n - 1.0));
        Light { color: self.of.color / self.paths as f32, variance: if self.paths > 1 { variance as f32 } else { f32::INFINITY } }
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
    let light: Vec<Light> = sums.iter().map(Sums::light).collect();
    let glossy = match &bake.params.denoise {
        Some(params) => {
            let texels: Vec<(u32, Hit)> = centres.iter().map(|centre| (centre.texel, centre.hit)).collect();
            denoised(bake.world, probe, &texels, &light, (params, bake.params.roughness_scale))
        }
        None => light.iter().map(|light| light.color).collect(),
    };
    let mut traced = Traced::default();
    let mirrored: Vec<Option<Rgb>> = centres.par_iter().map(|centre| mirrored(bake, probe, centre)).collect();
    for (((centre, sums), glossy), mirrored) in centres.iter().zip(sums).zip(glossy).zip(mirrored) {
        let texel = &mut probe.texels[centre.texel as usize];
        texel.set_glossy(glossy);
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
    let alpha = bake.world.scene.bsdf(&surface).alpha(&surface)?;
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
    let start = |(i, centre): (usize, &Centre)| {
        let Range { start: first, end } = range(i);
        let Hit { triangle, u, v, .. } = centre.hit;
        let wo = -direction(&probe.map, centre.texel, Vec2::splat(0.5));
        PathStart { triangle, u, v, stream: centre.stream, wo: wo.into(), first, end, padding: [0; 3] }
    };
    let starts: Vec<PathStart> = centres.iter().enumerate().map(start).collect();
    let all = starts.iter().map(|s| u64::from(s.samples())).sum();
    let rows = Rows { rows: u64::from(probe.map.size[1]), all, done: AtomicU64::new(0), progress };
    let done = |paths: usize| rows.advance(paths as u64);
    let sums = match bake.device {
        Some(device) => device.sums(&starts, &done)?,
        None => {
            let Bake { world, params, lightmap, .. } = *bake;
            let known = lightmap.map(|map| |s: &Surface, wo: Vec3| map.diffuse_radiance(&world.scene, s, wo));
            let known = known.as_ref().map(|known| known as KnownDiffuse);
            let spread = |i: usize, offset: Vec2| seen_at(world, probe, &centres[i], offset);
            let purpose = Purpose::Scattering(params.query(), params.spread.then_some(&spread as &Elsewhere));
            OnCpu { world, purpose, known, params: PathParams::default() }.sums(&starts, &done)?
        }
    };
    rows.finish();
    Ok(starts.iter().zip(sums).map(|(start, of)| Sums { paths: start.samples(), of }).collect())
}

/// What a texel sees at an offset from its corner, where that is glossy and of the object that its centre sees.
fn seen_at(world: &World, probe: &Probe, centre: &Centre, offset: Vec2) -> Option<(Surface, Vec3)> {
    let d = direction(&probe.map, centre.texel, offset);
    let seen = world.intersect(&Ray::new(probe.position, d))?;
    let object = world.scene.geometry.triangle_object[centre.hit.triangle as usize];
    (seen.object == object && is_glossy(world, &seen, -d)).then_some((seen, -d))
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
    let columns = [(x + width - 1) % width, x, (x + 1) % width];
    let texels = (y.saturating_sub(1)..=(y + 1).min(height - 1)).flat_map(|row| columns.map(|column| row * width + column));
    let around = texels.filter_map(|texel| pilot[texel as usize].map(|sums| (sums.of, sums.paths)));
    samples_to_error(error, ERROR_FLOOR, [PILOT.min(most), most], around)
}
