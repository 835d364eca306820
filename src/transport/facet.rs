//! The differential geometry of a hit, as Mitsuba's meshes have it.

use crate::base::math::Basis;
use crate::base::ray::Hit;
use crate::material::Surface;
use crate::material::surface::ray_offset;
use crate::scene::normals::unit_normal;
use crate::scene::{Geometry, Round};
use glam::{Vec2, Vec3};
use std::num::NonZeroU32;

/// Texture coordinate of a hit; the barycentrics where the object has none.
pub fn uv_at(geometry: &Geometry, hit: &Hit) -> Vec2 {
    if let Some(round) = geometry.round(hit.triangle) {
        return geometry.rounds[round as usize].uv(hit.triangle, hit.u, hit.v);
    }
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
    /// One more than the index of the round shape that the triangle stands for.
    round: Option<NonZeroU32>,
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
            normals: geometry.shading_normals(triangle, ng),
            uvs: vertices.map(|i| geometry.uvs[i]),
            ng,
            object: object_index,
            material: object.material,
            emitter: object.emitter.and_then(|e| NonZeroU32::new(e + 1)),
            extent: if object.has_uvs { extent } else { -extent },
            round: geometry.round(triangle).and_then(|r| NonZeroU32::new(r + 1)),
        }
    }

    /// The round shape that the triangle stands for.
    pub fn round<'a>(&self, geometry: &'a Geometry) -> Option<&'a Round> {
        self.round.map(|r| &geometry.rounds[r.get() as usize - 1])
    }

    /// Where `hit`, of this triangle, lies: [`Facet::surface`]'s point.
    #[inline]
    pub fn point(&self, hit: &Hit) -> Vec3 {
        let [a, b, c] = self.corners;
        a * (1.0 - hit.u - hit.v) + b * hit.u + c * hit.v
    }

    /// The surface that `hit`, of this triangle, lies on.
    pub fn surface(&self, hit: &Hit) -> Surface {
        let [a, b, c] = self.corners;
        let ([na, nb, nc], [ta, tb, tc]) = (self.normals, self.uvs);
        let w = 1.0 - hit.u - hit.v;
        let p = self.point(hit);
        let n = (na * w + nb * hit.u + nc * hit.v).try_normalize().unwrap_or(self.ng);
        let tangents = || {
            let ((e, f), (g, h)) = ((b - a, c - a), (tb - ta, tc - ta));
            let inv = 1.0 / g.perp_dot(h);
            inv.is_finite().then(|| ((e * h.y - f * g.y) * inv, (f * g.x - e * h.x) * inv))
        };
        let has_uvs = self.extent.is_sign_positive();
        let (dp_du, dp_dv) = has_uvs.then(tangents).flatten().unwrap_or_else(|| {
            let frame = Basis::from_normal(self.ng);
            (frame.s, frame.t)
        });
        Surface {
            p,
            ng: self.ng,
            frame: Basis::from_normal_and_tangent(n, dp_du),
            uv: if has_uvs { ta * w + tb * hit.u + tc * hit.v } else { Vec2::new(hit.u, hit.v) },
            dp_du,
            dp_dv,
            t: hit.t,
            triangle: hit.triangle,
            barycentric: Vec2::new(hit.u, hit.v),
            object: self.object,
            material: self.material,
            emitter: self.emitter.map(|e| e.get() - 1),
            offset: ray_offset(p, self.extent.abs()),
        }
    }

    /// The place on `round`, which the triangle stands for, that `hit` means. Few scenes have any: kept out of line, as all that paths do
    /// for round shapes, so that the way of triangles stays short.
    #[cold]
    #[inline(never)]
    pub fn surface_of(&self, round: &Round, hit: &Hit) -> Surface {
        let at = round.point(hit.triangle, hit.u, hit.v);
        let p = round.to_world.transform_point3(at.p).as_vec3();
        let n = round.normal(at.n).as_vec3();
        let [dp_du, dp_dv] = [at.dp_du, at.dp_dv].map(|d| round.to_world.transform_vector3(d).as_vec3());
        Surface {
            p,
            ng: n,
            frame: Basis::from_normal_and_tangent(n, dp_du),
            uv: at.uv.as_vec2(),
            dp_du,
            dp_dv,
            t: hit.t,
            triangle: hit.triangle,
            barycentric: Vec2::new(hit.u, hit.v),
            object: self.object,
            material: self.material,
            emitter: self.emitter.map(|e| e.get() - 1),
            offset: ray_offset(p, self.extent.abs()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::ray::Ray;
    use crate::scene::mesh::{Mesh, append};
    use crate::scene::{Scene, primitives};
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
        append(scene.geometry_mut(), mesh, m, flip, false, String::new(), 0, None);
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
            let hit = Bvh::build(&scene, &|_| true).closest(&scene, &[], &ray).unwrap();
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
        scene.geometry_mut().objects[0].has_uvs = false;
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
            let ball = primitives::sphere(centre, radius);
            append(scene.geometry_mut(), ball, Mat4::IDENTITY, false, false, String::new(), 0, None);
            let bvh = Bvh::build(&scene, &|_| true);
            let mut seen = 0;
            for i in 0..4000u32 {
                let [u, v] = [2 * i, 2 * i + 1].map(|w| crate::base::math::hash_words(&[w]) as f32 / u32::MAX as f32);
                let d = crate::base::math::direction_from_lat_long(Vec2::new(u, v));
                let o = centre - d * (3.0 * radius) + Vec3::new(v, u, 0.5) * radius * 0.3;
                let Some(hit) = bvh.closest(&scene, &[], &Ray::new(o, d)) else { continue };
                let s = surface(&scene, &hit);
                seen += 1;
                // Outwards, at any angle, nothing more is met; inwards, the far side.
                let out = (s.ng + Vec3::new(u - 0.5, v - 0.5, 0.1) * 1.9).normalize();
                if out.dot(s.ng) > 0.02 {
                    assert!(!bvh.occluded(&scene, &s.spawn(out)), "{s:?}");
                }
                let far = bvh.closest(&scene, &[], &s.spawn(d)).unwrap_or_else(|| panic!("no far side of {s:?}"));
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
