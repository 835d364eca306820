//! How much a method's error changes from frame to frame: what flickers and swims, of which a still frame tells nothing.
//!
//! *Ours*: with the display values a of the image and b of the reference, the mean over pixels and channels of
//! |(a₁ - b₁) - (a₀ - b₀)| for two consecutive frames 0 and 1. An error that stays where it is in the image counts nothing; noise, which is
//! new in every frame, counts in full, and that of the reference with it.
//!
//! Of an absolute value that part cannot be taken out again, but of a product it can: with a second render c of the reference, whose noise is
//! independent of that of b, the mean of ((a₁ - b₁) - (a₀ - b₀)) ((a₁ - c₁) - (a₀ - c₀)) expects the mean square of the change against a
//! reference without noise, for the same reason as in [`super::without_noise`].

use super::Raster;
use crate::base::math::Rgb;

/// a - b of every pixel, of display values.
pub fn signed_error([a, b]: [&Raster; 2]) -> Vec<Rgb> {
    a.pixels.iter().zip(&b.pixels).map(|(a, b)| a - b).collect()
}

/// Mean change between the [`signed_error`]s of two consecutive frames of one size, 0 to 2.
pub fn change(before: &[Rgb], after: &[Rgb]) -> f64 {
    assert_eq!(before.len(), after.len(), "frames of one size");
    let sum: f64 = before.iter().zip(after).map(|(x, y)| f64::from((y - x).abs().element_sum())).sum();
    sum / (3 * before.len().max(1)) as f64
}

/// Root mean square of that change without the references' noise: `before` and `after` are the [`signed_error`]s against one render of the
/// reference, and against another. 0 where chance takes its square below 0.
pub fn change_rms(before: [&[Rgb]; 2], after: [&[Rgb]; 2]) -> f64 {
    assert!(before.iter().chain(&after).all(|e| e.len() == before[0].len()), "frames of one size");
    let product = |i: usize| f64::from((after[0][i] - before[0][i]).dot(after[1][i] - before[1][i]));
    let sum: f64 = (0..before[0].len()).map(product).sum();
    (sum / (3 * before[0].len().max(1)) as f64).max(0.0).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::math::hash_words;
    use crate::metric::display;

    const SIZE: [usize; 2] = [64, 48];

    fn raster(of: impl Fn(u32) -> f32) -> Raster {
        Raster { size: SIZE, pixels: (0..(SIZE[0] * SIZE[1]) as u32).map(|i| Rgb::splat(of(i))).collect() }
    }

    #[test]
    fn an_error_that_stays_counts_nothing_and_noise_counts_in_full() {
        // Above the linear part of the encoding, so that display values follow.
        let scene = |frame: u32| raster(move |i| 0.2 + 0.1 * ((i + 3 * frame) as f32 * 0.05).sin());
        let error = |image: &Raster, frame: u32| {
            let [image, reference] = [image, &scene(frame)].map(|r| display(r, 0.0));
            signed_error([&image, &reference])
        };
        let still = |frame: u32| Raster { size: SIZE, pixels: scene(frame).pixels };
        assert_eq!(change(&error(&still(0), 0), &error(&still(1), 1)), 0.0);
        // Display errors uniform in ±w, independent in both frames and alike in the channels: the mean of |x - y| is 2w/3, and its
        // standard error over n pixels is w sqrt((4/6 - 4/9) / n).
        let w = 0.05f64;
        let noise = |frame: u32| -> Vec<Rgb> {
            let uniform = |i: u32| f64::from(hash_words(&[i, frame])) / f64::from(u32::MAX) * 2.0 - 1.0;
            (0..(SIZE[0] * SIZE[1]) as u32).map(|i| Rgb::splat((w * uniform(i)) as f32)).collect()
        };
        let found = change(&noise(0), &noise(1));
        let expected = 2.0 / 3.0 * w;
        let deviation = w * ((4.0 / 6.0 - 4.0 / 9.0) / (SIZE[0] * SIZE[1]) as f64).sqrt();
        assert!((found - expected).abs() < 4.0 * deviation, "{found} in place of {expected} ± {deviation}");
    }

    /// Errors whose change is known, against references whose noise is larger than that.
    #[test]
    fn the_noise_of_the_references_goes() {
        let count = (SIZE[0] * SIZE[1]) as u32;
        let uniform = |i: u32, seed: u32| f64::from(hash_words(&[i, seed])) / f64::from(u32::MAX) * 2.0 - 1.0;
        // The method's own error: of a change of ±0.02 from pixel to pixel.
        let own = |i: u32, frame: u32| 0.02 * if frame == 0 { 0.0 } else { f64::from(i % 2) * 2.0 - 1.0 };
        let error = |noise: f64, frame: u32, seed: u32| -> Vec<Rgb> {
            let of = |i: u32, channel: u32| (own(i, frame) + noise * uniform(3 * i + channel, 2 * seed + frame)) as f32;
            (0..count).map(|i| Rgb::new(of(i, 0), of(i, 1), of(i, 2))).collect()
        };
        let found = |noise: f64, seeds: [u32; 2]| {
            let [before, after] = [0, 1].map(|frame| seeds.map(|seed| error(noise, frame, seed)));
            change_rms(before.each_ref().map(Vec::as_slice), after.each_ref().map(Vec::as_slice))
        };
        assert!((found(0.0, [1, 2]) - 0.02).abs() < 1e-6);
        // The noise's change has a variance of 2w²/3 = 0.04²; the mean of products of two such, over n values, a deviation of some 0.04²/√n.
        let w = 0.04 * 1.5f64.sqrt();
        let deviation = (0.04f64.powi(2) + 2.0 * 0.04 * 0.02) / f64::from(3 * count).sqrt() / (2.0 * 0.02);
        let clean = found(w, [1, 2]);
        assert!((clean - 0.02).abs() < 4.0 * deviation, "{clean} in place of 0.02 ± {deviation}");
        // One reference twice is the plain root mean square.
        let noisy = found(w, [1, 1]);
        assert!((noisy - (0.02f64.powi(2) + 0.04f64.powi(2)).sqrt()).abs() < 0.001, "{noisy}");
    }
}
