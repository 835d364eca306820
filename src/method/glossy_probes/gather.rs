//! Gathering view-dependent colour from the probes around the camera (§5.2).
//!
//! For each glossy pixel and each of the eight nearest probes: estimate where on the reflector the probe sees the same reflected
//! point (§5.1), search the probe's texels around it for the one with least energy (Eq. 1), and blend the eight colours (Eq. 2).
//!
//! *Ours*: colour is fetched at the fractional coordinate, geometry at the texel that holds it.

use super::blend::blend;
use super::candidates::WeightedProbe;
use super::gather_params::TILE;
use super::search::{BestSamples, tile};
use crate::base::math::{Rgb, floor};
use crate::base::simd::{Kernel, Lanes, Simd};
use crate::material::bsdf::{Lobes, Query};
use crate::probe::file::Probe;
use crate::transport::World;
use crate::view::gbuffer::{GBuffer, Pixel};
use crate::view::mirror::Reflected;
use glam::Vec2;
use rayon::prelude::*;

pub use super::blend::Gathered;
pub use super::gather_params::{BilinearRule, GatherParams, MAX_LEVELS, SearchLevel};

/// Gathers all pixels of a view from `probes` (§5.2). `reflected` holds the view's mirror hits, one a pixel.
/// `roughness_scale` is what the probes were baked at.
pub fn gather(
    world: &World,
    view: &GBuffer,
    reflected: &[Reflected],
    probes: &[WeightedProbe],
    roughness_scale: f32,
    params: &GatherParams,
) -> Vec<Gathered> {
    gather_by(Lanes::chosen(), (world, view, reflected), probes, roughness_scale, params)
}

/// [`gather`] in one form of lanes.
fn gather_by(
    lanes: Lanes,
    (world, view, reflected): (&World, &GBuffer, &[Reflected]),
    probes: &[WeightedProbe],
    roughness_scale: f32,
    params: &GatherParams,
) -> Vec<Gathered> {
    let (eye, [width, _]) = (view.camera.position(), view.size());
    let mut image = vec![Gathered::NONE; view.pixels.len()];
    image.par_chunks_mut(width.max(1) * TILE).enumerate().for_each(|(strip, out)| {
        for left in (0..width).step_by(TILE) {
            let tile = tile(view, reflected, [left, strip * TILE]);
            let search = BestSamples { eye, reflected, tile: &tile, width, probes, params };
            let found = gather_tile(lanes, world, search, roughness_scale);
            tile.iter().zip(found).for_each(|((i, _), g)| out[i - strip * TILE * width] = g);
        }
    });
    image
}

/// Gathers the pixels of a tile.
pub(crate) fn gather_tile(lanes: Lanes, world: &World, search: BestSamples, roughness_scale: f32) -> Vec<Gathered> {
    let albedo = |p: &Pixel| search.params.albedo_ratio.then(|| view_albedo(world, p, roughness_scale));
    let albedos = search.tile.iter().map(|(_, p)| albedo(p)).collect();
    lanes.run(Tile { search, albedos })
}

/// A tile's search and what comes of it.
struct Tile<'a> {
    search: BestSamples<'a>,
    /// Of each pixel, where they are asked for.
    albedos: Vec<Option<Rgb>>,
}

impl Kernel for Tile<'_> {
    type Output = Vec<Gathered>;

    #[inline(always)]
    fn run<S: Simd>(self, s: S) -> Vec<Gathered> {
        let (probes, params) = (self.search.probes, self.search.params);
        let samples = self.search.run(s);
        let mut gathered = Vec::with_capacity(samples.len());
        for (samples, albedo) in samples.iter().zip(self.albedos) {
            gathered.push(blend(s, samples, albedo, probes, params));
        }
        gathered
    }
}

/// The texels that [`blend`] may read for a sample: the four around it.
pub fn footprint_texels(probe: &Probe, at: Vec2) -> [usize; 4] {
    let (x, y) = (floor(at.x - 0.5), floor(at.y - 0.5));
    [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(i, j)| probe.index(x + i, y + j))
}

/// Directional albedo of the non-diffuse lobe in the view.
fn view_albedo(world: &World, pixel: &Pixel, roughness_scale: f32) -> Rgb {
    let query = Query { lobes: Lobes::NON_DIFFUSE, roughness_scale };
    let bsdf = world.scene.bsdf(&pixel.surface);
    bsdf.glossy_albedo(&pixel.surface, pixel.surface.frame.to_local(pixel.wo), query)
}
