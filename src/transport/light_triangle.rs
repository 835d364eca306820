//! Triangles of area lights, and parallelograms: two triangles that are sampled as one.

use super::light_sample::LightSample;
use super::light_tree::LightBounds;
use crate::material::Texture;
use crate::scene::normals::unit_normal;
use crate::scene::{Emitter, Geometry, Object, Scene};
use glam::{Vec2, Vec3};
use std::f32::consts::{FRAC_PI_2, PI};

/// A triangle of an area light, or a parallelogram of two, all in one place.
#[derive(Debug)]
pub(crate) struct LightTriangle {
    corners: [Vec3; 3],
    /// Unit geometric normal, which way it may point; zero for a triangle without area.
    normal: Vec3,
    /// Of the triangle, or of the whole parallelogram.
    pub(crate) area: f32,
    /// Whether it stands for the parallelogram whose fourth corner lies opposite the second.
    pub(crate) parallelogram: bool,
    /// Index into `Scene::emitters`.
    pub(crate) emitter: u32,
    /// Index into `Geometry::triangles`.
    pub(crate) index: u32,
}

impl LightTriangle {
    pub(super) fn new(geometry: &Geometry, index: u32, emitter: u32, parallelogram: bool) -> Self {
        let corners = geometry.corners(index);
        let normal = unit_normal(corners).unwrap_or(Vec3::ZERO);
        let area = if parallelogram { 1.0 } else { 0.5 } * geometry.area_normal(index).length();
        Self { corners, normal, area, parallelogram, emitter, index }
    }

    /// `mean` is the mean luminance of the emitter.
    pub(super) fn bounds(&self, geometry: &Geometry, mean: f32) -> LightBounds {
        let [a, b, c] = self.corners;
        let fourth = if self.parallelogram { a + c - b } else { a };
        let normals = geometry.shading_normals(self.index, self.normal);
        let axis = normals.iter().sum::<Vec3>().try_normalize();
        let widest = axis.map_or(PI, |axis| normals.iter().map(|n| axis.angle_between(*n)).fold(0.0, f32::max));
        // Normals between them lie in the same cone as long as that is narrower than a hemisphere.
        let spread = if widest < FRAC_PI_2 { widest } else { PI };
        LightBounds {
            corners: [a.min(b).min(c).min(fourth), a.max(b).max(c).max(fourth)],
            axis: axis.unwrap_or(Vec3::Z),
            spread,
            reach: FRAC_PI_2,
            power: if self.normal == Vec3::ZERO { 0.0 } else { mean * self.area },
        }
    }

    /// Barycentric weights of the point that `v` stands for, uniform by area; the second is negative in a parallelogram's other half,
    /// of which all that is interpolated goes on straight.
    fn weights(&self, v: Vec2) -> [f32; 3] {
        if self.parallelogram {
            return [v.x, 1.0 - v.x - v.y, v.y];
        }
        let root = (1.0 - v.x).sqrt();
        let [b, c] = [root * v.y, 1.0 - root];
        [1.0 - b - c, b, c]
    }

    /// `probability` is that of this triangle's choice.
    pub(super) fn sample(&self, scene: &Scene, p: Vec3, probability: f32, v: Vec2) -> Option<LightSample> {
        let Emitter::Area { object, radiance } = &scene.emitters[self.emitter as usize] else { return None };
        let [a, b, c] = self.weights(v);
        let point = self.corners[0] * a + self.corners[1] * b + self.corners[2] * c;
        let to_light = point - p;
        let distance = to_light.length();
        let wi = to_light.try_normalize()?;
        let (geometry, object) = (&scene.geometry, &scene.geometry.objects[*object as usize]);
        let indices = || geometry.triangles[self.index as usize].map(|i| i as usize);
        let front = if object.face_normals {
            self.normal
        } else {
            let [n0, n1, n2] = indices().map(|i| geometry.normals[i]);
            n0 * a + n1 * b + n2 * c
        };
        let cos = self.normal.dot(wi).abs();
        if front.dot(wi) >= 0.0 || cos == 0.0 {
            return None;
        }
        let radiance = match radiance {
            Texture::Constant(radiance) => *radiance,
            texture if object.has_uvs => {
                let [t0, t1, t2] = indices().map(|i| geometry.uvs[i]);
                texture.eval(t0 * a + t1 * b + t2 * c)
            }
            texture => texture.eval(Vec2::new(b, c)),
        };
        let pdf = probability * distance * distance / (self.area * cos);
        Some(LightSample { wi, distance, point, weight: radiance / pdf, pdf, delta: false })
    }
}

/// Whether an object is two triangles that make a parallelogram, cut from its first corner to the third, over which normals and texture
/// coordinates are linear: Mitsuba's `rectangle`, and most lamps. One choice fewer, a point that is as well spread as its numbers,
/// and in a scene with one lamp no hierarchy at all.
pub(super) fn is_parallelogram(geometry: &Geometry, object: &Object) -> bool {
    if object.triangles.len() != 2 {
        return false;
    }
    let vertices = |t: u32| geometry.triangles[t as usize].map(|i| i as usize);
    let (first, second) = (vertices(object.triangles.start), vertices(object.triangles.start + 1));
    let position = |i: usize| geometry.positions[i];
    let [a, b, c] = first;
    // The second triangle may begin with any of its corners, and have vertices of its own.
    let size = position(a).distance(position(c));
    let same = |i: usize, p: Vec3| position(i).distance(p) <= 1e-5 * size;
    let found = |p: Vec3| second.iter().copied().find(|&i| same(i, p));
    let fourth = position(a) + position(c) - position(b);
    let (Some(a2), Some(c2), Some(d)) = (found(position(a)), found(position(c)), found(fourth)) else { return false };
    let normal = |i: usize| geometry.normals[i];
    let even = object.face_normals || [b, c, a2, c2, d].iter().all(|&i| normal(i).distance(normal(a)) <= 1e-4);
    let uv = |i: usize| geometry.uvs[i];
    let near = |p: Vec2, q: Vec2| p.distance(q) <= 1e-5 * (1.0 + uv(a).distance(uv(c)));
    let linear = !object.has_uvs || near(uv(a), uv(a2)) && near(uv(c), uv(c2)) && near(uv(d), uv(a) + uv(c) - uv(b));
    even && linear && size > 0.0
}
