//! Baseline "RTRT + light map": a light map, and rays that follow the glossy lobes at run time.
//!
//! *Paper* (§7.3.1): light-map rendering augmented by BRDF-sampled rays, 3 bounces, 4 samples of the glossy lobe at the first
//! vertex. *Reading*: a bounce is a ray; each hit adds its emission and what the light map knows of its diffuse lobe, and the next
//! ray follows its glossy lobe. Nothing samples the emitters: that small and distant ones are missed is what the paper shows.
//! *Ours*: [`LightmapRtParams::next_event`] samples them as well, for a baseline as strong as rays and a light map can be.
//!
//! In: a view's G-buffer. Out: its glossy layer, linear radiance; unbiased but for the light map and the end of the chain.

pub mod gpu;
mod row;

pub use row::METHOD;

use crate::Result;
use crate::base::math::{Rgb, hash_words};
use crate::base::named::{Parameters, within};
use crate::lightmap::LightMap;
use crate::material::Surface;
use crate::transport::path::{PathParams, scattered};
use crate::transport::{Sampler, World};
use crate::view::MOST_SUPERSAMPLES;
use crate::view::denoiser::Denoiser;
use crate::view::gbuffer::{GBuffer, GLOSSY, Pixel, glossy};
use glam::{Vec2, Vec3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Most rays in a row: between mirrors that take nothing they would never end.
const MOST_BOUNCES: u32 = 1 << 12;

/// Rays of a pixel.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LightmapRtParams {
    /// N x N rays a pixel through the G-buffer.
    pub supersample: u32,
    /// Rays that leave the first vertex. *Paper*: 4.
    pub samples: u32,
    /// Rays in a row, the first included. *Paper*: 3.
    pub bounces: u32,
    /// Sample emitters at each vertex, and combine both by multiple importance sampling. The last hit then scatters once more, towards
    /// emitters alone. *Paper*: no.
    pub next_event: bool,
    /// Takes the noise out of the glossy layer; `None` for nothing. *Paper*: none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub denoise: Option<Denoiser>,
}

impl Default for LightmapRtParams {
    fn default() -> Self {
        Self { supersample: 1, samples: 4, bounces: 3, next_event: false, denoise: None }
    }
}

impl LightmapRtParams {
    /// The rays as a path: their last hit is a vertex, too.
    pub(crate) fn path(&self) -> PathParams {
        PathParams::of_rays(self.bounces.min(MOST_BOUNCES))
    }
}

impl Parameters for LightmapRtParams {
    fn validate(&self) -> Result<()> {
        within("supersample", self.supersample, 1..=MOST_SUPERSAMPLES)?;
        within("samples", self.samples, 1..=1 << 24)?;
        within("bounces", self.bounces, 1..=u32::MAX)?;
        self.denoise.map_or(Ok(()), |denoise| denoise.validate())
    }
}

/// The glossy layer of `view`, frame number `frame` of its path. The random stream of a pixel is a hash of (seed, frame, pixel).
pub fn lightmap_rt(
    world: &World,
    lightmap: &LightMap,
    view: &GBuffer,
    params: &LightmapRtParams,
    seed: u32,
    frame: u32,
) -> Vec<Rgb> {
    let pixel = |(i, pixel): (usize, &Option<Pixel>)| {
        let Some(p) = glossy(pixel) else { return Rgb::ZERO };
        let stream = hash_words(&[seed, frame, i as u32]);
        let sample = |s| light_along(world, lightmap, p, params, &mut Sampler::new(stream, s));
        let sum: Rgb = (0..params.samples).map(sample).filter(|c| c.is_finite()).sum();
        sum / params.samples.max(1) as f32
    };
    view.pixels.par_iter().enumerate().with_min_len(view.size()[0]).map(pixel).collect()
}

/// One sample of the radiance that a pixel's glossy lobe sends to the camera.
fn light_along(world: &World, lightmap: &LightMap, pixel: &Pixel, params: &LightmapRtParams, sampler: &mut Sampler) -> Rgb {
    let known = |s: &Surface, wo: Vec3| lightmap.diffuse_radiance(&world.scene, s, wo);
    if params.next_event {
        return scattered(world, &pixel.surface, pixel.wo, GLOSSY, Some(&known), &params.path(), sampler);
    }
    let (mut surface, mut wo) = (pixel.surface, pixel.wo);
    let (mut sum, mut throughput) = (Rgb::ZERO, Rgb::ONE);
    for _ in 1..params.path().max_depth {
        let [x, y, lobe, _] = sampler.next_4d();
        let bsdf = world.scene.bsdf(&surface);
        let Some(sample) = bsdf.sample(&surface, surface.frame.to_local(wo), lobe, Vec2::new(x, y), GLOSSY) else { break };
        throughput *= sample.weight;
        let ray = surface.spawn(surface.frame.to_world(sample.wo));
        let Some(hit) = world.intersect(&ray) else {
            return sum + throughput * world.lights.environment(ray.d);
        };
        wo = -ray.d;
        sum += throughput * (world.lights.emitted(&world.scene, &hit, wo) + known(&hit, wo));
        surface = hit;
    }
    sum
}
