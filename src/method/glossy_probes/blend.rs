//! Eq. 2 (§5.2): the colours that eight probes have for a pixel, weighted by how well they match.

use super::candidates::{Light, WeightedProbe};
use super::gather_params::{BilinearRule, GatherParams};
use super::samples::Samples;
use crate::base::math::Rgb;
use crate::base::simd::Simd;
use crate::base::simd::functions::exp_down;
use crate::base::simd::lane::F8;
use glam::Vec2;

/// Share of the largest weight below which a sample is not fetched: less than what rounding takes of the sum.
const NEGLIGIBLE: f32 = 1e-12;

/// A gathered pixel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gathered {
    /// Glossy radiance at the probes' reduced roughness (Eq. 2); black where `energy` is infinite.
    pub color: Rgb,
    /// Least energy among the probes' samples; infinite where no probe had a valid sample.
    pub energy: f32,
    /// The probe whose sample that was, and its texel coordinate; for inspection.
    pub best: Option<(usize, Vec2)>,
}

impl Gathered {
    /// Nothing was found.
    pub const NONE: Self = Self { color: Rgb::ZERO, energy: f32::INFINITY, best: None };
}

/// Eq. 2. `albedo` is the view's, where the ratio of albedos is asked for.
#[inline(always)]
pub(crate) fn blend<S: Simd>(
    s: S,
    samples: &Samples,
    albedo: Option<Rgb>,
    probes: &[WeightedProbe],
    params: &GatherParams,
) -> Gathered {
    let energies = F8::load(s, &samples.energy);
    let least = energies.least();
    if least == f32::INFINITY {
        return Gathered::NONE;
    }
    // exp(-φ E_min) is cancelled against Z, so that it cannot underflow.
    let falls = exp_down((energies - least) * -params.falloff).array();
    let mut weights = [0.0; 8];
    let (mut most, mut best) = (0f32, None);
    for (k, w) in probes.iter().enumerate().take(8) {
        if samples.energy[k] < f32::INFINITY {
            weights[k] = w.weight * falls[k];
            most = most.max(weights[k]);
        }
        if best.is_none() && samples.energy[k] == least {
            best = Some((w.index, Vec2::new(samples.texel[0][k], samples.texel[1][k])));
        }
    }
    let taps = Taps::new(s, samples, probes);
    let (mut sum, mut z) = (Rgb::ZERO, 0.0);
    for (k, w) in probes.iter().enumerate().take(8) {
        if weights[k] <= most * NEGLIGIBLE {
            continue;
        }
        let light = &w.candidates.light;
        let centre = &light[taps.centre[k] as usize];
        let mut color = taps.fetch(k, light, centre, params.bilinear);
        if let Some(view) = albedo {
            color *= albedo_ratio(view, centre);
        }
        sum += color * weights[k];
        z += weights[k];
    }
    Gathered { color: sum / z, energy: least, best }
}

/// Where eight probes are read, each at its own sample.
struct Taps {
    /// The texel that holds the sample.
    centre: [u32; 8],
    /// The four around it.
    around: [[u32; 8]; 4],
    /// Their bilinear weights.
    weights: [[f32; 8]; 4],
}

impl Taps {
    #[inline(always)]
    fn new<S: Simd>(s: S, samples: &Samples, probes: &[WeightedProbe]) -> Self {
        let (mut w, mut h) = ([1.0; 8], [1.0; 8]);
        for (k, probe) in probes.iter().enumerate().take(8) {
            (w[k], h[k]) = (probe.probe.size[0] as f32, probe.probe.size[1] as f32);
        }
        let (w, h) = (F8::load(s, &w), F8::load(s, &h));
        let (x, y) = (F8::load(s, &samples.texel[0]), F8::load(s, &samples.texel[1]));
        let grid = Grid { w, h };
        let (left, top) = ((x - 0.5).floor(), (y - 0.5).floor());
        let (fx, fy) = (x - 0.5 - left, y - 0.5 - top);
        let (columns, rows) = ([grid.column(left), grid.column(left + 1.0)], [grid.row(top), grid.row(top + 1.0)]);
        let (gx, gy) = (fx * -1.0 + 1.0, fy * -1.0 + 1.0);
        Self {
            centre: grid.index(grid.column(x.floor()), grid.row(y.floor())),
            around: [
                grid.index(columns[0], rows[0]),
                grid.index(columns[1], rows[0]),
                grid.index(columns[0], rows[1]),
                grid.index(columns[1], rows[1]),
            ],
            weights: [(gx * gy).array(), (fx * gy).array(), (gx * fy).array(), (fx * fy).array()],
        }
    }

    /// Colour of one probe's sample, bilinear over those of the four texels around it that `rule` lets in.
    #[inline(always)]
    fn fetch(&self, k: usize, light: &[Light], centre: &Light, rule: BilinearRule) -> Rgb {
        if rule == BilinearRule::Nearest {
            return centre.glossy;
        }
        let (mut sum, mut total) = (Rgb::ZERO, 0.0);
        for (texels, weights) in self.around.iter().zip(&self.weights) {
            let (tap, weight) = (&light[texels[k] as usize], weights[k]);
            let same_reflected = tap.reflected_material == centre.reflected_material;
            if tap.object == centre.object && (rule == BilinearRule::SameReflector || same_reflected) {
                sum += tap.glossy * weight;
                total += weight;
            }
        }
        // The centre texel is among the four with a weight of at least 1/4.
        sum / total
    }
}

/// Widths and heights of eight probes.
struct Grid<S: Simd> {
    w: F8<S>,
    h: F8<S>,
}

impl<S: Simd> Grid<S> {
    /// Wraps.
    #[inline(always)]
    fn column(&self, x: F8<S>) -> F8<S> {
        let zero = F8::splat(x.0, 0.0);
        (x - (x / self.w).floor() * self.w).max(zero).min(self.w - 1.0)
    }

    /// Clamps.
    #[inline(always)]
    fn row(&self, y: F8<S>) -> F8<S> {
        y.max(F8::splat(y.0, 0.0)).min(self.h - 1.0)
    }

    #[inline(always)]
    fn index(&self, column: F8<S>, row: F8<S>) -> [u32; 8] {
        let s = column.0;
        let mut to = [0; 8];
        s.store_ids(s.add_ids(s.mul_ids(row.ids(), self.w.ids()), column.ids()), &mut to);
        to
    }
}

/// Directional albedo of the non-diffuse lobe in the view over that at a probe's sample, both at the probes' roughness:
/// carries Fresnel and the specular texture over from one to the other. Clamped, as a ratio of small numbers says little.
#[inline(always)]
fn albedo_ratio(view: Rgb, centre: &Light) -> Rgb {
    (view / centre.albedo.max(Rgb::splat(1e-4))).clamp(Rgb::splat(0.25), Rgb::splat(4.0))
}
