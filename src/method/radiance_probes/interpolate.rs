//! Interpolation: what the probes around a point have to say of the light along its rays (§3.2).

use super::harmonics::{Harmonics, MAX_TERMS};
use super::seen::Ground;
use crate::base::named::words;
use crate::base::ray::Ray;
use crate::probe::support::weight;
use glam::Vec3;
use serde::{Deserialize, Serialize};

/// Most numbers that a receiver keeps of its light.
pub const MOST_NUMBERS: usize = 9;

/// How the probes' radiance is interpolated to a receiver.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Interpolation {
    /// At the surfaces that receiver and probe both see (Eq. 2).
    #[default]
    Visible,
    /// In the receiver's own directions, whatever probes see there (Eq. 1).
    Spatial,
    /// What Arikan et al. 2005 part, without the flaws of an implementation (Fig. 8): near surfaces as with `visible`, all others as with
    /// `spatial`, but where near ones stand before them. *Reading*: near is what is nearer than the nearest probe.
    Decomposed,
}

words!(Interpolation { Visible "visible", Spatial "spatial", Decomposed "decomposed" });

/// A receiver's row of the operator, dense over the probes that take part.
pub struct Row {
    /// Probes whose support holds the receiver.
    pub probes: Vec<u32>,
    /// For each number that the receiver keeps, each of these probes and each of its harmonics: α or β.
    pub values: Vec<f32>,
}

/// Makes rows.
pub struct Interpolator {
    interpolation: Interpolation,
    harmonics: Harmonics,
}

impl Interpolator {
    /// Of probes of `order`.
    pub fn new(order: u32, interpolation: Interpolation) -> Self {
        Self { interpolation, harmonics: Harmonics::new(order) }
    }

    /// Harmonics of a probe.
    pub fn terms(&self) -> usize {
        self.harmonics.terms()
    }

    /// The row of a receiver at `x` (Eq. 4, 7, 8): over its rays the sum of what each measures times w_i V_i Y_j(ψ_i) / Σ_k w_k V_k. `rays`:
    /// each with the `numbers` that are measured of its light.
    pub fn row(&self, ground: &Ground, x: Vec3, numbers: usize, rays: impl Iterator<Item = (Ray, [f32; MOST_NUMBERS])>) -> Row {
        let reach = |p: Vec3| weight(x.distance(p) / ground.radius);
        let support: Vec<(u32, f32)> =
            ground.probes.iter().enumerate().map(|(i, &p)| (i as u32, reach(p))).filter(|(_, w)| *w > 0.0).collect();
        let mut sums = Sums::new(numbers, support.len(), self.terms());
        let mut parts = Parts::new(support.len());
        for (ray, measure) in rays {
            self.parts(ground, (x, &ray), &support, &mut parts);
            let sum: f32 = parts.weights.iter().flatten().sum();
            if sum > 0.0 {
                sums.add(&self.harmonics, &parts, &measure.map(|m| m / sum));
            }
        }
        Row { probes: support.iter().map(|s| s.0).collect(), values: sums.rows(support.len()) }
    }

    /// What the probes of a support have to say of a ray from `x`, or close to it.
    fn parts(&self, ground: &Ground, (x, ray): (Vec3, &Ray), support: &[(u32, f32)], parts: &mut Parts) {
        let d = ray.d;
        parts.weights.fill([0.0; LANES]);
        let plain = |parts: &mut Parts| support.iter().enumerate().for_each(|(slot, &(_, weight))| parts.set(slot, weight, d));
        if self.interpolation == Interpolation::Spatial {
            return plain(parts);
        }
        let Some(hit) = ground.world.intersect(ray) else { return };
        let nearest = || support.iter().map(|&(i, _)| x.distance(ground.probes[i as usize])).fold(f32::INFINITY, f32::min);
        if self.interpolation == Interpolation::Decomposed && hit.t > nearest() {
            return plain(parts);
        }
        let Some(seen) = ground.receivers.at(&hit, -d).map(|r| ground.seen(r)) else { return };
        for (slot, &(i, weight)) in support.iter().enumerate().filter(|(_, (i, _))| seen[*i as usize] > 0) {
            if let Some(towards) = (hit.p - ground.probes[i as usize]).try_normalize() {
                parts.set(slot, weight * f32::from(seen[i as usize]), towards);
            }
        }
    }
}

/// Probes that are worked on side by side.
const LANES: usize = 8;

/// The part of each probe of a support in the light along a ray, in groups of [`LANES`].
struct Parts {
    /// w_i V_i.
    weights: Vec<[f32; LANES]>,
    /// ψ_i.
    towards: Vec<[[f32; LANES]; 3]>,
}

impl Parts {
    fn new(probes: usize) -> Self {
        let groups = probes.div_ceil(LANES);
        Self { weights: vec![[0.0; LANES]; groups], towards: vec![[[0.0; LANES]; 3]; groups] }
    }

    fn set(&mut self, slot: usize, weight: f32, towards: Vec3) {
        let (group, lane) = (slot / LANES, slot % LANES);
        self.weights[group][lane] = weight;
        for (axis, lanes) in self.towards[group].iter_mut().enumerate() {
            lanes[lane] = towards[axis];
        }
    }
}

/// A row in the making: of each number that is kept and each group of probes, the harmonics.
struct Sums {
    kinds: usize,
    terms: usize,
    values: Vec<[f32; LANES]>,
    /// Those of the directions of a group.
    y: [[f32; LANES]; MAX_TERMS],
}

impl Sums {
    fn new(kinds: usize, probes: usize, terms: usize) -> Self {
        let values = vec![[0.0; LANES]; kinds * probes.div_ceil(LANES) * terms];
        Self { kinds, terms, values, y: [[0.0; LANES]; MAX_TERMS] }
    }

    /// Adds a ray, `measure` times what it brings.
    fn add(&mut self, harmonics: &Harmonics, parts: &Parts, measure: &[f32; MOST_NUMBERS]) {
        for (group, (weights, towards)) in parts.weights.iter().zip(&parts.towards).enumerate() {
            if weights.iter().all(|&w| w == 0.0) {
                continue;
            }
            harmonics.evaluate_lanes(*towards, &mut self.y);
            for (kind, m) in measure[..self.kinds].iter().enumerate() {
                let factors = weights.map(|w| w * m);
                let at = (kind * parts.weights.len() + group) * self.terms;
                for (sum, y) in self.values[at..at + self.terms].iter_mut().zip(&self.y) {
                    for k in 0..LANES {
                        sum[k] += factors[k] * y[k];
                    }
                }
            }
        }
    }

    /// Number by number, probe by probe, harmonic by harmonic.
    fn rows(&self, probes: usize) -> Vec<f32> {
        let groups = probes.div_ceil(LANES);
        let value =
            |kind: usize, slot: usize, j: usize| self.values[(kind * groups + slot / LANES) * self.terms + j][slot % LANES];
        let all = (0..self.kinds).flat_map(|kind| (0..probes).map(move |slot| (kind, slot)));
        all.flat_map(|(kind, slot)| (0..self.terms).map(move |j| (kind, slot, j)))
            .map(|(kind, slot, j)| value(kind, slot, j))
            .collect()
    }
}
