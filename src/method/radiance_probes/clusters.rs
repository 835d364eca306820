//! What clusters of compressed rows make of the probes' radiance: projection to their own few dimensions, and reconstruction from these (§4.2).

use super::compress::Cluster;
use crate::base::math::Rgb;
use half::slice::HalfFloatSliceExt;
use rayon::prelude::*;

/// Lanes of a sum.
const LANES: usize = 8;

/// The light of the own few dimensions of each of `clusters`; `terms`: harmonics of a probe.
pub fn project(clusters: &[Cluster], lambda: &[Rgb], terms: usize) -> Vec<Vec<Rgb>> {
    clusters.par_iter().map(|cluster| cluster.project(lambda, terms)).collect()
}

/// The light of all `count` receivers of `clusters`, `numbers` each, from that of their spaces.
pub fn reconstruct(clusters: &[Cluster], spaces: &[Vec<Rgb>], numbers: usize, count: usize) -> Vec<Rgb> {
    let of = |(cluster, space): (&Cluster, &Vec<Rgb>)| cluster.reconstruct(space, numbers);
    let all: Vec<Vec<Rgb>> = clusters.par_iter().zip(spaces).map(of).collect();
    let mut light = vec![Rgb::ZERO; count * numbers];
    for (cluster, values) in clusters.iter().zip(&all) {
        for (&r, values) in cluster.receivers.iter().zip(values.chunks_exact(numbers)) {
            light[r as usize * numbers..][..numbers].copy_from_slice(values);
        }
    }
    light
}

impl Cluster {
    /// Bytes that it takes.
    pub fn bytes(&self) -> usize {
        2 * (self.projection.len() + self.reconstruction.len()) + 4 * (self.receivers.len() + self.probes.len())
    }

    /// Σ Vᵀ λ, under `lambda` of all probes.
    fn project(&self, lambda: &[Rgb], terms: usize) -> Vec<Rgb> {
        // A channel after the other, so that sums run along them.
        let mine = || self.probes.iter().flat_map(|&p| &lambda[p as usize * terms..][..terms]);
        let channels: [Vec<f32>; 3] = std::array::from_fn(|c| mine().map(|l| l[c]).collect());
        let width = channels[0].len();
        let mut row = vec![0.0; width];
        let number = |k: usize| {
            self.projection[k * width..][..width].convert_to_f32_slice(&mut row);
            Rgb::from_array([0, 1, 2].map(|c| dot(&row, &channels[c])))
        };
        (0..self.rank).map(number).collect()
    }

    /// U times the light of the cluster's space: `rows` numbers a receiver.
    fn reconstruct(&self, space: &[Rgb], rows: usize) -> Vec<Rgb> {
        let mut factors = vec![0.0; self.rank];
        let number = |i: usize| {
            self.reconstruction[i * self.rank..][..self.rank].convert_to_f32_slice(&mut factors);
            factors.iter().zip(space).map(|(&u, &l)| l * u).sum()
        };
        (0..self.receivers.len() * rows).map(number).collect()
    }
}

/// Σ a b, in lanes of a fixed order.
fn dot(a: &[f32], b: &[f32]) -> f32 {
    let mut sums = [0.0; LANES];
    let (a, b) = (a.chunks_exact(LANES), b.chunks_exact(LANES));
    let rest: f32 = a.remainder().iter().zip(b.remainder()).map(|(x, y)| x * y).sum();
    for (x, y) in a.zip(b) {
        for k in 0..LANES {
            sums[k] += x[k] * y[k];
        }
    }
    sums.iter().sum::<f32>() + rest
}
