//! Small geometry that every stage shares: colours, frames, lat-long directions, hashing.

use glam::{Vec2, Vec3};
use std::f32::consts::{PI, TAU};

/// Linear Rec.709 radiance, irradiance or reflectance.
pub type Rgb = Vec3;

/// Rec.709 luminance of a linear colour.
pub fn luminance(c: Rgb) -> f32 {
    c.dot(Vec3::new(0.212_639, 0.715_169, 0.072_192))
}

/// Decodes the sRGB transfer curve.
pub fn linear_from_srgb(x: f32) -> f32 {
    if x <= 0.04045 { x / 12.92 } else { ((x + 0.055) / 1.055).powf(2.4) }
}

/// An orthonormal basis; `n` is its third axis ("z" in local coordinates).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Basis {
    /// First tangent, local x.
    pub s: Vec3,
    /// Second tangent, local y.
    pub t: Vec3,
    /// Normal, local z.
    pub n: Vec3,
}

impl Basis {
    /// A frame about the unit vector `n` (Duff et al. 2017).
    pub fn from_normal(n: Vec3) -> Self {
        let sign = 1f32.copysign(n.z);
        let a = -1.0 / (sign + n.z);
        let b = n.x * n.y * a;
        Self { s: Vec3::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x), t: Vec3::new(b, sign + n.y * n.y * a, -n.y), n }
    }

    /// A frame about the unit vector `n` whose `s` lies as near `tangent` as it can
    /// (Gram-Schmidt); any frame about `n` where `tangent` is zero or parallel to it.
    pub fn from_normal_and_tangent(n: Vec3, tangent: Vec3) -> Self {
        match (tangent - n * n.dot(tangent)).try_normalize() {
            Some(s) => Self { s, t: n.cross(s), n },
            None => Self::from_normal(n),
        }
    }

    /// World to local coordinates; inverse of [`Basis::to_world`].
    pub fn to_local(&self, v: Vec3) -> Vec3 {
        Vec3::new(self.s.dot(v), self.t.dot(v), self.n.dot(v))
    }

    /// Local to world coordinates; inverse of [`Basis::to_local`].
    pub fn to_world(&self, v: Vec3) -> Vec3 {
        self.s * v.x + self.t * v.y + self.n * v.z
    }
}

/// Mirror direction of `w` about the unit normal `n`, both pointing away from the surface.
pub fn reflect(w: Vec3, n: Vec3) -> Vec3 {
    n * (2.0 * n.dot(w)) - w
}

/// Unit direction, with x not below 0, of the larger eigenvalue of a symmetric matrix [[m + `half`, `xy`], [`xy`, m - `half`]], where `radius` is
/// the length of (`half`, `xy`): half the angle of that vector, without asking for the angle. The x axis where there is no larger one.
pub fn major_axis(half: f32, xy: f32, radius: f32) -> Vec2 {
    if !(radius > 0.0 && radius.is_finite()) {
        return Vec2::X;
    }
    // The larger of cosine and sine, from the cosine of twice the angle; the other from the sine of that.
    let larger = (0.5 * (1.0 + half.abs() / radius)).sqrt();
    let smaller = 0.5 * xy.abs() / (radius * larger);
    let (c, s) = if half >= 0.0 { (larger, smaller) } else { (smaller, larger) };
    Vec2::new(c, s.copysign(xy))
}

/// Uniform number in [0, 1) of the upper 24 of random bits.
pub fn unit(bits: u32) -> f32 {
    (bits >> 8) as f32 * (1.0 / 16_777_216.0)
}

/// Largest integer not above `x`, saturating. Without SSE4.1, which the baseline lacks, `f32::floor` is a call.
pub fn floor(x: f32) -> i64 {
    let i = x as i64;
    i.saturating_sub(i64::from(i as f32 > x))
}

/// What [`floor`] leaves of each coordinate, in [0, 1].
pub fn fraction(p: Vec2) -> Vec2 {
    p - Vec2::new(floor(p.x) as f32, floor(p.y) as f32)
}

/// World direction of a lat-long coordinate: `u` in [0, 1) is the longitude from -Z over +X,
/// `v` in [0, 1] the polar angle from +Y (the convention of Mitsuba's `envmap`).
/// Inverse of [`lat_long_from_direction`].
pub fn direction_from_lat_long(uv: Vec2) -> Vec3 {
    let (sin_phi, cos_phi) = (uv.x * TAU).sin_cos();
    let (sin_theta, cos_theta) = (uv.y * PI).sin_cos();
    Vec3::new(sin_phi * sin_theta, cos_theta, -cos_phi * sin_theta)
}

/// Lat-long coordinate of a unit direction, `u` in [0, 1), `v` in [0, 1].
/// Inverse of [`direction_from_lat_long`].
pub fn lat_long_from_direction(d: Vec3) -> Vec2 {
    let u = d.x.atan2(-d.z) / TAU;
    let u = if u < 0.0 { u + 1.0 } else { u };
    Vec2::new(if u >= 1.0 { 0.0 } else { u }, d.y.clamp(-1.0, 1.0).acos() / PI)
}

/// The `i`-th of `n` directions spread evenly over the sphere (a Fibonacci spiral from +Y down).
pub fn spread_over_sphere(i: u32, n: u32) -> Vec3 {
    let v = (1.0 - 2.0 * (i as f32 + 0.5) / n as f32).acos() / PI;
    direction_from_lat_long(Vec2::new((f64::from(i) * 0.618_033_988_749_894_9).fract() as f32, v))
}

/// A well-mixed 64-bit hash of a 64-bit key (SplitMix64's finaliser).
pub fn hash64(mut x: u64) -> u64 {
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

/// 2^64 over the golden ratio.
pub(crate) const GOLDEN: u64 = 0x9e37_79b9_7f4a_7c15;

/// Hash of a sequence of words; the random stream of (seed, probe, texel, ...) starts here.
pub fn hash_words(words: &[u32]) -> u32 {
    let mut h = GOLDEN;
    for &w in words {
        h = hash64(h ^ u64::from(w)).wrapping_add(GOLDEN);
    }
    (hash64(h) >> 32) as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lat_long_round_trips() {
        for i in 0..1000 {
            let uv = Vec2::new((i as f32 * 0.618_034).fract(), (i as f32 + 0.5) / 1000.0);
            let back = lat_long_from_direction(direction_from_lat_long(uv));
            assert!((back - uv).abs().max_element() < 1e-4, "{uv} -> {back}");
        }
    }

    #[test]
    fn the_major_axis_has_half_the_angle() {
        for i in 0..2000 {
            let angle = (i as f32 * 0.618_034).fract() * TAU - PI;
            let (half, xy) = (angle.cos() * 3.0, angle.sin() * 3.0);
            let found = major_axis(half, xy, half.hypot(xy));
            let expected = Vec2::from_angle(0.5 * xy.atan2(half));
            assert!((found - expected).length() < 3e-7, "{angle}: {found}, not {expected}");
        }
        for (half, xy) in [(0.0, 0.0), (f32::NAN, 1.0), (f32::INFINITY, 1.0)] {
            assert_eq!(major_axis(half, xy, half.hypot(xy)), Vec2::X);
        }
        assert_eq!((major_axis(1.0, 0.0, 1.0), major_axis(-1.0, 0.0, 1.0)), (Vec2::X, Vec2::Y));
    }

    #[test]
    fn frames_are_orthonormal_and_round_trip() {
        for i in 0..1000 {
            let uv = Vec2::new((i as f32 * 0.618_034).fract(), (i as f32 + 0.5) / 1000.0);
            let n = direction_from_lat_long(uv);
            let f = Basis::from_normal(n);
            let v = Vec3::new(0.3, -0.5, 0.7);
            assert!((f.to_local(f.to_world(v)) - v).length() < 1e-5);
            assert!((f.s.cross(f.t) - n).length() < 1e-5);
        }
    }
}
