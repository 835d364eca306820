//! Directional albedo of a microfacet reflection lobe, tabulated.
//!
//! The albedo is ∫ F G dm over the visible normals. For F = 1 that is an energy E(cos, alpha); for Schlick's F it needs
//! the mean of (1 - w·m)⁵ too. *Ours*: the table holds E and the cosine at which (1 - cos)⁵ takes that mean, and any
//! Fresnel term is taken there: exact for smooth lobes and for Schlick's Fresnel, within a few per cent otherwise.

use super::fresnel;
use super::microfacet::{Distribution, Microfacets};
use super::warp::direction;
use crate::math::reflect;
use glam::Vec2;
use std::sync::OnceLock;

/// Cosines in the table, from 0 to 1.
const COSINES: usize = 33;
/// Alphas in the table, from 0 to 1; linear in the square root, for the albedo changes fastest at small ones.
const ALPHAS: usize = 17;
/// Side of the grid of samples behind an entry.
const SAMPLES: usize = 24;

type Table = Vec<Vec2>;

/// Energy of a lobe with F = 1, and the cosine at which its Fresnel term is to be taken, for a view of cosine `cos` > 0.
pub fn lobe_albedo(distribution: Distribution, alpha: f32, cos: f32) -> (f32, f32) {
    static TABLES: [OnceLock<Table>; 2] = [OnceLock::new(), OnceLock::new()];
    let table = TABLES[distribution as usize].get_or_init(|| tabulate(distribution));
    let x = cos.clamp(0.0, 1.0) * (COSINES - 1) as f32;
    let y = alpha.clamp(0.0, 1.0).sqrt() * (ALPHAS - 1) as f32;
    let (i, j) = ((x as usize).min(COSINES - 2), (y as usize).min(ALPHAS - 2));
    let (fx, fy) = (x - i as f32, y - j as f32);
    let row = |j: usize| table[j * COSINES + i].lerp(table[j * COSINES + i + 1], fx);
    let at = row(j).lerp(row(j + 1), fy);
    (at.x, at.y)
}

fn tabulate(distribution: Distribution) -> Table {
    let mut table = Table::with_capacity(ALPHAS * COSINES);
    for j in 0..ALPHAS {
        let alpha = (j as f32 / (ALPHAS - 1) as f32).powi(2);
        for i in 0..COSINES {
            let cos = i as f32 / (COSINES - 1) as f32;
            table.push(if j == 0 {
                Vec2::new(1.0, cos)
            } else {
                let mean = reflected_mean(&Microfacets::new(distribution, Vec2::splat(alpha)), cos.max(1e-3), SAMPLES, |c| {
                    Vec2::new(1.0, (1.0 - c).max(0.0).powi(5))
                });
                Vec2::new(mean.x, 1.0 - (mean.y / mean.x.max(1e-6)).powf(0.2))
            });
        }
    }
    table
}

/// Mean over the visible normals of `f(wi · m)` times the shadowing of the reflected direction: the directional albedo
/// of a lobe with Fresnel term `f`. `side`² stratified samples.
pub(super) fn reflected_mean(facets: &Microfacets, cos: f32, side: usize, f: impl Fn(f32) -> Vec2) -> Vec2 {
    let wi = direction(cos, 0.0);
    let mut sum = Vec2::ZERO;
    for k in 0..side * side {
        let m = facets.sample(wi, (Vec2::new((k / side) as f32, (k % side) as f32) + 0.5) / side as f32);
        let wo = reflect(wi, m);
        if wo.z > 0.0 {
            sum += f(wi.dot(m)) * facets.g1(wo, m);
        }
    }
    sum / (side * side) as f32
}

/// Mean over the visible normals of the light that a rough interface lets through, as Mitsuba's `roughplastic` takes it.
pub(super) fn transmitted_mean(facets: &Microfacets, cos: f32, side: usize, eta: f32) -> f32 {
    let wi = direction(cos, 0.0);
    let mut sum = 0.0;
    for k in 0..side * side {
        let m = facets.sample(wi, (Vec2::new((k / side) as f32, (k % side) as f32) + 0.5) / side as f32);
        let f = fresnel::dielectric(wi.dot(m), eta);
        let wo = fresnel::refract(wi, m, &f);
        if wo.z < 0.0 {
            sum += (1.0 - f.r) * facets.g1(wo, m);
        }
    }
    sum / (side * side) as f32
}
