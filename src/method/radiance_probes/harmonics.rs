//! Real spherical harmonics Y_j, j = l² + l + m, to a chosen order, and their expansions.
//!
//! The sign convention is that of Sloan 2008: without the Condon-Shortley phase, so that Y_1 is sqrt(3 / 4π) (y, z, x).

use glam::Vec3;
use std::f64::consts::PI;

/// Highest order that there is.
pub const MAX_ORDER: u32 = 9;
/// Functions up to it.
pub const MAX_TERMS: usize = terms(MAX_ORDER);

/// Number of functions up to an order.
pub const fn terms(order: u32) -> usize {
    ((order + 1) * (order + 1)) as usize
}

/// The functions up to an order, ready to be evaluated.
#[derive(Debug, Clone)]
pub struct Harmonics {
    order: usize,
    /// Of P_mm, normalised, for each m.
    diagonal: Vec<f32>,
    /// a and b of P_lm = a (z P_(l-1)m - b P_(l-2)m), for each m and each l > m.
    steps: Vec<[f32; 2]>,
}

impl Harmonics {
    /// Of orders from 0 to [`MAX_ORDER`].
    pub fn new(order: u32) -> Self {
        let order = order.min(MAX_ORDER) as usize;
        let mut diagonal = vec![(0.25 / PI).sqrt()];
        for m in 1..=order {
            let m = m as f64;
            // sqrt(2) of the pair ±m comes in with the first of them.
            let pair = if m == 1.0 { 2.0 } else { 1.0 };
            diagonal.push(diagonal[m as usize - 1] * (pair * (2.0 * m + 1.0) / (2.0 * m)).sqrt());
        }
        let mut steps = Vec::new();
        for m in 0..=order {
            for l in m + 1..=order {
                let (l, m) = (l as f64, m as f64);
                let a = ((4.0 * l * l - 1.0) / (l * l - m * m)).sqrt();
                let b = (((l - 1.0) * (l - 1.0) - m * m) / (4.0 * (l - 1.0) * (l - 1.0) - 1.0)).sqrt();
                steps.push([a as f32, b as f32]);
            }
        }
        Self { order, diagonal: diagonal.iter().map(|&d| d as f32).collect(), steps }
    }

    /// How many there are.
    pub fn terms(&self) -> usize {
        terms(self.order as u32)
    }

    /// Writes Y_j(d) of all of them; `d` unit.
    pub fn evaluate(&self, d: Vec3, y: &mut [f32]) {
        let mut lanes = [[0.0]; MAX_TERMS];
        self.evaluate_lanes([[d.x], [d.y], [d.z]], &mut lanes);
        y.iter_mut().zip(&lanes[..self.terms()]).for_each(|(y, [lane])| *y = *lane);
    }

    /// Writes Y_j of `N` unit directions at once, given by their coordinates.
    pub fn evaluate_lanes<const N: usize>(&self, [x, y, z]: [[f32; N]; 3], out: &mut [[f32; N]]) {
        let mut steps = self.steps.iter();
        // r^m cos(mφ) and r^m sin(mφ), r = sin θ.
        let (mut cos, mut sin) = ([1.0; N], [0.0; N]);
        for m in 0..=self.order {
            let (mut below, mut p) = ([0.0; N], [self.diagonal[m]; N]);
            let mut put = |l: usize, p: &[f32; N]| {
                for k in 0..N {
                    out[l * l + l + m][k] = p[k] * cos[k];
                }
                // Of m = 0 the same place once more, as sin is 0 there and must not be written.
                if m > 0 {
                    for k in 0..N {
                        out[l * l + l - m][k] = p[k] * sin[k];
                    }
                }
            };
            put(m, &p);
            for (l, [a, b]) in (m + 1..=self.order).zip(&mut steps) {
                let next: [f32; N] = std::array::from_fn(|k| a * (z[k] * p[k] - b * below[k]));
                (below, p) = (p, next);
                put(l, &p);
            }
            let turned: [[f32; N]; 2] =
                [std::array::from_fn(|k| cos[k] * x[k] - sin[k] * y[k]), std::array::from_fn(|k| sin[k] * x[k] + cos[k] * y[k])];
            [cos, sin] = turned;
        }
    }

    /// Y_j(d) as a list.
    pub fn at(&self, d: Vec3) -> Vec<f32> {
        let mut y = vec![0.0; self.terms()];
        self.evaluate(d, &mut y);
        y
    }
}

/// The irradiance of an expansion's terms for a receiver that faces their direction: A_l of Ramamoorthi and Hanrahan 2001, π times what a
/// clamped cosine does to order l.
pub fn cosine_factor(l: u32) -> f64 {
    match l {
        0 => PI,
        1 => 2.0 * PI / 3.0,
        l if l % 2 == 1 => 0.0,
        l => {
            let factorial = |n: u32| (1..=n).map(f64::from).product::<f64>();
            let half = l / 2;
            let sign = if half % 2 == 1 { 1.0 } else { -1.0 };
            let l = f64::from(l);
            2.0 * PI * sign / ((l + 2.0) * (l - 1.0)) * factorial(2 * half)
                / (2f64.powi(2 * half as i32) * factorial(half).powi(2))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::math::{Basis, direction_from_lat_long};
    use glam::Vec2;

    /// A direction, and its share of the sphere: a product rule of Gauss-Legendre in z would be exact; the midpoints of many cells do.
    fn sphere(n: u32) -> impl Iterator<Item = (Vec3, f64)> {
        (0..n).flat_map(move |i| {
            (0..2 * n).map(move |k| {
                let z = (f64::from(i) + 0.5) / f64::from(n) * 2.0 - 1.0;
                let phi = (f64::from(k) + 0.5) / f64::from(n) * PI;
                let r = (1.0 - z * z).sqrt();
                let d = Vec3::new((r * phi.cos()) as f32, (r * phi.sin()) as f32, z as f32);
                (d, 2.0 * PI / f64::from(n * n))
            })
        })
    }

    #[test]
    fn the_first_ones_are_those_of_the_books() {
        let harmonics = Harmonics::new(3);
        for i in 0..50 {
            let d = direction_from_lat_long(Vec2::new((i as f32 * 0.618).fract(), (i as f32 + 0.5) / 50.0));
            let (x, y, z) = (f64::from(d.x), f64::from(d.y), f64::from(d.z));
            let k = |c: f64| (c / PI).sqrt();
            let expected = [
                k(0.25),
                k(0.75) * y,
                k(0.75) * z,
                k(0.75) * x,
                k(3.75) * x * y,
                k(3.75) * y * z,
                k(0.3125) * (3.0 * z * z - 1.0),
                k(3.75) * x * z,
                k(0.9375) * (x * x - y * y),
                k(35.0 / 32.0) * y * (3.0 * x * x - y * y),
            ];
            let found = harmonics.at(d);
            for (j, e) in expected.iter().enumerate() {
                assert!((f64::from(found[j]) - e).abs() < 1e-5, "{j}: {} for {e}", found[j]);
            }
        }
    }

    #[test]
    fn they_are_orthonormal() {
        let harmonics = Harmonics::new(MAX_ORDER);
        let n = harmonics.terms();
        let mut gram = vec![0.0; n * n];
        for (d, share) in sphere(400) {
            let y = harmonics.at(d);
            for i in 0..n {
                for j in 0..=i {
                    gram[i * n + j] += f64::from(y[i]) * f64::from(y[j]) * share;
                }
            }
        }
        for i in 0..n {
            for j in 0..=i {
                let expected = f64::from(i == j);
                assert!((gram[i * n + j] - expected).abs() < 2e-3, "{i}, {j}: {}", gram[i * n + j]);
            }
        }
    }

    /// Σ_m Y_lm(a) Y_lm(b) is a function of the angle alone: the sum is the same in a turned frame, and (2l + 1) / 4π where a = b.
    #[test]
    fn their_sums_know_no_frame() {
        let harmonics = Harmonics::new(MAX_ORDER);
        let frame = Basis::from_normal(Vec3::new(0.3, -0.8, 0.52).normalize());
        let (a, b) = (Vec3::new(0.6, 0.64, -0.48), Vec3::new(-0.36, 0.48, 0.8));
        let [ya, yb, ta, tb] = [a, b, frame.to_world(a), frame.to_world(b)].map(|d| harmonics.at(d.normalize()));
        for l in 0..=MAX_ORDER as usize {
            let sum = |p: &[f32], q: &[f32]| (l * l..(l + 1) * (l + 1)).map(|j| p[j] * q[j]).sum::<f32>();
            assert!((sum(&ya, &yb) - sum(&ta, &tb)).abs() < 1e-4, "{l}");
            assert!((f64::from(sum(&ya, &ya)) - (2.0 * l as f64 + 1.0) / (4.0 * PI)).abs() < 1e-4, "{l}");
        }
    }

    /// The clamped cosine's own expansion by quadrature.
    #[test]
    fn cosine_factors_are_those_of_the_integral() {
        let harmonics = Harmonics::new(MAX_ORDER);
        for l in 0..=MAX_ORDER {
            let j = (l * l + l) as usize;
            let zonal: f64 = sphere(300).map(|(d, share)| f64::from(harmonics.at(d)[j]) * f64::from(d.z.max(0.0)) * share).sum();
            let expected = cosine_factor(l) * ((2.0 * f64::from(l) + 1.0) / (4.0 * PI)).sqrt();
            assert!((zonal - expected).abs() < 1e-3, "{l}: {zonal} for {expected}");
        }
    }
}
