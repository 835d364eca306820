//! The probes around a point where they stand in no grid, and their weights.
//!
//! *Ours*: inverse distances that end at the nearest probe that does not take part (Franke and Little's weights), so that a probe comes in
//! and goes out with a weight of 0: what is interpolated changes without steps as the point moves. At a probe it alone counts.

use super::placement::ProbeWeight;
use glam::Vec3;

/// Probes that take part.
pub(crate) const COUNT: usize = 8;

/// The eight probes of `positions` nearest to `p`, the nearest first; weights sum to 1. Of fewer than eight the rest have weight 0.
pub fn around(positions: &[[f32; 3]], p: Vec3) -> [ProbeWeight; COUNT] {
    let mut near = [(f32::INFINITY, 0usize); COUNT + 1];
    for (probe, position) in positions.iter().enumerate() {
        let mut entry = (Vec3::from(*position).distance_squared(p), probe);
        for place in &mut near {
            if entry.0 < place.0 {
                std::mem::swap(place, &mut entry);
            }
        }
    }
    // Where all take part, none may fall to 0 before the farthest.
    let farthest = near.iter().rfind(|(d, _)| d.is_finite()).map_or(1.0, |(d, _)| d.sqrt());
    let end = if near[COUNT].0.is_finite() { farthest } else { 2.0 * farthest };
    let raw = |d: f32| ((end - d).max(0.0) / (end * d.max(1e-6 * end)).max(f32::MIN_POSITIVE)).powi(2);
    let mut result = std::array::from_fn(|k| {
        let (squared, probe) = near[k];
        ProbeWeight { probe, weight: if squared.is_finite() { raw(squared.sqrt()) } else { 0.0 } }
    });
    let sum: f32 = result.iter().map(|w| w.weight).sum();
    match sum > 0.0 {
        true => result.iter_mut().for_each(|w| w.weight /= sum),
        // All as far away as one another.
        false => result[0].weight = 1.0,
    }
    result
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::math::{hash_words, unit};

    fn random(i: u32, k: u32) -> Vec3 {
        Vec3::from_array(std::array::from_fn(|axis| unit(hash_words(&[i, k, axis as u32]))))
    }

    #[test]
    fn the_nearest_take_part_and_their_weights_sum_to_one() {
        let positions: Vec<[f32; 3]> = (0..40).map(|i| random(i, 1).to_array()).collect();
        for i in 0..200 {
            let p = random(i, 2) * 1.4 - 0.2;
            let found = around(&positions, p);
            let mut all: Vec<(f32, usize)> =
                positions.iter().enumerate().map(|(k, q)| (p.distance_squared(Vec3::from(*q)), k)).collect();
            all.sort_by(|a, b| a.0.total_cmp(&b.0));
            assert_eq!(found.map(|w| w.probe).to_vec(), all[..8].iter().map(|a| a.1).collect::<Vec<_>>());
            assert!((found.iter().map(|w| w.weight).sum::<f32>() - 1.0).abs() < 1e-5);
            assert!(found.windows(2).all(|w| w[0].weight >= w[1].weight));
        }
        assert_eq!(around(&positions, Vec3::from(positions[7]))[0].probe, 7);
        assert!(around(&positions, Vec3::from(positions[7]))[0].weight > 0.999);
    }

    /// A step of a tenth of a millimetre changes no probe's weight by more than a few thousandths, whoever comes and goes.
    #[test]
    fn weights_change_without_steps() {
        let positions: Vec<[f32; 3]> = (0..30).map(|i| random(i, 3).to_array()).collect();
        let weights = |p: Vec3| {
            let mut all = vec![0.0; positions.len()];
            around(&positions, p).iter().for_each(|w| all[w.probe] += w.weight);
            all
        };
        let (a, b) = (random(1, 4), random(2, 4));
        let mut last = weights(a);
        for k in 1..10_000 {
            let next = weights(a.lerp(b, k as f32 / 10_000.0));
            for (x, y) in last.iter().zip(&next) {
                assert!((x - y).abs() < 5e-3, "step {k}: {x} to {y}");
            }
            last = next;
        }
    }

    #[test]
    fn few_probes_and_probes_in_one_place_are_no_trouble() {
        for positions in [vec![[1.0; 3]], vec![[1.0; 3]; 3], vec![[0.0; 3]; 12], vec![[0.0; 3], [1.0, 0.0, 0.0]]] {
            for p in [Vec3::ZERO, Vec3::ONE, Vec3::splat(-7.0)] {
                let found = around(&positions, p);
                assert!((found.iter().map(|w| w.weight).sum::<f32>() - 1.0).abs() < 1e-5, "{positions:?} {p}");
                assert!(found.iter().all(|w| w.weight >= 0.0 && w.probe < positions.len()));
            }
        }
        let two = around(&[[0.0; 3], [1.0, 0.0, 0.0]], Vec3::new(0.25, 0.0, 0.0));
        assert!(two[0].weight > two[1].weight && two[1].weight > 0.0, "{two:?}");
    }
}
