//! The solid angle of a disc, for lights that are near (§2.4).
//!
//! *Paper*: a precomputed 2D table. Entries are an integral along the disc's rim: with s the distance of a rim's point from the foot of the
//! perpendicular, and h the height, the solid angle is ∮ (1 - h / √(h² + s²)) dφ, which is smooth for feet inside and outside.

use std::f64::consts::TAU;
use std::sync::OnceLock;

/// Entries each way.
pub(crate) const SIZE: usize = 64;
/// Points along the rim.
const RIM: usize = 512;
/// How many radii away a disc is a distant patch: there, cos · area / d² is 1.2 % too large at most.
pub const FAR: f32 = 8.0;

/// Solid angle of a disc of radius 1 from `distance` > 0 away, in a direction at `cos` >= 0 from its axis; within 2 % up to [`FAR`], but for
/// points next to the rim in its plane, where it jumps.
pub fn solid_angle(distance: f32, cos: f32) -> f32 {
    let table = table();
    let last = (SIZE - 1) as f32;
    let x = (distance / (1.0 + distance) * (1.0 + FAR) / FAR * last).clamp(0.0, last);
    let y = cos.clamp(0.0, 1.0) * last;
    let (i, j) = ((x as usize).min(SIZE - 2), (y as usize).min(SIZE - 2));
    let (fx, fy) = (x - i as f32, y - j as f32);
    let row = |j: usize| table[j * SIZE + i] + (table[j * SIZE + i + 1] - table[j * SIZE + i]) * fx;
    row(j) + (row(j + 1) - row(j)) * fy
}

/// The table, rows of [`SIZE`].
pub(super) fn table() -> &'static [f32] {
    static TABLE: OnceLock<Vec<f32>> = OnceLock::new();
    TABLE.get_or_init(|| (0..SIZE * SIZE).map(|i| exact(distance_of(i % SIZE), cosine_of(i / SIZE)) as f32).collect())
}

/// Columns are even in d / (1 + d).
fn distance_of(i: usize) -> f64 {
    let x = i as f64 / (SIZE - 1) as f64 * f64::from(FAR / (1.0 + FAR));
    (x / (1.0 - x)).max(1e-6)
}

fn cosine_of(j: usize) -> f64 {
    (j as f64 / (SIZE - 1) as f64).max(1e-6)
}

fn exact(distance: f64, cos: f64) -> f64 {
    let height = distance * cos;
    let offset = distance * (1.0 - cos * cos).max(0.0).sqrt();
    let part = |i: usize| {
        let (sin, cos) = ((i as f64 + 0.5) / RIM as f64 * TAU).sin_cos();
        let s2 = (cos - offset).powi(2) + sin * sin;
        (1.0 - height / (height * height + s2).sqrt()) * (1.0 - offset * cos) / s2.max(1e-12)
    };
    ((0..RIM).map(part).sum::<f64>() * TAU / RIM as f64).clamp(0.0, TAU)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f32::consts::PI;

    /// ∫ h / r³ over the disc, in rings.
    fn by_area(distance: f32, cos: f32) -> f64 {
        let (height, offset) = (f64::from(distance * cos), f64::from(distance * (1.0 - cos * cos).sqrt()));
        let (rings, parts) = (400, 400);
        let mut sum = 0.0;
        for i in 0..rings {
            let r = (i as f64 + 0.5) / f64::from(rings);
            for k in 0..parts {
                let (sin, cos) = ((f64::from(k) + 0.5) / f64::from(parts) * TAU).sin_cos();
                let d2 = (r * cos - offset).powi(2) + (r * sin).powi(2) + height * height;
                sum += height / d2.powf(1.5) * r / f64::from(rings) * TAU / f64::from(parts);
            }
        }
        sum
    }

    #[test]
    fn the_table_is_the_integral_over_the_disc() {
        for distance in [0.2f32, 0.6, 1.5, 3.0, 7.0] {
            for cos in [0.25f32, 0.5, 0.8, 1.0] {
                let (expected, found) = (by_area(distance, cos), f64::from(solid_angle(distance, cos)));
                assert!((found / expected - 1.0).abs() < 0.02, "{distance} {cos}: {found}, {expected}");
            }
        }
        let on_axis = |d: f32| 2.0 * PI * (1.0 - d / (1.0 + d * d).sqrt());
        for d in [0.05f32, 0.5, 2.0, 6.0] {
            assert!((solid_angle(d, 1.0) / on_axis(d) - 1.0).abs() < 0.01, "{d}");
        }
        assert!((solid_angle(1e-5, 0.7) - 2.0 * PI).abs() < 0.01, "on the disc it fills the hemisphere");
        let patch = |cos: f32| PI * cos / (FAR * FAR);
        assert!(
            (solid_angle(FAR, 1.0) / patch(1.0) - 1.0).abs() < 0.013 && (solid_angle(FAR, 0.4) / patch(0.4) - 1.0).abs() < 0.013
        );
    }
}
