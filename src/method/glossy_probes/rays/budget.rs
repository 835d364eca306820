//! How many rays each pixel gets of those that a frame has.
//!
//! *Ours*. What is spread evenly says how far the rays of a pixel differ, σ relative to the light there. The variance of a mean of n rays is σ² / n, and its sum over
//! all pixels is least, for a sum of n that is given, where n is proportional to σ (Neyman's allocation). σ is taken from a window around each pixel:
//! a pixel's own few rays would give the fewest more to the one that has missed a bright path so far.
//!
//! In: the rays so far. Out: how many each pixel has in the end.

use super::halves::Sums;
use super::{Level, blurred};
use crate::base::math::Rgb;
use glam::Vec2;
use rayon::prelude::*;

/// Standard deviation of the window that σ is taken from, pixels.
const WINDOW: f32 = 2.0;
/// Most rays a pixel, in units of the mean: a denoiser makes more of neighbours that have some each.
const MOST: f32 = 2.0;
/// Power of the luminance by which σ² is divided: between 1, as display values see noise, and 2, which would make dark pixels count as much as bright ones.
const RELATIVE_TO: f32 = 1.5;
/// Steps of the search for what a unit of σ is worth.
const STEPS: u32 = 40;

/// Rays each pixel has in the end, even numbers, never fewer than `sums` has of it: `per_pixel` in the mean over those that show something glossy, and of all
/// others as many as before.
pub(super) fn allotted(probes: &[Rgb], sums: &[Sums], level: &Level, per_pixel: u32) -> Vec<u32> {
    // Of what is glossy, and what that weighs.
    let variance = |i: usize| {
        let variance = sums[i].variance() * level.scale(probes[i], sums[i].mean(), RELATIVE_TO);
        if sums[i].is_glossy() && variance.is_finite() { Vec2::new(variance, 1.0) } else { Vec2::ZERO }
    };
    let variances: Vec<Vec2> = (0..sums.len()).into_par_iter().map(variance).collect();
    let sigma: Vec<f32> =
        blurred(&variances, level.width, WINDOW).into_iter().map(|v| (v.x / v.y.max(f32::MIN_POSITIVE)).sqrt()).collect();
    let most = MOST * per_pixel as f32;
    let count = |i: usize, of_sigma: f32| {
        let so_far = sums[i].count();
        match sums[i].is_glossy() {
            true => (2 * (0.5 * of_sigma * sigma[i]).clamp(0.0, 0.5 * most).round() as u32).max(so_far),
            false => so_far,
        }
    };
    let glossy: Vec<usize> = (0..sums.len()).filter(|&i| sums[i].is_glossy()).collect();
    let all = |of_sigma: f32| glossy.par_iter().map(|&i| u64::from(count(i, of_sigma))).sum::<u64>();
    let budget = glossy.len() as u64 * u64::from(per_pixel);
    // What is afforded grows with what a unit of σ is worth; pixels of the least σ that counts have their most at `high`.
    let least = f32::EPSILON.sqrt();
    let (mut low, mut high) = (0.0, most / least);
    for _ in 0..STEPS {
        let middle = 0.5 * (low + high);
        if all(middle) > budget { high = middle } else { low = middle }
    }
    (0..sums.len()).map(|i| count(i, low)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const WIDTH: usize = 96;
    const COUNT: usize = WIDTH * 48;
    const SO_FAR: u32 = 8;

    /// Pixels whose rays so far are 1 ± `sigma`, by column; nothing glossy in the first 8 rows.
    fn pixels(sigma: impl Fn(usize) -> f32) -> Vec<Sums> {
        let pixel = |i: usize| {
            let mut sums = Sums::default();
            for k in 0..SO_FAR {
                let light = Rgb::splat(1.0 + sigma(i % WIDTH) * if k % 4 < 2 { 1.0 } else { -1.0 });
                sums.add((i >= 8 * WIDTH).then_some(light));
            }
            sums
        };
        (0..COUNT).map(pixel).collect()
    }

    fn counts(sigma: impl Fn(usize) -> f32, per_pixel: u32) -> Vec<u32> {
        let probes = vec![Rgb::ONE; COUNT];
        allotted(&probes, &pixels(sigma), &Level::of(&probes, WIDTH), per_pixel)
    }

    fn mean(counts: &[u32]) -> f64 {
        let glossy = &counts[8 * WIDTH..];
        glossy.iter().map(|&n| f64::from(n)).sum::<f64>() / glossy.len() as f64
    }

    #[test]
    fn pixels_get_rays_in_proportion_to_their_deviation_and_no_more_than_there_are() {
        // Three times the deviation on the right.
        let counts = counts(|x| if x < WIDTH / 2 { 0.1 } else { 0.3 }, 32);
        let [left, right] = [WIDTH / 4, 3 * WIDTH / 4].map(|x| counts[24 * WIDTH + x]);
        assert!(right.abs_diff(3 * left) <= 4, "{left} and {right}");
        let mean = mean(&counts);
        assert!((31.0..=32.0).contains(&mean), "{mean} in place of 32");
        assert!(counts.iter().all(|n| n % 2 == 0), "as many of each half");
        assert!(counts[..8 * WIDTH].iter().all(|&n| n == SO_FAR), "nothing glossy, no more rays");
    }

    #[test]
    fn even_noise_gets_an_even_share() {
        let counts = counts(|_| 0.2, 32);
        assert!(counts[8 * WIDTH..].iter().all(|&n| n == counts[24 * WIDTH]), "to the border, too");
        let mean = mean(&counts);
        assert!((31.0..=32.0).contains(&mean), "{mean} in place of 32");
    }

    #[test]
    fn a_few_pixels_do_not_take_all() {
        let counts = counts(|x| if x == WIDTH / 2 { 30.0 } else { 0.0 }, 16);
        assert_eq!(counts.iter().max(), Some(&32), "twice the mean");
        assert_eq!(counts[24 * WIDTH], SO_FAR, "what has no noise has enough");
    }

    #[test]
    fn what_is_no_number_gets_no_more() {
        let mut sums = pixels(|_| 0.2);
        sums[24 * WIDTH + 48].add(Some(Rgb::splat(f32::NAN)));
        let probes = vec![Rgb::ONE; COUNT];
        let counts = allotted(&probes, &sums, &Level::of(&probes, WIDTH), 16);
        assert!(counts.iter().all(|&n| n <= 32));
    }
}
