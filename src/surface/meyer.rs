//! Principal curvatures at one vertex of a triangle mesh.
//!
//! Meyer, Desbrun, Schröder, Barr 2003: the mean curvature from the cotangent Laplacian over the mixed area A,
//! the Gaussian curvature from the angle that is missing about the vertex,
//!   2 kH n = 1/(2A) Σ (cot α + cot β)(x - x_j),   kG = (2π - Σ θ) / A,   k = kH ± √(kH² - kG),
//! and the directions from the tensor with trace 2 kH that fits the normal curvatures of the edges, k_j = 2 (x - x_j)·n / |x - x_j|².
//! *Ours*: a ring that is plane to within rounding has curvature 0 exactly; |k| is at most twice the largest |k_j|
//! (noise in the missing angle of slivers knows no bound); edge weights of obtuse triangles are not let below 0.
//!
//! [`from_normals`] is for vertices without a whole ring (*Ours*): the tensor that turns the vertex normals along the edges
//! of the triangles about it (Rusinkiewicz 2004). It sees curvature where a strip of quads has no inner vertex.

use super::paraboloid::Curvature;
use crate::base::math::Basis;
use glam::{DVec3, Vec3};
use std::f64::consts::TAU;

/// Heights over the tangent plane below this many times |x| are rounding of the file's floats.
const POSITION_ROUNDING: f64 = 1e-6;
/// Heights below this fraction of the edge's length count as plane too: a radius of 50,000 edges.
const SLOPE_ROUNDING: f64 = 1e-5;

/// Curvature of the closed ring about `p`. `ring` holds (next, previous) neighbours of each triangle in winding order.
pub fn curvature(p: Vec3, normal: Vec3, ring: &[(Vec3, Vec3)]) -> Curvature {
    let n = normal.as_dvec3();
    let frame = Basis::from_normal(normal);
    let (s, t) = (frame.s.as_dvec3(), frame.t.as_dvec3());
    let mut laplacian = DVec3::ZERO;
    let (mut area, mut angle, mut largest) = (0.0, 0.0, 0.0f64);
    // Normal curvature against direction: weights, and weighted moments of cos 2φ, sin 2φ and k.
    let mut edges: Vec<(f64, f64, f64, f64)> = Vec::with_capacity(ring.len() * 2);
    let facet = ring.iter().fold(DVec3::ZERO, |sum, &(a, b)| {
        let (a, b) = (a.as_dvec3() - p.as_dvec3(), b.as_dvec3() - p.as_dvec3());
        sum + a.cross(b)
    });
    let facet = facet.normalize_or_zero();
    let mut flat = true;
    for &(a, b) in ring {
        let (a, b) = (a.as_dvec3() - p.as_dvec3(), b.as_dvec3() - p.as_dvec3());
        flat &= a.dot(facet).abs() <= POSITION_ROUNDING * p.as_dvec3().abs().max_element() + SLOPE_ROUNDING * a.length();
        let double = a.cross(b).length();
        if double <= 0.0 {
            continue;
        }
        let (aa, bb, ab) = (a.length_squared(), b.length_squared(), a.dot(b));
        let cot_a = (aa - ab) / double;
        let cot_b = (bb - ab) / double;
        angle += double.atan2(ab);
        laplacian -= a * cot_b + b * cot_a;
        area += if ab < 0.0 {
            double / 4.0
        } else if cot_a < 0.0 || cot_b < 0.0 {
            double / 8.0
        } else {
            (aa * cot_b + bb * cot_a) / 8.0
        };
        for (e, ee, weight) in [(a, aa, (aa * cot_b).max(0.0)), (b, bb, (bb * cot_a).max(0.0))] {
            let (x, y) = (e.dot(s), e.dot(t));
            let rr = x * x + y * y;
            if rr > 0.0 {
                let k = -2.0 * e.dot(n) / ee;
                largest = largest.max(k.abs());
                edges.push((weight, (x * x - y * y) / rr, 2.0 * x * y / rr, k));
            }
        }
    }
    if flat || area <= 0.0 {
        return Curvature::plane(normal);
    }
    let mean = laplacian.dot(n) / (4.0 * area);
    let gauss = (TAU - angle) / area;
    let radius = (mean * mean - gauss).max(0.0).sqrt();
    let (mut cc, mut cs, mut ss, mut ck, mut sk) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for (w, c, s, k) in edges {
        cc += w * c * c;
        cs += w * c * s;
        ss += w * s * s;
        ck += w * c * (k - mean);
        sk += w * s * (k - mean);
    }
    let det = cc * ss - cs * cs;
    let (x, y) =
        if det > 1e-9 * (cc + ss) * (cc + ss) { ((ck * ss - sk * cs) / det, (sk * cc - ck * cs) / det) } else { (1.0, 0.0) };
    let phi = if x == 0.0 && y == 0.0 { 0.0 } else { 0.5 * y.atan2(x) };
    let limit = 2.0 * largest;
    let bounded = |k: f64| if k.is_finite() { k.clamp(-limit, limit) as f32 } else { 0.0 };
    let d1 = (s * phi.cos() + t * phi.sin()).as_vec3();
    Curvature { k1: bounded(mean + radius), k2: bounded(mean - radius), d1, d2: normal.cross(d1) }
}

/// Curvature about `p` from the normals alone, least squares over the edges of all triangles about it.
/// Each triangle is three (position, normal) pairs.
pub fn from_normals(normal: Vec3, triangles: impl Iterator<Item = [(Vec3, Vec3); 3]>) -> Curvature {
    let frame = Basis::from_normal(normal);
    // Normal equations for the tensor [xx, xy, yy], turning e = (x, y) into Δn = (xx x + xy y, xy x + yy y).
    let mut m = glam::DMat3::ZERO;
    let mut r = DVec3::ZERO;
    for corners in triangles {
        for i in 0..3 {
            let ((pa, na), (pb, nb)) = (corners[i], corners[(i + 1) % 3]);
            let (e, dn) = (frame.to_local(pb - pa).as_dvec3(), frame.to_local(nb - na).as_dvec3());
            let rows = [(DVec3::new(e.x, e.y, 0.0), dn.x), (DVec3::new(0.0, e.x, e.y), dn.y)];
            for (row, value) in rows {
                m += glam::DMat3::from_cols(row * row.x, row * row.y, row * row.z);
                r += row * value;
            }
        }
    }
    let scale = m.x_axis.x + m.y_axis.y + m.z_axis.z;
    if r == DVec3::ZERO || m.determinant() <= 1e-12 * scale.powi(3) {
        return Curvature::plane(normal);
    }
    let k = (m.inverse() * r).as_vec3();
    if k.is_finite() { Curvature::from_tensor(&frame, k.to_array()) } else { Curvature::plane(normal) }
}
