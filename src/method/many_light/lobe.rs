//! Directional radiance: one normalised Phong lobe, and the lobe that stands for many (§2.1).
//!
//! *Paper* (Eq. 1): L_s(w) = l_s (k + 1) / 2π (w · d)^k, whose integral over the sphere is l_s. Many lobes become one (Eq. 3, 4) by Toksvig's
//! factor: the shorter the mean of their directions, the wider. *Paper*: directions are weighted by magnitude, exponents are not, and lobes
//! without light count for neither. *Reading*: magnitudes are summed with the areas that send them, so that no light is made where some of a
//! cluster's lights have no lobe.

use super::params::Kernel;
use crate::base::math::{Rgb, luminance};
use glam::Vec3;
use std::f32::consts::TAU;

/// The Phong exponent of a microfacet lobe. *Ours*: for Beckmann's facets seen from above, the cone about the mirror direction that holds half
/// of what is reflected holds half of the Phong lobe, too: k = 1 / 2a² - 1, within 1 % up to a = .5. GGX has the same core and longer tails.
pub fn exponent_of(alpha: f32) -> f32 {
    (0.5 / (alpha * alpha).max(f32::MIN_POSITIVE) - 1.0).max(0.0)
}

/// Density of a normalised lobe at the cosine `cos` from its centre, per steradian. A Gaussian's sharpness is the exponent: near the centre, both
/// are Gaussians in the angle with the variance 1 / k (Toksvig 2005).
pub fn density(kernel: Kernel, exponent: f32, cos: f32) -> f32 {
    match kernel {
        Kernel::Phong if cos <= 0.0 => 0.0,
        Kernel::Phong => (exponent + 1.0) / TAU * cos.powf(exponent),
        Kernel::Gaussian => {
            let sharpness = exponent.max(1e-3);
            sharpness / (TAU * -(-2.0 * sharpness).exp_m1()) * (sharpness * (cos - 1.0)).exp()
        }
    }
}

/// A lobe of radiance.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Lobe {
    /// d: its centre, unit; zero for a lobe without light.
    pub direction: Vec3,
    /// k.
    pub exponent: f32,
    /// l_s: its integral over directions.
    pub magnitude: Rgb,
}

impl Lobe {
    /// Radiance in the unit direction `w`.
    pub fn radiance(&self, kernel: Kernel, w: Vec3) -> Rgb {
        self.magnitude * density(kernel, self.exponent, self.direction.dot(w))
    }
}

/// What is known of lobes taken together: sums, which add up in any grouping.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct LobeSum {
    /// How many have light.
    count: f32,
    /// Sum of their exponents.
    exponents: f32,
    /// Sum of their magnitudes' luminance.
    weight: f32,
    /// Sum of their centres, each weighted by its luminance.
    directions: Vec3,
    /// Sum of their magnitudes.
    magnitudes: Rgb,
}

impl LobeSum {
    /// With one more, `share` times its magnitude.
    pub fn add(&mut self, lobe: &Lobe, share: f32) {
        let weight = luminance(lobe.magnitude) * share;
        if weight > 0.0 {
            self.merge(
                &Self {
                    count: 1.0,
                    exponents: lobe.exponent,
                    weight,
                    directions: lobe.direction * weight,
                    magnitudes: lobe.magnitude * share,
                },
                1.0,
            );
        }
    }

    /// With those of another cluster, `scale` times their magnitudes.
    pub fn merge(&mut self, other: &Self, scale: f32) {
        self.count += other.count;
        self.exponents += other.exponents;
        self.weight += other.weight * scale;
        self.directions += other.directions * scale;
        self.magnitudes += other.magnitudes * scale;
    }

    /// The sum of all magnitudes' luminance.
    pub fn weight(&self) -> f32 {
        self.weight
    }

    /// The lobe that stands for them: of the sum of their magnitudes (Eq. 4).
    pub fn filtered(&self) -> Lobe {
        if self.weight <= 0.0 {
            return Lobe::default();
        }
        let mean = self.directions / self.weight;
        let length = mean.length().clamp(f32::MIN_POSITIVE, 1.0);
        let exponent = self.exponents / self.count;
        let toksvig = length / (length + exponent * (1.0 - length));
        Lobe { direction: mean.normalize_or_zero(), exponent: exponent * toksvig, magnitude: self.magnitudes }
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::base::math::{hash_words, reflect, spread_over_sphere, unit};
    use crate::material::bsdf::microfacet::Microfacets;
    use crate::material::bsdf::{Distribution, warp};
    use glam::Vec2;

    const DIRECTIONS: u32 = 20_000;

    fn over_sphere(f: impl Fn(Vec3) -> f32) -> f32 {
        let sum: f64 = (0..DIRECTIONS).map(|i| f64::from(f(spread_over_sphere(i, DIRECTIONS)))).sum();
        (sum * 4.0 * std::f64::consts::PI / f64::from(DIRECTIONS)) as f32
    }

    /// A lobe about a direction within `spread` radians of +Z.
    pub fn lobe(i: u32, spread: f32, exponent: f32) -> Lobe {
        let [u, v] = [0, 1].map(|k| unit(hash_words(&[i, k])));
        let direction = warp::direction(1.0 - u * (1.0 - spread.cos()), v);
        Lobe { direction, exponent, magnitude: Rgb::ONE }
    }

    #[test]
    fn a_lobe_holds_its_magnitude() {
        for kernel in [Kernel::Phong, Kernel::Gaussian] {
            for exponent in [0.0, 1.0, 5.0, 20.0, 60.0, 300.0] {
                let d = Vec3::new(0.3, -0.5, 0.8).normalize();
                let all = over_sphere(|w| Lobe { direction: d, exponent, magnitude: Rgb::splat(2.0) }.radiance(kernel, w).y);
                assert!((all - 2.0).abs() < 0.01, "{kernel} {exponent}: {all}");
            }
        }
    }

    /// The error of the filtered lobe against the sum of all lobes, RMS over directions relative to the sum's own RMS.
    fn error(kernel: Kernel, spread: f32, exponents: [f32; 2]) -> (f32, f32) {
        let mut sum = LobeSum::default();
        let lobes: Vec<Lobe> = (0..64).map(|i| lobe(i, spread, exponents[i as usize % 2])).collect();
        lobes.iter().for_each(|l| sum.add(l, 1.0 / 64.0));
        let filtered = sum.filtered();
        let exact = |w: Vec3| lobes.iter().map(|l| l.radiance(kernel, w).y / 64.0).sum::<f32>();
        let squares = over_sphere(|w| exact(w).powi(2));
        let wrong = over_sphere(|w| (exact(w) - filtered.radiance(kernel, w).y).powi(2));
        ((wrong / squares).sqrt(), over_sphere(|w| filtered.radiance(kernel, w).y))
    }

    /// Rows: cones of 0, 10, 20, 30, 45 and 60 degrees that centres spread over; columns: exponents 5, 15, 30, 60. The bounds are what was
    /// measured, rounded up: semi-glossy clusters are filtered well, and sharp lobes far apart are not, as the paper says.
    #[test]
    fn a_filtered_lobe_is_near_the_sum_of_what_it_stands_for() {
        let bounds = [
            [0.001, 0.001, 0.001, 0.001],
            [0.011, 0.015, 0.026, 0.053],
            [0.042, 0.068, 0.125, 0.23],
            [0.092, 0.16, 0.27, 0.39],
            [0.20, 0.32, 0.43, 0.54],
            [0.33, 0.44, 0.55, 0.65],
        ];
        let mut table = String::new();
        let mut failed = false;
        for (spread, bounds) in [0f32, 10.0, 20.0, 30.0, 45.0, 60.0].into_iter().zip(bounds) {
            for (exponent, bound) in [5.0, 15.0, 30.0, 60.0].into_iter().zip(bounds) {
                let (wrong, energy) = error(Kernel::Phong, spread.to_radians(), [exponent; 2]);
                table += &format!("{spread} {exponent}: {wrong:.4} (energy {energy:.3})\n");
                failed |= wrong > bound || (energy - 1.0).abs() > 0.01;
            }
        }
        let (mixed, _) = error(Kernel::Phong, 20f32.to_radians(), [5.0, 60.0]);
        table += &format!("20 5+60: {mixed:.4}\n");
        assert!(!failed && mixed < 0.5, "{table}");
    }

    #[test]
    fn filtering_in_groups_is_filtering_all_at_once_and_dark_lobes_do_not_count() {
        let lobes: Vec<Lobe> = (0..8).map(|i| lobe(i, 0.5, 20.0)).collect();
        let (mut all, mut groups) = (LobeSum::default(), [LobeSum::default(); 2]);
        for (i, l) in lobes.iter().enumerate() {
            all.add(l, 0.5);
            groups[i % 2].add(l, 0.5);
        }
        all.add(&Lobe { magnitude: Rgb::ZERO, direction: -Vec3::Z, exponent: 1e4 }, 1.0);
        let mut merged = groups[0];
        merged.merge(&groups[1], 1.0);
        let (a, b) = (all.filtered(), merged.filtered());
        assert!((a.exponent - b.exponent).abs() < 1e-4 && a.direction.distance(b.direction) < 1e-6, "{a:?} {b:?}");
        assert!((a.magnitude.x - 4.0).abs() < 1e-5);
        assert_eq!(LobeSum::default().filtered(), Lobe::default());
        let same = Lobe { direction: Vec3::X, exponent: 33.0, magnitude: Rgb::ONE };
        let mut one = LobeSum::default();
        one.add(&same, 1.0);
        assert_eq!(one.filtered(), same);
    }

    /// Half of what rough facets reflect from above lies within the cone that holds half of the Phong lobe: the rule itself, for Beckmann's
    /// facets; GGX's longer tails leave less there.
    #[test]
    fn exponents_follow_from_roughness() {
        for (family, least, most) in [(Distribution::Beckmann, 0.48, 0.52), (Distribution::Ggx, 0.38, 0.46)] {
            for alpha in [0.05f32, 0.1, 0.2, 0.3, 0.5] {
                let cos_half = 0.5f32.powf(1.0 / (exponent_of(alpha) + 1.0));
                let facets = Microfacets::new(family, Vec2::splat(alpha));
                let n = 128 * 128;
                let inside = |i: u32| {
                    let v = Vec2::new((i % 128) as f32 + 0.5, (i / 128) as f32 + 0.5) / 128.0;
                    reflect(Vec3::Z, facets.sample(Vec3::Z, v)).z > cos_half
                };
                let share = (0..n).filter(|&i| inside(i)).count() as f32 / n as f32;
                assert!((least..most).contains(&share), "{family:?} {alpha}: {share}");
            }
        }
        assert!(exponent_of(0.0) > 1e6 && exponent_of(1.0) == 0.0);
    }
}
