//! Maps from the unit square to directions.

use glam::{Vec2, Vec3};
use std::f32::consts::{FRAC_1_PI, FRAC_PI_4, TAU};

/// Area-preserving map from the unit square to the unit disk that keeps neighbours together (Shirley and Chiu 1997).
pub fn disk(v: Vec2) -> Vec2 {
    let o = v * 2.0 - Vec2::ONE;
    if o == Vec2::ZERO {
        return Vec2::ZERO;
    }
    let (r, phi) =
        if o.x.abs() > o.y.abs() { (o.x, FRAC_PI_4 * (o.y / o.x)) } else { (o.y, 2.0 * FRAC_PI_4 - FRAC_PI_4 * (o.x / o.y)) };
    let (sin, cos) = phi.sin_cos();
    Vec2::new(cos, sin) * r
}

/// Inverse of [`disk`].
pub fn square(d: Vec2) -> Vec2 {
    let r = d.length();
    if r == 0.0 {
        return Vec2::splat(0.5);
    }
    let o = if d.x.abs() > d.y.abs() {
        let r = r.copysign(d.x);
        Vec2::new(r, r * octants(d.y / d.x))
    } else {
        let r = r.copysign(d.y);
        Vec2::new(r * octants(d.x / d.y), r)
    };
    ((o + Vec2::ONE) * 0.5).clamp(Vec2::ZERO, Vec2::splat(1.0 - f32::EPSILON / 2.0))
}

/// The angle whose tangent is `t`, -1 to 1, as a share of π/4: a polynomial fitted to an error of 1.2e-7.
fn octants(t: f32) -> f32 {
    const TERMS: [[f32; 2]; 4] = [
        [1.273_239_4, -0.424_397_4],
        [0.254_283_37, -0.178_627_62],
        [0.126_593_66, -0.076_270_84],
        [0.031_265_475, -0.006_086_195_5],
    ];
    // In pairs, and pairs of pairs, so that few have to wait for others.
    let t2 = t * t;
    let t4 = t2 * t2;
    let [a, b, c, d] = TERMS.map(|[even, odd]| even + odd * t2);
    t * ((a + b * t4) + (c + d * t4) * (t4 * t4))
}

/// A direction about +z with pdf = cos / π (solid angle).
pub fn cosine_hemisphere(v: Vec2) -> Vec3 {
    let d = disk(v);
    d.extend((1.0 - d.length_squared()).max(0.0).sqrt())
}

/// Density of [`cosine_hemisphere`], per solid angle.
pub fn cosine_hemisphere_pdf(w: Vec3) -> f32 {
    w.z.max(0.0) * FRAC_1_PI
}

/// The unit direction with cosine `z` at the azimuth `turn` (in turns).
pub fn direction(z: f32, turn: f32) -> Vec3 {
    let (sin, cos) = (turn * TAU).sin_cos();
    let r = (1.0 - z * z).max(0.0).sqrt();
    Vec3::new(r * cos, r * sin, z)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn square_undoes_disk() {
        for i in 0..64 * 64 {
            let v = (Vec2::new((i % 64) as f32, (i / 64) as f32) + 0.5) / 64.0;
            let back = square(disk(v));
            assert!(back.distance(v) < 1e-6, "{v} came back as {back}");
        }
        assert_eq!(square(disk(Vec2::splat(0.5))), Vec2::splat(0.5));
        for edge in [Vec2::X, -Vec2::X, Vec2::Y, -Vec2::Y, Vec2::new(0.8, 0.7)] {
            let v = square(edge);
            assert!(v.cmpge(Vec2::ZERO).all() && v.cmplt(Vec2::ONE).all(), "{edge}: {v}");
        }
    }
}
