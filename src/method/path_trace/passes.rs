//! Frames in passes: the first samples of all pixels tell where paths are worth going on, and where to
//! ([`crate::transport::efficiency`]), and the next go by that. All samples count alike; what one pass decides of the next leaves the mean where it was.

use super::{PathTraceParams, Samples};
use crate::base::math::{Rgb, luminance};
use crate::base::progress::Progress;
use crate::base::ray::Ray;
use crate::material::bsdf::{Lobes, Query};
use crate::transport::efficiency::{Lessons, RAY_COST, Start, Walk};
use crate::transport::{Sampler, World};
use glam::{DVec3, Vec2, Vec3};
use rayon::prelude::*;
use std::ops::Range;
use std::sync::atomic::{AtomicU64, Ordering};

/// Fewest samples a pixel for which passes pay.
pub(super) const FEWEST: u32 = 16;

/// Samples a pixel of the first pass, whose variance tells something, and most that passes learn from, as a share of all, and in number. Each
/// pass doubles what there is.
const FIRST: u32 = 2;
const LEARNING: (u32, u32) = (4, 64);

/// Rows of pixels are followed in so many parts, each with lessons of its own.
const BANDS: usize = 64;

/// Added to the square of a pixel's radiance where errors are relative to it, as relative MSE has it, in scenes that are
/// as bright as pictures are; in darker ones the square of their mean.
const OFFSET: f32 = 0.01;

/// Share of the pixels, the noisiest, that say nothing of the image's variance: fireflies would decide it.
const OUTLIERS: f64 = 0.005;

/// Rays of the camera that tell where the scene is.
const LOOKS: u32 = 4096;

/// Layers of a pixel as its samples come in.
#[derive(Clone, Copy)]
struct Pixel<const N: usize> {
    sum: [DVec3; N],
    /// Sums of the values of this pass, of their squares, and of their cost.
    pass: [DVec3; N],
    squares: [DVec3; N],
    cost: f64,
}

/// Traces one sample: its layers and its cost. The layers' weights are one over their radiance.
pub(super) type Trace<'a, const N: usize> = &'a (dyn Fn(&mut Walk, &Ray, &[Rgb; N], &mut Sampler) -> ([Rgb; N], f32) + Sync);

/// Means of `N` layers over the samples of every pixel.
pub(super) fn image<const N: usize>(
    world: &World,
    samples: &Samples,
    params: &PathTraceParams,
    trace: Trace<N>,
    progress: &dyn Progress,
) -> Vec<[Rgb; N]> {
    let [width, height] = samples.camera.size.map(|n| n as usize);
    let zero = [DVec3::ZERO; N];
    let mut pixels = vec![Pixel { sum: zero, pass: zero, squares: zero, cost: 0.0 }; width * height];
    let mut weights = vec![[Rgb::ONE; N]; width * height];
    let mut lessons = Lessons::over(seen(world, samples));
    let mut plan = None;
    // Samples of rows.
    let done = AtomicU64::new(0);
    for range in passes(params.spp) {
        let learns = range.end < params.spp;
        let rows = height.div_ceil(BANDS);
        let band = |(band, (pixels, weights)): (usize, (&mut [Pixel<N>], &[[Rgb; N]]))| {
            let lessons = learns.then(|| lessons.empty(width * height * range.len()));
            let mut walk = Walk { world, params: &params.path, plan: plan.as_ref(), lessons };
            for (i, (pixel, weights)) in pixels.iter_mut().zip(weights).enumerate() {
                let sample_at = samples.of((i % width) as u32, (band * rows + i / width) as u32);
                (pixel.pass, pixel.squares, pixel.cost) = (zero, zero, 0.0);
                for index in range.clone() {
                    let (ray, weight, mut sampler) = sample_at(index);
                    let (layers, cost) = trace(&mut walk, &ray, weights, &mut sampler);
                    pixel.add(&layers.map(|x| (x * weight).as_dvec3()), cost);
                }
                if i % width == width - 1 {
                    let samples = range.len() as u64;
                    let before = done.fetch_add(samples, Ordering::Relaxed);
                    progress.advance((before + samples) / u64::from(params.spp) - before / u64::from(params.spp));
                }
            }
            walk.lessons
        };
        let parts = pixels.par_chunks_mut(rows * width).zip(weights.par_chunks(rows * width));
        let learned: Vec<Option<Lessons>> = parts.enumerate().map(band).collect();
        if learns {
            learned.iter().flatten().for_each(|part| lessons.absorb(part));
            weights = relative_to(&pixels, width, range.end);
            plan = Some(lessons.plan(efficiency(&pixels, &weights, range.len())));
        }
    }
    pixels.iter().map(|p| p.sum.map(|s| (s / f64::from(params.spp)).as_vec3())).collect()
}

/// The samples of each pass; the last one learns nothing.
fn passes(spp: u32) -> impl Iterator<Item = Range<u32>> {
    let (share, most) = LEARNING;
    let ends = std::iter::successors(Some(FIRST), |end| Some(end * 2)).take_while(move |&end| end <= most.min(spp / share));
    let mut start = 0;
    ends.chain([spp]).map(move |end| std::mem::replace(&mut start, end)..end)
}

impl<const N: usize> Pixel<N> {
    fn add(&mut self, layers: &[DVec3; N], cost: f32) {
        for (k, &x) in layers.iter().enumerate() {
            self.sum[k] += x;
            self.pass[k] += x;
            self.squares[k] += x * x;
        }
        self.cost += f64::from(cost);
    }

    /// Variance of one of `count` samples, relative to the layers' radiance, all together.
    fn relative_variance(&self, weights: &[Rgb; N], count: f64) -> f64 {
        let of = |k: usize| {
            let variance = (self.squares[k] - self.pass[k] * self.pass[k] / count) / (count - 1.0);
            (variance * (weights[k] * weights[k]).as_dvec3()).element_sum() / 3.0
        };
        (0..N).map(of).sum()
    }
}

/// Points that the camera sees.
fn seen(world: &World, samples: &Samples) -> Vec<Vec3> {
    let size = Vec2::new(samples.camera.size[0] as f32, samples.camera.size[1] as f32);
    let look = |i| {
        let [x, y, lens_x, lens_y] = Sampler::new(samples.seed, i).next_4d();
        let ray = samples.camera.ray(Vec2::new(x, y) * size, Vec2::new(lens_x, lens_y));
        world.closest(&ray).map(|hit| ray.at(hit.t))
    };
    (0..LOOKS).into_par_iter().filter_map(look).collect()
}

/// One over the radiance of each pixel's layers, that is a root mean square, after so many samples: the mean of 3 x 3 pixels.
fn relative_to<const N: usize>(pixels: &[Pixel<N>], width: usize, samples: u32) -> Vec<[Rgb; N]> {
    let height = pixels.len() / width.max(1);
    let total: DVec3 = pixels.iter().flat_map(|p| p.sum).sum();
    let mean = luminance((total / f64::from(samples) / pixels.len() as f64).as_vec3());
    let offset = OFFSET.min(mean * mean).max(f32::MIN_POSITIVE);
    let around = |i: usize| {
        let (x, y) = (i % width, i / width);
        let (mut sum, mut count) = ([DVec3::ZERO; N], 0.0);
        for y in y.saturating_sub(1)..(y + 2).min(height) {
            for x in x.saturating_sub(1)..(x + 2).min(width) {
                sum.iter_mut().zip(pixels[y * width + x].sum).for_each(|(sum, p)| *sum += p);
                count += f64::from(samples);
            }
        }
        sum.map(|s| (s / count).as_vec3()).map(|m| (m * m + offset).map(|x| x.sqrt().recip()))
    };
    (0..pixels.len()).into_par_iter().map(around).collect()
}

/// sqrt(C / V) of the pass's `count` samples.
fn efficiency<const N: usize>(pixels: &[Pixel<N>], weights: &[[Rgb; N]], count: usize) -> f32 {
    let of = |(pixel, weights): (&Pixel<N>, &[Rgb; N])| pixel.relative_variance(weights, count as f64);
    let mut variances: Vec<f64> = pixels.par_iter().zip(weights).map(of).collect();
    variances.par_sort_unstable_by(f64::total_cmp);
    let kept = variances.len() - (variances.len() as f64 * OUTLIERS) as usize;
    let variance = variances[..kept].iter().sum::<f64>() / kept.max(1) as f64;
    let cost = pixels.iter().map(|p| p.cost).sum::<f64>() / (count * pixels.len().max(1)) as f64;
    (cost / variance.max(1e-9)).sqrt() as f32
}

/// The full image's sample.
pub(super) fn full(walk: &mut Walk, ray: &Ray, [weight]: &[Rgb; 1], sampler: &mut Sampler) -> ([Rgb; 1], f32) {
    let world = walk.world;
    let numbers = walk.numbers(sampler);
    let Some(surface) = world.seen(ray) else { return ([world.backdrop(ray.d)], RAY_COST) };
    let start = Start::seen(*weight);
    let scattered = walk.scattered(numbers, &surface, -ray.d, Query::default(), start, sampler);
    let emitted = world.lights.emitted(&world.scene, &surface, -ray.d);
    ([emitted + scattered.light], RAY_COST + scattered.cost)
}

/// The layers' sample: emission, diffuse, glossy. The two halves of the first vertex have paths of their own.
pub(super) fn layers(walk: &mut Walk, ray: &Ray, weights: &[Rgb; 3], sampler: &mut Sampler) -> ([Rgb; 3], f32) {
    let world = walk.world;
    let mut branches = [0, 1].map(|k| sampler.branch(k));
    let numbers = branches.each_mut().map(|branch| walk.numbers(branch));
    let Some(surface) = world.seen(ray) else { return ([world.backdrop(ray.d), Rgb::ZERO, Rgb::ZERO], RAY_COST) };
    let present = world.scene.bsdf(&surface).lobes();
    let mut layers = [world.lights.emitted(&world.scene, &surface, -ray.d), Rgb::ZERO, Rgb::ZERO];
    let mut cost = RAY_COST;
    for (k, lobes) in [Lobes::DIFFUSE, Lobes::NON_DIFFUSE].into_iter().enumerate() {
        if present.intersects(lobes) {
            let query = Query { lobes, ..Query::default() };
            let start = Start::seen(weights[k + 1]);
            let scattered = walk.scattered(numbers[k], &surface, -ray.d, query, start, &mut branches[k]);
            layers[k + 1] = scattered.light;
            cost += scattered.cost;
        }
    }
    (layers, cost)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn passes_double_what_there_is_until_they_have_learned_enough() {
        let of = |spp| passes(spp).map(|range| range.end).collect::<Vec<_>>();
        assert_eq!(of(FEWEST), [2, 4, 16]);
        assert_eq!(of(33), [2, 4, 8, 33]);
        assert_eq!(of(4096), [2, 4, 8, 16, 32, 64, 4096]);
        let all: Vec<u32> = passes(100).flatten().collect();
        assert_eq!(all, (0..100).collect::<Vec<_>>());
    }
}
