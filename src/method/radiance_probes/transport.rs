//! Local transport: how a receiver's light follows from the radiance of the probes around it (§3.2, §3.3).

use super::harmonics::{Harmonics, MAX_TERMS};
use super::seen::Ground;
use crate::base::math::Basis;
use crate::base::named::words;
use crate::lightmap::receivers::POINTS;
use crate::lightmap::visible::facing;
use crate::material::Surface;
use crate::material::bsdf::warp;
use crate::probe::support::weight;
use glam::{Vec2, Vec3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::f32::consts::{PI, TAU};

/// Rows that say how large rows are.
const SCALE_ROWS: u32 = 512;

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

/// What of its light a receiver keeps.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Kept {
    /// ∫ T_in(ω) L(ω) cos θ dω, the light map's quantity (Eq. 7).
    #[default]
    Irradiance,
    /// The four spherical harmonics of the incident radiance up to order 1, in the world's frame (Eq. 8).
    Sh1,
}

impl Kept {
    /// Numbers a receiver.
    pub fn rows(self) -> usize {
        match self {
            Self::Irradiance => 1,
            Self::Sh1 => 4,
        }
    }
}

words!(Kept { Irradiance "irradiance", Sh1 "sh1" });
words!(Interpolation { Visible "visible", Spatial "spatial", Decomposed "decomposed" });

/// Directions over a hemisphere about +z, the same ones for every receiver: neighbours then differ by what they see alone, and their rows
/// compress well (*Ours*).
pub struct Gather {
    directions: Vec<Vec3>,
    kept: Kept,
    interpolation: Interpolation,
    harmonics: Harmonics,
}

/// A receiver's row of the operator, dense over the probes that take part.
pub struct Row {
    /// Probes whose support holds the receiver.
    pub probes: Vec<u32>,
    /// For each number that the receiver keeps, each of these probes and each of its harmonics: α or β.
    pub values: Vec<f32>,
}

impl Gather {
    /// `rays` a receiver, probes of `order`.
    pub fn new(rays: u32, order: u32, kept: Kept, interpolation: Interpolation) -> Self {
        let direction = |i: u32| {
            let u = Vec2::new((i as f32 + 0.5) / rays as f32, ((f64::from(i) + 0.5) * 0.618_033_988_749_895).fract() as f32);
            let z = match kept {
                Kept::Irradiance => (1.0 - u.x).sqrt(),
                Kept::Sh1 => 1.0 - u.x,
            };
            warp::direction(z, u.y)
        };
        Self { directions: (0..rays).map(direction).collect(), kept, interpolation, harmonics: Harmonics::new(order) }
    }

    /// The directions, about +z.
    pub fn directions(&self) -> &[Vec3] {
        &self.directions
    }

    /// Harmonics of a probe.
    pub fn terms(&self) -> usize {
        self.harmonics.terms()
    }

    /// The mean square of receivers' rows, by a sample of them: what errors of compression are measured by.
    pub fn scale(&self, ground: &Ground) -> f64 {
        let chosen = sample(ground.receivers.list.len(), SCALE_ROWS);
        mean_square(&chosen.par_iter().map(|&r| self.row(ground, r)).collect::<Vec<_>>())
    }

    /// The row of a receiver (Eq. 4, 7, 8): over its rays the mean of what it measures times w_i V_i Y_j(ψ_i) / Σ_k w_k V_k.
    pub fn row(&self, ground: &Ground, receiver: u32) -> Row {
        let surfaces = std::array::from_fn::<_, POINTS, _>(|k| ground.receivers.surface(ground.world, receiver, k));
        let x = surfaces[0].p;
        let reach = |p: Vec3| weight(x.distance(p) / ground.radius);
        let support: Vec<(u32, f32)> =
            ground.probes.iter().enumerate().map(|(i, &p)| (i as u32, reach(p))).filter(|(_, w)| *w > 0.0).collect();
        let mut sums = Sums::new(self.kept.rows(), support.len(), self.terms());
        let back = ground.receivers.list[receiver as usize].back;
        let bsdf = &ground.world.scene.materials[surfaces[0].material as usize].bsdf;
        let frames = surfaces.map(|s| Basis::from_normal(s.frame.n * if back { -1.0 } else { 1.0 }));
        let mut parts = Parts::new(support.len());
        for (k, &local) in self.directions.iter().enumerate() {
            let surface = &surfaces[k % POINTS];
            let d = frames[k % POINTS].to_world(local);
            if d.dot(facing(surface, back)) <= 0.0 {
                continue;
            }
            self.parts(ground, surface, d, &support, &mut parts);
            let sum: f32 = parts.weights.iter().flatten().sum();
            if sum <= 0.0 {
                continue;
            }
            let measure = match self.kept {
                Kept::Irradiance => [PI * bsdf.diffuse_in(surface, surface.frame.to_local(d)), 0.0, 0.0, 0.0],
                Kept::Sh1 => first_four(d).map(|y| TAU * y),
            };
            let share = 1.0 / (sum * self.directions.len() as f32);
            sums.add(&self.harmonics, &parts, &measure.map(|m| m * share));
        }
        Row { probes: support.iter().map(|s| s.0).collect(), values: sums.rows(support.len()) }
    }

    /// What the probes of a support have to say of the ray from `surface` along `d`.
    fn parts(&self, ground: &Ground, surface: &Surface, d: Vec3, support: &[(u32, f32)], parts: &mut Parts) {
        parts.weights.fill([0.0; LANES]);
        let plain = |parts: &mut Parts| support.iter().enumerate().for_each(|(slot, &(_, weight))| parts.set(slot, weight, d));
        if self.interpolation == Interpolation::Spatial {
            return plain(parts);
        }
        let Some(hit) = ground.world.intersect(&surface.spawn(d)) else { return };
        let nearest =
            || support.iter().map(|&(i, _)| surface.p.distance(ground.probes[i as usize])).fold(f32::INFINITY, f32::min);
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
    fn add(&mut self, harmonics: &Harmonics, parts: &Parts, measure: &[f32; 4]) {
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

/// Every so-manieth receiver, so that there are about `count`.
pub fn sample(receivers: usize, count: u32) -> Vec<u32> {
    (0..receivers).step_by(receivers.div_ceil(count.max(1) as usize).max(1)).map(|r| r as u32).collect()
}

/// Mean square of rows that are not zero: what errors are measured by.
pub fn mean_square(rows: &[Row]) -> f64 {
    let square = |row: &Row| row.values.iter().map(|&v| f64::from(v) * f64::from(v)).sum::<f64>();
    let squares: Vec<f64> = rows.iter().map(square).filter(|&s| s > 0.0).collect();
    squares.iter().sum::<f64>() / squares.len().max(1) as f64
}

/// The harmonics up to order 1.
pub fn first_four(d: Vec3) -> [f32; 4] {
    let (y0, y1) = ((0.25 / PI).sqrt(), (0.75 / PI).sqrt());
    [y0, y1 * d.y, y1 * d.z, y1 * d.x]
}
