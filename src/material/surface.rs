//! A point on a surface, with all that a scattering model asks for.

use crate::base::math::Basis;
use crate::base::ray::Ray;
use glam::{Vec2, Vec3};

/// Half an ulp of 1: the relative rounding error of one operation.
const EPSILON: f32 = f32::EPSILON / 2.0;

/// How far off its surface a ray starts, in rounding errors of the largest coordinate of the point and of the triangle's
/// corners. Interpolation and intersection lose about 10 of the latter together. *Ours*: Mitsuba moves by 1500 of
/// (1 + largest coordinate), which depends on the unit of length and lets light under the feet of furniture.
pub(crate) const OFFSET_ULPS: (f32, f32) = (256.0, 32.0);

/// How much of its length a shadow ray leaves out before its target, where grazing light magnifies rounding errors.
pub(crate) const SHADOW_GAP: f32 = 3e-4;

/// A point on a surface with all that a BSDF asks for.
#[derive(Debug, Clone, Copy)]
pub struct Surface {
    /// World position (from the barycentrics, not from the ray).
    pub p: Vec3,
    /// Unit geometric normal, as the winding says; it need not face the viewer.
    pub ng: Vec3,
    /// Shading frame: `n` interpolated (or `ng` for face normals), `s` along `dp_du`.
    pub frame: Basis,
    /// Texture coordinate; the barycentrics where the object has none.
    pub uv: Vec2,
    /// Change of position with u.
    pub dp_du: Vec3,
    /// Change of position with v.
    pub dp_dv: Vec3,
    /// Distance along the ray.
    pub t: f32,
    /// Triangle index.
    pub triangle: u32,
    /// Barycentric weights of the second and third vertex.
    pub barycentric: Vec2,
    /// Object index.
    pub object: u32,
    /// Material index.
    pub material: u32,
    /// Emitter index.
    pub emitter: Option<u32>,
    /// How far along `ng` a ray must start not to meet this surface again.
    pub offset: f32,
}

/// How far along its normal a ray must start that leaves the point `p` of a triangle whose corners' largest coordinate is `extent`.
pub(crate) fn ray_offset(p: Vec3, extent: f32) -> f32 {
    EPSILON * (OFFSET_ULPS.0 * p.abs().max_element()).max(OFFSET_ULPS.1 * extent)
}

impl Surface {
    /// A point with unit normal `n` of something flat that belongs to no scene: what a model can be asked about by itself.
    pub fn flat(p: Vec3, n: Vec3) -> Self {
        let frame = Basis::from_normal(n);
        Self {
            p,
            ng: n,
            frame,
            uv: Vec2::ZERO,
            dp_du: frame.s,
            dp_dv: frame.t,
            t: 1.0,
            triangle: 0,
            barycentric: Vec2::ZERO,
            object: 0,
            material: 0,
            emitter: None,
            offset: 0.0,
        }
    }

    /// The shading normal, turned to the side of the viewer at direction `wo` (unit, away from the surface).
    ///
    /// Interpolated normals can turn away from a viewer who sees the surface at a grazing angle;
    /// the geometric normal then stands in, as no mirror shows its back.
    pub fn facing_normal(&self, wo: Vec3) -> Vec3 {
        let ng = if self.ng.dot(wo) < 0.0 { -self.ng } else { self.ng };
        let n = if self.frame.n.dot(ng) < 0.0 { -self.frame.n } else { self.frame.n };
        if n.dot(wo) > 0.0 { n } else { ng }
    }

    /// The point just off the surface on the side of `d`.
    fn origin(&self, d: Vec3) -> Vec3 {
        self.p + self.ng * self.offset.copysign(self.ng.dot(d))
    }

    /// A ray that leaves along the unit direction `d` and does not meet its own surface again.
    pub fn spawn(&self, d: Vec3) -> Ray {
        Ray::new(self.origin(d), d)
    }

    /// A ray from here to `target` that ends just before it. Empty (t_max below t_min) where they touch.
    pub fn spawn_to(&self, target: Vec3) -> Ray {
        let o = self.origin(target - self.p);
        let distance = o.distance(target);
        let gap = distance * SHADOW_GAP + EPSILON * OFFSET_ULPS.0 * target.abs().max_element();
        Ray { o, d: (target - o) / distance.max(f32::MIN_POSITIVE), t_min: 0.0, t_max: distance - gap }
    }
}
