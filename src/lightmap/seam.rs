//! Chart borders on smooth surfaces: both sides shall show the same light.
//!
//! Ours: along each shared edge, the bilinear lookups of both charts shall agree, while no texel moves far from what was
//! baked. That is a sparse least-squares problem: minimise Σ (a - b)² + λ Σ (x - x₀)² over points of the seams and the
//! texels that they touch, gutters included. Conjugate gradients solve it in a few steps, since λ bounds the condition.

use super::atlas::{Atlas, GUTTER, Seam};
use super::lookup::bilinear;
use crate::base::math::{Rgb, luminance};
use crate::scene::Geometry;
use glam::Vec2;
use std::collections::BTreeMap;

/// λ of a texel with samples of its own: small, so that seams close, large enough that noise stays where it is.
const KEEP_BAKED: f32 = 0.05;

/// Texels across a chart from which on λ is what it is; narrower charts hold on to their light by the cube of how much
/// they are narrower. A seam moves the texels beside it, and on a rod two texels wide those are all: its lit side would
/// bleed into its dark side.
const WIDE_CHART: f32 = 8.0;

/// Relative jump at which a seam's weight has fallen to a half. Noise stays well below in a finished bake; a larger jump
/// is light that really changes within a texel or two, which shall not spread.
const HALF_JUMP: f32 = 0.3;

/// λ of gutter texels, which are only guesses.
const KEEP_FILLED: f32 = 0.005;

/// Seam points a texel of edge length.
const POINTS_PER_TEXEL: f32 = 2.0;

/// Conjugate gradient steps; the residual falls by about 0.7 a step.
const STEPS: usize = 40;

/// One row: up to eight unknowns with their weights, positive on one side of the seam and negative on the other.
type Row = [(u32, f32); 8];

/// Evens out the light across the seams whose charts both are `active`. `baked`: the texel has samples of its own.
pub fn close(geometry: &Geometry, atlas: &Atlas, pixels: &mut [Rgb], baked: &[bool], active: &dyn Fn(u32) -> bool) {
    let mut unknowns: BTreeMap<usize, u32> = BTreeMap::new();
    let mut rows: Vec<[(usize, f32); 8]> = Vec::new();
    for seam in &atlas.seams {
        if active(atlas.triangle_chart[seam.a.0 as usize]) && active(atlas.triangle_chart[seam.b.0 as usize]) {
            rows.extend(points(geometry, atlas, seam, pixels));
        }
    }
    for (pixel, _) in rows.iter().flatten() {
        unknowns.insert(*pixel, 0);
    }
    for (i, index) in unknowns.values_mut().enumerate() {
        *index = i as u32;
    }
    let rows: Vec<Row> = rows.iter().map(|r| r.map(|(pixel, w)| (unknowns[&pixel], w))).collect();
    let firmness = firmness(atlas);
    let keep: Vec<f32> = unknowns.keys().map(|&p| firmness[p] * if baked[p] { KEEP_BAKED } else { KEEP_FILLED }).collect();
    let start: Vec<Rgb> = unknowns.keys().map(|&p| pixels[p]).collect();
    let solution = solve(&rows, &keep, &start);
    for (&pixel, value) in unknowns.keys().zip(solution) {
        // An overshoot next to a dark texel shall not become negative light.
        pixels[pixel] = value.max(Rgb::ZERO);
    }
}

/// How much more than in a wide chart each pixel holds on to its light.
fn firmness(atlas: &Atlas) -> Vec<f32> {
    let mut out = vec![1.0; (atlas.size[0] * atlas.size[1]) as usize];
    for chart in &atlas.charts {
        let narrow = (WIDE_CHART / chart.size[0].min(chart.size[1]) as f32).max(1.0);
        for y in chart.corner[1] - GUTTER..chart.corner[1] + chart.size[1] + GUTTER {
            let row = (y * atlas.size[0] + chart.corner[0] - GUTTER) as usize;
            out[row..row + (chart.size[0] + 2 * GUTTER) as usize].fill(narrow.powi(3));
        }
    }
    out
}

/// Points along a seam, each as the difference of two bilinear lookups.
fn points(geometry: &Geometry, atlas: &Atlas, seam: &Seam, pixels: &[Rgb]) -> Vec<[(usize, f32); 8]> {
    let edge = |(t, e): (u32, u8), reverse: bool| -> Option<[Vec2; 2]> {
        let c = atlas.corners(geometry, t)?;
        let (from, to) = (c[e as usize % 3], c[(e as usize + 1) % 3]);
        Some(if reverse { [to, from] } else { [from, to] })
    };
    let (Some(a), Some(b)) = (edge(seam.a, false), edge(seam.b, true)) else { return Vec::new() };
    let length = a[0].distance(a[1]).max(b[0].distance(b[1]));
    let count = ((length * POINTS_PER_TEXEL).ceil() as usize).max(1);
    // A short edge counts for less: seams of dense meshes have many of them.
    let weight = (length * POINTS_PER_TEXEL / count as f32).min(1.0);
    (0..count)
        .filter_map(|i| {
            let t = (i as f32 + 0.5) / count as f32;
            let (pa, pb) = (bilinear(a[0].lerp(a[1], t), atlas.size)?, bilinear(b[0].lerp(b[1], t), atlas.size)?);
            let light = |taps: &[(usize, f32); 4]| taps.iter().map(|&(i, w)| luminance(pixels[i]) * w).sum::<f32>();
            let (la, lb) = (light(&pa), light(&pb));
            let jump = (la - lb).abs() / (0.5 * (la + lb)).max(f32::MIN_POSITIVE) / HALF_JUMP;
            let weight = weight / (1.0 + jump * jump);
            let mut row = [(0, 0.0); 8];
            for k in 0..4 {
                row[k] = (pa[k].0, pa[k].1 * weight);
                row[k + 4] = (pb[k].0, -pb[k].1 * weight);
            }
            Some(row)
        })
        .collect()
}

/// Minimises |Rx|² + Σ keep (x - start)² by conjugate gradients from `start`, preconditioned by the diagonal.
fn solve(rows: &[Row], keep: &[f32], start: &[Rgb]) -> Vec<Rgb> {
    let apply = |x: &[Rgb]| {
        let mut y: Vec<Rgb> = x.iter().zip(keep).map(|(&x, &k)| x * k).collect();
        for row in rows {
            let difference: Rgb = row.iter().map(|&(i, w)| x[i as usize] * w).sum();
            for &(i, w) in row {
                y[i as usize] += difference * w;
            }
        }
        y
    };
    let dot = |a: &[Rgb], b: &[Rgb]| a.iter().zip(b).map(|(a, b)| (*a * *b).as_dvec3()).sum::<glam::DVec3>();
    let mut diagonal = keep.to_vec();
    for &(i, w) in rows.iter().flatten() {
        diagonal[i as usize] += w * w;
    }
    let precondition = |r: &[Rgb]| r.iter().zip(&diagonal).map(|(&r, &d)| r / d).collect::<Vec<Rgb>>();
    let mut x = start.to_vec();
    let mut r: Vec<Rgb> = apply(&x).into_iter().zip(start.iter().zip(keep)).map(|(y, (&s, &k))| s * k - y).collect();
    let mut z = precondition(&r);
    let mut p = z.clone();
    let mut rz = dot(&r, &z);
    for _ in 0..STEPS {
        let q = apply(&p);
        let pq = dot(&p, &q);
        // Each colour is a problem of its own; one that is solved already stands still.
        let ratio = |a: glam::DVec3, b: glam::DVec3| {
            Rgb::from_array(std::array::from_fn(|c| if b[c] > 1e-30 { (a[c] / b[c]) as f32 } else { 0.0 }))
        };
        let step = ratio(rz, pq);
        for i in 0..x.len() {
            x[i] += p[i] * step;
            r[i] -= q[i] * step;
        }
        z = precondition(&r);
        let next = dot(&r, &z);
        let turn = ratio(next, rz);
        for i in 0..p.len() {
            p[i] = z[i] + p[i] * turn;
        }
        rz = next;
    }
    x
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::math::hash_words;
    use crate::lightmap::lookup::sides;
    use crate::lightmap::texels::Texels;
    use crate::lightmap::{AtlasParams, fill, testing};
    use glam::Vec3;

    /// A sphere lit by a smooth function of the normal, plus noise; mean and largest jump across its seams.
    fn jumps(noise: f32, stitched: bool) -> (f32, f32) {
        let mut geometry = Geometry::default();
        testing::sphere(&mut geometry, Vec3::ZERO, 1.0, 24);
        let params = AtlasParams { texel: Some(0.06), ..Default::default() };
        let atlas = Atlas::build(&geometry, &|_| true, &params).unwrap();
        let texels = Texels::new(&geometry, &atlas);
        let mut pixels = vec![Rgb::ZERO; (atlas.size[0] * atlas.size[1]) as usize];
        let mut baked = vec![false; pixels.len()];
        for i in 0..texels.len() {
            // The mean of the covered part, as a bake would have it.
            let light: f32 = (0..16)
                .map(|k| {
                    let u = Vec2::new((k % 4) as f32 + 0.5, (k / 4) as f32 + 0.5) / 4.0;
                    let p = texels.point(&geometry, &atlas, i, u);
                    let [a, b, c] = geometry.corners(p.triangle);
                    (a + (b - a) * p.barycentric.x + (c - a) * p.barycentric.y).dot(Vec3::new(0.6, 0.8, 0.0)) / 16.0
                })
                .sum();
            let random = hash_words(&[i as u32]) as f32 / u32::MAX as f32 - 0.5;
            pixels[texels.pixel[i] as usize] = Rgb::splat(2.0 + light + noise * random * 12f32.sqrt());
            baked[texels.pixel[i] as usize] = true;
        }
        fill::dilate(&atlas, &mut pixels, &baked);
        if stitched {
            close(&geometry, &atlas, &mut pixels, &baked, &|_| true);
        }
        let map = sides(&geometry, &atlas, pixels, None);
        let corner =
            |e: u8, t: f32| [Vec2::ZERO, Vec2::X, Vec2::Y][e as usize].lerp([Vec2::X, Vec2::Y, Vec2::ZERO][e as usize], t);
        let (mut sum, mut largest, mut count) = (0.0, 0f32, 0);
        for seam in &atlas.seams {
            for i in 0..10 {
                let t = (i as f32 + 0.5) / 10.0;
                let a = map.lookup(seam.a.0, corner(seam.a.1, t), false);
                let b = map.lookup(seam.b.0, corner(seam.b.1, 1.0 - t), false);
                let jump = (luminance(a) - luminance(b)).abs();
                sum += jump;
                largest = largest.max(jump);
                count += 1;
            }
        }
        assert!(count > 500);
        (sum / count as f32, largest)
    }

    #[test]
    fn a_lit_side_does_not_bleed_into_a_dark_one() {
        // A small sphere whose charts are three texels wide, each in a light of its own.
        let mut geometry = Geometry::default();
        testing::sphere(&mut geometry, Vec3::ZERO, 0.05, 16);
        let atlas = Atlas::build(&geometry, &|_| true, &AtlasParams { texel: Some(0.1), ..Default::default() }).unwrap();
        let texels = Texels::new(&geometry, &atlas);
        let mut pixels = vec![Rgb::ZERO; (atlas.size[0] * atlas.size[1]) as usize];
        let mut baked = vec![false; pixels.len()];
        for i in 0..texels.len() {
            pixels[texels.pixel[i] as usize] = Rgb::splat(if texels.chart[i].is_multiple_of(2) { 1.0 } else { 0.01 });
            baked[texels.pixel[i] as usize] = true;
        }
        fill::dilate(&atlas, &mut pixels, &baked);
        close(&geometry, &atlas, &mut pixels, &baked, &|_| true);
        let dark: Vec<f32> =
            (0..texels.len()).filter(|&i| texels.chart[i] % 2 == 1).map(|i| pixels[texels.pixel[i] as usize].x).collect();
        let (mean, worst) = (dark.iter().sum::<f32>() / dark.len() as f32, dark.iter().copied().fold(0.0, f32::max));
        assert!(mean < 0.02 && worst < 0.1, "mean {mean}, worst {worst}");
    }

    #[test]
    fn seams_of_a_smooth_sphere_close_to_well_under_the_noise() {
        let (open, closed) = (jumps(0.05, false), jumps(0.05, true));
        // Two independent lookups differ by some 0.05 on average; a closed seam by a fraction of that.
        assert!(open.0 > 0.03, "{open:?}");
        assert!(closed.0 < 0.008 && closed.1 < 0.05, "{closed:?}");
        let exact = jumps(0.0, true);
        assert!(exact.0 < 0.002, "{exact:?}");
    }
}
