//! Baking a probe: reflector, mirror-reflected and glossy maps at the resolution that its parameterisation gives (§4.1, §4.2.2, §6.1).

use super::file::{Probe, Texel};
use super::qhmap::ParameterMap;
use crate::lightmap::LightMap;
use crate::math::{Rgb, hash_words};
use crate::progress::Progress;
use crate::render::mirror::mirror_hit;
use crate::transport::bsdf::{Lobes, Query};
use crate::transport::path::{KnownDiffuse, PathParams, scattered};
use crate::transport::{Ray, Sampler, Surface, World};
use glam::{Vec2, Vec3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Parameters of a bake.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BakeParams {
    /// Paths a texel. *Paper* (§7): 2048.
    pub spp: u32,
    /// Multiplies alpha at the first vertex. *Paper* (§6.1): 0.5.
    pub roughness_scale: f32,
    /// Spread the samples over the texel's solid angle, as far as it shows the reflector that its centre shows, in place of
    /// sending all through the centre. *Ours*. A spread texel mixes what a mirror shows on both sides of an edge, and the gather
    /// then finds a bright colour where the geometry maps promise a dark surface; so it is off by default.
    pub spread: bool,
}

impl Default for BakeParams {
    fn default() -> Self {
        Self { spp: 2048, roughness_scale: 0.5, spread: false }
    }
}

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

/// Fills the glossy map: L(S|D)*S+E with the first vertex' roughness reduced. Texels for which `wanted` does not hold stay black.
/// Returns how many texels had paths traced. The random stream of a texel is a hash of (seed, probe index, texel), so that no thread count changes a bit.
pub fn bake_glossy(
    bake: &Bake,
    probe: &mut Probe,
    index: u32,
    wanted: &(dyn Fn(u32) -> bool + Sync),
    progress: &dyn Progress,
) -> u64 {
    let Probe { position, texels, map, .. } = probe;
    let (position, width, map) = (*position, map.size[0], &*map);
    let bake_row = |(y, row): (usize, &mut [Texel])| {
        let mut traced = 0;
        for (x, texel) in row.iter_mut().enumerate() {
            let i = y as u32 * width + x as u32;
            if texel.triangle != super::file::NO_TRIANGLE && wanted(i) {
                let stream = hash_words(&[bake.seed, index, i]);
                if let Some(glossy) = glossy_texel(bake, position, map, i, stream) {
                    texel.set_glossy(glossy);
                    traced += 1;
                }
            }
        }
        progress.advance(1);
        traced
    };
    texels.par_chunks_mut(width as usize).enumerate().map(bake_row).sum()
}

/// Mean of the paths of one texel; `None` where its centre sees no glossy surface.
fn glossy_texel(bake: &Bake, position: Vec3, map: &ParameterMap, texel: u32, stream: u32) -> Option<Rgb> {
    let Bake { world, params, .. } = *bake;
    let query = Query { lobes: Lobes::NON_DIFFUSE, roughness_scale: params.roughness_scale };
    let to_centre = direction(map, texel, Vec2::splat(0.5));
    let centre = world.intersect(&Ray::new(position, to_centre)).filter(|s| is_glossy(world, s, -to_centre))?;
    let known = bake.lightmap.map(|map| |s: &Surface, wo: Vec3| map.diffuse_radiance(&world.scene, s, wo));
    let mut sum = Rgb::ZERO;
    for sample in 0..params.spp {
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
        sum += scattered(world, &surface, wo, query, known, &PathParams::default(), &mut sampler);
    }
    Some(sum / params.spp as f32)
}
