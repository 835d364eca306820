//! Path-traced frames: emission, diffuse and glossy layers in one pass.
//!
//! A box filter: each pixel is the mean of samples spread over its own square (Owen-scrambled Sobol).
//! In: world, camera. Out: linear radiance a layer; their sum is the full image.

use crate::math::{Rgb, hash_words};
use crate::progress::Progress;
use crate::scene::Camera;
use crate::transport::path::{Layers, PathParams, trace_layers};
use crate::transport::{Sampler, World};
use glam::{DVec3, Vec2};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Samples and depth of a path-traced frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PathTraceParams {
    /// Samples a pixel.
    pub spp: u32,
    /// Depth and termination.
    pub path: PathParams,
}

impl Default for PathTraceParams {
    fn default() -> Self {
        Self { spp: 64, path: PathParams::default() }
    }
}

/// The layers of a frame, rows from the top.
#[derive(Debug, Clone, PartialEq)]
pub struct LayerImages {
    /// LE.
    pub emission: Vec<Rgb>,
    /// L(S|D)*DE.
    pub diffuse: Vec<Rgb>,
    /// L(S|D)*S+E.
    pub glossy: Vec<Rgb>,
}

impl LayerImages {
    /// The full image.
    pub fn full(&self) -> Vec<Rgb> {
        self.emission.iter().zip(&self.diffuse).zip(&self.glossy).map(|((&e, &d), &g)| e + d + g).collect()
    }
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
    let [width, height] = camera.size;
    let row = |y: u32| -> Vec<Layers> {
        let pixels = (0..width).map(|x| {
            let stream = hash_words(&[seed, frame, y * width + x]);
            pixel(world, camera, params, Vec2::new(x as f32, y as f32), stream)
        });
        let pixels = pixels.collect();
        progress.advance(1);
        pixels
    };
    let rows: Vec<Vec<Layers>> = (0..height).into_par_iter().map(row).collect();
    let layer = |pick: fn(&Layers) -> Rgb| rows.iter().flatten().map(pick).collect();
    LayerImages { emission: layer(|l| l.emission), diffuse: layer(|l| l.diffuse), glossy: layer(|l| l.glossy) }
}

/// Mean over the samples of the pixel whose upper left corner is `corner`.
fn pixel(world: &World, camera: &Camera, params: &PathTraceParams, corner: Vec2, stream: u32) -> Layers {
    let mut sums = [DVec3::ZERO; 3];
    for index in 0..params.spp {
        let mut sampler = Sampler::new(stream, index);
        let [x, y, lens_x, lens_y] = sampler.next_4d();
        let ray = camera.ray(corner + Vec2::new(x, y), Vec2::new(lens_x, lens_y));
        let sample = trace_layers(world, &ray, &params.path, &mut sampler);
        for (sum, value) in sums.iter_mut().zip([sample.emission, sample.diffuse, sample.glossy]) {
            *sum += value.as_dvec3();
        }
    }
    let [emission, diffuse, glossy] = sums.map(|s| (s / f64::from(params.spp.max(1))).as_vec3());
    Layers { emission, diffuse, glossy }
}
