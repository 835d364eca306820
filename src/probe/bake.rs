//! Baking a probe: reflector, mirror-reflected and glossy maps at the resolution that its parameterisation gives (§4.1, §4.2.2, §6.1).

use super::file::{NO_TRIANGLE, Probe, Texel};
use super::qhmap::ParameterMap;
use crate::lightmap::LightMap;
use crate::math::{Rgb, hash_words, luminance};
use crate::progress::Progress;
use crate::render::mirror::mirror_hit;
use crate::transport::bsdf::{Lobes, Query};
use crate::transport::path::{KnownDiffuse, PathParams, scattered};
use crate::transport::{Ray, Sampler, Surface, World};
use glam::{Vec2, Vec3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::ops::Range;

/// Parameters of a bake.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BakeParams {
    /// Paths a texel; the most, where `error` is given. *Paper* (§7): 2048.
    pub spp: u32,
    /// Standard error at which a texel is done, in units of its luminance plus [`ERROR_FLOOR`]; `None` gives each `spp` paths. *Ours*.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub error: Option<f32>,
    /// Multiplies alpha at the first vertex. *Paper* (§6.1): 0.5.
    pub roughness_scale: f32,
    /// Spread the samples over the texel's solid angle, as far as it shows the reflector that its centre shows, in place of
    /// sending all through the centre. *Ours*. A spread texel mixes what a mirror shows on both sides of an edge, and the gather
    /// then finds a bright colour where the geometry maps promise a dark surface; so it is off by default.
    pub spread: bool,
}

impl Default for BakeParams {
    fn default() -> Self {
        Self { spp: 2048, error: None, roughness_scale: 0.5, spread: false }
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

/// Whether a view of `surface` from `wo` has a lobe for the probe to store.
pub fn is_glossy(world: &World, surface: &Surface, wo: Vec3) -> bool {
    let bsdf = &world.scene.materials[surface.material as usize].bsdf;
    bsdf.lobes().contains(Lobes::NON_DIFFUSE) && (bsdf.is_two_sided() || surface.frame.n.dot(wo) > 0.0)
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

/// Fills the glossy map: L(S|D)*S+E with the first vertex' roughness reduced. Texels for which `wanted` does not hold stay black.
/// The random stream of a texel is a hash of (seed, probe index, texel), so that no thread count changes a bit.
///
/// Adaptive sampling decides from the first [`PILOT`] paths of a texel and of its neighbours together. Stopping as soon as the texel's own
/// paths agree would favour those that have missed a rare bright path so far.
pub fn bake_glossy(
    bake: &Bake,
    probe: &mut Probe,
    index: u32,
    wanted: &(dyn Fn(u32) -> bool + Sync),
    progress: &dyn Progress,
) -> Traced {
    let Probe { position, texels, map, .. } = probe;
    let (width, map) = (map.size[0], &*map);
    let sees = |i: u32| texels[i as usize].triangle != NO_TRIANGLE && wanted(i);
    let trace = |i: u32, samples: Range<u32>| {
        sees(i).then(|| glossy_texel(bake, *position, map, i, hash_words(&[bake.seed, index, i]), samples)).flatten()
    };
    let count = texels.len() as u32;
    let each = |texel: &(dyn Fn(u32) -> Option<Sums> + Sync), progress: Option<&dyn Progress>| -> Vec<Option<Sums>> {
        let row = |y: u32| {
            let row: Vec<_> = (y * width..(y + 1) * width).map(texel).collect();
            if let Some(progress) = progress {
                progress.advance(1);
            }
            row
        };
        (0..count / width).into_par_iter().flat_map_iter(row).collect()
    };
    let most = bake.params.spp;
    let sums = match bake.params.error {
        None => each(&|i| trace(i, 0..most), Some(progress)),
        Some(error) => {
            let pilot = each(&|i| trace(i, 0..PILOT.min(most)), None);
            let rest = |i: u32| {
                let first = pilot[i as usize]?;
                let paths = paths_for(error, most, &pilot, i, width);
                if paths > first.paths { trace(i, first.paths..paths).map(|more| first.and(more)) } else { Some(first) }
            };
            each(&rest, Some(progress))
        }
    };
    let mut traced = Traced::default();
    for (texel, sums) in texels.iter_mut().zip(sums) {
        if let Some(sums) = sums {
            texel.set_glossy(sums.color / sums.paths as f32);
            traced.texels += 1;
            traced.paths += u64::from(sums.paths);
        }
    }
    traced
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

/// Sums over those of the texel's paths; `None` where its centre sees no glossy surface.
fn glossy_texel(bake: &Bake, position: Vec3, map: &ParameterMap, texel: u32, stream: u32, samples: Range<u32>) -> Option<Sums> {
    let Bake { world, params, .. } = *bake;
    let query = Query { lobes: Lobes::NON_DIFFUSE, roughness_scale: params.roughness_scale };
    let to_centre = direction(map, texel, Vec2::splat(0.5));
    let centre = world.intersect(&Ray::new(position, to_centre)).filter(|s| is_glossy(world, s, -to_centre))?;
    let known = bake.lightmap.map(|map| |s: &Surface, wo: Vec3| map.diffuse_radiance(&world.scene, s, wo));
    let mut sums = Sums::default();
    for sample in samples {
        let mut sampler = Sampler::new(stream, sample);
        let offset = sampler.next_2d();
        let (mut surface, mut wo) = (centre, -to_centre);
        if params.spread {
            let d = direction(map, texel, offset);
            let seen = world.intersect(&Ray::new(position, d));
            if let Some(s) = seen.filter(|s| s.object == centre.object && is_glossy(world, s, -d)) {
                (surface, wo) = (s, -d);
            }
        }
        let known = known.as_ref().map(|known| known as KnownDiffuse);
        let color = scattered(world, &surface, wo, query, known, &PathParams::default(), &mut sampler);
        let y = f64::from(luminance(color));
        sums = sums.and(Sums { paths: 1, color, moments: [y, y * y] });
    }
    Some(sums)
}
