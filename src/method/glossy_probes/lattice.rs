//! Neighbourhoods on a lat-long image: it wraps at the seam and continues over the poles.

/// Index of texel (x, y) of a `w` x `h` lat-long image, for y up to one height beyond either pole. Over a pole the sphere
/// continues half a turn away, rows running back; `w` is even.
pub fn index(w: u32, h: u32, x: i32, y: i32) -> usize {
    let (iw, ih) = (w as i32, h as i32);
    let (x, y) = match y {
        y if y < 0 => (x + iw / 2, -1 - y),
        y if y >= ih => (x + iw / 2, 2 * ih - 1 - y),
        y => (x, y),
    };
    y as usize * w as usize + x.rem_euclid(iw) as usize
}

/// Weights of a Gaussian at -`reach` to `reach`. Sum to 1.
pub fn gaussian(reach: i32, sigma: f32) -> Vec<f32> {
    let mut kernel: Vec<f32> = (-reach..=reach).map(|i| (-0.5 * (i as f32 / sigma).powi(2)).exp()).collect();
    let sum: f32 = kernel.iter().sum();
    kernel.iter_mut().for_each(|k| *k /= sum);
    kernel
}

/// Gaussian blur of a lat-long image, `sigma` in texels, the kernel cut at 4 sigma or at the image's height. Sums to 1.
pub fn blur(w: u32, h: u32, image: &[f32], sigma: f32) -> Vec<f32> {
    let reach = ((4.0 * sigma).ceil() as i32).clamp(0, h as i32);
    if reach == 0 {
        return image.to_vec();
    }
    let kernel = gaussian(reach, sigma);
    let pass = |source: &[f32], dx: i32, dy: i32| -> Vec<f32> {
        let mut out = Vec::with_capacity(source.len());
        for y in 0..h as i32 {
            for x in 0..w as i32 {
                let taps = kernel.iter().zip(-reach..=reach);
                out.push(taps.map(|(k, i)| k * source[index(w, h, x + i * dx, y + i * dy)]).sum());
            }
        }
        out
    };
    pass(&pass(image, 1, 0), 0, 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn over_the_pole_lies_the_other_side() {
        assert_eq!(index(8, 4, 9, 1), 9);
        assert_eq!(index(8, 4, -1, 1), 15);
        assert_eq!(index(8, 4, 1, -1), 5);
        assert_eq!(index(8, 4, 6, 5), 2 * 8 + 2);
    }

    #[test]
    fn blur_keeps_a_constant_and_spreads_a_spike_evenly_across_the_seam() {
        assert!(blur(32, 16, &[2.0; 512], 3.0).iter().all(|x| (x - 2.0).abs() < 1e-5));
        let mut spike = [0.0; 64 * 32];
        spike[16 * 64] = 1.0;
        let b = blur(64, 32, &spike, 2.0);
        assert!((b.iter().sum::<f32>() - 1.0).abs() < 1e-5);
        assert!((b[16 * 64 + 3] - b[16 * 64 + 61]).abs() < 1e-7 && b[16 * 64 + 3] > 0.0);
        let expected = (-0.5f32 * 9.0 / 4.0).exp();
        assert!((b[16 * 64 + 3] / b[16 * 64] - expected).abs() < 1e-4);
    }
}
