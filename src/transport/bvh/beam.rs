//! Rays from one point in much the same direction, followed together: a camera's through a few pixels.
//!
//! *Ours*: nodes are asked once for all rays, by intervals that hold all of their directions; in the leaves each ray takes the steps that it
//! takes alone. A box that any of them meets is visited, so the answers are theirs, bit for bit.

use super::traverse::{FAR_SLACK, LEAST_DIRECTION, Nearest, Sheared, octant, push};
use super::triangle::Shear;
use super::wide::{MARK, Node, Tree};
use super::{Facet, Hit, Ray};
use crate::base::simd::Simd;

/// Most rays of a beam.
pub const BEAM: usize = 16;

/// Rays that can be followed together.
pub struct Beam<'a> {
    rays: &'a [Ray],
    /// Reciprocals of the directions that are farthest from and nearest to zero, axis by axis.
    inverse: [[f32; 2]; 3],
    /// Origin times those.
    start: [[f32; 2]; 3],
    shears: [Shear; BEAM],
    octant: u32,
    t_min: f32,
}

impl<'a> Beam<'a> {
    /// `None` where the rays are none or too many, do not begin at one point, or go to either side of an axis.
    pub fn new(rays: &'a [Ray]) -> Option<Self> {
        let first = rays.first()?;
        let fits = |ray: &Ray| ray.o == first.o && octant(ray) == octant(first);
        if rays.len() > BEAM || !rays.iter().all(fits) {
            return None;
        }
        let (mut inverse, mut start) = ([[0.0; 2]; 3], [[0.0; 2]; 3]);
        for axis in 0..3 {
            let lengths = || rays.iter().map(|ray| ray.d[axis].abs().max(LEAST_DIRECTION));
            let ends = [lengths().fold(0.0, f32::max), lengths().fold(f32::INFINITY, f32::min)];
            inverse[axis] = ends.map(|d| 1.0 / d.copysign(first.d[axis]));
            start[axis] = inverse[axis].map(|inverse| first.o[axis] * inverse);
        }
        let t_min = rays.iter().map(|ray| ray.t_min).fold(f32::INFINITY, f32::min);
        let mut shears = [Shear::new(first); BEAM];
        shears.iter_mut().zip(rays).for_each(|(shear, ray)| *shear = Shear::new(ray));
        Some(Self { rays, inverse, start, shears, octant: octant(first), t_min })
    }

    /// Distances to side `side` of each child's box across axis `k`: the least and the greatest of any ray.
    #[inline(always)]
    fn side<S: Simd>(&self, s: S, node: &Node, side: usize, k: usize) -> (S::F, S::F) {
        let bounds = s.load(&node.bounds[side]);
        let a = s.mul_sub(bounds, s.splat(self.inverse[k][0]), s.splat(self.start[k][0]));
        let b = s.mul_sub(bounds, s.splat(self.inverse[k][1]), s.splat(self.start[k][1]));
        (s.min(a, b), s.max(a, b))
    }

    /// Where the first ray enters each child's box, at the earliest, and the last leaves it.
    #[inline(always)]
    fn slabs<S: Simd>(&self, s: S, node: &Node, t_max: S::F) -> (S::F, S::F) {
        let x = if self.octant & 1 == 0 { 0 } else { 3 };
        let y = if self.octant & 2 == 0 { 1 } else { 4 };
        let z = if self.octant & 4 == 0 { 2 } else { 5 };
        let (nx, ny, nz) = (self.side(s, node, x, 0).0, self.side(s, node, y, 1).0, self.side(s, node, z, 2).0);
        let (fx, fy, fz) = (self.side(s, node, 3 - x, 0).1, self.side(s, node, 5 - y, 1).1, self.side(s, node, 7 - z, 2).1);
        let leave = s.mul(s.min(s.min(fx, fy), fz), s.splat(FAR_SLACK));
        (s.max(s.max(nx, ny), s.max(nz, s.splat(self.t_min))), s.min(leave, t_max))
    }
}

/// The closest hit of each ray, as [`super::traverse::closest`] finds it; `passes` is told which ray it is asked about.
#[inline(always)]
pub fn closest<S: Simd>(
    s: S,
    tree: &Tree,
    facets: &[Facet],
    beam: &Beam,
    (entries, ids): (&mut [f32], &mut [u32]),
    passes: &mut dyn FnMut(usize, &Hit) -> bool,
) -> [Option<Hit>; BEAM] {
    let Some(root) = tree.root else { return [None; BEAM] };
    let mut nearest = [Nearest { t: f32::NEG_INFINITY, hit: None }; BEAM];
    for (nearest, ray) in nearest.iter_mut().zip(beam.rays) {
        *nearest = Nearest::within(ray.t_max);
    }
    let order = s.octant_order(beam.octant);
    let mut farthest = greatest(&nearest);
    (entries[0], ids[0]) = (beam.t_min, root);
    let mut top = 1;
    while top > 0 {
        top -= 1;
        if entries[top] > farthest {
            continue;
        }
        let id = ids[top];
        if id & MARK == 0 {
            let node = &tree.nodes[id as usize];
            let slabs = beam.slabs(s, node, s.splat(farthest));
            top = push(s, tree, node, slabs, order, (&mut *entries, &mut *ids), top);
            continue;
        }
        let block = &tree.blocks[(id & !MARK) as usize];
        for (i, ray) in beam.rays.iter().enumerate() {
            let met = Sheared::new(s, &beam.shears[i], ray.t_min).block(s, block, s.splat(nearest[i].t));
            nearest[i].take(s, block, met, facets, &mut |hit| passes(i, hit));
        }
        farthest = greatest(&nearest);
    }
    nearest.map(|nearest| nearest.hit)
}

#[inline(always)]
fn greatest(nearest: &[Nearest; BEAM]) -> f32 {
    let mut most = nearest[0].t;
    for Nearest { t, .. } in &nearest[1..] {
        most = if *t > most { *t } else { most };
    }
    most
}
