//! Path-traced frames: emission, diffuse and glossy layers in one pass, or the full image by one path a sample.
//!
//! With a box filter, each pixel is the mean of samples spread over its own square (Owen-scrambled Sobol); with another
//! ([`crate::scene::film`]), over all that the filter reaches. Frames of many samples go by efficiency: `passes.rs`.
//! In: world, camera. Out: linear radiance a layer; their sum is the full image.

pub mod denoise_gpu;
pub mod gpu;
mod passes;
mod row;

pub use row::METHOD;

use crate::base::math::{Rgb, hash_words};
use crate::base::progress::Progress;
use crate::base::ray::Ray;
use crate::scene::Camera;
use crate::scene::film::{Filter, FilterSamples};
use crate::transport::path::{Layers, PathParams, radiance, trace_layers};
use crate::transport::{Sampler, World};
use crate::view::layers::LayerImages;
use glam::{DVec3, Vec2};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Samples and depth of a path-traced frame.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PathTraceParams {
    /// Samples a pixel.
    pub spp: u32,
    /// Depth and termination.
    pub path: PathParams,
    /// Reconstruction filter, the same for all layers.
    #[serde(default, skip_serializing_if = "is_box")]
    pub filter: Filter,
    /// Whether paths end and branch by what that does for the image ([`crate::transport::efficiency`]), from 16 samples a pixel on; by their
    /// throughput otherwise, as always on a GPU.
    #[serde(default)]
    pub efficiency: bool,
}

fn is_box(filter: &Filter) -> bool {
    *filter == Filter::Box
}

impl Default for PathTraceParams {
    fn default() -> Self {
        Self { spp: 64, path: PathParams::default(), filter: Filter::Box, efficiency: true }
    }
}

/// Renders the full image of frame number `frame`, without a split: half as many paths as [`path_trace`], noisier.
pub fn path_trace_full(
    world: &World,
    camera: &Camera,
    params: &PathTraceParams,
    seed: u32,
    frame: u32,
    progress: &dyn Progress,
) -> Vec<Rgb> {
    let samples = Samples::new(camera, params, seed, frame);
    // What `radiance` does for glass before hidden emitters has no place in the passes.
    let pixels = if params.in_passes() && !world.scene.hide_emitters {
        passes::image(world, &samples, params, &passes::full, progress)
    } else {
        samples.means(params.spp, &|ray, sampler| [radiance(world, ray, &params.path, sampler)], progress)
    };
    pixels.into_iter().map(|[full]| full).collect()
}

/// Renders frame number `frame` of a path from `camera`. Advances `progress` by one a row; start and finish are the caller's.
pub fn path_trace(
    world: &World,
    camera: &Camera,
    params: &PathTraceParams,
    seed: u32,
    frame: u32,
    progress: &dyn Progress,
) -> LayerImages {
    let samples = Samples::new(camera, params, seed, frame);
    let sample = |ray: &Ray, sampler: &mut Sampler| {
        let Layers { emission, diffuse, glossy } = trace_layers(world, ray, &params.path, sampler);
        [emission, diffuse, glossy]
    };
    let pixels = if params.in_passes() {
        passes::image(world, &samples, params, &passes::layers, progress)
    } else {
        samples.means(params.spp, &sample, progress)
    };
    let layer = |k: usize| pixels.iter().map(|p| p[k]).collect();
    LayerImages { emission: layer(0), diffuse: layer(1), glossy: layer(2) }
}

impl PathTraceParams {
    /// Whether there is anything to learn, and the samples to learn it from.
    fn in_passes(&self) -> bool {
        self.efficiency && self.spp >= passes::FEWEST && self.path.max_depth > 1
    }
}

/// The samples of a frame's pixels.
struct Samples<'a> {
    camera: &'a Camera,
    /// Across and down; `None` for a box.
    filter: Option<[FilterSamples; 2]>,
    seed: u32,
    frame: u32,
}

impl<'a> Samples<'a> {
    fn new(camera: &'a Camera, params: &PathTraceParams, seed: u32, frame: u32) -> Self {
        let sides = || camera.size.map(|side| FilterSamples::new(params.filter, side));
        Self { camera, filter: (params.filter != Filter::Box).then(sides), seed, frame }
    }

    /// Those of a pixel, by their index: the ray, its weight, and the numbers that are left to it.
    fn of(&self, x: u32, y: u32) -> impl Fn(u32) -> (Ray, f32, Sampler) {
        let stream = hash_words(&[self.seed, self.frame, y * self.camera.size[0] + x]);
        move |index| {
            let mut sampler = Sampler::new(stream, index);
            let [dx, dy, lens_x, lens_y] = sampler.next_4d();
            let (at, weight) = match &self.filter {
                None => (Vec2::new(x as f32 + dx, y as f32 + dy), 1.0),
                Some([across, down]) => {
                    let ((at_x, weight_x), (at_y, weight_y)) = (across.sample(x, dx), down.sample(y, dy));
                    (Vec2::new(at_x, at_y), weight_x * weight_y)
                }
            };
            (self.camera.ray(at, Vec2::new(lens_x, lens_y)), weight, sampler)
        }
    }

    /// Means of `N` quantities over the samples of every pixel.
    fn means<const N: usize>(
        &self,
        spp: u32,
        sample: &(dyn Fn(&Ray, &mut Sampler) -> [Rgb; N] + Sync),
        progress: &dyn Progress,
    ) -> Vec<[Rgb; N]> {
        let [width, height] = self.camera.size;
        let pixel = |x: u32, y: u32| {
            let (sample_at, mut sums) = (self.of(x, y), [DVec3::ZERO; N]);
            for index in 0..spp {
                let (ray, weight, mut sampler) = sample_at(index);
                for (sum, value) in sums.iter_mut().zip(sample(&ray, &mut sampler)) {
                    *sum += (value * weight).as_dvec3();
                }
            }
            sums.map(|s| (s / f64::from(spp.max(1))).as_vec3())
        };
        let row = |y: u32| -> Vec<[Rgb; N]> {
            let pixels = (0..width).map(|x| pixel(x, y)).collect();
            progress.advance(1);
            pixels
        };
        (0..height).into_par_iter().map(row).collect::<Vec<_>>().concat()
    }
}
