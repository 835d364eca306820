//! Local transport: how a texel's light follows from the radiance of the probes around it (§3.3).

use super::interpolate::{Interpolation, Interpolator, MOST_NUMBERS, Row};
use super::seen::Ground;
use crate::base::math::Basis;
use crate::base::named::words;
use crate::lightmap::receivers::POINTS;
use crate::lightmap::visible::facing;
use crate::material::bsdf::warp;
use glam::{Vec2, Vec3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::f32::consts::{PI, TAU};

/// Rows that say how large rows are.
const SCALE_ROWS: u32 = 512;

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

/// Directions over a hemisphere about +z, the same ones for every receiver: neighbours then differ by what they see alone, and their rows
/// compress well (*Ours*).
pub struct Gather {
    directions: Vec<Vec3>,
    kept: Kept,
    interpolator: Interpolator,
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
        Self { directions: (0..rays).map(direction).collect(), kept, interpolator: Interpolator::new(order, interpolation) }
    }

    /// The directions, about +z.
    pub fn directions(&self) -> &[Vec3] {
        &self.directions
    }

    /// Harmonics of a probe.
    pub fn terms(&self) -> usize {
        self.interpolator.terms()
    }

    /// The mean square of receivers' rows, by a sample of them: what errors of compression are measured by.
    pub fn scale(&self, ground: &Ground) -> f64 {
        let chosen = sample(ground.receivers.list.len(), SCALE_ROWS);
        mean_square(&chosen.par_iter().map(|&r| self.row(ground, r)).collect::<Vec<_>>())
    }

    /// The row of a receiver.
    pub fn row(&self, ground: &Ground, receiver: u32) -> Row {
        let surfaces = std::array::from_fn::<_, POINTS, _>(|k| ground.receivers.surface(ground.world, receiver, k));
        let back = ground.receivers.list[receiver as usize].back;
        let bsdf = ground.world.scene.bsdf(&surfaces[0]);
        let frames = surfaces.map(|s| Basis::from_normal(s.frame.n * if back { -1.0 } else { 1.0 }));
        let share = 1.0 / self.directions.len() as f32;
        let rays = self.directions.iter().enumerate().filter_map(|(k, &local)| {
            let surface = &surfaces[k % POINTS];
            let d = frames[k % POINTS].to_world(local);
            if d.dot(facing(surface, back)) <= 0.0 {
                return None;
            }
            let mut measure = [0.0; MOST_NUMBERS];
            match self.kept {
                Kept::Irradiance => measure[0] = PI * share * bsdf.diffuse_in(surface, surface.frame.to_local(d)),
                Kept::Sh1 => measure[..4].copy_from_slice(&first_four(d).map(|y| TAU * share * y)),
            }
            Some((surface.spawn(d), measure))
        });
        self.interpolator.row(ground, surfaces[0].p, self.kept.rows(), rays)
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
