//! Closest-hit and any-hit queries over the scene's triangles.
//!
//! The answer does not depend on the tree: of two triangles at exactly the same distance, the one with the lower index wins.
//! Triangles without area or with coordinates that are not finite are never hit.
//!
//! Ours: a ray passes a triangle whose material has an opacity where a hash of ray and triangle, uniform in [0, 1), is not
//! below that opacity. Repeating a ray repeats its answer, and the mean over many rays is the opacity.

#[cfg(test)]
mod tests;
mod triangle;

use super::surface::uv_at;
use super::{Hit, Ray};
use crate::math::{hash_words, luminance};
use crate::scene::Scene;
use crate::scene::shapes::normals::unit_normal;
use obvhs::aabb::Aabb;
use obvhs::bvh2::{Bvh2, leaf_collapser::collapse, reinsertion::ReinsertionOptimizer};
use obvhs::ploc::{PlocBuilder, PlocSearchDistance, SortPrecision};
use triangle::Shear;

/// Boxes are larger than their triangles by this much of the scene's largest coordinate: more than what rounding can move a
/// hit, so that the tree finds whatever testing every triangle would.
const BOX_MARGIN: f32 = 8.0 * f32::EPSILON;

/// Acceleration structure over the triangles of a scene (all, or the opaque ones only).
pub struct Bvh {
    tree: Bvh2,
    /// Triangle of each primitive of the tree.
    triangles: Vec<u32>,
    /// Whether any triangle may let rays pass.
    masked: bool,
}

impl Bvh {
    /// Builds over the triangles for which `keep` holds.
    pub fn build(scene: &Scene, keep: &dyn Fn(u32) -> bool) -> Self {
        let geometry = &scene.geometry;
        let count = geometry.triangles.len() as u32;
        let has_area = |t| unit_normal(geometry.corners(t)).is_some();
        let kept: Vec<u32> = (0..count).filter(|&t| keep(t) && has_area(t)).collect();
        let extent = kept.iter().flat_map(|&t| geometry.corners(t)).fold(0f32, |m, p| m.max(p.abs().max_element()));
        let margin = glam::Vec3A::splat(extent * BOX_MARGIN);
        let boxes: Vec<Aabb> = kept
            .iter()
            .map(|&t| Aabb::from_points(&geometry.corners(t).map(|p| p.to_vec3a())))
            .map(|b| Aabb::new(b.min - margin, b.max + margin))
            .collect();
        // obvhs's medium build, spelled out: its own function checks the tree for seconds in builds with debug assertions.
        let mut tree = PlocBuilder::with_capacity(boxes.len()).build(
            PlocSearchDistance::Medium,
            &boxes,
            (0..boxes.len() as u32).collect(),
            SortPrecision::U64,
            3,
        );
        let mut optimizer = ReinsertionOptimizer::default();
        optimizer.run(&mut tree, 0.05, None);
        collapse(&mut tree, 8, 8.0);
        optimizer.run(&mut tree, 0.1, None);
        let triangles = tree.primitive_indices.iter().map(|&i| kept[i as usize]).collect();
        let masked = scene.materials.iter().any(|m| m.opacity.is_some());
        Self { tree, triangles, masked }
    }

    /// First hit in [t_min, t_max]. Alpha-masked triangles are passed where a hash of ray and triangle says so.
    pub fn closest(&self, scene: &Scene, ray: &Ray) -> Option<Hit> {
        let shear = Shear::new(ray);
        let mut best: Option<Hit> = None;
        let mut visit = |i: usize| {
            let triangle = self.triangles[i];
            let t_max = best.map_or(ray.t_max, |b| b.t);
            if let Some((t, u, v)) = shear.intersect(scene.geometry.corners(triangle)) {
                let nearer = t < t_max || (t == t_max && best.is_none_or(|b| triangle < b.triangle));
                let hit = Hit { t, triangle, u, v };
                if t >= ray.t_min && nearer && !(self.masked && passes(scene, ray, &hit)) {
                    best = Some(hit);
                }
            }
            best.map_or(f32::INFINITY, |b| b.t)
        };
        if !self.triangles.is_empty() {
            let r = obvhs::ray::Ray::new(ray.o.into(), ray.d.into(), ray.t_min, ray.t_max);
            self.tree.ray_traverse(r, &mut obvhs::ray::RayHit::none(), |_, i| visit(i));
        }
        best
    }

    /// Whether anything lies in [t_min, t_max].
    pub fn occluded(&self, scene: &Scene, ray: &Ray) -> bool {
        self.closest(scene, ray).is_some()
    }
}

/// Whether `ray` goes through a triangle of partly opaque material.
fn passes(scene: &Scene, ray: &Ray, hit: &Hit) -> bool {
    let object = scene.geometry.object(hit.triangle);
    let Some(opacity) = &scene.materials[object.material as usize].opacity else { return false };
    let words = [ray.o.x, ray.o.y, ray.o.z, ray.d.x, ray.d.y, ray.d.z].map(f32::to_bits);
    let hash = hash_words(&[words[0], words[1], words[2], words[3], words[4], words[5], hit.triangle]);
    let uniform = (hash >> 8) as f32 * (1.0 / 16_777_216.0);
    uniform >= luminance(opacity.eval(uv_at(&scene.geometry, hit)))
}
