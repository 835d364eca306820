//! How much a method's error changes from frame to frame: what flickers and swims, of which a still frame tells nothing.
//!
//! *Ours*. With the display values a of the image and b of the reference, the mean over pixels and channels of
//! |(a₁ - b₁) - (a₀ - b₀)| for two consecutive frames 0 and 1. An error that stays where it is in the image counts nothing; noise, which is
//! new in every frame, counts in full, and that of the reference with it.

use super::Raster;
use crate::base::math::Rgb;

/// a - b of every pixel, of display values.
pub fn signed_error([a, b]: &[Raster; 2]) -> Vec<Rgb> {
    a.pixels.iter().zip(&b.pixels).map(|(a, b)| a - b).collect()
}

/// Mean change between the [`signed_error`]s of two consecutive frames of one size, 0 to 2.
pub fn change(before: &[Rgb], after: &[Rgb]) -> f64 {
    assert_eq!(before.len(), after.len(), "frames of one size");
    let sum: f64 = before.iter().zip(after).map(|(x, y)| f64::from((y - x).abs().element_sum())).sum();
    sum / (3 * before.len().max(1)) as f64
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
        let error = |image: &Raster, frame: u32| signed_error(&[image, &scene(frame)].map(|r| display(r, 0.0)));
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
}
