//! The support of a radiance probe: how far it reaches, and how much it counts there (Silvennoinen and Lehtinen 2017, §4.1).

use glam::Vec3;
use rayon::prelude::*;

/// Probes whose support covers a receiver, on average (§4.1).
pub const OVERLAP: f32 = 10.0;

/// w(t), Eq. 10; t = distance / radius, not negative.
pub fn weight(t: f32) -> f32 {
    if t < 1.0 { (2.0 * t - 3.0) * t * t + 1.0 } else { 0.0 }
}

/// The common radius under which `overlap` probes' supports cover a receiver on average, metres.
pub fn radius(probes: &[Vec3], receivers: &[Vec3], overlap: f32) -> f32 {
    let covered = |r: f32| {
        let of = |x: &Vec3| probes.iter().filter(|p| p.distance_squared(*x) < r * r).count() as u64;
        receivers.par_iter().map(of).sum::<u64>() as f32 / receivers.len().max(1) as f32
    };
    let farthest =
        receivers.par_iter().map(|x| probes.iter().map(|p| p.distance(*x)).fold(0.0, f32::max)).reduce(|| 0.0, f32::max);
    let (mut low, mut high) = (0.0, farthest * 1.001);
    if covered(high) <= overlap {
        return high;
    }
    for _ in 0..24 {
        let middle = 0.5 * (low + high);
        if covered(middle) < overlap { low = middle } else { high = middle }
    }
    high
}
