//! The differential geometry of a hit, as Mitsuba's meshes have it.

use crate::base::math::Frame;
use crate::base::ray::{Hit, Ray};
use crate::scene::Geometry;
use crate::scene::normals::unit_normal;
use glam::{Vec2, Vec3};
use std::num::NonZeroU32;

/// Half an ulp of 1: the relative rounding error of one operation.
const EPSILON: f32 = f32::EPSILON / 2.0;

/// How far off its surface a ray starts, in rounding errors of the largest coordinate of the point and of the triangle's
/// corners. Interpolation and intersection lose about 10 of the latter together. Ours: Mitsuba moves by 1500 of
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
    pub frame: Frame,
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

/// Texture coordinate of a hit; the barycentrics where the object has none.
pub fn uv_at(geometry: &Geometry, hit: &Hit) -> Vec2 {
    if !geometry.object(hit.triangle).has_uvs {
        return Vec2::new(hit.u, hit.v);
    }
    let [a, b, c] = geometry.triangles[hit.triangle as usize].map(|i| geometry.uvs[i as usize]);
    a * (1.0 - hit.u - hit.v) + b * hit.u + c * hit.v
}

/// All of a triangle that a [`Surface`] is made of, in two lines of the cache: rays without order wait for memory, and the
/// scene's own arrays would make them wait for ten.
#[derive(Debug, Clone, Copy)]
#[repr(C, align(128))]
pub struct Facet {
    pub(crate) corners: [Vec3; 3],
    /// Unit shading normals of the corners; `ng` thrice for face normals.
    pub(crate) normals: [Vec3; 3],
    pub(crate) uvs: [Vec2; 3],
    pub(crate) ng: Vec3,
    pub(crate) object: u32,
    pub(crate) material: u32,
    pub(crate) emitter: Option<NonZeroU32>,
    /// Largest coordinate of the corners; negative where the object has no texture coordinates.
    pub(crate) extent: f32,
}

impl Facet {
    /// The facet of a triangle.
    pub fn new(geometry: &Geometry, triangle: u32) -> Self {
        let object_index = geometry.triangle_object[triangle as usize];
        let object = &geometry.objects[object_index as usize];
        let vertices = geometry.triangles[triangle as usize].map(|i| i as usize);
        let corners = geometry.corners(triangle);
        let ng = unit_normal(corners).unwrap_or(Vec3::Z);
        let extent = corners.iter().fold(0f32, |m, p| m.max(p.abs().max_element()));
        Self {
            corners,
            normals: if object.face_normals { [ng; 3] } else { vertices.map(|i| geometry.normals[i]) },
            uvs: vertices.map(|i| geometry.uvs[i]),
            ng,
            object: object_index,
            material: object.material,
            emitter: object.emitter.and_then(|e| NonZeroU32::new(e + 1)),
            extent: if object.has_uvs { extent } else { -extent },
        }
    }

    /// The surface that `hit`, of this triangle, lies on.
    pub fn surface(&self, hit: &Hit) -> Surface {
        let [a, b, c] = self.corners;
        let ([na, nb, nc], [ta, tb, tc]) = (self.normals, self.uvs);
        let w = 1.0 - hit.u - hit.v;
        let p = a * w + b * hit.u + c * hit.v;
        let n = (na * w + nb * hit.u + nc * hit.v).try_normalize().unwrap_or(self.ng);
        let tangents = || {
            let ((e, f), (g, h)) = ((b - a, c - a), (tb - ta, tc - ta));
            let inv = 1.0 / g.perp_dot(h);
            inv.is_finite().then(|| ((e * h.y - f * g.y) * inv, (f * g.x - e * h.x) * inv))
        };
        let has_uvs = self.extent.is_sign_positive();
        let (dp_du, dp_dv) = has_uvs.then(tangents).flatten().unwrap_or_else(|| {
            let frame = Frame::from_normal(self.ng);
            (frame.s, frame.t)
        });
        Surface {
            p,
            ng: self.ng,
            frame: Frame::from_normal_and_tangent(n, dp_du),
            uv: if has_uvs { ta * w + tb * hit.u + tc * hit.v } else { Vec2::new(hit.u, hit.v) },
            dp_du,
            dp_dv,
            t: hit.t,
            triangle: hit.triangle,
            barycentric: Vec2::new(hit.u, hit.v),
            object: self.object,
            material: self.material,
            emitter: self.emitter.map(|e| e.get() - 1),
            offset: EPSILON * (OFFSET_ULPS.0 * p.abs().max_element()).max(OFFSET_ULPS.1 * self.extent.abs()),
        }
    }
}

impl Surface {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::mesh::Mesh;
    use crate::scene::{Scene, mesh as shapes};
    use crate::transport::bvh::Bvh;
    use glam::Mat4;

    fn surface(scene: &Scene, hit: &Hit) -> Surface {
        Facet::new(&scene.geometry, hit.triangle).surface(hit)
    }

    /// A quad from (0, 0) to (1, 1) with skewed texture coordinates, as Mitsuba reads it from an OBJ.
    fn quad(normals: bool, m: Mat4, flip: bool) -> Scene {
        let mesh = Mesh {
            positions: [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]].map(Vec3::from).to_vec(),
            normals: if normals { vec![Vec3::Z; 4] } else { vec![] },
            uvs: [[0.1, 0.8], [0.9, 0.7], [0.8, 0.3], [0.1, 0.05]].map(Vec2::from).to_vec(),
            triangles: vec![[0, 1, 2], [0, 2, 3]],
        };
        let mut scene = Scene::default();
        shapes::append(&mut scene.geometry, mesh, m, flip, false, String::new(), 0, None);
        scene
    }

    /// Against `ray_intersect` of Mitsuba 3.9.1 from (0.3, 0.2, 5) straight down, plain, mirrored and flipped.
    #[test]
    fn frames_are_those_of_mitsuba() {
        let mirror = Mat4::from_scale(Vec3::new(-1.0, 1.0, 1.0));
        let id = Mat4::IDENTITY;
        let (q, r) = (0.970_143, 0.242_536);
        let cases = [
            (false, id, false, [0.0, 0.0, 1.0], [q, -r, 0.0], [r, q, 0.0]),
            (true, id, false, [0.0, 0.0, 1.0], [q, -r, 0.0], [r, q, 0.0]),
            (false, mirror, false, [0.0, 0.0, -1.0], [-q, -r, 0.0], [-r, q, 0.0]),
            (true, mirror, false, [0.0, 0.0, 1.0], [-q, -r, 0.0], [r, -q, 0.0]),
            (false, mirror, true, [0.0, 0.0, 1.0], [-q, -r, 0.0], [r, -q, 0.0]),
            (true, mirror, true, [0.0, 0.0, -1.0], [-q, -r, 0.0], [-r, q, 0.0]),
            (true, id, true, [0.0, 0.0, -1.0], [q, -r, 0.0], [-r, -q, 0.0]),
        ];
        for (normals, m, flip, n, s, t) in cases {
            let scene = quad(normals, m, flip);
            let x = if m == mirror { -1.0 } else { 1.0 };
            let ray = Ray::new(Vec3::new(0.3 * x, 0.2, 5.0), Vec3::NEG_Z);
            let hit = Bvh::build(&scene, &|_| true).closest(&scene, &ray).unwrap();
            let found = surface(&scene, &hit);
            let near = |a: Vec3, b: [f32; 3]| (a - Vec3::from(b)).length() < 1e-5;
            assert!(near(found.frame.n, n) && near(found.frame.s, s) && near(found.frame.t, t), "{:?}", found.frame);
            assert!(near(found.ng, n) && near(found.p, [0.3 * x, 0.2, 0.0]) && (found.t - 5.0).abs() < 1e-6);
            assert!((found.uv - Vec2::new(0.32, 0.69)).length() < 1e-6, "{}", found.uv);
            assert!(near(found.dp_du, [1.212_12 * x, -0.303_03, 0.0]), "{}", found.dp_du);
            assert!(near(found.dp_dv, [-0.303_03 * x, -2.424_24, 0.0]), "{}", found.dp_dv);
        }
    }

    #[test]
    fn without_texture_coordinates_the_barycentrics_stand_in() {
        let mut scene = quad(true, Mat4::IDENTITY, false);
        scene.geometry.objects[0].has_uvs = false;
        let found = surface(&scene, &Hit { t: 1.0, triangle: 1, u: 0.25, v: 0.5 });
        assert_eq!(found.uv, Vec2::new(0.25, 0.5));
        assert!((found.dp_du.cross(found.dp_dv) - found.ng).length() < 1e-6);
    }

    #[test]
    fn rays_leave_their_surface_and_stop_before_the_next() {
        // Two spheres, near and far from the origin, small and large.
        for (centre, radius) in
            [(Vec3::ZERO, 1.0), (Vec3::new(80.0, -40.0, 20.0), 0.5), (Vec3::splat(1e-3), 1e-3), (Vec3::X, 1e4)]
        {
            let mut scene = Scene::default();
            let ball = shapes::primitives::sphere(centre, radius);
            shapes::append(&mut scene.geometry, ball, Mat4::IDENTITY, false, false, String::new(), 0, None);
            let bvh = Bvh::build(&scene, &|_| true);
            let mut seen = 0;
            for i in 0..4000u32 {
                let [u, v] = [2 * i, 2 * i + 1].map(|w| crate::base::math::hash_words(&[w]) as f32 / u32::MAX as f32);
                let d = crate::base::math::direction_from_lat_long(Vec2::new(u, v));
                let o = centre - d * (3.0 * radius) + Vec3::new(v, u, 0.5) * radius * 0.3;
                let Some(hit) = bvh.closest(&scene, &Ray::new(o, d)) else { continue };
                let s = surface(&scene, &hit);
                seen += 1;
                // Outwards, at any angle, nothing more is met; inwards, the far side.
                let out = (s.ng + Vec3::new(u - 0.5, v - 0.5, 0.1) * 1.9).normalize();
                if out.dot(s.ng) > 0.02 {
                    assert!(!bvh.occluded(&scene, &s.spawn(out)), "{s:?}");
                }
                let far = bvh.closest(&scene, &s.spawn(d)).unwrap_or_else(|| panic!("no far side of {s:?}"));
                let far = surface(&scene, &far);
                if d.dot(far.ng) > 0.02 && far.p.distance(s.p) > 0.02 * radius {
                    assert!(!bvh.occluded(&scene, &s.spawn_to(far.p)), "{s:?} to {far:?}");
                    assert!(!bvh.occluded(&scene, &far.spawn_to(s.p)), "{far:?} to {s:?}");
                    assert!(bvh.occluded(&scene, &s.spawn_to(far.p + d * radius)), "past the far side");
                }
            }
            assert!(seen > 2000, "{seen}");
        }
    }
}
