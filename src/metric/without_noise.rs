//! Errors without the reference's own noise, from two renders of the reference with different seeds.
//!
//! A rendered reference is the truth r and noise: b = r + n. Its noise adds to the squared error of every method alike, mean
//! (a - b)² = mean (a - r)² + mean n², and to its DSSIM likewise. With a second render c = r + n', whose noise n' is independent
//! of n, products of both have no such term: mean (a - b)(a - c) expects mean (a - r)², and the covariance of b and c in a window
//! expects the variance of r. All this is of display values, whose curve makes of unbiased radiance something slightly biased; that
//! is of second order in the noise.

use super::{Raster, display, planes, rmse, ssim};
use crate::base::math::{Rgb, luminance};
use rayon::prelude::*;
use serde::Serialize;

/// The numbers of one frame, or their mean over frames.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct WithoutNoise {
    /// [`crate::metric::Metrics::rmse_rgb`] without the reference's noise; 0 where chance takes its square below 0.
    pub rmse_rgb: f64,
    /// [`crate::metric::Metrics::rmse_lum`], likewise.
    pub rmse_lum: f64,
    /// [`crate::metric::Metrics::dssim_rgb`], likewise.
    pub dssim_rgb: f64,
    /// [`crate::metric::Metrics::dssim_lum`], likewise.
    pub dssim_lum: f64,
    /// The noise of one reference: [`crate::metric::Metrics::rmse_rgb`] between both, by the square root of two.
    pub noise_rmse_rgb: f64,
}

/// Errors of `image` against two independent renders of its reference, at 2^`exposure`. All hold linear radiance, are of one
/// size, and at least [`ssim::WINDOW`] pixels a side.
pub fn without_noise(image: &Raster, references: [&Raster; 2], exposure: f32) -> WithoutNoise {
    assert!(references.iter().all(|r| r.size == image.size), "without_noise takes images of one size");
    let [a, b, c] = [image, references[0], references[1]].map(|r| display(r, exposure));
    let product = |of: fn(Rgb, Rgb) -> f64| {
        let differences = a.pixels.iter().zip(&b.pixels).zip(&c.pixels).map(|((&a, &b), &c)| of(a - b, a - c));
        (differences.sum::<f64>() / a.pixels.len() as f64).max(0.0).sqrt()
    };
    let [pa, pb, pc] = [&a, &b, &c].map(planes);
    let dssim: Vec<f64> =
        (0..4).into_par_iter().map(|i| (1.0 - ssim::ssim_to_pair(&pa[i], [&pb[i], &pc[i]], a.size)) / 2.0).collect();
    WithoutNoise {
        rmse_rgb: product(|x, y| f64::from(x.dot(y)) / 3.0),
        rmse_lum: product(|x, y| f64::from(luminance(x)) * f64::from(luminance(y))),
        dssim_rgb: dssim[..3].iter().sum::<f64>() / 3.0,
        dssim_lum: dssim[3],
        noise_rmse_rgb: rmse::rmse(&b.pixels, &c.pixels) / std::f64::consts::SQRT_2,
    }
}

impl WithoutNoise {
    /// Mean of each number over frames.
    pub fn mean(frames: &[Self]) -> Self {
        let mean = |of: fn(&Self) -> f64| frames.iter().map(of).sum::<f64>() / frames.len() as f64;
        Self {
            rmse_rgb: mean(|m| m.rmse_rgb),
            rmse_lum: mean(|m| m.rmse_lum),
            dssim_rgb: mean(|m| m.dssim_rgb),
            dssim_lum: mean(|m| m.dssim_lum),
            noise_rmse_rgb: mean(|m| m.noise_rmse_rgb),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metric::{Metrics, compare};

    const SIZE: [usize; 2] = [160, 120];

    /// Stripes and a gradient in the middle of the display's range, `shift` pixels along, with noise of a standard deviation.
    fn picture(shift: usize, noise: f32, seed: u64) -> Raster {
        let mut count = seed << 32;
        // Uniform, of variance 1, by the hash of a counter (SplitMix64).
        let mut random = || {
            count += 1;
            let z = count.wrapping_mul(0x9e37_79b9_7f4a_7c15);
            let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            12f32.sqrt() * (((z ^ (z >> 31)) >> 40) as f32 / (1 << 24) as f32 - 0.5)
        };
        let pixel = |i: usize| {
            let (x, y) = ((i % SIZE[0] + shift) as f32, (i / SIZE[0]) as f32);
            Rgb::new(0.3 + 0.1 * (0.3 * x).sin(), 0.2 + 0.001 * y, 0.25 + 0.05 * (0.1 * x + 0.4 * y).sin())
        };
        let pixels = (0..SIZE[0] * SIZE[1]).map(|i| pixel(i) + noise * Rgb::new(random(), random(), random())).collect();
        Raster { size: SIZE, pixels }
    }

    /// Noise that is as large as the error goes, and what is left is what a clean reference says.
    #[test]
    fn the_noise_of_the_reference_goes() {
        let image = picture(1, 0.0, 0);
        let clean = compare(&image, &picture(0, 0.0, 0), 0.0).metrics;
        let noisy = [1, 2].map(|seed| picture(0, 0.02, seed));
        let with = compare(&image, &noisy[0], 0.0).metrics;
        let without = without_noise(&image, [&noisy[0], &noisy[1]], 0.0);
        assert!(with.rmse_rgb > 1.5 * clean.rmse_rgb && with.dssim_rgb > 5.0 * clean.dssim_rgb, "{with:?} {clean:?}");
        let near = |found: f64, expected: f64| (found - expected).abs() < 0.03 * expected;
        assert!(near(without.rmse_rgb, clean.rmse_rgb) && near(without.rmse_lum, clean.rmse_lum), "{without:?} {clean:?}");
        // Of the noise's DSSIM, a hundredth may be left.
        let near = |found: f64, expected: f64, with: f64| (found - expected).abs() < 0.01 * with;
        assert!(near(without.dssim_rgb, clean.dssim_rgb, with.dssim_rgb), "{without:?} {clean:?}");
        assert!(near(without.dssim_lum, clean.dssim_lum, with.dssim_lum), "{without:?} {clean:?}");
        let own = compare(&noisy[0], &picture(0, 0.0, 0), 0.0).metrics.rmse_rgb;
        assert!((without.noise_rmse_rgb - own).abs() < 0.02 * own, "{} {own}", without.noise_rmse_rgb);
    }

    #[test]
    fn one_reference_twice_is_the_plain_measure() {
        let (image, reference) = (picture(1, 0.01, 1), picture(0, 0.01, 2));
        let plain: Metrics = compare(&image, &reference, 1.0).metrics;
        let twice = without_noise(&image, [&reference, &reference], 1.0);
        let pairs = [
            (twice.rmse_rgb, plain.rmse_rgb),
            (twice.rmse_lum, plain.rmse_lum),
            (twice.dssim_rgb, plain.dssim_rgb),
            (twice.dssim_lum, plain.dssim_lum),
            (twice.noise_rmse_rgb, 0.0),
        ];
        assert!(pairs.iter().all(|(a, b)| (a - b).abs() < 1e-6), "{pairs:?}");
    }
}
