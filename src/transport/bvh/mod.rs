//! Closest-hit and any-hit queries over the scene's triangles.
//!
//! The answer does not depend on the tree: of two triangles at exactly the same distance, the one with the lower index wins.
//! Triangles without area or with coordinates that are not finite are never hit.
//!
//! Ours: a ray passes a surface whose material has an opacity where a hash of ray and surface, uniform in [0, 1), is not
//! below that opacity. Repeating a ray repeats its answer, and the mean over many rays is the opacity. The two faces of a thin
//! sheet (a blind, a leaf) count once, as in Mitsuba, which steps over the second: see [`SHEET`].

mod beam;
mod cut;
mod round;
#[cfg(test)]
mod tests;
mod traverse;
mod triangle;
mod wide;

pub use beam::BEAM;

use super::facet::{Facet, uv_at};
use crate::base::math::{hash_words, unit};
use crate::base::ray::{Hit, Ray};
use crate::base::simd::{Kernel, Lanes, Simd};
use crate::scene::normals::unit_normal;
use crate::scene::{Geometry, Round, Scene};
use beam::Beam;
use glam::Vec3A;
use obvhs::aabb::Aabb;
use obvhs::bvh2::{Bvh2, reinsertion::ReinsertionOptimizer};
use obvhs::cwbvh::{CwBvh, bvh2_to_cwbvh::bvh2_to_cwbvh};
use obvhs::ploc::{PlocBuilder, PlocSearchDistance, SortPrecision};
use round::RoundTree;
use std::cell::RefCell;
use traverse::STACK;
use wide::Tree;

/// Boxes are larger than their triangles by this much of the scene's largest coordinate: more than what rounding can move a
/// hit, so that the tree finds whatever testing every triangle would.
const BOX_MARGIN: f32 = 16.0 * f32::EPSILON;

/// Most triangles a leaf of the compressed tree: what its nodes can say.
const MAX_COMPRESSED_LEAF: u32 = 3;

/// Hits of one object in one interval of this length along a ray share their hash, times (1 + largest coordinate of its origin).
/// Sixteen times Mitsuba's step off a surface, so that few sheets thinner than that step straddle two intervals.
pub(crate) const SHEET: f32 = 16.0 * 1500.0 * 0.5 * f32::EPSILON;

/// Acceleration structure over the triangles of a scene (all, or the opaque ones only).
pub struct Bvh {
    tree: Tree,
    /// What is met as a round shape; its triangles are not in `tree`.
    rounds: Option<RoundTree>,
    /// The triangles that it is built over.
    kept: Vec<u32>,
    margin: f32,
    lanes: Lanes,
}

impl Bvh {
    /// Builds over the triangles for which `keep` holds.
    pub fn build(scene: &Scene, keep: &dyn Fn(u32) -> bool) -> Self {
        Self::with_margin(scene, keep, 0.0)
    }

    /// Builds over the triangles from `first` on, which stand beside those of this tree: rays to either come from as far.
    pub fn beside(&self, scene: &Scene, first: u32) -> Self {
        Self::with_margin(scene, &|t| t >= first, self.margin)
    }

    fn with_margin(scene: &Scene, keep: &dyn Fn(u32) -> bool, least: f32) -> Self {
        let geometry = &scene.geometry;
        let count = geometry.triangles.len() as u32;
        let has_area = |t| unit_normal(geometry.corners(t)).is_some();
        let flat = |t| geometry.rounds.is_empty() || geometry.round(t).is_none();
        let kept: Vec<u32> = (0..count).filter(|&t| keep(t) && flat(t) && has_area(t)).collect();
        let has_opacity: Vec<bool> = scene.materials.iter().map(|m| m.opacity.is_some()).collect();
        let masked = |t| has_opacity.get(geometry.object(t).material as usize).copied().unwrap_or(false);
        let extent = kept.iter().flat_map(|&t| geometry.corners(t)).fold(0f32, |m, p| m.max(p.abs().max_element()));
        let margin = (extent * BOX_MARGIN).max(least);
        let round_extent =
            geometry.rounds.iter().flat_map(Round::bounds).fold(extent, |m, p| m.max(p.abs().max_element() as f32));
        Self {
            tree: Tree::new(&triangle_tree(geometry, &kept, margin), &kept, geometry, &masked),
            rounds: RoundTree::build(geometry, keep, round_extent * BOX_MARGIN),
            kept,
            margin,
            lanes: Lanes::chosen(),
        }
    }

    /// First hit in [t_min, t_max]. Alpha-masked triangles are passed where a hash of ray and triangle says so. `facets`, of the scene's
    /// triangles from 0 on, are fetched into the cache while the ray is still under way; there may be none.
    #[inline]
    pub fn closest(&self, scene: &Scene, facets: &[Facet], ray: &Ray) -> Option<Hit> {
        let flat = self.closest_triangle(scene, facets, ray);
        match &self.rounds {
            Some(rounds) => rounds.closest(scene, ray, flat, &mut |hit| passes(scene, ray, hit)),
            None => flat,
        }
    }

    /// First hits of rays, which are followed together where they begin at one point and go in much the same direction, [`BEAM`] at the
    /// most: each one's [`Bvh::closest`].
    pub fn closest_of(&self, scene: &Scene, facets: &[Facet], rays: &[Ray], hits: &mut [Option<Hit>]) {
        match Beam::new(rays).filter(|_| self.rounds.is_none() && self.tree.stack <= STACK) {
            Some(beam) => {
                let passes = &mut |ray: usize, hit: &Hit| passes(scene, &rays[ray], hit);
                let found = self.lanes.run(Together(&self.tree, facets, &beam, passes));
                hits.iter_mut().zip(found).for_each(|(to, hit)| *to = hit);
            }
            None => hits.iter_mut().zip(rays).for_each(|(to, ray)| *to = self.closest(scene, facets, ray)),
        }
    }

    fn closest_triangle(&self, scene: &Scene, facets: &[Facet], ray: &Ray) -> Option<Hit> {
        self.lanes.run(Closest(&self.tree, facets, ray, &mut |hit: &Hit| passes(scene, ray, hit)))
    }

    /// Whether anything lies in [t_min, t_max].
    #[inline]
    pub fn occluded(&self, scene: &Scene, ray: &Ray) -> bool {
        let by_round = |rounds: &RoundTree| rounds.occluded(scene, ray, &mut |hit| passes(scene, ray, hit));
        self.triangle_occludes(scene, ray) || self.rounds.as_ref().is_some_and(by_round)
    }

    fn triangle_occludes(&self, scene: &Scene, ray: &Ray) -> bool {
        self.lanes.run(Any(&self.tree, ray, &mut |hit: &Hit| passes(scene, ray, hit)))
    }

    /// The same triangles in the compressed tree that GPUs read, and their indices in the order of its leaves. `geometry` is what
    /// the tree was built from.
    pub fn compressed(&self, geometry: &Geometry) -> (CwBvh, Vec<u32>) {
        let tree = bvh2_to_cwbvh(&triangle_tree(geometry, &self.kept, self.margin), MAX_COMPRESSED_LEAF, true, false);
        let triangles = tree.primitive_indices.iter().map(|&i| self.kept[i as usize]).collect();
        (tree, triangles)
    }
}

/// The binary tree over some triangles, their boxes widened by `margin`.
fn triangle_tree(geometry: &Geometry, kept: &[u32], margin: f32) -> Bvh2 {
    let margin = Vec3A::splat(margin);
    let boxes: Vec<Aabb> = kept
        .iter()
        .map(|&t| Aabb::from_points(&geometry.corners(t).map(|p| p.to_vec3a())))
        .map(|b| Aabb::new(b.min - margin, b.max + margin))
        .collect();
    binary_tree(&boxes)
}

/// obvhs's medium build up to its leaves, spelled out: its own function checks the tree for seconds in builds with debug
/// assertions.
fn binary_tree(boxes: &[Aabb]) -> Bvh2 {
    let indices = (0..boxes.len() as u32).collect();
    let mut tree =
        PlocBuilder::with_capacity(boxes.len()).build(PlocSearchDistance::Medium, boxes, indices, SortPrecision::U64, 3);
    let mut optimizer = ReinsertionOptimizer::default();
    optimizer.run(&mut tree, 0.1, None);
    tree
}

thread_local! {
    /// Kept from ray to ray: clearing a kilobyte is a twentieth of a ray's time.
    static STACKS: RefCell<([f32; STACK], [u32; STACK])> = const { RefCell::new(([0.0; STACK], [0; STACK])) };
}

/// What may wave a hit through.
type Passes<'a> = &'a mut dyn FnMut(&Hit) -> bool;

/// The first hit.
struct Closest<'a>(&'a Tree, &'a [Facet], &'a Ray, Passes<'a>);

impl Kernel for Closest<'_> {
    type Output = Option<Hit>;

    #[inline(always)]
    fn run<S: Simd>(self, s: S) -> Option<Hit> {
        let Self(tree, facets, ray, passes) = self;
        if tree.stack <= STACK {
            STACKS.with_borrow_mut(|(entries, ids)| traverse::closest(s, tree, facets, ray, (entries, ids), passes))
        } else {
            traverse::closest(s, tree, facets, ray, (&mut vec![0.0; tree.stack], &mut vec![0; tree.stack]), passes)
        }
    }
}

/// The first hits of a beam, in a tree for which the thread's stack is deep enough.
struct Together<'a>(&'a Tree, &'a [Facet], &'a Beam<'a>, &'a mut dyn FnMut(usize, &Hit) -> bool);

impl Kernel for Together<'_> {
    type Output = [Option<Hit>; BEAM];

    #[inline(always)]
    fn run<S: Simd>(self, s: S) -> [Option<Hit>; BEAM] {
        let Self(tree, facets, beam, passes) = self;
        STACKS.with_borrow_mut(|(entries, ids)| beam::closest(s, tree, facets, beam, (entries, ids), passes))
    }
}

/// Whether there is any.
struct Any<'a>(&'a Tree, &'a Ray, Passes<'a>);

impl Kernel for Any<'_> {
    type Output = bool;

    #[inline(always)]
    fn run<S: Simd>(self, s: S) -> bool {
        let Self(tree, ray, passes) = self;
        if tree.stack <= STACK {
            STACKS.with_borrow_mut(|(_, ids)| traverse::any(s, tree, ray, ids, passes))
        } else {
            traverse::any(s, tree, ray, &mut vec![0; tree.stack], passes)
        }
    }
}

/// Whether `ray` goes through a triangle of partly opaque material.
pub(crate) fn passes(scene: &Scene, ray: &Ray, hit: &Hit) -> bool {
    let object_index = scene.geometry.triangle_object[hit.triangle as usize];
    let object = &scene.geometry.objects[object_index as usize];
    let Some(opacity) = &scene.materials[object.material as usize].opacity else { return false };
    let words = [ray.o.x, ray.o.y, ray.o.z, ray.d.x, ray.d.y, ray.d.z].map(f32::to_bits);
    let of_ray = hash_words(&words);
    let from_front = scene.geometry.area_normal(hit.triangle).dot(ray.d) < 0.0;
    // Where a ray's intervals begin is its own.
    let interval = (hit.t / (SHEET * (1.0 + ray.o.abs().max_element())) + unit(of_ray)).floor();
    unit(hash_words(&[of_ray, object_index, interval.to_bits()])) >= opacity.eval(uv_at(&scene.geometry, hit), from_front)
}
