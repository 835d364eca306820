//! Points and the parts of the surfaces that they stand for: each is nearest to its own.
//!
//! *Ours*: repulsion knows no force from beyond a border, and pushes points against it. So each moves into the middle of its cell, the samples of
//! the surface that are nearer to it than to others and face alike (Lloyd's relaxation), and stands for the cell's area.

use glam::Vec3;
use rayon::prelude::*;
use std::collections::HashMap;

/// Rounds of moving; the cells change little after the second.
const ROUNDS: u32 = 3;
/// Least cosine between the normals of a sample and a point that it may belong to.
const ALIKE: f32 = 0.3;
/// Rings of cells of the grid that are searched for the nearest point.
const RINGS: i32 = 3;

/// A point of a surface.
#[derive(Debug, Clone, Copy)]
pub struct Sample {
    /// Position.
    pub p: Vec3,
    /// Unit normal of its side.
    pub n: Vec3,
}

/// For points that lie about `spacing` apart: the sample that each moves to, and how many samples are in its cell. `None` for a point that is
/// nearest to none.
pub fn settle(samples: &[Sample], mut points: Vec<Sample>, spacing: f32) -> Vec<Option<(u32, u32)>> {
    let mut chosen = vec![None; points.len()];
    for _ in 0..ROUNDS {
        let owners = owners(samples, &points, spacing);
        let mut sums = vec![(Vec3::ZERO, 0u32); points.len()];
        for (sample, owner) in samples.iter().zip(&owners) {
            if let Some(i) = owner {
                sums[*i as usize].0 += sample.p;
                sums[*i as usize].1 += 1;
            }
        }
        let mut nearest = vec![(f32::INFINITY, 0u32); points.len()];
        for (k, (sample, owner)) in samples.iter().zip(&owners).enumerate() {
            if let Some(i) = owner {
                let (sum, count) = sums[*i as usize];
                let distance = sample.p.distance_squared(sum / count as f32);
                if distance < nearest[*i as usize].0 {
                    nearest[*i as usize] = (distance, k as u32);
                }
            }
        }
        for (i, ((_, k), (_, count))) in nearest.into_iter().zip(sums).enumerate() {
            chosen[i] = (count > 0).then_some((k, count));
            if count > 0 {
                points[i] = samples[k as usize];
            }
        }
    }
    // The cells of where they have come to rest.
    let mut counts = vec![0u32; points.len()];
    owners(samples, &points, spacing).into_iter().flatten().for_each(|i| counts[i as usize] += 1);
    chosen.into_iter().zip(counts).map(|(at, count)| at.map(|(k, _)| (k, count)).filter(|_| count > 0)).collect()
}

/// The nearest point of each sample, of those that face alike; of two at the same distance, the first.
fn owners(samples: &[Sample], points: &[Sample], spacing: f32) -> Vec<Option<u32>> {
    let cell = |p: Vec3| (p / spacing).floor().as_ivec3();
    let mut cells: HashMap<[i32; 3], Vec<u32>> = HashMap::new();
    for (i, point) in points.iter().enumerate() {
        cells.entry(cell(point.p).to_array()).or_default().push(i as u32);
    }
    let of = |sample: &Sample| {
        let at = cell(sample.p);
        let mut best = (f32::INFINITY, None);
        for ring in 0..=RINGS {
            // What lies in the next ring is farther away than this.
            let reach = (ring - 1).max(0) as f32 * spacing;
            if best.0 <= reach * reach && best.1.is_some() {
                break;
            }
            for offset in shell(ring) {
                let Some(list) = cells.get(&[at.x + offset[0], at.y + offset[1], at.z + offset[2]]) else { continue };
                for &i in list {
                    let point = &points[i as usize];
                    let distance = point.p.distance_squared(sample.p);
                    if distance < best.0 && point.n.dot(sample.n) > ALIKE {
                        best = (distance, Some(i));
                    }
                }
            }
        }
        best.1
    };
    samples.par_iter().with_min_len(1024).map(of).collect()
}

/// Offsets of the cells whose largest distance along an axis is `ring`.
fn shell(ring: i32) -> impl Iterator<Item = [i32; 3]> {
    let all = (-ring..=ring).flat_map(move |x| (-ring..=ring).flat_map(move |y| (-ring..=ring).map(move |z| [x, y, z])));
    all.filter(move |o| o.iter().any(|c| c.abs() == ring))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::math::{hash_words, unit};

    fn random(count: u32, key: u32) -> Vec<Sample> {
        let at = |i: u32, k: u32| unit(hash_words(&[i, k, key]));
        (0..count).map(|i| Sample { p: Vec3::new(at(i, 0), 0.0, at(i, 1)), n: Vec3::Y }).collect()
    }

    #[test]
    fn the_nearest_point_is_that_of_brute_force() {
        let (samples, points) = (random(500, 1), random(100, 2));
        let found = owners(&samples, &points, 0.1);
        for (sample, owner) in samples.iter().zip(found) {
            let best = (0..100)
                .min_by(|&a, &b| points[a].p.distance_squared(sample.p).total_cmp(&points[b].p.distance_squared(sample.p)));
            assert_eq!(owner, best.map(|i| i as u32));
        }
        let behind: Vec<Sample> = samples.iter().map(|s| Sample { n: -s.n, ..*s }).collect();
        assert!(owners(&behind, &points, 0.1).iter().all(Option::is_none));
    }

    /// Points at random come to have cells of like size, and every sample is in one.
    #[test]
    fn cells_come_to_be_alike() {
        let samples = random(20_000, 1);
        let start = random(200, 2);
        let settled = settle(&samples, start.clone(), 0.07);
        let spread = |counts: &[f32]| {
            let mean = counts.iter().sum::<f32>() / counts.len() as f32;
            (counts.iter().map(|c| (c / mean - 1.0).powi(2)).sum::<f32>() / counts.len() as f32).sqrt()
        };
        let mut before = vec![0.0; 200];
        owners(&samples, &start, 0.07).into_iter().flatten().for_each(|i| before[i as usize] += 1.0);
        let after: Vec<f32> = settled.iter().map(|s| s.unwrap().1 as f32).collect();
        assert_eq!(after.iter().sum::<f32>(), 20_000.0);
        assert!(spread(&after) < 0.6 * spread(&before), "{} {}", spread(&before), spread(&after));
    }
}
