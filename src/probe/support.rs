//! Which probes a receiver interpolates, and with what weights ([Silvennoinen and Lehtinen 2017] §4.1, "Spatial Weight Function").
//!
//! *Paper*: all probes have one support radius, found by a search for the one under which ten supports cover a receiver on average.
//! *Ours*: where that leaves a receiver without any, the radius grows until none is left out, as §4.1 asks of the placement.

use glam::Vec3;
use rayon::prelude::*;

/// Probes whose support covers a receiver, on average (§4.1).
pub const OVERLAP: f32 = 10.0;
/// How much farther than a receiver its support reaches at least, as a share of the radius: at the radius itself the weight is 0.
const MARGIN: f32 = 1e-3;
/// Where the search ends, as a share of the radius.
const PRECISION: f32 = 1e-5;

/// w(t), Eq. 10; t = distance / radius, not negative.
pub fn weight(t: f32) -> f32 {
    if t < 1.0 { (2.0 * t - 3.0) * t * t + 1.0 } else { 0.0 }
}

/// The common radius under which `overlap` probes' supports cover a receiver on average, metres. With no more probes than that, all of
/// them cover every receiver. No receiver is left uncovered. 0 without probes or receivers.
pub fn radius(probes: &[Vec3], receivers: &[Vec3], overlap: f32) -> f32 {
    let extremes = |&x: &Vec3| {
        let squares = probes.iter().map(|p| p.distance_squared(x));
        squares.fold((f32::INFINITY, 0f32), |(near, far), d| (near.min(d), far.max(d)))
    };
    if probes.is_empty() || receivers.is_empty() {
        return 0.0;
    }
    let (near, far) = receivers.par_iter().map(extremes).reduce(|| (0.0, 0.0), |a, b| (a.0.max(b.0), a.1.max(b.1)));
    let (least, most) = (near.sqrt() * (1.0 + MARGIN), far.sqrt() * (1.0 + MARGIN));
    if probes.len() as f32 <= overlap {
        return most;
    }
    let (mut below, mut enough) = (least, most);
    if mean_overlap(probes, receivers, least) >= f64::from(overlap) {
        return least;
    }
    while enough - below > PRECISION * enough {
        let middle = 0.5 * (below + enough);
        if mean_overlap(probes, receivers, middle) >= f64::from(overlap) {
            enough = middle;
        } else {
            below = middle;
        }
    }
    enough
}

/// How many probes' supports of this radius cover a receiver, on average; 0 without receivers.
pub fn mean_overlap(probes: &[Vec3], receivers: &[Vec3], radius: f32) -> f64 {
    let square = radius * radius;
    let covering = |x: &Vec3| probes.iter().filter(|p| p.distance_squared(*x) < square).count() as u64;
    receivers.par_iter().map(covering).sum::<u64>() as f64 / receivers.len().max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::math::{hash_words, unit};

    fn scattered(count: u32, seed: u32) -> Vec<Vec3> {
        let at = |i: u32, k: u32| unit(hash_words(&[i, k, seed]));
        (0..count).map(|i| Vec3::new(4.0 * at(i, 0), 2.0 * at(i, 1), 3.0 * at(i, 2))).collect()
    }

    /// The sorted distances from each receiver to all probes.
    fn distances(probes: &[Vec3], receivers: &[Vec3]) -> Vec<Vec<f32>> {
        let sorted = |x: &Vec3| {
            let mut list: Vec<f32> = probes.iter().map(|p| p.distance(*x)).collect();
            list.sort_by(f32::total_cmp);
            list
        };
        receivers.iter().map(sorted).collect()
    }

    #[test]
    fn weights_are_the_cubic_of_equation_10() {
        for i in 0..=1000 {
            let t = f64::from(i) / 1000.0;
            let expected = 2.0 * t.powi(3) - 3.0 * t.powi(2) + 1.0;
            assert!((f64::from(weight(t as f32)) - expected).abs() < 1e-6, "{t}");
        }
        assert_eq!((weight(0.0), weight(0.5), weight(1.0), weight(7.0), weight(f32::INFINITY)), (1.0, 0.5, 0.0, 0.0, 0.0));
        // Smooth at both ends, and a partition with its mirror image: w(t) + w(1 - t) = 1.
        assert!(weight(1e-3) > 1.0 - 1e-5 && weight(1.0 - 1e-3) < 1e-5);
        assert!((0..=100).all(|i| (weight(i as f32 / 100.0) + weight(1.0 - i as f32 / 100.0) - 1.0).abs() < 1e-6));
    }

    /// The mean of counts over receivers passes ten at the (10 · receivers)-th of all distances.
    #[test]
    fn the_radius_is_the_least_under_which_ten_supports_cover_a_receiver() {
        let (probes, receivers) = (scattered(60, 1), scattered(500, 2));
        for overlap in [2.0, OVERLAP, 33.5] {
            let mut all = distances(&probes, &receivers).concat();
            all.sort_by(f32::total_cmp);
            let least = distances(&probes, &receivers).iter().map(|list| list[0]).fold(0.0, f32::max);
            let expected = all[(overlap * 500.0) as usize - 1].max(least);
            let found = radius(&probes, &receivers, overlap);
            assert!(found > expected && found < expected * 1.0011, "{overlap}: {found} not {expected}");
            let mean = all.iter().filter(|&&d| d < found).count() as f64 / 500.0;
            assert!(mean >= f64::from(overlap) && (mean - mean_overlap(&probes, &receivers, found)).abs() < 1e-9, "{mean}");
        }
    }

    #[test]
    fn a_receiver_far_from_all_probes_is_reached_too() {
        let (probes, mut receivers) = (scattered(60, 1), scattered(500, 2));
        receivers.push(Vec3::new(9.0, 1.0, 1.0));
        let found = radius(&probes, &receivers, OVERLAP);
        let lists = distances(&probes, &receivers);
        assert!(lists.iter().all(|list| weight(list[0] / found) > 0.0));
        assert!(found < lists[500][0] * 1.0011 && found > 4.9, "{found}");
        assert!(mean_overlap(&probes, &receivers, found) > 10.0);
    }

    #[test]
    fn few_probes_cover_every_receiver_and_none_cover_nothing() {
        let receivers = scattered(200, 2);
        for count in [1, 9, 10] {
            let probes = scattered(count, 1);
            let found = radius(&probes, &receivers, OVERLAP);
            let lists = distances(&probes, &receivers);
            let farthest = lists.concat().into_iter().fold(0.0, f32::max);
            assert!(lists.concat().iter().all(|d| weight(d / found) > 0.0) && found < farthest * 1.0011, "{count}");
        }
        assert_eq!((radius(&[], &receivers, OVERLAP), radius(&receivers, &[], OVERLAP)), (0.0, 0.0));
    }
}
