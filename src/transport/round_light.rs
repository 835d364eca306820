//! Lamps that are round shapes: each is one emitter of the [`super::light_tree`], not thousands of triangles.
//!
//! From outside, a sphere's points are drawn evenly over the solid angle in which it is seen (Shirley, Wang and Zimmerman 1996); where
//! an uneven scale has made it an ellipsoid, that is done in its own space, in which it is a sphere, and the density is carried over.
//! From inside, and for cylinders and disks, points are drawn evenly by area.

use super::light_sample::LightSample;
use super::light_tree::LightBounds;
use crate::material::Texture;
use crate::scene::Round;
use crate::scene::round::{RoundKind, RoundPoint};
use glam::{DVec3, Vec2, Vec3};
use std::f32::consts::{FRAC_PI_2, PI};
use std::f64::consts::TAU;

/// How far outside of a unit sphere, at least, its cone is sampled.
const LEAST_HEIGHT: f64 = 1e-6;

/// Cosine of half the angle of the cone in which the unit sphere is seen from the squared distance `d2`, less than one by this.
fn cone(d2: f64) -> f64 {
    let sin2 = 1.0 / d2;
    sin2 / (1.0 + (1.0 - sin2).max(0.0).sqrt())
}

/// The cone's receiver in the sphere's own space; `None` where points are drawn by area.
fn outside(round: &Round, p: Vec3) -> Option<DVec3> {
    let local = round.to_local.transform_point3(p.as_dvec3());
    let far = local.length_squared() > 1.0 + 2.0 * LEAST_HEIGHT;
    (round.kind == RoundKind::Sphere && !round.inwards && far).then_some(local)
}

/// Density by solid angle in the world of the direction `wi` that is one of the cone's in the sphere's own space.
fn cone_pdf(round: &Round, local: DVec3, wi: DVec3) -> f64 {
    let own = round.to_local.matrix3 * wi;
    let carried = round.to_local.matrix3.determinant().abs() / own.length().powi(3);
    carried / (TAU * cone(local.length_squared()))
}

/// Density by solid angle, seen from `p`, of points drawn evenly by the area of the shape's own space.
fn area_pdf(round: &Round, p: DVec3, at: DVec3, own_normal: DVec3) -> f64 {
    let to_light = at - p;
    let cos = round.normal(own_normal).dot(to_light).abs() / to_light.length();
    let area = round.kind.area(&glam::DMat3::IDENTITY) * round.stretch(own_normal);
    if cos > 0.0 { to_light.length_squared() / (area * cos) } else { 0.0 }
}

/// What the light tree knows of a lamp of mean luminance `mean`.
pub(crate) fn bounds(round: &Round, mean: f32) -> LightBounds {
    let (axis, spread) = match round.kind {
        RoundKind::Disk => (round.normal(DVec3::Z).as_vec3(), 0.0),
        RoundKind::Sphere | RoundKind::Cylinder => (Vec3::Z, PI),
    };
    let corners = round.bounds().map(|p| p.as_vec3());
    LightBounds { corners, axis, spread, reach: FRAC_PI_2, power: mean * round.area() as f32 }
}

/// A direction from `p` to a lamp that is chosen with `probability`.
#[cold]
#[inline(never)]
pub(crate) fn sample(round: &Round, radiance: &Texture, p: Vec3, probability: f32, v: Vec2) -> Option<LightSample> {
    let from = p.as_dvec3();
    let (x, y) = (f64::from(v.x), f64::from(v.y));
    let local = outside(round, p);
    let at: RoundPoint = match local {
        Some(local) => round.nearest(cone_point(local, x, y)),
        None => round.uniform(x, y),
    };
    let point = round.to_world.transform_point3(at.p);
    let wi = (point - from).try_normalize()?;
    if round.normal(at.n).dot(wi) >= 0.0 {
        return None;
    }
    let pdf = match local {
        Some(local) => cone_pdf(round, local, wi),
        None => area_pdf(round, from, point, at.n),
    };
    let pdf = pdf as f32 * probability;
    let weight = radiance.eval(at.uv.as_vec2()) / pdf;
    let distance = from.distance(point) as f32;
    (pdf > 0.0).then_some(LightSample { wi: wi.as_vec3(), distance, point: point.as_vec3(), weight, pdf, delta: false })
}

/// Density by solid angle with which [`sample`] finds the point `at` of the lamp from `p`, its choice left out.
#[cold]
#[inline(never)]
pub(crate) fn pdf(round: &Round, p: Vec3, at: Vec3) -> f32 {
    let (from, at) = (p.as_dvec3(), at.as_dvec3());
    let pdf = match (outside(round, p), (at - from).try_normalize()) {
        (Some(local), Some(wi)) => cone_pdf(round, local, wi),
        (None, Some(_)) => area_pdf(round, from, at, round.nearest(round.to_local.transform_point3(at)).n),
        (_, None) => 0.0,
    };
    pdf as f32
}

/// The point of the unit sphere in direction (x, y) of the cone in which it is seen from `from`.
fn cone_point(from: DVec3, x: f64, y: f64) -> DVec3 {
    let d2 = from.length_squared();
    // 1 - cos θ, without the difference of two numbers that are nearly equal.
    let height = x * cone(d2);
    let sin2 = height * (2.0 - height);
    let to_centre = -from / d2.sqrt();
    let (s, t) = to_centre.any_orthonormal_pair();
    let (sin_phi, cos_phi) = (y * TAU).sin_cos();
    let d = to_centre * (1.0 - height) + (s * cos_phi + t * sin_phi) * sin2.sqrt();
    let distance = d2.sqrt() * (1.0 - height) - (1.0 - d2 * sin2).max(0.0).sqrt();
    from + d * distance
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::math::Rgb;
    use crate::transport::Sampler;
    use glam::{DAffine3, DQuat};

    fn shape(kind: RoundKind, scale: DVec3, inwards: bool) -> Round {
        let turn = DQuat::from_rotation_x(0.7) * DQuat::from_rotation_z(0.3);
        let to_world = DAffine3::from_scale_rotation_translation(scale, turn, DVec3::new(0.5, -0.2, 1.0));
        let [first, object] = [0; 2];
        Round { kind, to_world, to_local: to_world.inverse(), inwards, object, first, turned: false, cells: [8, 4] }
    }

    /// The mean of 1 / pdf over the samples is the solid angle in which the shape's front is seen: here from a sum over
    /// directions, half a million of them.
    #[test]
    fn samples_cover_what_is_seen_with_the_density_they_tell() {
        let even = DVec3::splat(0.6);
        let uneven = DVec3::new(0.3, 1.1, 0.6);
        let (far, near, inside) = (Vec3::new(2.0, 1.0, -1.0), Vec3::new(0.5, -0.2, 1.63), Vec3::new(0.6, -0.1, 1.05));
        let cases = [
            (RoundKind::Sphere, even, false, far),
            (RoundKind::Sphere, even, false, near),
            (RoundKind::Sphere, even, true, inside),
            (RoundKind::Sphere, uneven, false, far),
            (RoundKind::Cylinder, even, false, far),
            (RoundKind::Cylinder, uneven, true, inside),
            (RoundKind::Disk, uneven, false, far),
            (RoundKind::Disk, uneven, true, far),
        ];
        let front = |round: &Round, p: Vec3, d: Vec3| {
            let t = round.meets(p, d).into_iter().find(|&t| t > 1e-9)?;
            let at = p.as_dvec3() + d.as_dvec3() * t;
            let n = round.normal(round.nearest(round.to_local.transform_point3(at)).n);
            (n.dot(d.as_dvec3()) < 0.0).then_some(at.as_vec3())
        };
        for (kind, scale, inwards, p) in cases {
            let round = shape(kind, scale, inwards);
            const N: u32 = 1 << 19;
            let (mut seen, mut told, mut pdfs) = (0.0, 0.0, 0.0);
            for i in 0..N {
                let v = Sampler::new(5, i).next_2d();
                let z = 1.0 - 2.0 * v.y;
                let r = (1.0 - z * z).max(0.0).sqrt();
                let d = Vec3::new(r * (v.x * 2.0 * PI).cos(), r * (v.x * 2.0 * PI).sin(), z);
                if let Some(at) = front(&round, p, d) {
                    seen += 4.0 * f64::from(PI) / f64::from(N);
                    pdfs += 4.0 * f64::from(PI) / f64::from(N) * f64::from(pdf(&round, p, at));
                }
                let Some(s) = sample(&round, &Texture::Constant(Rgb::ONE), p, 1.0, v) else { continue };
                // A point behind another of the same shape is the shadow ray's business.
                let first = front(&round, p, s.wi).is_some_and(|at| at.distance(s.point) < 1e-3);
                if first {
                    told += f64::from(s.weight.x) / f64::from(N);
                }
                let again = pdf(&round, p, s.point);
                assert!((again / s.pdf - 1.0).abs() < 1e-2, "{kind:?} {scale} from {p}: {} and {again}", s.pdf);
            }
            // Two standard errors of as many independent directions as have met the shape; scrambled Sobol points do better.
            let hits = seen / (4.0 * f64::from(PI)) * f64::from(N);
            let is_right = if seen == 0.0 { told == 0.0 } else { (told / seen - 1.0).abs() < 2.0 / hits.sqrt() + 1e-3 };
            assert!(is_right, "{kind:?} {scale} from {p}: {told}, {seen} sr are seen");
            assert!(
                kind != RoundKind::Sphere || inwards || (pdfs - 1.0).abs() < 4e-3,
                "{kind:?} {scale}: density sums to {pdfs}"
            );
        }
    }
}
