//! Samples follow the density that is claimed for them, and their weights are value over density.

use super::models::{model, surface};
use glam::{Vec2, Vec3};
use reprobe::base::math::Rgb;
use reprobe::material::Surface;
use reprobe::material::bsdf::warp::direction;
use reprobe::material::bsdf::{Bsdf, Lobes, Query};
use reprobe::transport::Sampler;

/// Models with a density; those without delta lobes are drawn from in full.
const MODELS: [&str; 17] = [
    "diffuse",
    "plastic",
    "twosided_plastic",
    "roughplastic_ggx_0.3",
    "roughplastic_ggx_0.1_nonlinear",
    "roughplastic_beckmann_0.5_nonlinear",
    "roughconductor_ggx_0.1",
    "roughconductor_ggx_anisotropic",
    "roughconductor_beckmann_0.4",
    "roughdielectric_ggx_0.2",
    "roughdielectric_beckmann_0.3",
    "blend",
    "bumpmap_rough",
    "normalmap_diffuse",
    "principled_cloth",
    "principled_metal",
    "principled_glass",
];

const QUERIES: [Query; 4] = [
    Query { lobes: Lobes::ALL, roughness_scale: 1.0 },
    Query { lobes: Lobes::DIFFUSE, roughness_scale: 1.0 },
    Query { lobes: Lobes::NON_DIFFUSE, roughness_scale: 0.5 },
    Query { lobes: Lobes::ALL, roughness_scale: 1.5 },
];

const VIEWS: [(f32, f32); 3] = [(0.95, 0.1), (0.35, 0.6), (-0.7, 0.8)];

/// Cells of the sphere: even in the polar angle and the azimuth.
const POLAR: usize = 24;
const AZIMUTHS: usize = 24;
/// Sub-cells of a cell for the integral of the density. Lobes are narrowest in azimuth, by the cosine of the view.
const SUB: [usize; 2] = [8, 24];

fn cell(w: Vec3) -> usize {
    let i = (w.z.acos() / std::f32::consts::PI * POLAR as f32) as usize;
    let turn = (w.y.atan2(w.x) / std::f32::consts::TAU).rem_euclid(1.0);
    i.min(POLAR - 1) * AZIMUTHS + ((turn * AZIMUTHS as f32) as usize).min(AZIMUTHS - 1)
}

/// Probability of each cell of the sphere: the density's integral.
fn probabilities(bsdf: &Bsdf, s: &Surface, wi: Vec3, query: Query) -> Vec<f64> {
    let side = std::f64::consts::PI / (POLAR * SUB[0]) as f64 * std::f64::consts::TAU / (AZIMUTHS * SUB[1]) as f64;
    let mut sums = vec![0.0; POLAR * AZIMUTHS];
    for i in 0..POLAR * SUB[0] {
        let (sin, cos) = ((i as f32 + 0.5) / (POLAR * SUB[0]) as f32 * std::f32::consts::PI).sin_cos();
        for j in 0..AZIMUTHS * SUB[1] {
            let wo = direction(cos, (j as f32 + 0.5) / (AZIMUTHS * SUB[1]) as f32);
            sums[i / SUB[0] * AZIMUTHS + j / SUB[1]] += f64::from(bsdf.pdf(s, wi, wo, query) * sin) * side;
        }
    }
    sums
}

/// Excess of the chi-squared statistic over its mean, in its standard deviations. Cells that expect few samples are pooled.
fn chi_squared(counts: &[u32], probabilities: &[f64], samples: u32) -> f64 {
    let (mut statistic, mut cells) = (0.0, 0.0);
    let mut add = |count: f64, expected: f64| {
        if expected > 5.0 {
            statistic += (count - expected).powi(2) / expected;
            cells += 1.0;
        }
    };
    let mut pool = (0.0, 0.0);
    for (count, p) in counts.iter().zip(probabilities) {
        let (count, expected) = (f64::from(*count), p * f64::from(samples));
        if expected > 20.0 {
            add(count, expected);
        } else {
            pool = (pool.0 + count, pool.1 + expected);
        }
    }
    // Samples where none may fall.
    let stray = if pool.1 < 5.0 && pool.0 > 20.0 { pool.0 } else { 0.0 };
    add(pool.0, pool.1);
    (statistic - cells) / (2.0 * f64::max(cells, 1.0)).sqrt() + stray
}

#[test]
fn samples_follow_their_density() {
    let samples = 20_000;
    let mut failures = Vec::new();
    let mut tested = 0;
    for name in MODELS {
        let (bsdf, s) = (model(name), surface([0.3, 0.6]));
        for (cos, turn) in VIEWS {
            let wi = direction(cos, turn);
            for query in QUERIES.into_iter().filter(|q| bsdf.lobes().intersects(q.lobes)) {
                let mut counts = vec![0; POLAR * AZIMUTHS];
                let mut drawn = 0;
                for i in 0..samples {
                    let mut sampler = Sampler::new(7, i);
                    let (u, v) = (sampler.next_1d(), sampler.next_2d());
                    if let Some(sample) = bsdf.sample(&s, wi, u, v, query).filter(|b| !b.delta) {
                        counts[cell(sample.wo)] += 1;
                        drawn += 1;
                    }
                }
                let probabilities = probabilities(&bsdf, &s, wi, query);
                let total: f64 = probabilities.iter().sum();
                assert!(total < 1.01, "{name} {cos} {query:?}: the density integrates to {total}");
                let excess = chi_squared(&counts, &probabilities, samples);
                // The samples are better spread than random ones, so only an excess is a fault.
                if excess > 4.0 {
                    failures.push(format!("{name} cos {cos} {query:?}: {excess:.1} sigma, {drawn} drawn, {total:.4}"));
                }
                tested += u32::from(drawn > 1000);
            }
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
    assert!(tested > 80, "{tested}");
}

#[test]
fn the_chi_squared_test_sees_a_wrong_density() {
    let (bsdf, s) = (model("roughconductor_ggx_anisotropic"), surface([0.3, 0.6]));
    let wi = direction(0.5, 0.6);
    let mut counts = vec![0; POLAR * AZIMUTHS];
    for i in 0..20_000 {
        let mut sampler = Sampler::new(7, i);
        let (u, v) = (sampler.next_1d(), sampler.next_2d());
        if let Some(sample) = bsdf.sample(&s, wi, u, v, Query::default()) {
            counts[cell(sample.wo)] += 1;
        }
    }
    let query = Query { roughness_scale: 1.2, ..Query::default() };
    let excess = chi_squared(&counts, &probabilities(&bsdf, &s, wi, query), 20_000);
    assert!(excess > 10.0, "{excess}");
}

#[test]
fn weights_are_value_over_density() {
    for name in MODELS {
        let (bsdf, s) = (model(name), surface([0.3, 0.6]));
        for (cos, turn) in VIEWS {
            let wi = direction(cos, turn);
            for query in QUERIES {
                for i in 0..500 {
                    let mut sampler = Sampler::new(9, i);
                    let (u, v) = (sampler.next_1d(), sampler.next_2d());
                    let Some(sample) = bsdf.sample(&s, wi, u, v, query).filter(|b| !b.delta) else { continue };
                    let (value, pdf) = bsdf.eval_pdf(&s, wi, sample.wo, query);
                    // The half vector found again from wi and wo is rounded.
                    let close = |a: f32, b: f32| (a - b).abs() < 2e-3 * a.abs().max(b.abs()) + 1e-6;
                    assert!(close(sample.pdf, pdf), "{name} {cos} {query:?}: pdf {} {pdf}", sample.pdf);
                    let (weight, again) = (sample.weight, value / pdf);
                    for k in 0..3 {
                        assert!(close(weight[k], again[k]), "{name} {cos} {query:?}: weight {weight} {again}");
                    }
                }
            }
        }
    }
}

#[test]
fn tiny_alphas_and_grazing_directions_stay_finite() {
    let names = ["roughplastic_ggx_0.01", "roughplastic_beckmann_0.1", "roughconductor_ggx_0.1"];
    let more = ["roughconductor_beckmann_0.4", "roughdielectric_ggx_0.2", "roughdielectric_beckmann_0.3"];
    let rest = ["principled_coat", "principled_glass", "bumpmap_rough", "normalmap_diffuse", "plastic", "blend"];
    for name in names.iter().chain(&more).chain(&rest) {
        let (bsdf, s) = (model(name), surface([0.3, 0.6]));
        for scale in [0.0, 1e-3, 1.0, 20.0] {
            let query = Query { roughness_scale: scale, ..Query::default() };
            for z in [1.0, 0.5, 1e-3, 1e-6, 1e-20, 0.0, -1e-20, -1e-6, -0.5, -1.0] {
                let wi = direction(z, 0.2);
                let check = |wo: Vec3| {
                    let (value, pdf) = bsdf.eval_pdf(&s, wi, wo, query);
                    let good = value.is_finite() && pdf.is_finite() && pdf >= 0.0 && value.min_element() >= 0.0;
                    assert!(good, "{name} x {scale}: wi {wi} wo {wo}: {value} {pdf}");
                };
                for wo in [1.0, 1e-3, 1e-7, 0.0, -1e-7, -1e-3, -1.0].map(|z| direction(z, 0.7)) {
                    check(wo);
                }
                check(Vec3::new(-wi.x, -wi.y, wi.z));
                check(-wi);
                for i in 0..64 {
                    let mut sampler = Sampler::new(3, i);
                    let corner = [0.0, 1.0 - f32::EPSILON / 2.0][i as usize % 2];
                    let v = if i < 8 { Vec2::splat(corner) } else { sampler.next_2d() };
                    let u = if i % 4 < 2 { corner } else { sampler.next_1d() };
                    let Some(sample) = bsdf.sample(&s, wi, u, v, query) else { continue };
                    let good = sample.weight.is_finite() && sample.weight.cmpge(Rgb::ZERO).all() && sample.pdf > 0.0;
                    assert!(good && (sample.wo.length() - 1.0).abs() < 1e-3, "{name} x {scale}: wi {wi}: {sample:?}");
                }
            }
        }
    }
}
