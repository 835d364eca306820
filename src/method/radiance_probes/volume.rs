//! Receivers in free space: an irradiance volume (Greger et al. 1998), by which shapes that a frame adds have light by way of the probes.
//!
//! Its points keep the radiance around them to second order, from which all but about a hundredth of irradiance comes, whichever way a
//! surface faces (Ramamoorthi and Hanrahan 2001). *Ours*: a point of the grid that the scene hides from a surface gives it no light.

use super::clusters::{project, reconstruct};
use super::compress::Cluster;
use super::harmonics::{Harmonics, cosine_factor, terms};
use super::interpolate::{Interpolation, Interpolator, MOST_NUMBERS, Row};
use super::seen::Ground;
use crate::base::math::{Rgb, spread_over_sphere};
use crate::base::ray::Ray;
use crate::material::Surface;
use crate::material::bsdf::warp::cosine_hemisphere;
use crate::transport::World;
use crate::{Error, Result};
use glam::{Vec2, Vec3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::f32::consts::PI;

/// Order of the radiance that a point keeps.
const ORDER: u32 = 2;
/// Numbers that a point keeps.
pub const NUMBERS: usize = terms(ORDER);
const _: () = assert!(NUMBERS <= MOST_NUMBERS);

/// Directions by which light enters a coat.
pub(crate) const DIRECTIONS: u32 = 8;

/// Most points of a grid.
const MOST_POINTS: f64 = (1 << 22) as f64;

/// A grid of points.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Grid {
    /// The point of least coordinates, metres.
    pub low: Vec3,
    /// Between neighbours, metres.
    pub spacing: f32,
    /// Points along x, y and z.
    pub counts: [u32; 3],
}

impl Grid {
    /// The grid of a spacing that fills the part of the scene which probes reach.
    ///
    /// # Errors
    /// It would have too many points.
    pub fn new(ground: &Ground, spacing: f32) -> Result<Self> {
        let (low, high) = ground.world.scene.geometry.bounds();
        let probes = || ground.probes.iter().copied();
        let low = low.max(probes().fold(Vec3::INFINITY, Vec3::min) - ground.radius);
        let high = high.min(probes().fold(Vec3::NEG_INFINITY, Vec3::max) + ground.radius).max(low);
        let counts = ((high - low) / spacing).floor().as_dvec3() + 1.0;
        let all = counts.element_product();
        if all > MOST_POINTS {
            return Err(Error::Request(format!("--volume {spacing}: would be {all:.0} points; expected {MOST_POINTS} at most")));
        }
        let counts = counts.as_uvec3();
        let rest = high - low - (counts - 1).as_vec3() * spacing;
        Ok(Self { low: low + rest / 2.0, spacing, counts: counts.to_array() })
    }

    /// Whether there are points, and not more than a grid may have.
    pub fn has_points(&self) -> bool {
        (1.0..=MOST_POINTS).contains(&self.counts.iter().map(|&n| f64::from(n)).product())
    }

    /// How many points there are.
    pub fn count(&self) -> usize {
        self.counts.iter().map(|&n| n as usize).product()
    }

    fn point(&self, cell: u32) -> Vec3 {
        let [nx, ny, _] = self.counts;
        self.low + Vec3::new((cell % nx) as f32, (cell / nx % ny) as f32, (cell / nx / ny) as f32) * self.spacing
    }

    /// The eight points around `p`, or around the place of the grid that is nearest to it, and their trilinear weights.
    fn around(&self, p: Vec3) -> [(u32, f32); 8] {
        let [nx, ny, nz] = self.counts;
        let most = Vec3::new((nx - 1) as f32, (ny - 1) as f32, (nz - 1) as f32);
        let q = ((p - self.low) / self.spacing).clamp(Vec3::ZERO, most);
        let low = q.floor();
        let share = q - low;
        std::array::from_fn(|k| {
            let step = [k & 1, k >> 1 & 1, k >> 2];
            let [x, y, z] = [0, 1, 2].map(|a| (low[a] as u32 + step[a] as u32).min(self.counts[a] - 1));
            let weights = [0, 1, 2].map(|a| if step[a] == 1 { share[a] } else { 1.0 - share[a] });
            ((z * ny + y) * nx + x, weights.iter().product())
        })
    }
}

/// Points of a grid that light comes to, and how it follows from the probes' radiance.
#[derive(Debug, Clone, PartialEq)]
pub struct Volume {
    /// The grid.
    pub grid: Grid,
    /// The points' numbers in it, x first; ascending.
    pub cells: Vec<u32>,
    /// Their rows: [`NUMBERS`] each.
    pub clusters: Vec<Cluster>,
}

/// What is baked of a volume.
pub struct Space {
    /// The grid.
    pub grid: Grid,
    /// The points' numbers in it; ascending.
    pub cells: Vec<u32>,
    directions: Vec<Vec3>,
    interpolator: Interpolator,
}

impl Space {
    /// The points from which a probe is seen that reaches them, which are therefore in the open; `rays` to gather with.
    pub fn new(ground: &Ground, spacing: f32, rays: u32, (order, interpolation): (u32, Interpolation)) -> Result<Self> {
        let grid = Grid::new(ground, spacing)?;
        let is_lit = |&cell: &u32| {
            let p = grid.point(cell);
            ground.probes.iter().any(|&probe| p.distance(probe) < ground.radius && !hidden(ground.world, p, probe))
        };
        let cells = (0..grid.count() as u32).into_par_iter().filter(is_lit).collect();
        let directions = (0..rays).map(|i| spread_over_sphere(i, rays)).collect();
        Ok(Self { grid, cells, directions, interpolator: Interpolator::new(order, interpolation) })
    }

    /// Where the points are, metres.
    pub fn points(&self) -> Vec<Vec3> {
        self.cells.iter().map(|&cell| self.grid.point(cell)).collect()
    }

    /// The row of a point.
    pub fn row(&self, ground: &Ground, point: u32) -> Row {
        let p = self.grid.point(self.cells[point as usize]);
        let harmonics = Harmonics::new(ORDER);
        let share = 4.0 * PI / self.directions.len() as f32;
        let rays = self.directions.iter().map(|&d| {
            let mut measure = [0.0; MOST_NUMBERS];
            harmonics.evaluate(d, &mut measure);
            (Ray::new(p, d), measure.map(|y| y * share))
        });
        self.interpolator.row(ground, p, NUMBERS, rays)
    }
}

impl Volume {
    /// Bytes that it takes.
    pub fn bytes(&self) -> usize {
        self.clusters.iter().map(Cluster::bytes).sum::<usize>() + 4 * self.cells.len()
    }

    /// The light of its points, [`NUMBERS`] each, from the probes' radiance; `terms`: harmonics of a probe.
    pub fn receive(&self, lambda: &[Rgb], terms: usize) -> Vec<Rgb> {
        reconstruct(&self.clusters, &project(&self.clusters, lambda, terms), NUMBERS, self.cells.len())
    }

    /// Which points light a surface on the side that `wo` points to, and the weight of each of their numbers in its E_T.
    pub fn taps(&self, world: &World, surface: &Surface, wo: Vec3) -> Vec<(u32, [f32; NUMBERS])> {
        let around = self.grid.around(surface.p);
        let kept = |(cell, w): &(u32, f32)| Some((self.cells.binary_search(cell).ok()? as u32, *w)).filter(|_| *w > 0.0);
        let known: Vec<(u32, f32)> = around.iter().filter_map(kept).collect();
        let is_open = |(point, _): &&(u32, f32)| !hidden(world, surface.p, self.grid.point(self.cells[*point as usize]));
        let open: Vec<(u32, f32)> = known.iter().filter(is_open).copied().collect();
        let taps = if open.is_empty() { known } else { open };
        let sum: f32 = taps.iter().map(|t| t.1).sum();
        let side = if surface.frame.n.dot(wo) < 0.0 { -1.0 } else { 1.0 };
        let mut y = [0.0; NUMBERS];
        Harmonics::new(ORDER).evaluate(surface.frame.n * side, &mut y);
        for l in 0..=ORDER {
            y[terms(l) - (2 * l + 1) as usize..terms(l)].iter_mut().for_each(|y| *y *= cosine_factor(l) as f32);
        }
        let share = entering(world, surface, side) / sum;
        taps.into_iter().map(|(point, w)| (point, y.map(|y| y * w * share))).collect()
    }
}

/// T_in of light from all directions.
fn entering(world: &World, surface: &Surface, side: f32) -> f32 {
    let bsdf = world.scene.bsdf(surface);
    let of = |k: u32| {
        let d = cosine_hemisphere(Vec2::new((k as f32 + 0.5) / DIRECTIONS as f32, (0.618_034 * (k as f32 + 0.5)).fract()));
        bsdf.diffuse_in(surface, Vec3::new(d.x, d.y, d.z * side))
    };
    (0..DIRECTIONS).map(of).sum::<f32>() / DIRECTIONS as f32
}

/// E_T by way of [`Volume::taps`] of the light of a volume's points.
pub fn irradiance(taps: &[(u32, [f32; NUMBERS])], light: &[Rgb]) -> Rgb {
    let of = |(point, weights): &(u32, [f32; NUMBERS])| -> Rgb {
        light[*point as usize * NUMBERS..][..NUMBERS].iter().zip(weights).map(|(&l, w)| l * w).sum()
    };
    taps.iter().map(of).sum::<Rgb>().max(Rgb::ZERO)
}

/// Whether the scene's own shapes, those that a frame adds aside, stand between two points.
fn hidden(world: &World, from: Vec3, to: Vec3) -> bool {
    let Some(d) = (to - from).try_normalize() else { return false };
    world.bvh.occluded(&world.scene, &Ray { t_max: from.distance(to) * (1.0 - 1e-4), ..Ray::new(from, d) })
}
