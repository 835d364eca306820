//! Rays beside the probes: a few along each pixel's glossy lobe, lit by the light map, joined with what the probes say by how much each is to be
//! trusted.
//!
//! *Ours*. Probes have no noise, and are off where their texels are too coarse for a moulding or where no probe sees what a mirror shows; rays are
//! right in the mean and noisy, less so with a denoiser. Which of the two is nearer need not be guessed from the gather's energy or the lobe's width: half of the rays
//! tells it. The rays' estimate is the mean M of what the halves say, each denoised by itself, and in a window w M + (1 - w) P, with P from the probes, is nearest to the
//! truth T for w = Σ (M - P)·(T - P) / Σ |M - P|². In the mean, a half of the rays as it is, R, stands for T, with what the other half, which it has no part in,
//! gives to M: Σ (M - P)·(T - P) = Σ ½ [(X₁ - P)·(R₂ - P) + (X₂ - P)·(R₁ - P)]. No threshold chooses, so that there is no border to see.
//! Some rays are spread evenly (`halves`), the rest goes where these are noisy (`budget`).
//!
//! In: a frame's glossy layer from probes, linear. Out: the same, joined.

mod budget;
mod halves;

use super::lattice::gaussian;
use crate::base::clock::Clock;
use crate::base::math::{Rgb, luminance};
use crate::base::named::within;
use crate::lightmap::LightMap;
use crate::scene::Camera;
use crate::transport::World;
use crate::view::denoise::DenoiseParams;
use crate::view::denoiser::Denoiser;
use crate::{Error, Result};
use budget::allotted;
use glam::Vec2;
use halves::{Lit, Sums, follow};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Rays a pixel from which on our own filter looks no farther than its first level: what noise is left is less than what the next one blurs.
const MANY: u32 = 16;

/// Most rays a pixel.
const MOST_RAYS: u32 = 1 << 12;
/// Fewest rays a pixel that tell how many more it takes.
const TELLING: u32 = 4;
/// Luminance that is added to a pixel's before squares are divided by it, in units of the layer's geometric mean: what is darker counts as if it
/// were so bright.
const FLOOR: f32 = 0.2;
/// What both estimates being as good is worth, in squares of differences relative to their sum.
const PRIOR: f32 = 0.005;

/// Rays of a pixel.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RaysParams {
    /// Rays a pixel in the mean over those that show something glossy; 0 leaves the probes alone. *Paper*: 0.
    pub per_pixel: u32,
    /// Share of them that is spread evenly, 0 to 1; the rest goes where these are the noisiest, at most twice `per_pixel` to a pixel.
    pub even: f32,
    /// Rays in a row, the first included.
    pub bounces: u32,
    /// Standard deviation of the window in which both are weighed, pixels.
    pub window: f32,
}

impl Default for RaysParams {
    fn default() -> Self {
        Self { per_pixel: 0, even: 0.5, bounces: 3, window: 4.0 }
    }
}

impl RaysParams {
    /// An error where a parameter is out of its range.
    pub fn validate(&self) -> Result<()> {
        within("rays.per_pixel", self.per_pixel, 0..=MOST_RAYS)?;
        if self.per_pixel == 1 {
            return Err(Error::Request("rays.per_pixel=1: expected 0, or 2 and more: half of them judges the others".into()));
        }
        within("rays.even", self.even, 0.0..=1.0)?;
        within("rays.bounces", self.bounces, 1..=MOST_RAYS)?;
        within("rays.window", self.window, 0.5..=256.0)
    }
}

/// Our own filter for the halves of so many rays a pixel. The probes have what is smooth, so that this may stop at far less than where it has but the
/// noise of a path or two before it.
pub fn filter(per_pixel: u32) -> DenoiseParams {
    let levels = if per_pixel < MANY { 2 } else { 1 };
    DenoiseParams { levels, normal_power: 512.0, depth_sigma: 0.5, albedo_sigma: 0.05, ..DenoiseParams::default() }
}

/// A camera and its frame's random numbers.
#[derive(Clone, Copy)]
pub struct Shot<'a> {
    /// The camera, at the layer's size.
    pub camera: &'a Camera,
    /// Seed and frame number.
    pub seeds: [u32; 2],
}

/// The glossy layer of probes, joined with rays.
///
/// # Errors
/// The denoiser's.
pub fn joined(
    (world, lightmap): (&World, &LightMap),
    shot: Shot,
    probes: &[Rgb],
    (params, denoiser): (&RaysParams, Option<&Denoiser>),
    clock: &mut Clock,
) -> Result<Vec<Rgb>> {
    let width = shot.camera.size[0] as usize;
    let level = Level::of(probes, width);
    let halves = halves(Lit { world, lightmap }, shot, (probes, &level), params);
    clock.lap("rays");
    let estimates = match denoiser {
        None => halves.clone(),
        Some(denoiser) => {
            let [_, guides] = denoiser.guides(world, shot.camera, params.per_pixel, shot.seeds);
            clock.lap("guides");
            let denoised = denoiser.denoise_layers([&halves[0], &halves[1]], &guides, width)?;
            clock.lap("denoise");
            denoised
        }
    };
    let weights = weights(probes, &halves, &estimates, (&level, params.window));
    let layer = (0..probes.len()).map(|i| probes[i] + (mean(&estimates, i) - probes[i]) * weights[i]).collect();
    clock.lap("join");
    Ok(layer)
}

/// Means of each half of the rays of every pixel: some spread evenly, the rest as [`allotted`].
fn halves(lit: Lit, shot: Shot, (probes, level): (&[Rgb], &Level), params: &RaysParams) -> [Vec<Rgb>; 2] {
    let evenly = (2 * (0.5 * params.even * params.per_pixel as f32).round() as u32).max(TELLING).min(params.per_pixel);
    let mut sums = vec![Sums::default(); probes.len()];
    follow(lit, shot, params.bounces, &mut sums, |_| evenly);
    if evenly < params.per_pixel {
        let counts = allotted(probes, &sums, level, params.per_pixel);
        follow(lit, shot, params.bounces, &mut sums, |i| counts[i]);
    }
    sums.iter().map(Sums::means).unzip::<_, _, Vec<_>, Vec<_>>().into()
}

/// What a layer is like as a whole.
struct Level {
    /// Pixels a row.
    width: usize,
    /// Luminance that is added to a pixel's before it divides.
    floor: f32,
}

impl Level {
    fn of(probes: &[Rgb], width: usize) -> Self {
        let lights = || probes.iter().map(|&c| luminance(c)).filter(|&y| y > 0.0);
        Self { width, floor: FLOOR * (lights().map(f32::ln).sum::<f32>() / lights().count().max(1) as f32).exp() }
    }

    /// What squares of differences of the light of a pixel, `a` and `b` by two estimates, are worth: one over a power of its luminance.
    fn scale(&self, a: Rgb, b: Rgb, power: f32) -> f32 {
        (luminance(a) + luminance(b) + self.floor).powf(-power)
    }
}

/// What both halves say of a pixel together.
fn mean(estimates: &[Vec<Rgb>; 2], i: usize) -> Rgb {
    0.5 * (estimates[0][i] + estimates[1][i])
}

/// What the mean of the rays' estimates, one of each half, weighs at each pixel, 0 to 1.
fn weights(probes: &[Rgb], halves: &[Vec<Rgb>; 2], estimates: &[Vec<Rgb>; 2], (level, window): (&Level, f32)) -> Vec<f32> {
    let term = |i: usize| {
        let (p, m) = (probes[i], mean(estimates, i));
        let scale = level.scale(p, m, 2.0);
        let along = |of: usize, by: usize| (estimates[of][i] - p).dot(halves[by][i] - p);
        let term = Vec2::new(along(0, 1) + along(1, 0), 2.0 * (m - p).length_squared()) * scale;
        if term.is_finite() { term } else { Vec2::ZERO }
    };
    let terms: Vec<Vec2> = (0..probes.len()).into_par_iter().with_min_len(level.width.max(1)).map(term).collect();
    let weight = |sum: Vec2| ((sum.x + 0.5 * PRIOR) / (sum.y + PRIOR)).clamp(0.0, 1.0);
    blurred(&terms, level.width, window).into_iter().map(weight).collect()
}

/// Gaussian sums of an image; what lies outside of it is zero.
fn blurred(image: &[Vec2], width: usize, sigma: f32) -> Vec<Vec2> {
    let reach = (3.0 * sigma).ceil() as usize;
    let kernel = gaussian(reach as i32, sigma);
    let height = image.len() / width.max(1);
    // Of the pixel `i` the neighbours along an axis on which it is number `at` of `count`, `stride` apart.
    let pass = |source: &[Vec2], i: usize, [at, count, stride]: [usize; 3]| -> Vec2 {
        let (first, last) = (at.saturating_sub(reach), (at + reach).min(count - 1));
        (first..=last).map(|k| source[i + k * stride - at * stride] * kernel[k + reach - at]).sum()
    };
    let all = |source: &[Vec2], axis: &(dyn Fn(usize) -> [usize; 3] + Sync)| -> Vec<Vec2> {
        (0..source.len()).into_par_iter().with_min_len(width.max(1)).map(|i| pass(source, i, axis(i))).collect()
    };
    let across = all(image, &|i| [i % width, width, 1]);
    all(&across, &|i| [i / width, height, width])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::math::hash_words;
    use crate::transport::Sampler;

    const WIDTH: usize = 192;
    const COUNT: usize = WIDTH * 96;
    /// Standard deviation of a half's noise.
    const NOISE: f32 = 0.2;

    fn gaussian(i: usize, half: u32) -> f32 {
        let uniform = |k: u32| Sampler::new(hash_words(&[i as u32, half, k]), 0).next_4d()[0];
        (0..12).map(uniform).sum::<f32>() - 6.0
    }

    /// Probes that are off by `bias` in the left half of an image whose truth is 1, and two halves of noisy rays.
    fn picture(bias: f32) -> (Vec<Rgb>, [Vec<Rgb>; 2]) {
        let probes = (0..COUNT).map(|i| Rgb::splat(if i % WIDTH < WIDTH / 2 { 1.0 + bias } else { 1.0 })).collect();
        let half = |h| (0..COUNT).map(|i| Rgb::splat(1.0 + NOISE * gaussian(i, h))).collect();
        (probes, [half(0), half(1)])
    }

    /// Mean weight of both sides, away from their border.
    fn sides(weights: &[f32]) -> [f32; 2] {
        let mean = |from: usize| {
            let inside: Vec<f32> =
                weights.iter().enumerate().filter(|(i, _)| (from..from + 32).contains(&(i % WIDTH))).map(|(_, w)| *w).collect();
            inside.iter().sum::<f32>() / inside.len() as f32
        };
        [mean(32), mean(128)]
    }

    #[test]
    fn noisy_rays_weigh_what_wiener_would_give_them_and_nothing_where_probes_are_right() {
        let bias = 0.3;
        let (probes, halves) = picture(bias);
        let weights = weights(&probes, &halves, &halves, (&Level::of(&probes, WIDTH), 8.0));
        let [left, right] = sides(&weights);
        // The mean of both has half of a half's variance: b² / (b² + σ² / 2).
        let wiener = bias * bias / (bias * bias + NOISE * NOISE / 2.0);
        assert!((left - wiener).abs() < 0.02, "{left}, not {wiener}");
        // 200 pixels a window: the weight's own noise is a tenth, cut off below 0.
        assert!(right < 0.1, "{right}");
    }

    #[test]
    fn rays_without_noise_replace_probes_that_are_off_and_equals_are_mixed() {
        let bias = 0.3;
        let (probes, halves) = picture(bias);
        let clean = || vec![Rgb::ONE; COUNT];
        let [left, right] = sides(&weights(&probes, &halves, &[clean(), clean()], (&Level::of(&probes, WIDTH), 8.0)));
        // All of it, but for what the prior holds back: squares of three channels and two halves, relative to the sum of both and the floor.
        let squares = 6.0 * bias * bias / (2.0 + bias + FLOOR * (1.0 + bias).sqrt()).powi(2);
        let expected = (squares + 0.5 * PRIOR) / (squares + PRIOR);
        assert!((left - expected).abs() < 0.01 && left > 0.9, "{left}, not {expected}");
        assert!((right - 0.5).abs() < 1e-3, "{right}");
    }

    #[test]
    fn what_is_no_number_does_not_spread() {
        let (mut probes, halves) = picture(0.3);
        probes[50 * WIDTH + 50] = Rgb::splat(f32::NAN);
        let weights = weights(&probes, &halves, &halves, (&Level::of(&probes, WIDTH), 8.0));
        assert!(weights.iter().all(|w| w.is_finite()));
    }

    #[test]
    fn sums_keep_a_constant_inside_and_spread_a_spike_evenly() {
        let mut image = vec![Vec2::new(3.0, 1.0); COUNT];
        let sums = blurred(&image, WIDTH, 2.0);
        assert!(sums[48 * WIDTH + 96].distance(Vec2::new(3.0, 1.0)) < 1e-5);
        image.fill(Vec2::ZERO);
        image[48 * WIDTH + 96] = Vec2::ONE;
        let sums = blurred(&image, WIDTH, 2.0);
        assert_eq!(sums[48 * WIDTH + 93], sums[48 * WIDTH + 99]);
        assert_eq!(sums[48 * WIDTH + 93], sums[45 * WIDTH + 96]);
        assert!((sums.iter().map(|s| s.x).sum::<f32>() - 1.0).abs() < 1e-5);
    }
}
