//! Pixels at which light is gathered, and interpolation in between (§2.3).
//!
//! *Paper*: grids of 16, 8, 4, 2 and 1 pixels; a pixel of a grid that differs too much from its four neighbours there in place and normal, or whose
//! four parents differ in light, is sampled, each grid by itself; others are interpolated from their parents, with bilateral weights. *Reading*:
//! neighbours are those beside and above; parents are the corners of the next coarser grid's cell, two where the pixel lies on its edge.
//! *Ours*, where the text is silent: light is without albedo, and counts relative to the coarsest grid's mean, which is taken for middle grey
//! (.18), so that the threshold has no unit; parents of other materials weigh nothing, and a pixel without a parent that fits is sampled.

use super::arrival::Received;
use super::params::{ManyLightParams, Sampling};
use crate::view::gbuffer::{GBuffer, Pixel};
use rayon::prelude::*;

/// Distance of the coarsest grid's pixels.
const COARSEST: usize = 16;
/// Distance of the pixels of bilateral sampling.
const UNIFORM: usize = 4;
/// What the mean of the coarsest grid's light is taken for.
pub(crate) const MIDDLE_GREY: f32 = 0.18;
/// Power of the cosine between normals (Sloan et al. 2007 leave it open).
pub(crate) const NORMAL_POWER: i32 = 32;
/// Distance from a parent's tangent plane at which it weighs half, as a fraction of depth.
pub(crate) const PLANE: f32 = 0.01;
/// Sum of weights below which no parent fits.
pub(crate) const LEAST_WEIGHT: f32 = 0.02;

/// What is asked of pixels.
pub struct Sampler<'a, V> {
    /// The view.
    pub view: &'a GBuffer,
    /// How.
    pub params: &'a ManyLightParams,
    /// Length of the diagonal of the scene's bounding box, metres.
    pub diagonal: f32,
    /// A pixel's value.
    pub sample: &'a (dyn Fn(usize, &Pixel) -> V + Sync),
}

/// Values of all pixels, and which of them were sampled.
pub struct Filled<V> {
    /// A pixel each; the default where nothing is seen.
    pub values: Vec<V>,
    /// Whether each was sampled.
    pub sampled: Vec<bool>,
}

impl<V: Received + Send + Sync> Sampler<'_, V> {
    /// All pixels.
    pub fn fill(&self) -> Filled<V> {
        let count = self.view.pixels.len();
        let mut filled = Filled { values: vec![V::default(); count], sampled: vec![false; count] };
        let coarsest = coarsest(self.params.sampling);
        let first = self.grid(coarsest, None);
        self.take(&first, &mut filled);
        let lights = first.iter().map(|&i| filled.values[i].weight());
        let exposure = exposure(lights.sum(), first.len());
        let mut threshold = self.params.threshold;
        let mut step = coarsest / 2;
        while step > 0 {
            let list = self.grid(step, Some(2 * step));
            let interpolated: Vec<Option<V>> = list
                .par_iter()
                .with_min_len(256)
                .map(|&i| {
                    self.interpolated(i, step, &filled.values)
                        .filter(|_| self.is_coherent(i, step, threshold, exposure, &filled.values))
                })
                .collect();
            let todo: Vec<usize> = list.iter().zip(&interpolated).filter(|(_, v)| v.is_none()).map(|(&i, _)| i).collect();
            for (&i, value) in list.iter().zip(interpolated) {
                filled.values[i] = value.unwrap_or_default();
            }
            self.take(&todo, &mut filled);
            threshold *= 2.0;
            step /= 2;
        }
        filled
    }

    /// Pixels with a surface at every `step`th place each way that are not at every `coarser`th.
    fn grid(&self, step: usize, coarser: Option<usize>) -> Vec<usize> {
        let [width, height] = self.view.size();
        let is_new = |x: usize, y: usize| coarser.is_none_or(|c| !x.is_multiple_of(c) || !y.is_multiple_of(c));
        let rows = (0..height).step_by(step);
        rows.flat_map(|y| (0..width).step_by(step).filter(move |&x| is_new(x, y)).map(move |x| y * width + x))
            .filter(|&i| self.view.pixels[i].is_some())
            .collect()
    }

    /// Samples the pixels of a compact list.
    fn take(&self, list: &[usize], filled: &mut Filled<V>) {
        let values: Vec<V> = list
            .par_iter()
            .with_min_len(8)
            .map(|&i| self.view.pixels[i].as_ref().map_or_else(V::default, |p| (self.sample)(i, p)))
            .collect();
        for (&i, value) in list.iter().zip(values) {
            (filled.values[i], filled.sampled[i]) = (value, true);
        }
    }

    /// Pixels of the next coarser grid around one, with bilinear weights.
    fn parents(&self, i: usize, step: usize) -> impl Iterator<Item = (usize, f32)> {
        let [width, height] = self.view.size();
        let (x, y) = (i % width, i / width);
        let coarse = 2 * step;
        let ends = |at: usize, size: usize| {
            let low = at / coarse * coarse;
            let part = (at - low) as f32 / coarse as f32;
            [(low, 1.0 - part), (low + coarse, part)].map(|(at, weight)| (at, if at < size { weight } else { 0.0 }))
        };
        let (across, down) = (ends(x, width), ends(y, height));
        let all = (0..4).map(move |k| (across[k & 1], down[k >> 1]));
        all.filter(|((_, a), (_, b))| a * b > 0.0).map(move |((x, a), (y, b))| (y * width + x, a * b))
    }

    /// From the parents; `None` where none fits and pixels may be sampled in its place.
    fn interpolated(&self, i: usize, step: usize, values: &[V]) -> Option<V> {
        let at = self.view.pixels[i].as_ref()?;
        let (mut sum, mut total) = (V::default(), 0.0);
        let mut plain = (V::default(), 0.0);
        for (parent, bilinear) in self.parents(i, step) {
            if let Some(p) = &self.view.pixels[parent] {
                let weight = bilinear * likeness(at, p);
                sum.add(&values[parent], weight);
                total += weight;
                plain.0.add(&values[parent], bilinear);
                plain.1 += bilinear;
            }
        }
        let scaled = |(sum, total): (V, f32)| {
            let mut mean = V::default();
            mean.add(&sum, 1.0 / total);
            mean
        };
        match self.params.sampling {
            _ if total > LEAST_WEIGHT => Some(scaled((sum, total))),
            Sampling::Bilateral if plain.1 > 0.0 => Some(scaled(plain)),
            Sampling::Bilateral => Some(V::default()),
            _ => None,
        }
    }

    /// The test of §2.3.
    fn is_coherent(&self, i: usize, step: usize, threshold: f32, exposure: f32, values: &[V]) -> bool {
        if self.params.sampling == Sampling::Bilateral {
            return true;
        }
        let ([width, height], Some(centre)) = (self.view.size(), &self.view.pixels[i]) else { return true };
        let (x, y) = (i % width, i / width);
        let differs = |j: usize| {
            let Some(p) = &self.view.pixels[j] else { return f32::INFINITY };
            let away = p.surface.p.distance(centre.surface.p) / (0.5 * self.diagonal);
            away + (2.0 - 2.0 * p.normal.dot(centre.normal)).max(0.0).sqrt()
        };
        let beside = [
            (x >= step).then(|| i - step),
            (x + step < width).then_some(i + step),
            (y >= step).then(|| i - step * width),
            (y + step < height).then_some(i + step * width),
        ];
        let geometry = beside.into_iter().flatten().map(differs).fold(0.0, f32::max);
        if geometry > threshold {
            return false;
        }
        let lights: Vec<f32> = self.parents(i, step).map(|(parent, _)| values[parent].weight() * exposure).collect();
        let pairs = (0..lights.len()).flat_map(|j| (0..j).map(move |k| (j, k)));
        let light: f32 = pairs.map(|(j, k)| (lights[j] - lights[k]).abs()).sum();
        geometry + self.params.lambda * light <= threshold
    }
}

/// Distance of the coarsest grid's pixels.
pub(super) fn coarsest(sampling: Sampling) -> usize {
    match sampling {
        Sampling::Full => 1,
        Sampling::Bilateral => UNIFORM,
        Sampling::Adaptive => COARSEST,
    }
}

/// What light is multiplied with for it to count, by that of the coarsest grid's pixels.
fn exposure(sum: f32, pixels: usize) -> f32 {
    MIDDLE_GREY / (sum / pixels.max(1) as f32).max(f32::MIN_POSITIVE)
}

/// How well two pixels lie on one surface, 0 to 1.
fn likeness(a: &Pixel, b: &Pixel) -> f32 {
    if a.surface.material != b.surface.material {
        return 0.0;
    }
    let off = (b.surface.p - a.surface.p).dot(a.normal).abs() / a.depth.max(f32::MIN_POSITIVE);
    a.normal.dot(b.normal).max(0.0).powi(NORMAL_POWER) * PLANE / (PLANE + off)
}
