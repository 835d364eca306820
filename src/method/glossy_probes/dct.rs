//! Local geometric complexity: the frequency analysis of the normal buffer (§4.2.1, appendix A).
//!
//!   m_complexity = 1/N² Σ_p Σ_q w_pq ‖b_pq * n‖₁,   w_pq = ‖(p, q)‖ᵏ
//!
//! with b_pq the two-dimensional DCT-II basis on N x N texels, convolved with each component of the normal.
//!
//! *Reading*: the orthonormal basis; the window of texel x spans x − N/2 to x + N/2 − 1.
//! *Ours*: the image wraps at the seam and continues over the poles.
//!
//! The basis is separable: one pass along rows for each p, then all q down the columns. The column pass folds the window
//! about its middle, twice for even q, since the basis is even or odd there: 96 products for 16 responses of 16 taps.

use super::lattice;
use std::f64::consts::PI;

/// Responses below this are the rounding of flat normals, which the weights (up to 5·10⁶) would blow up.
const NOISE: f32 = 3e-5;

/// Texels that are computed at once, for the sake of vector instructions.
const LANES: usize = 16;

/// Sizes N that [`complexity`] takes.
pub const SIZES: [u32; 3] = [8, 16, 32];

/// `m_complexity` of every texel, before normalisation, of three components of a `w` x `h` lat-long image.
/// `n` is one of [`SIZES`], at most h and w; `w` is a multiple of 16.
pub fn complexity(w: u32, h: u32, components: [&[f32]; 3], n: u32, exponent: f32) -> Vec<f32> {
    match n {
        8 => analyse::<8>(w, h, components, exponent),
        16 => analyse::<16>(w, h, components, exponent),
        _ => analyse::<32>(w, h, components, exponent),
    }
}

fn analyse<const N: usize>(w: u32, h: u32, components: [&[f32]; 3], exponent: f32) -> Vec<f32> {
    let (width, height) = (w as usize, h as usize);
    let basis = basis::<N>();
    let mut out = vec![0.0; width * height];
    let half = N as i32 / 2;
    let (padded_width, padded_height) = (width + N, height + N);
    for component in components {
        let padded: Vec<f32> = (0..padded_height as i32)
            .flat_map(|y| (0..padded_width as i32).map(move |x| component[lattice::index(w, h, x - half, y - half)]))
            .collect();
        let mut rows = vec![0.0; width * padded_height];
        for (p, wave) in basis.iter().enumerate() {
            for (source, target) in padded.chunks_exact(padded_width).zip(rows.chunks_exact_mut(width)) {
                for (x, t) in target.chunks_exact_mut(LANES).enumerate() {
                    let mut sum = [0.0; LANES];
                    for (i, &b) in wave.iter().enumerate() {
                        add_scaled(&mut sum, b, lanes(source, x * LANES + i));
                    }
                    t.copy_from_slice(&sum);
                }
            }
            let weights: [f32; N] = std::array::from_fn(|q| {
                let norm = ((p * p + q * q) as f32).sqrt();
                if p + q == 0 { 0.0 } else { norm.powf(exponent) / (N * N) as f32 }
            });
            for y in 0..height {
                for (x, target) in out[y * width..(y + 1) * width].chunks_exact_mut(LANES).enumerate() {
                    let window = std::array::from_fn(|i| lanes(&rows, (y + i) * width + x * LANES));
                    let sum = weighted_responses::<N>(&basis, &weights, &window);
                    target.iter_mut().zip(sum).for_each(|(t, s)| *t += s);
                }
            }
        }
    }
    out
}

/// Σ_q w_q |Σ_i b_q(i) window_i|, for each lane.
fn weighted_responses<const N: usize>(basis: &[[f32; N]; N], weights: &[f32; N], window: &[[f32; LANES]; N]) -> [f32; LANES] {
    let add = |a: [f32; LANES], b: [f32; LANES]| std::array::from_fn(|l| a[l] + b[l]);
    let subtract = |a: [f32; LANES], b: [f32; LANES]| std::array::from_fn(|l| a[l] - b[l]);
    // Even waves see the window's even part only, odd ones its odd part; the even part of half the length again.
    let (mut even, mut odd) = ([[0.0; LANES]; N], [[0.0; LANES]; N]);
    for i in 0..N / 2 {
        even[i] = add(window[i], window[N - 1 - i]);
        odd[i] = subtract(window[i], window[N - 1 - i]);
    }
    let (mut even_even, mut even_odd) = ([[0.0; LANES]; N], [[0.0; LANES]; N]);
    for i in 0..N / 4 {
        even_even[i] = add(even[i], even[N / 2 - 1 - i]);
        even_odd[i] = subtract(even[i], even[N / 2 - 1 - i]);
    }
    let mut total = [0.0; LANES];
    let mut gather = |q: usize, terms: &[[f32; LANES]]| {
        let mut sum = [0.0; LANES];
        for (&b, term) in basis[q].iter().zip(terms) {
            add_scaled(&mut sum, b, *term);
        }
        for (t, s) in total.iter_mut().zip(sum) {
            *t += weights[q] * (s.abs() - NOISE).max(0.0);
        }
    };
    for q in (0..N).step_by(4) {
        gather(q, &even_even[..N / 4]);
        gather(q + 1, &odd[..N / 2]);
        gather(q + 2, &even_odd[..N / 4]);
        gather(q + 3, &odd[..N / 2]);
    }
    total
}

fn lanes(source: &[f32], at: usize) -> [f32; LANES] {
    std::array::from_fn(|l| source[at..at + LANES][l])
}

fn add_scaled(sum: &mut [f32; LANES], scale: f32, term: [f32; LANES]) {
    sum.iter_mut().zip(term).for_each(|(s, t)| *s += scale * t);
}

/// The orthonormal DCT-II: `basis[p][i]`.
fn basis<const N: usize>() -> [[f32; N]; N] {
    std::array::from_fn(|p| {
        let scale = if p == 0 { 1.0 / N as f64 } else { 2.0 / N as f64 }.sqrt();
        std::array::from_fn(|i| (scale * (PI * (2 * i + 1) as f64 * p as f64 / (2 * N) as f64).cos()) as f32)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::math::hash_words;

    fn noise(seed: u32, n: usize) -> Vec<f32> {
        (0..n as u32).map(|i| hash_words(&[seed, i]) as f32 / u32::MAX as f32 * 2.0 - 1.0).collect()
    }

    /// The formula as it is printed, in doubles.
    fn printed(w: u32, h: u32, components: [&[f32]; 3], n: i32, exponent: f64, x: i32, y: i32) -> f64 {
        let b = |p: i32, i: i32| {
            let scale = if p == 0 { 1.0 } else { 2.0 } / f64::from(n);
            scale.sqrt() * (PI * f64::from((2 * i + 1) * p) / f64::from(2 * n)).cos()
        };
        let mut total = 0.0;
        for (p, q) in (0..n).flat_map(|p| (0..n).map(move |q| (p, q))).skip(1) {
            for component in components {
                let mut response = 0.0;
                for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
                    let texel = lattice::index(w, h, x + i - n / 2, y + j - n / 2);
                    response += b(p, i) * b(q, j) * f64::from(component[texel]);
                }
                total += f64::from(p * p + q * q).powf(exponent / 2.0) * response.abs();
            }
        }
        total / f64::from(n * n)
    }

    #[test]
    fn separable_and_folded_analysis_equals_the_formula() {
        let (w, h) = (64, 32);
        let planes = [noise(1, 2048), noise(2, 2048), noise(3, 2048)];
        let components = [&planes[0][..], &planes[1][..], &planes[2][..]];
        for n in SIZES {
            let fast = complexity(w, h, components, n, 5.0);
            for (x, y) in [(0, 0), (63, 31), (30, 15), (5, 1), (33, 29)] {
                let expected = printed(w, h, components, n as i32, 5.0, x, y);
                let found = f64::from(fast[(y * 64 + x) as usize]);
                assert!((found / expected - 1.0).abs() < 1e-3, "N = {n}, texel ({x}, {y}): {found}, expected {expected}");
            }
        }
    }

    #[test]
    fn constant_normals_have_no_complexity() {
        let n = 1.0 / 3f32.sqrt();
        let plane = vec![n; 64 * 32];
        assert!(complexity(64, 32, [&plane, &plane, &plane], 16, 5.0).iter().all(|&c| c == 0.0));
    }

    #[test]
    fn fine_detail_counts_more_than_one_edge() {
        let (w, h) = (128, 64);
        let edge: Vec<f32> = (0..w * h).map(|i| if i % w < 64 { 1.0 } else { -1.0 }).collect();
        let stripes: Vec<f32> = (0..w * h).map(|i| if i % 2 == 0 { 1.0 } else { -1.0 }).collect();
        let zero = vec![0.0; (w * h) as usize];
        let at = |plane: &[f32]| complexity(w, h, [plane, &zero, &zero], 16, 5.0)[(32 * w + 64) as usize];
        assert!(at(&stripes) > 3.0 * at(&edge), "{} {}", at(&stripes), at(&edge));
    }
}
