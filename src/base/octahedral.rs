//! The octahedral map: directions about a point as a square image (Engelhardt and Dachsbacher 2008).
//!
//! The sphere is projected onto the octahedron |x| + |y| + |z| = 1, seen from +Y, and its lower half folded outwards. In each octant the
//! map is projective, so that a straight line in space is a straight line there, and the square's edges meet their own mirror images.

use glam::{IVec2, Vec2, Vec3};

/// The place of a direction (of any length but 0) in [0, 1]².
pub fn encode(d: Vec3) -> Vec2 {
    within_octant(d, Vec3::ONE.copysign(d)) * 0.5 + 0.5
}

/// The place in [-1, 1]² of a point of the octant with these signs, its borders included.
pub fn within_octant(p: Vec3, signs: Vec3) -> Vec2 {
    let Vec3 { x, y: _, z } = p / p.dot(signs);
    if signs.y > 0.0 { Vec2::new(x, z) } else { Vec2::new(signs.x * (1.0 - signs.z * z), signs.z * (1.0 - signs.x * x)) }
}

/// The unit direction of a place in [0, 1]².
pub fn decode(place: Vec2) -> Vec3 {
    let p = place * 2.0 - 1.0;
    let y = 1.0 - p.x.abs() - p.y.abs();
    let fold = (-y).max(0.0);
    Vec3::new(p.x - fold.copysign(p.x), y, p.y - fold.copysign(p.y)).normalize()
}

/// The unit direction of the middle of texel `i` of an n x n map, rows from the top.
pub fn middle(i: usize, n: usize) -> Vec3 {
    decode((Vec2::new((i % n) as f32, (i / n) as f32) + 0.5) / n as f32)
}

/// A unit direction in four bytes, to 4e-5 radians.
pub fn pack(d: Vec3) -> u32 {
    let [x, y] = (encode(d) * 65535.0).round().to_array().map(|v| v as u32);
    x | y << 16
}

/// What [`pack`] made.
pub fn unpack(bits: u32) -> Vec3 {
    decode(Vec2::new((bits & 0xffff) as f32, (bits >> 16) as f32) / 65535.0)
}

/// The texel that stands at (x, y) of an n x n map, also beyond its edges: there the map goes on mirrored at the edge's middle.
pub fn wrapped(at: IVec2, n: i32) -> usize {
    let mut p = at;
    for axis in 0..2 {
        let other = 1 - axis;
        if p[axis] < 0 || p[axis] >= n {
            p[axis] = (if p[axis] < 0 { -1 - p[axis] } else { 2 * n - 1 - p[axis] }).clamp(0, n - 1);
            p[other] = n - 1 - p[other];
        }
    }
    let p = p.clamp(IVec2::ZERO, IVec2::splat(n - 1));
    (p.y * n + p.x) as usize
}

/// The four texels about a direction in an n x n map, across its seams, and their weights.
pub fn taps(d: Vec3, n: usize) -> [(usize, f32); 4] {
    let at = encode(d) * n as f32 - 0.5;
    let (low, f) = (at.floor(), at - at.floor());
    let tap = |x: i32, y: i32| {
        let weight = (if x == 1 { f.x } else { 1.0 - f.x }) * (if y == 1 { f.y } else { 1.0 - f.y });
        (wrapped(low.as_ivec2() + IVec2::new(x, y), n as i32), weight)
    };
    [tap(0, 0), tap(1, 0), tap(0, 1), tap(1, 1)]
}

/// Solid angle of texel (x, y) of an n x n map, steradians: its density at the middle.
pub fn solid_angle(x: usize, y: usize, n: usize) -> f32 {
    let p = (Vec2::new(x as f32, y as f32) + 0.5) / n as f32;
    let d = decode(p);
    // The octahedron's face is the plane |x| + |y| + |z| = 1; seen from the middle it is foreshortened and farther by 1 / |d|₁.
    let sum = d.abs().element_sum();
    let side = 2.0 / n as f32;
    side * side * sum * sum * sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f32::consts::PI;

    #[test]
    fn directions_round_trip_and_texels_fill_the_sphere() {
        let n = 32;
        let mut sum = 0.0;
        for (x, y) in (0..n).flat_map(|y| (0..n).map(move |x| (x, y))) {
            let place = (Vec2::new(x as f32, y as f32) + 0.5) / n as f32;
            assert!((encode(decode(place) * 3.0) - place).abs().max_element() < 1e-6, "{place}");
            sum += solid_angle(x, y, n);
        }
        assert!((sum - 4.0 * PI).abs() < 0.01, "{sum}");
        for d in [Vec3::X, Vec3::Y, Vec3::Z, -Vec3::X, -Vec3::Y, -Vec3::Z, Vec3::new(1.0, -1.0, 0.0).normalize()] {
            assert!((decode(encode(d)) - d).length() < 1e-6, "{d}");
            assert!((unpack(pack(d)) - d).length() < 5e-5, "{d}");
        }
    }

    /// A texel beyond an edge is the one that lies there on the sphere.
    #[test]
    fn edges_meet_their_mirror_images() {
        let n = 16;
        let direction = |i: usize| middle(i, n as usize);
        for k in 0..n {
            for (inside, outside) in [
                (IVec2::new(k, 0), IVec2::new(k, -1)),
                (IVec2::new(k, n - 1), IVec2::new(k, n)),
                (IVec2::new(0, k), IVec2::new(-1, k)),
                (IVec2::new(n - 1, k), IVec2::new(n, k)),
            ] {
                let angle = direction(wrapped(inside, n)).angle_between(direction(wrapped(outside, n)));
                // No texel is longer than those in the middle of the octahedron's faces.
                assert!(angle < 2.0 * 6f32.sqrt() / n as f32, "{inside} and {outside} are {angle} apart");
            }
        }
        assert_eq!(wrapped(IVec2::new(-1, -1), n), 255);
    }

    #[test]
    fn a_line_is_straight_within_an_octant() {
        let (a, b) = (Vec3::new(0.2, -0.3, 0.9), Vec3::new(0.7, -1.4, 0.1));
        let [p, q, r] = [0.0, 0.4, 1.0].map(|t| encode(a + (b - a) * t));
        assert!((q - p).perp_dot(r - p).abs() < 1e-6);
    }
}
