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
