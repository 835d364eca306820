//! Directional albedo of a microfacet reflection lobe, tabulated.
//!
//! The albedo is ∫ F G dm over the visible normals. For F = 1 that is an energy E(cos, alpha). *Ours*: beside E the table
//! holds the cosine at which the Fresnel term of [`REFERENCE_ETA`] takes its mean over the lobe, and any other Fresnel
//! term is taken there: exact for smooth lobes and for that index, within a few per cent for others and for metals.

use super::fresnel;
use super::microfacet::{Distribution, Microfacets};
use super::warp::direction;
use crate::base::math::reflect;
use glam::Vec2;
use std::sync::OnceLock;

/// Cosines in the table, from 0 to 1.
pub(crate) const COSINES: usize = 33;
/// Alphas in the table, from 0 to 1; linear in the square root, for the albedo changes fastest at small ones.
pub(crate) const ALPHAS: usize = 17;
/// The index of refraction that the table's cosines are exact for: a common plastic.
const REFERENCE_ETA: f32 = 1.5;
/// Nodes of the quadrature behind an entry, each way.
const NODES: usize = 24;

type Table = Vec<Vec2>;

/// Energy of a lobe with F = 1, and the cosine at which its Fresnel term is to be taken, for a view of cosine `cos` > 0.
pub fn lobe_albedo(distribution: Distribution, alpha: f32, cos: f32) -> (f32, f32) {
    let table = table(distribution);
    let x = cos.clamp(0.0, 1.0) * (COSINES - 1) as f32;
    let y = alpha.clamp(0.0, 1.0).sqrt() * (ALPHAS - 1) as f32;
    let (i, j) = ((x as usize).min(COSINES - 2), (y as usize).min(ALPHAS - 2));
    let (fx, fy) = (x - i as f32, y - j as f32);
    let row = |j: usize| table[j * COSINES + i].lerp(table[j * COSINES + i + 1], fx);
    let at = row(j).lerp(row(j + 1), fy);
    (at.x, at.y)
}

/// Energy and cosine of every entry, a row of cosines an alpha.
pub(crate) fn table(distribution: Distribution) -> &'static [Vec2] {
    static TABLES: [OnceLock<Table>; 2] = [OnceLock::new(), OnceLock::new()];
    TABLES[distribution as usize].get_or_init(|| tabulate(distribution))
}

fn tabulate(distribution: Distribution) -> Table {
    let nodes = gauss_legendre(NODES);
    let mut table = Table::with_capacity(ALPHAS * COSINES);
    for j in 0..ALPHAS {
        let alpha = (j as f32 / (ALPHAS - 1) as f32).powi(2);
        for i in 0..COSINES {
            let cos = i as f32 / (COSINES - 1) as f32;
            table.push(if j == 0 {
                Vec2::new(1.0, cos)
            } else {
                let facets = Microfacets::new(distribution, Vec2::splat(alpha));
                let mean =
                    reflected_mean(&facets, cos.max(1e-3), &nodes, |c| Vec2::new(1.0, fresnel::dielectric(c, REFERENCE_ETA).r));
                Vec2::new(mean.x, cosine_of_fresnel(mean.y / mean.x.max(1e-6)))
            });
        }
    }
    table
}

/// The cosine at which the reference interface reflects `r`, by bisection: the term falls with the cosine.
fn cosine_of_fresnel(r: f32) -> f32 {
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..24 {
        let mid = 0.5 * (low + high);
        if fresnel::dielectric(mid, REFERENCE_ETA).r > r { low = mid } else { high = mid }
    }
    0.5 * (low + high)
}

/// Mean over the visible normals of `f(wi · m)` times the shadowing of the reflected direction: the directional albedo
/// of a lobe with Fresnel term `f`. By quadrature over `nodes`² sample points.
pub(super) fn reflected_mean(facets: &Microfacets, cos: f32, nodes: &[Vec2], f: impl Fn(f32) -> Vec2) -> Vec2 {
    let wi = direction(cos, 0.0);
    over_square(nodes, |v| {
        let m = facets.sample(wi, v);
        let wo = reflect(wi, m);
        if wo.z > 0.0 { f(wi.dot(m)) * facets.g1(wo, m) } else { Vec2::ZERO }
    })
}

/// Mean over the visible normals of the light that a rough interface lets through, as Mitsuba's `roughplastic` takes it.
pub(super) fn transmitted_mean(facets: &Microfacets, cos: f32, nodes: &[Vec2], eta: f32) -> f32 {
    let wi = direction(cos, 0.0);
    over_square(nodes, |v| {
        let m = facets.sample(wi, v);
        let f = fresnel::dielectric(wi.dot(m), eta);
        let wo = fresnel::refract(wi, m, &f);
        if wo.z < 0.0 { Vec2::X * ((1.0 - f.r) * facets.g1(wo, m)) } else { Vec2::ZERO }
    })
    .x
}

fn over_square(nodes: &[Vec2], f: impl Fn(Vec2) -> Vec2) -> Vec2 {
    let row = |y: Vec2| nodes.iter().fold(Vec2::ZERO, |sum, x| sum + f(Vec2::new(x.x, y.x)) * x.y);
    nodes.iter().fold(Vec2::ZERO, |sum, y| sum + row(*y) * y.y)
}

/// Gauss-Legendre quadrature on [0, 1]: nodes and weights. Its nodes crowd the ends, where the tails of the slopes are.
pub(super) fn gauss_legendre(n: usize) -> Vec<Vec2> {
    let node = |i: usize| {
        let mut x = (std::f64::consts::PI * (i as f64 + 0.75) / (n as f64 + 0.5)).cos();
        let mut derivative = 1.0;
        for _ in 0..8 {
            // Legendre's recurrence; Newton's method on the last polynomial.
            let (mut p0, mut p1) = (1.0, x);
            for k in 2..=n {
                let k = k as f64;
                (p0, p1) = (p1, ((2.0 * k - 1.0) * x * p1 - (k - 1.0) * p0) / k);
            }
            derivative = n as f64 * (x * p1 - p0) / (x * x - 1.0);
            x -= p1 / derivative;
        }
        Vec2::new((0.5 + 0.5 * x) as f32, (1.0 / ((1.0 - x * x) * derivative * derivative)) as f32)
    };
    (0..n).map(node).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::math::Rgb;

    #[test]
    fn quadrature_is_exact_for_polynomials() {
        let nodes = gauss_legendre(8);
        for power in 0..=15 {
            let sum: f32 = nodes.iter().map(|n| n.x.powi(power) * n.y).sum();
            assert!((sum - 1.0 / (power + 1) as f32).abs() < 1e-6, "{power}");
        }
    }

    #[test]
    fn albedo_is_the_integral_of_the_lobe() {
        let nodes = gauss_legendre(48);
        let mut worst = [0.0f32; 4];
        for family in [Distribution::Beckmann, Distribution::Ggx] {
            for alpha in [0.02, 0.07, 0.2, 0.35, 0.6] {
                for cos in [0.1, 0.25, 0.5, 0.77, 1.0] {
                    let facets = Microfacets::new(family, Vec2::splat(alpha));
                    let exact = |f: &dyn Fn(f32) -> f32| reflected_mean(&facets, cos, &nodes, |c| Vec2::X * f(c)).x;
                    let (energy, at) = lobe_albedo(family, alpha, cos);
                    let (eta, k) = (Rgb::new(0.2, 0.92, 1.1), Rgb::new(3.9, 2.45, 2.1));
                    let error = |ours: f32, exact: f32| (ours / exact - 1.0).abs();
                    let errors = [
                        error(energy, exact(&|_| 1.0)),
                        error(energy * fresnel::dielectric(at, 1.5).r, exact(&|c| fresnel::dielectric(c, 1.5).r)),
                        error(energy * fresnel::dielectric(at, 1.8).r, exact(&|c| fresnel::dielectric(c, 1.8).r)),
                        error(energy * fresnel::conductor(at, eta, k).y, exact(&|c| fresnel::conductor(c, eta, k).y)),
                    ];
                    for (worst, error) in worst.iter_mut().zip(errors) {
                        *worst = worst.max(error);
                    }
                }
            }
        }
        // Energy: interpolation in the table. Fresnel: taken at one cosine.
        assert!(worst[0] < 0.01 && worst[1] < 0.02 && worst[2] < 0.03 && worst[3] < 0.02, "{worst:?}");
    }
}
