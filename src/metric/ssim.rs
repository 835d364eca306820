//! Structural similarity.
//!
//! *Paper* (Wang et al. 2004): an 11x11 Gaussian window of sigma 1.5, K1 = 0.01, K2 = 0.03, data range 1. Population statistics.
//! *Reading*: borders mirror (the edge pixel twice), and the mean leaves out the outermost 5 pixels, where the window reaches
//! over the edge: the choices of scikit-image's `structural_similarity(gaussian_weights=True, sigma=1.5,
//! use_sample_covariance=False, data_range=1)`, which the tests compare with.

/// Edge of the window, pixels; images must be at least this large.
pub const WINDOW: usize = 11;
const RADIUS: usize = WINDOW / 2;
const SIGMA: f64 = 1.5;
const C1: f64 = 0.01 * 0.01;
const C2: f64 = 0.03 * 0.03;

/// Similarity of two planes.
#[derive(Debug, Clone)]
pub struct Ssim {
    /// Mean over the pixels whose window lies inside the image.
    pub mean: f64,
    /// Similarity of every pixel, in [-1, 1].
    pub map: Vec<f32>,
}

/// SSIM of two planes of `size` (width, height), values in [0, 1].
pub fn ssim(a: &[f32], b: &[f32], size: [usize; 2]) -> Ssim {
    let blur = |of: &dyn Fn(f64, f64) -> f64| blur_of(a, b, size, of);
    let (ua, ub) = (blur(&|x, _| x), blur(&|_, y| y));
    let (uaa, ubb, uab) = (blur(&|x, _| x * x), blur(&|_, y| y * y), blur(&|x, y| x * y));
    let at = |i: usize| similarity([ua[i], uaa[i]], [ub[i], ub[i]], [uab[i], uab[i]], ubb[i]);
    let map: Vec<f64> = (0..a.len()).map(at).collect();
    Ssim { mean: mean_inside(&map, size), map: map.iter().map(|&x| x as f32).collect() }
}

/// Mean SSIM of a plane to what two noisy ones have in common: their squares are taken as the product of both, in which
/// independent noise has no mean (in flat windows it may fall below 0, which is let be as far as the quotient allows). The same
/// plane twice gives [`ssim`]'s mean.
pub fn ssim_to_pair(a: &[f32], [b, c]: [&[f32]; 2], size: [usize; 2]) -> f64 {
    let product = |x: &[f32], y: &[f32]| blur_of(x, y, size, &|x, y| x * y);
    let [ua, ub, uc] = [a, b, c].map(|plane| blur_of(plane, plane, size, &|x, _| x));
    let (uaa, uab, uac, ubc) = (product(a, a), product(a, b), product(a, c), product(b, c));
    let at = |i: usize| similarity([ua[i], uaa[i]], [ub[i], uc[i]], [uab[i], uac[i]], ubc[i]);
    let map: Vec<f64> = (0..a.len()).map(at).collect();
    mean_inside(&map, size)
}

/// SSIM by the means under one window: of a and its square, of b and c, of their products with a, and of b times c.
fn similarity([ua, uaa]: [f64; 2], [ub, uc]: [f64; 2], [uab, uac]: [f64; 2], ubc: f64) -> f64 {
    let (va, vbc) = (uaa - ua * ua, (ubc - ub * uc).max(-0.5 * C2));
    let structure = ((uab - ua * ub) + (uac - ua * uc) + C2) / (va + vbc + C2);
    structure * (ua * (ub + uc) + C1) / (ua * ua + ub * uc + C1)
}

/// A function of two planes, pixel by pixel, under the window.
fn blur_of(a: &[f32], b: &[f32], size: [usize; 2], of: &dyn Fn(f64, f64) -> f64) -> Vec<f64> {
    let [width, height] = size;
    assert!(width >= WINDOW && height >= WINDOW && a.len() == width * height && b.len() == a.len(), "ssim of {size:?}");
    gaussian(a.iter().zip(b).map(|(&x, &y)| of(f64::from(x), f64::from(y))).collect(), size)
}

/// Mean over the pixels whose window lies inside the image.
fn mean_inside(map: &[f64], [width, height]: [usize; 2]) -> f64 {
    let rows = RADIUS..height - RADIUS;
    let inside = rows.clone().flat_map(|y| &map[y * width + RADIUS..(y + 1) * width - RADIUS]);
    inside.sum::<f64>() / (rows.len() * (width - 2 * RADIUS)) as f64
}

/// Separable Gaussian with mirrored borders.
fn gaussian(plane: Vec<f64>, [width, height]: [usize; 2]) -> Vec<f64> {
    let weights: [f64; WINDOW] = std::array::from_fn(|i| (-0.5 * ((i as f64 - RADIUS as f64) / SIGMA).powi(2)).exp());
    let sum: f64 = weights.iter().sum();
    let weights = weights.map(|w| w / sum);
    let mirror = |i: isize, n: usize| {
        let i = if i < 0 { -1 - i } else { i } as usize;
        if i < n { i } else { 2 * n - 1 - i }
    };
    let pass = |from: &[f64], n: usize, stride: usize, lines: usize, line_stride: usize| {
        let mut to = vec![0.0; from.len()];
        for line in 0..lines {
            let start = line * line_stride;
            for i in 0..n {
                let tap = |(k, w): (usize, &f64)| w * from[start + stride * mirror(i as isize + k as isize - RADIUS as isize, n)];
                to[start + stride * i] = weights.iter().enumerate().map(tap).sum();
            }
        }
        to
    };
    let rows = pass(&plane, width, 1, height, width);
    pass(&rows, height, width, width, 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two textures of 24 x 17 that any language can make again.
    fn textures() -> (Vec<f32>, Vec<f32>) {
        let value = |i: usize, k: usize| ((i * i * 7 + i * 13 * k + k) % 101) as f32 / 101.0;
        let a: Vec<f32> = (0..24 * 17).map(|i| value(i, 1)).collect();
        let b = a.iter().enumerate().map(|(i, x)| 0.7 * x + 0.3 * value(i, 5)).collect();
        (a, b)
    }

    #[test]
    fn equals_scikit_image() {
        let (a, b) = textures();
        let s = ssim(&a, &b, [24, 17]);
        let expected = 0.876726078;
        assert!((s.mean - expected).abs() < 1e-6, "{} against {expected}", s.mean);
        // Map values, corners included: the borders mirror as theirs do.
        for (x, y, expected) in
            [(0, 0, 0.9375613), (23, 16, 0.8466748), (12, 8, 0.8634829), (23, 0, 0.9079100), (5, 5, 0.9340506)]
        {
            let found = f64::from(s.map[y * 24 + x]);
            assert!((found - expected).abs() < 1e-5, "({x}, {y}): {found} against {expected}");
        }
    }

    #[test]
    fn contrast_reversal_is_negative() {
        let (a, _) = textures();
        let inverse: Vec<f32> = a.iter().map(|x| 1.0 - x).collect();
        assert!(ssim(&a, &inverse, [24, 17]).mean < -0.5);
    }
}
