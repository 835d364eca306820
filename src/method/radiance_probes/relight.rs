//! Probe transport: the radiance of the surfaces around a probe as spherical harmonics (§4.2), along rays that stay the same.
//!
//! *Ours*: all probes have the same directions, so that their harmonics are one small table and not one a probe, and what all probes see
//! times that table is one product of matrices.

use super::harmonics::Harmonics;
use super::seen::{Ground, NO_RECEIVER};
use crate::base::math::{Rgb, spread_over_sphere};
use crate::base::ray::Ray;
use glam::Vec3;
use nalgebra_sparse::na::DMatrix;
use rayon::prelude::*;

/// Probes that are gathered at once.
const PROBES: usize = 8;

/// What the rays of all probes share.
pub struct RelightRays {
    /// Unit, evenly spread.
    pub directions: Vec<Vec3>,
    /// Y_j of each, over the density of directions: a row a ray.
    weighted: DMatrix<f32>,
}

impl RelightRays {
    /// `count` rays for probes of `order`.
    pub fn new(count: u32, order: u32) -> Self {
        let directions: Vec<Vec3> = (0..count).map(|i| spread_over_sphere(i, count)).collect();
        let harmonics = Harmonics::new(order);
        let share = 4.0 * std::f32::consts::PI / count as f32;
        let mut weighted = DMatrix::zeros(directions.len(), harmonics.terms());
        for (i, d) in directions.iter().enumerate() {
            harmonics.at(*d).into_iter().enumerate().for_each(|(j, y)| weighted[(i, j)] = y * share);
        }
        Self { directions, weighted }
    }

    /// The weighted harmonics, ray by ray.
    pub fn by_ray(&self) -> Vec<f32> {
        self.weighted.transpose().as_slice().to_vec()
    }

    /// The receiver that each ray of each probe meets, probe by probe.
    pub fn hits(&self, ground: &Ground) -> Vec<u32> {
        let meets = |p: Vec3, d: Vec3| {
            let surface = ground.world.intersect(&Ray::new(p, d))?;
            ground.receivers.at(&surface, -d)
        };
        let of = |&p: &Vec3| self.directions.iter().map(move |&d| meets(p, d).unwrap_or(NO_RECEIVER));
        ground.probes.par_iter().flat_map_iter(of).collect()
    }

    /// λ: each probe's coefficients (red, green and blue of a term together), from the radiance of the receivers that its rays meet.
    pub fn project(&self, hits: &[u32], radiance: &[Rgb]) -> Vec<Rgb> {
        let (rays, terms) = (self.directions.len(), self.weighted.ncols());
        let project = |hits: &[u32]| -> Vec<Rgb> {
            let count = hits.len() / rays;
            let mut light = DMatrix::<f32>::zeros(3 * count, rays);
            for (ray, column) in light.as_mut_slice().chunks_exact_mut(3 * count).enumerate() {
                for (probe, rgb) in column.chunks_exact_mut(3).enumerate() {
                    // What is no receiver has no diffuse light.
                    let seen = radiance.get(hits[probe * rays + ray] as usize);
                    rgb.copy_from_slice(&seen.copied().unwrap_or(Rgb::ZERO).to_array());
                }
            }
            let product = light * &self.weighted;
            let term = |probe: usize, j: usize| Rgb::from_array([0, 1, 2].map(|c| product[(3 * probe + c, j)]));
            (0..count).flat_map(|probe| (0..terms).map(move |j| (probe, j))).map(|(probe, j)| term(probe, j)).collect()
        };
        hits.par_chunks(PROBES * rays).flat_map_iter(project).collect()
    }
}
