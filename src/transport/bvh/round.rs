//! The tree over round shapes that are no meshes: see [`crate::scene::round`].
//!
//! Few rays of few scenes come here, so it is obvhs's binary tree, walked one box at a time.

use crate::base::ray::{Hit, Ray};
use crate::scene::{Geometry, Round, Scene};
use glam::{Vec3, Vec3A};
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;

/// Round shapes and their tree.
pub struct RoundTree {
    tree: Bvh2,
    /// Indices into `Geometry::rounds` of the tree's primitives.
    kept: Vec<u32>,
}

impl RoundTree {
    /// Over the round shapes for whose first triangle `keep` holds; `None` where there is none. Boxes grow by `margin`.
    pub fn build(geometry: &Geometry, keep: &dyn Fn(u32) -> bool, margin: f32) -> Option<Self> {
        let kept: Vec<u32> = (0..geometry.rounds.len() as u32).filter(|&r| keep(geometry.rounds[r as usize].first)).collect();
        let margin = Vec3A::splat(margin);
        let of = |r: &u32| {
            let [low, high] = geometry.rounds[*r as usize].bounds().map(|p| p.as_vec3a());
            Aabb::new(low - margin, high + margin)
        };
        let boxes: Vec<Aabb> = kept.iter().map(of).collect();
        (!kept.is_empty()).then(|| Self { tree: super::binary_tree(&boxes), kept })
    }

    /// The closest hit that `passes` does not wave through, or `best` where that is nearer.
    #[inline(never)]
    pub fn closest(&self, scene: &Scene, ray: &Ray, mut best: Option<Hit>, passes: &mut dyn FnMut(&Hit) -> bool) -> Option<Hit> {
        let mut t_max = best.map_or(ray.t_max, |hit| hit.t);
        self.walk(scene, ray, &mut t_max, &mut |hit, t_max| {
            if hit.t < *t_max && !passes(&hit) {
                *t_max = hit.t;
                best = Some(hit);
                return true;
            }
            false
        });
        best
    }

    /// Whether there is any hit that `passes` does not wave through.
    #[inline(never)]
    pub fn occluded(&self, scene: &Scene, ray: &Ray, passes: &mut dyn FnMut(&Hit) -> bool) -> bool {
        let mut found = false;
        self.walk(scene, ray, &mut ray.t_max.clone(), &mut |hit, t_max| {
            if !passes(&hit) {
                found = true;
                // Nothing is nearer than this.
                *t_max = f32::NEG_INFINITY;
            }
            found
        });
        found
    }

    /// Visits the hits within [t_min, t_max] of each shape in order, until `accept` takes one of it. `accept` may lower t_max.
    fn walk(&self, scene: &Scene, ray: &Ray, t_max: &mut f32, accept: &mut dyn FnMut(Hit, &mut f32) -> bool) {
        let inverse = Vec3::from(ray.d.to_array().map(|x| 1.0 / if x.abs() < 1e-24 { 1e-24f32.copysign(x) } else { x }));
        let enter = |node: u32, t_max: f32| {
            let bounds = &self.tree.nodes[node as usize].aabb;
            let (a, b) = ((Vec3::from(bounds.min) - ray.o) * inverse, (Vec3::from(bounds.max) - ray.o) * inverse);
            let near = a.min(b).max_element().max(ray.t_min);
            let far = a.max(b).min_element() * (1.0 + 4.0 * f32::EPSILON);
            (near <= far.min(t_max)).then_some(near)
        };
        let mut stack = vec![0u32];
        while let Some(index) = stack.pop() {
            if enter(index, *t_max).is_none() {
                continue;
            }
            let node = &self.tree.nodes[index as usize];
            if node.is_leaf() {
                for i in node.first_index..node.first_index + node.prim_count {
                    let round = &scene.geometry.rounds[self.kept[self.tree.primitive_indices[i as usize] as usize] as usize];
                    self.shape(round, ray, t_max, accept);
                }
                continue;
            }
            // The nearer child last, to be taken first.
            let children = [node.first_index, node.first_index + 1];
            let [a, b] = children.map(|c| enter(c, *t_max).unwrap_or(f32::INFINITY));
            stack.extend(if a < b { [children[1], children[0]] } else { children });
        }
    }

    fn shape(&self, round: &Round, ray: &Ray, t_max: &mut f32, accept: &mut dyn FnMut(Hit, &mut f32) -> bool) {
        for t in round.meets(ray.o, ray.d) {
            let t32 = t as f32;
            if !(t32 >= ray.t_min && t32 <= *t_max && t32 <= f32::MAX) {
                continue;
            }
            let p = round.to_local.transform_point3(ray.o.as_dvec3() + ray.d.as_dvec3() * t);
            let (triangle, u, v) = round.locate(p);
            if accept(Hit { t: t32, triangle, u, v }, t_max) {
                return;
            }
        }
    }
}
