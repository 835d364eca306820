//! Walks through the eight-wide tree: nearest octant first for the closest hit, farthest first for any hit.

use super::triangle::Shear;
use super::wide::{Block, MARK, Node, Tree};
use super::{Facet, Hit, Ray};
use crate::base::prefetch::{prefetch, prefetch_at};
use crate::base::simd::Simd;

/// Distances to the far sides of boxes grow by this much against rounding: 4 ulp, where the slab test can lose 3 (compare Ize 2013).
pub(super) const FAR_SLACK: f32 = 1.0 + 4.0 * f32::EPSILON;

/// Directions closer to zero than this count as this, so that no slab is 0 times infinity.
pub(super) const LEAST_DIRECTION: f32 = 1e-24;

/// Entries of the stack that lives on the machine's: enough for nodes 17 deep, and the real scenes have 14.
pub const STACK: usize = 128;

// No closures over lanes in here: a closure does not inherit the caller's target features, and each operation in it would
// be a function call.

/// A ray made ready for boxes and triangles.
struct Prepared<S: Simd> {
    inverse: [S::F; 3],
    /// Origin times `inverse`.
    start: [S::F; 3],
    /// Which of `Node::bounds` a ray enters through, for each axis; it leaves through the others.
    near: [usize; 3],
    order: S::I,
    triangles: Sheared<S>,
}

/// A ray made ready for triangles.
pub(super) struct Sheared<S: Simd> {
    t_min: S::F,
    origin: [S::F; 3],
    shear: [S::F; 3],
    axes: [usize; 3],
}

impl<S: Simd> Prepared<S> {
    /// `first`: the octant of directions for which children are visited nearest first.
    #[inline(always)]
    fn new(s: S, ray: &Ray, first: u32) -> Self {
        let d = [ray.d.x, ray.d.y, ray.d.z];
        let negative = d.map(|x| x.is_sign_negative());
        let inverse = d.map(|x| 1.0 / if x.abs() < LEAST_DIRECTION { LEAST_DIRECTION.copysign(x) } else { x });
        Self {
            inverse: splat3(s, inverse),
            start: splat3(s, [ray.o.x * inverse[0], ray.o.y * inverse[1], ray.o.z * inverse[2]]),
            near: [0, 1, 2].map(|k| if negative[k] { k + 3 } else { k }),
            order: s.octant_order(first),
            triangles: Sheared::new(s, &Shear::new(ray), ray.t_min),
        }
    }

    /// Distance to side `side` of each child's box, across axis `k`. The rounding of `start` moves a side by half an ulp of
    /// the origin's coordinate. Up to sixteen times the scene's extent, boxes are wider by more; beyond, the distance itself
    /// is so large that it is within [`FAR_SLACK`].
    #[inline(always)]
    fn side(&self, s: S, node: &Node, side: usize, k: usize) -> S::F {
        s.mul_sub(s.load(&node.bounds[side]), self.inverse[k], self.start[k])
    }

    /// Where the ray enters and leaves each child's box. Lower and upper bounds lie three apart.
    #[inline(always)]
    fn slabs(&self, s: S, node: &Node, t_max: S::F) -> (S::F, S::F) {
        let [x, y, z] = self.near;
        let (nx, ny, nz) = (self.side(s, node, x, 0), self.side(s, node, y, 1), self.side(s, node, z, 2));
        let (fx, fy, fz) = (self.side(s, node, 3 - x, 0), self.side(s, node, 5 - y, 1), self.side(s, node, 7 - z, 2));
        let leave = s.mul(s.min(s.min(fx, fy), fz), s.splat(FAR_SLACK));
        (s.max(s.max(nx, ny), s.max(nz, self.triangles.t_min)), s.min(leave, t_max))
    }
}

impl<S: Simd> Sheared<S> {
    #[inline(always)]
    pub(super) fn new(s: S, ray: &Shear, t_min: f32) -> Self {
        Self { t_min: s.splat(t_min), origin: splat3(s, ray.origin), shear: splat3(s, ray.shear), axes: ray.axes }
    }

    /// The corners `k` of eight triangles, sheared.
    #[inline(always)]
    fn corner(&self, s: S, block: &Block, k: usize) -> [S::F; 3] {
        let [kx, ky, kz] = self.axes;
        let z = s.sub(s.load(&block.corners[k][kz]), self.origin[2]);
        let x = s.sub(s.load(&block.corners[k][kx]), self.origin[0]);
        let y = s.sub(s.load(&block.corners[k][ky]), self.origin[1]);
        [s.sub(x, s.mul(self.shear[0], z)), s.sub(y, s.mul(self.shear[1], z)), z]
    }

    /// [`Shear::intersect`] of eight triangles: a bit for each that is hit within [t_min, t_max]; t, u and v.
    #[inline(always)]
    pub(super) fn block(&self, s: S, block: &Block, t_max: S::F) -> (u32, S::F, S::F, S::F) {
        let a = self.corner(s, block, 0);
        let b = self.corner(s, block, 1);
        let c = self.corner(s, block, 2);
        let u = s.sub(s.mul(c[0], b[1]), s.mul(c[1], b[0]));
        let v = s.sub(s.mul(a[0], c[1]), s.mul(a[1], c[0]));
        let w = s.sub(s.mul(b[0], a[1]), s.mul(b[1], a[0]));
        let zero = s.splat(0.0);
        let inside = s.le(zero, s.min(u, s.min(v, w))) | s.le(s.max(u, s.max(v, w)), zero);
        if inside == 0 {
            return (0, zero, zero, zero);
        }
        // Where all three are zero, t is NaN and lies in no range.
        let inv = s.div(s.splat(1.0), s.add(s.add(u, v), w));
        let (u, v, w) = (s.mul(u, inv), s.mul(v, inv), s.mul(w, inv));
        let t = s.mul(s.add(s.add(s.mul(u, a[2]), s.mul(v, b[2])), s.mul(w, c[2])), self.shear[2]);
        (inside & s.le(self.t_min, t) & s.le(t, t_max), t, v, w)
    }
}

/// The closest hit that `passes` does not wave through. Of two at one distance, the lower index wins. `facets` will be asked for that
/// of the hit.
#[inline(always)]
pub fn closest<S: Simd>(
    s: S,
    tree: &Tree,
    facets: &[Facet],
    ray: &Ray,
    stack: (&mut [f32], &mut [u32]),
    passes: &mut dyn FnMut(&Hit) -> bool,
) -> Option<Hit> {
    let r = Prepared::new(s, ray, octant(ray));
    let (entries, ids) = stack;
    let mut nearest = Nearest::within(ray.t_max);
    entries[0] = ray.t_min;
    ids[0] = tree.root?;
    let mut top = 1;
    while top > 0 {
        top -= 1;
        if entries[top] > nearest.t {
            continue;
        }
        let id = ids[top];
        if id & MARK == 0 {
            let node = &tree.nodes[id as usize];
            let slabs = r.slabs(s, node, s.splat(nearest.t));
            top = push(s, tree, node, slabs, r.order, (&mut *entries, &mut *ids), top);
        } else {
            let block = &tree.blocks[(id & !MARK) as usize];
            nearest.take(s, block, r.triangles.block(s, block, s.splat(nearest.t)), facets, passes);
        }
    }
    nearest.hit
}

/// Puts the children of a node that are met, entered and left as `slabs` says, on the stack, the first in `order` lowest; its new height.
#[inline(always)]
pub(super) fn push<S: Simd>(
    s: S,
    tree: &Tree,
    node: &Node,
    (enter, leave): (S::F, S::F),
    order: S::I,
    (entries, ids): (&mut [f32], &mut [u32]),
    top: usize,
) -> usize {
    let mask = s.le_permuted(enter, leave, order);
    let children = s.pack_ids(s.permute_ids(s.load_ids(&node.children), order), mask);
    let enter = s.pack(s.permute(enter, order), mask);
    s.store(enter, entries[top..].first_chunk_mut().expect("room for eight"));
    s.store_ids(children, ids[top..].first_chunk_mut().expect("room for eight"));
    let end = top + mask.count_ones() as usize;
    prefetch_all(tree, &ids[top..end]);
    end
}

/// The closest hit of a ray so far.
#[derive(Clone, Copy)]
pub(super) struct Nearest {
    /// Its distance; before there is any, how far the ray goes.
    pub(super) t: f32,
    pub(super) hit: Option<Hit>,
}

impl Nearest {
    /// None as yet. A triangle so thin that its distance overflows is no hit: hence not infinity.
    #[inline(always)]
    pub(super) fn within(t_max: f32) -> Self {
        Self { t: t_max.min(f32::MAX), hit: None }
    }

    /// Takes what [`Sheared::block`] says of a block, but for what `passes` waves through. Of two at one distance, the lower index wins.
    #[inline(always)]
    pub(super) fn take<S: Simd>(
        &mut self,
        s: S,
        block: &Block,
        (mut mask, t, u, v): (u32, S::F, S::F, S::F),
        facets: &[Facet],
        passes: &mut dyn FnMut(&Hit) -> bool,
    ) {
        if mask == 0 {
            return;
        }
        let (t, u, v) = (lanes(s, t), lanes(s, u), lanes(s, v));
        while mask != 0 {
            let lane = mask.trailing_zeros() as usize & 7;
            mask &= mask - 1;
            let hit = Hit { t: t[lane], triangle: block.ids[lane] & !MARK, u: u[lane], v: v[lane] };
            let wins = hit.t < self.t || hit.t == self.t && self.hit.is_none_or(|b| hit.triangle < b.triangle);
            if wins && !(block.ids[lane] & MARK != 0 && passes(&hit)) {
                *self = Self { t: hit.t, hit: Some(hit) };
                prefetch_at(facets, hit.triangle as usize);
            }
        }
    }
}

/// Whether there is any hit that `passes` does not wave through.
#[inline(always)]
pub fn any<S: Simd>(s: S, tree: &Tree, ray: &Ray, ids: &mut [u32], passes: &mut dyn FnMut(&Hit) -> bool) -> bool {
    // What a ray starts from rarely blocks it; what stands before the light often does: a tenth faster than nearest first or no order.
    let r = Prepared::new(s, ray, !octant(ray) & 7);
    let t_max = s.splat(ray.t_max.min(f32::MAX));
    let Some(root) = tree.root else { return false };
    ids[0] = root;
    let mut top = 1;
    while top > 0 {
        top -= 1;
        let id = ids[top];
        if id & MARK == 0 {
            let node = &tree.nodes[id as usize];
            let (enter, leave) = r.slabs(s, node, t_max);
            let mask = s.le_permuted(enter, leave, r.order);
            let children = s.pack_ids(s.permute_ids(s.load_ids(&node.children), r.order), mask);
            s.store_ids(children, ids[top..].first_chunk_mut().expect("room for eight"));
            let end = top + mask.count_ones() as usize;
            prefetch_all(tree, &ids[top..end]);
            top = end;
        } else {
            let block = &tree.blocks[(id & !MARK) as usize];
            let (mut mask, t, u, v) = r.triangles.block(s, block, t_max);
            if mask == 0 {
                continue;
            }
            let (t, u, v) = (lanes(s, t), lanes(s, u), lanes(s, v));
            while mask != 0 {
                let lane = mask.trailing_zeros() as usize & 7;
                mask &= mask - 1;
                let hit = Hit { t: t[lane], triangle: block.ids[lane] & !MARK, u: u[lane], v: v[lane] };
                if block.ids[lane] & MARK == 0 || !passes(&hit) {
                    return true;
                }
            }
        }
    }
    false
}

/// Nearly all of what is put on the stack is visited, so its fetching can begin. Waiting for memory is most of the time of
/// rays without order in a large scene.
#[inline(always)]
fn prefetch_all(tree: &Tree, ids: &[u32]) {
    for &id in ids {
        if id & MARK == 0 {
            prefetch(&tree.nodes[id as usize]);
        } else {
            prefetch(&tree.blocks[(id & !MARK) as usize]);
        }
    }
}

/// A bit for each axis along which the ray goes down.
#[inline(always)]
pub(super) fn octant(ray: &Ray) -> u32 {
    let [x, y, z] = [ray.d.x, ray.d.y, ray.d.z].map(|x| u32::from(x.is_sign_negative()));
    x | y << 1 | z << 2
}

#[inline(always)]
fn splat3<S: Simd>(s: S, x: [f32; 3]) -> [S::F; 3] {
    [s.splat(x[0]), s.splat(x[1]), s.splat(x[2])]
}

#[inline(always)]
fn lanes<S: Simd>(s: S, x: S::F) -> [f32; 8] {
    let mut out = [0.0; 8];
    s.store(x, &mut out);
    out
}
