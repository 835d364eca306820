//! The inverse of a deformed lat-long mesh at probe resolution: rasterises the mesh with the original vertex positions as
//! colours (§4.2.2, Fig. 4i).
//!
//! *Ours*: each quad is inverted exactly as the bilinear patch it is, not as two triangles, so that the inverse is that of
//! [`crate::probe::parameter_map::ParameterMap::forward_at`] to rounding, whichever way a diagonal would have run.

use super::parameter_map::quads;
use glam::{DVec2, Vec2};

/// How far a texel's centre may lie outside a quad, in quad coordinates, and still count as in it: rounding alone.
const EDGE_TOLERANCE: f64 = 1e-6;

/// Lat-long coordinates and their derivatives at texel centres, rows from the top.
pub struct InverseMap {
    /// Lat-long coordinate; u unwrapped so that it stays near the texel's own u.
    pub lat_long: Vec<Vec2>,
    /// Lengths of ∂f⁻¹/∂x and ∂f⁻¹/∂y, lat-long texels of the probe's size per texel.
    pub derivative: Vec<Vec2>,
}

/// Inverts a mesh (see [`crate::probe::parameter_map::ParameterMap`]) none of whose quads is flipped.
pub fn invert(mesh: [u32; 2], forward: &[Vec2], size: [u32; 2]) -> InverseMap {
    let scale = DVec2::new(f64::from(size[0]), f64::from(size[1]));
    let quad_size = DVec2::new(f64::from(mesh[0]), f64::from(mesh[1])).recip();
    let (w, h) = (size[0] as i64, size[1] as i64);
    let mut lat_long = vec![Vec2::NAN; (w * h) as usize];
    let mut derivative = vec![Vec2::ONE; (w * h) as usize];
    for (index, quad) in quads(mesh).enumerate() {
        let corner = DVec2::new((index as u32 % mesh[0]) as f64, (index as u32 / mesh[0]) as f64);
        let patch = Bilinear::new(quad.map(|i| forward[i].as_dvec2() * scale));
        let (lo, hi) = (patch.lower - 0.5 - EDGE_TOLERANCE, patch.upper - 0.5 + EDGE_TOLERANCE);
        for y in (lo.y.ceil() as i64).max(0)..=(hi.y.floor() as i64).min(h - 1) {
            for x in lo.x.ceil() as i64..=hi.x.floor() as i64 {
                let Some(st) = patch.invert(DVec2::new(x as f64, y as f64) + 0.5) else { continue };
                let texel = (y * w + x.rem_euclid(w)) as usize;
                let turn = x.div_euclid(w) as f64;
                lat_long[texel] = ((corner + st) * quad_size - DVec2::new(turn, 0.0)).as_vec2();
                derivative[texel] = patch.inverse_derivative(st, quad_size * scale).as_vec2();
            }
        }
    }
    debug_assert!(lat_long.iter().all(|p| p.is_finite()), "the mesh covers every texel");
    for i in 0..lat_long.len() {
        if !lat_long[i].is_finite() {
            // Cannot happen but by rounding: the neighbour is then right to rounding.
            lat_long[i] = if i > 0 { lat_long[i - 1] } else { Vec2::ZERO };
        }
    }
    InverseMap { lat_long, derivative }
}

/// The patch a + s e + t f + s t g, s and t in [0, 1].
struct Bilinear {
    a: DVec2,
    e: DVec2,
    f: DVec2,
    g: DVec2,
    lower: DVec2,
    upper: DVec2,
}

impl Bilinear {
    /// Corners at (s, t) = (0, 0), (1, 0), (1, 1), (0, 1), convex and in this sense of rotation.
    fn new([a, b, c, d]: [DVec2; 4]) -> Self {
        let lower = a.min(b).min(c).min(d);
        let upper = a.max(b).max(c).max(d);
        Self { a, e: b - a, f: d - a, g: a - b + c - d, lower, upper }
    }

    /// (s, t) of a point, `None` outside.
    ///
    /// t solves (h − f t) × (e + g t) = 0 with h = p − a. The slope of that quadratic at the solution is the patch's
    /// Jacobian, positive inside, which tells the wanted root from the other.
    fn invert(&self, p: DVec2) -> Option<DVec2> {
        let h = p - self.a;
        let k0 = h.perp_dot(self.e);
        let k1 = h.perp_dot(self.g) + self.e.perp_dot(self.f);
        let k2 = self.g.perp_dot(self.f);
        let root = (k1 * k1 - 4.0 * k0 * k2).max(0.0).sqrt();
        // Both forms are the same root; each cancels where the other does not.
        let t = if k1 >= 0.0 { -2.0 * k0 / (k1 + root) } else { (root - k1) / (2.0 * k2) };
        let (along, rest) = (self.e + self.g * t, h - self.f * t);
        let s = rest.dot(along) / along.length_squared();
        let st = DVec2::new(s, t);
        let inside = st.cmpge(DVec2::splat(-EDGE_TOLERANCE)).all() && st.cmple(DVec2::splat(1.0 + EDGE_TOLERANCE)).all();
        inside.then(|| st.clamp(DVec2::ZERO, DVec2::ONE))
    }

    /// Lengths of the inverse's derivatives by x and by y, with (s, t) measured in `unit`.
    fn inverse_derivative(&self, st: DVec2, unit: DVec2) -> DVec2 {
        let (ds, dt) = (self.e + self.g * st.y, self.f + self.g * st.x);
        let det = ds.perp_dot(dt);
        let by_x = DVec2::new(dt.y, -ds.y) / det * unit;
        let by_y = DVec2::new(-dt.x, ds.x) / det * unit;
        DVec2::new(by_x.length(), by_y.length())
    }
}
