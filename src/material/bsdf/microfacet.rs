//! Microfacet normal distributions, shadowing and visible-normal sampling.
//!
//! Walter et al. 2007 for the distributions and Smith shadowing; visible normals after Heitz and d'Eon 2014: for GGX
//! by spherical caps (Dupuy and Benyoub 2023), for Beckmann by inverting the slope's distribution with Newton's method.
//! Values agree with Mitsuba's, its rational approximation of Beckmann's shadowing (0.35 %) included.

use super::warp::direction;
use glam::{Vec2, Vec3};
use serde::{Deserialize, Serialize};
use std::f32::consts::PI;

/// Smallest alpha that a distribution is evaluated with (Mitsuba's floor).
pub const ALPHA_MIN: f32 = 1e-4;

/// Family of microfacet normal distributions.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Distribution {
    /// Gaussian slopes; Mitsuba's default.
    #[default]
    Beckmann,
    /// Trowbridge-Reitz.
    Ggx,
}

/// A distribution of microfacet normals about +z.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Microfacets {
    distribution: Distribution,
    alpha: Vec2,
}

impl Microfacets {
    /// Alpha along local x and y, raised to [`ALPHA_MIN`].
    pub fn new(distribution: Distribution, alpha: Vec2) -> Self {
        Self { distribution, alpha: alpha.max(Vec2::splat(ALPHA_MIN)) }
    }

    /// Density of microfacet normals: D(m), per solid angle and projected area; 0 below the horizon.
    pub fn d(&self, m: Vec3) -> f32 {
        if m.z <= 0.0 {
            return 0.0;
        }
        let slope2 = (m.truncate() / self.alpha).length_squared();
        let area = PI * self.alpha.x * self.alpha.y;
        let z2 = m.z * m.z;
        let d = match self.distribution {
            Distribution::Beckmann => (-slope2 / z2).exp() / (area * z2 * z2),
            Distribution::Ggx => 1.0 / (area * (slope2 + z2) * (slope2 + z2)),
        };
        // Too small to matter, and 0/0 nearby.
        if d * m.z > 1e-20 { d } else { 0.0 }
    }

    /// Smith's share of the facets `m` that is seen from `v`, for either side of the surface.
    pub fn g1(&self, v: Vec3, m: Vec3) -> f32 {
        self.g1_over_cos(v, m) * v.z.abs()
    }

    /// [`Microfacets::g1`] over |cos v|: finite at grazing angles, where both go to zero.
    pub fn g1_over_cos(&self, v: Vec3, m: Vec3) -> f32 {
        // No side of a facet is seen from the other side of the surface.
        if v.dot(m) * v.z <= 0.0 {
            return 0.0;
        }
        let cos = v.z.abs();
        let stretched = (v.truncate() * self.alpha).length();
        match self.distribution {
            Distribution::Ggx => 2.0 / (cos + (cos * cos + stretched * stretched).sqrt()),
            Distribution::Beckmann => {
                let a = cos / stretched;
                if a >= 1.6 || stretched == 0.0 {
                    1.0 / cos
                } else {
                    (3.535 + 2.181 * a) / ((1.0 + 2.276 * a + 2.577 * a * a) * stretched)
                }
            }
        }
    }

    /// A normal among those visible from `wi` (wi.z > 0).
    /// pdf = D(m) · G1(wi) · (wi · m) / cos wi (solid angle of m).
    pub fn sample(&self, wi: Vec3, v: Vec2) -> Vec3 {
        let w = (wi.truncate() * self.alpha).extend(wi.z).normalize_or(Vec3::Z);
        match self.distribution {
            Distribution::Ggx => {
                // Directions reflected off the visible half of a unit sphere fill a cap uniformly.
                let cap = direction((1.0 - v.y) * (1.0 + w.z) - w.z, v.x);
                let h = cap + w;
                (h.truncate() * self.alpha).extend(h.z.max(0.0)).normalize_or(Vec3::Z)
            }
            Distribution::Beckmann => {
                // In the frame where wi has azimuth 0 the slopes are independent.
                let sin = w.truncate().length();
                let azimuth = if sin > 0.0 { w.truncate() / sin } else { Vec2::X };
                let slope = Vec2::new(beckmann_slope(sin / w.z, v.x), erf_inv(centred(v.y)));
                let slope = azimuth.rotate(slope) * self.alpha;
                (-slope).extend(1.0).normalize()
            }
        }
    }

    /// The isotropic alpha that scatters most alike for a viewer at `w`: that along the view at grazing angles, where it
    /// sets the shadowing, the geometric mean from above.
    pub fn alpha_towards(&self, w: Vec3) -> f32 {
        ((self.alpha * w.truncate()).length_squared() + self.alpha.x * self.alpha.y * w.z * w.z).sqrt()
    }

    /// Geometric mean of the two alphas.
    pub fn mean_alpha(&self) -> f32 {
        (self.alpha.x * self.alpha.y).sqrt()
    }
}

/// From (0, 1) to (-1, 1), kept off the ends, where a Gaussian has infinite slope.
fn centred(u: f32) -> f32 {
    (2.0 * u - 1.0).clamp(-1.0 + 1e-6, 1.0 - 1e-6)
}

pub(crate) const FRAC_1_SQRT_PI: f32 = 0.564_189_6;

/// Slope along the view of a visible Beckmann facet (alpha = 1) seen under the angle with tangent `tan`.
///
/// Its density is proportional to (1 - x tan) exp(-x²) for x < 1/tan. In b = erf(x) the distribution function is
/// proportional to 1 + b + tan/√π · exp(-x²), which is smooth enough for Newton's method (Jakob 2014).
fn beckmann_slope(tan: f32, u: f32) -> f32 {
    if tan < 1e-5 {
        return erf_inv(centred(u));
    }
    let cdf = |b: f32, x: f32| 1.0 + b + FRAC_1_SQRT_PI * tan * (-x * x).exp();
    let x_max = 1.0 / tan;
    let b_max = erf(x_max).min(1.0 - 1e-6);
    let target = u.clamp(1e-6, 1.0 - 1e-6) * (1.0 + erf(x_max) + FRAC_1_SQRT_PI * tan * (-x_max * x_max).exp());
    let (mut low, mut high) = (-1.0 + 1e-6, b_max);
    // Exact at grazing angles (Jakob's guess).
    let mut b = (b_max - (1.0 + b_max) * erf((-u.max(1e-6).ln()).max(0.0).sqrt())).clamp(low, high);
    for _ in 0..12 {
        let x = erf_inv(b);
        let error = cdf(b, x) - target;
        if error.abs() < 1e-6 {
            break;
        }
        if error > 0.0 {
            high = b;
        } else {
            low = b;
        }
        let newton = b - error / (1.0 - x * tan);
        b = if newton > low && newton < high { newton } else { 0.5 * (low + high) };
    }
    erf_inv(b)
}

/// Error function, to 1.5e-7 (Abramowitz and Stegun 7.1.26).
fn erf(x: f32) -> f32 {
    let t = 1.0 / (1.0 + 0.327_591_1 * x.abs());
    let poly =
        [1.061_405_4, -1.453_152_1, 1.421_413_7, -0.284_496_74, 0.254_829_6].iter().fold(0.0, |sum: f32, c| sum * t + c) * t;
    (1.0 - poly * (-x * x).exp()).copysign(x)
}

/// Inverse error function on (-1, 1), to a few 1e-6 relative (Giles 2010, single precision).
fn erf_inv(y: f32) -> f32 {
    let w = -((1.0 - y) * (1.0 + y)).ln();
    let horner = |w: f32, c: [f32; 9]| c.iter().fold(0.0, |sum, c| sum * w + c);
    y * if w < 5.0 {
        horner(
            w - 2.5,
            [
                2.810_226_4e-8,
                3.432_739_4e-7,
                -3.523_387_7e-6,
                -4.391_506_5e-6,
                2.185_808_7e-4,
                -1.253_725e-3,
                -4.177_681_6e-3,
                0.246_640_73,
                1.501_409_4,
            ],
        )
    } else {
        horner(
            w.sqrt() - 3.0,
            [
                -2.002_142_6e-4,
                1.009_505_6e-4,
                1.349_343_2e-3,
                -3.673_428_4e-3,
                5.739_507_7e-3,
                -7.622_461_3e-3,
                9.438_870_5e-3,
                1.001_674,
                2.832_976_8,
            ],
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FAMILIES: [Distribution; 2] = [Distribution::Beckmann, Distribution::Ggx];

    #[test]
    fn error_function_and_its_inverse_agree() {
        assert!((erf(0.5) - 0.520_499_9).abs() < 1e-6 && (erf(-2.0) + 0.995_322_3).abs() < 1e-6);
        for i in -99..100 {
            let y = i as f32 / 100.0;
            assert!((erf(erf_inv(y)) - y).abs() < 2e-6, "{y}");
        }
    }

    /// ∫ f(m) dm over the upper hemisphere, in the tangent of the angle so that small alphas are resolved.
    fn over_normals(alpha: f32, f: impl Fn(Vec3) -> f32) -> f64 {
        let (n, k) = (2000, 64);
        let mut sum = 0.0;
        for i in 0..n {
            // tan = alpha · t/(1-t) sweeps [0, ∞); dω = sin dθ dφ = cos³ tan dtan dφ.
            let t = (i as f32 + 0.5) / n as f32;
            let tan = alpha * t / (1.0 - t);
            let cos = 1.0 / (1.0 + tan * tan).sqrt();
            let weight = cos.powi(3) * tan * alpha / (1.0 - t).powi(2) / n as f32 * std::f32::consts::TAU / k as f32;
            for j in 0..k {
                sum += f64::from(f(direction(cos, (j as f32 + 0.5) / k as f32)) * weight);
            }
        }
        sum
    }

    #[test]
    fn facets_project_to_the_flat_area() {
        for family in FAMILIES {
            for alpha in [0.01, 0.1, 0.5, 1.0] {
                let facets = Microfacets::new(family, Vec2::new(alpha, alpha * 0.5));
                let area = over_normals(alpha, |m| facets.d(m) * m.z);
                assert!((area - 1.0).abs() < 2e-3, "{family:?} {alpha}: {area}");
            }
        }
    }

    #[test]
    fn visible_facets_project_to_what_the_viewer_sees() {
        for family in FAMILIES {
            for alpha in [0.1, 0.5, 1.0] {
                for cos in [0.05, 0.3, 0.9] {
                    let facets = Microfacets::new(family, Vec2::splat(alpha));
                    let wi = direction(cos, 0.1);
                    let seen = over_normals(alpha, |m| facets.d(m) * facets.g1_over_cos(wi, m) * wi.dot(m).max(0.0));
                    // Beckmann's shadowing is a rational fit.
                    let tolerance = if family == Distribution::Beckmann { 4e-3 } else { 2e-3 };
                    assert!((seen - 1.0).abs() < tolerance, "{family:?} {alpha} {cos}: {seen}");
                }
            }
        }
    }

    #[test]
    fn sampled_normals_follow_their_density() {
        // The mean of any function over the samples is its integral against the density.
        let functions: [fn(Vec3) -> f32; 4] = [|m| m.x, |m| m.y * m.y, |m| m.z, |m| if m.x > 0.1 { 1.0 } else { 0.0 }];
        for family in FAMILIES {
            for (alpha, cos) in [(0.1, 0.9), (0.1, 0.1), (0.6, 0.7), (0.6, 0.02), (0.3, 1.0)] {
                let facets = Microfacets::new(family, Vec2::new(alpha, alpha * 0.4));
                let wi = direction(cos, 0.07);
                let n = 512;
                let mut means = [0.0f64; 4];
                for i in 0..n {
                    for j in 0..n {
                        let m = facets.sample(wi, (Vec2::new(i as f32, j as f32) + 0.5) / n as f32);
                        for (mean, f) in means.iter_mut().zip(functions) {
                            *mean += f64::from(f(m)) / f64::from(n * n);
                        }
                    }
                }
                for (mean, f) in means.iter().zip(functions) {
                    let expected = over_normals(alpha, |m| f(m) * facets.d(m) * facets.g1_over_cos(wi, m) * wi.dot(m).max(0.0));
                    assert!((mean - expected).abs() < 5e-3, "{family:?} {alpha} {cos}: {mean} {expected}");
                }
            }
        }
    }
}
