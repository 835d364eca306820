//! A hierarchy of emitters, descended at random by how much each half can send to a point.
//!
//! Conty Estevez and Kulla 2018, "Importance Sampling of Many Lights with Adaptive Tree Splitting": bounds of position, of
//! direction and of power, put together by the surface area orientation heuristic. *Ours*: no splitting, one emitter a
//! descent; and a surface's back counts as [`BACK`], not as nothing, so that no scattering model is ever cut off.

use crate::base::simd::{Kernel, Lanes, Simd};
use bytemuck::{Pod, Zeroable};
use glam::Vec3;
use std::f32::consts::PI;
use std::ops::Range;

/// What the cosine at the receiver counts at least.
pub(crate) const BACK: f32 = 0.05;

/// Share of the choice among a node's children that goes to all of them alike: the importance does not know what is
/// hidden, and a bright lamp behind a wall must not take all samples from the one in the room.
pub(crate) const EVEN: f32 = 0.25;

/// Parts of an axis between which a node may be split.
const BINS: usize = 12;

/// Where light arrives.
#[derive(Debug, Clone, Copy)]
pub struct Receiver {
    /// Position.
    pub p: Vec3,
    /// Unit normal on the side that light counts on; zero where it counts on both.
    pub n: Vec3,
}

/// What an emitter, or several, can at most do.
#[derive(Debug, Clone, Copy)]
pub struct LightBounds {
    /// Corners of the box that holds all emitting points.
    pub corners: [Vec3; 2],
    /// Mean direction of emission.
    pub axis: Vec3,
    /// Largest angle between the axis and an emitting normal, radians.
    pub spread: f32,
    /// Largest angle between such a normal and light, radians.
    pub reach: f32,
    /// Emitted power, in any unit that all share.
    pub power: f32,
}

/// Children of a node: an emitter that many others surround costs two or three steps, and eight bounds side by side vectorise.
pub(crate) const WIDTH: usize = 8;

/// Marks a child that is an emitter.
pub(crate) const LEAF: u32 = 1 << 31;

/// The hierarchy; emitters are numbers from 0 in the order in which their bounds came.
#[derive(Debug, Default)]
pub struct LightTree {
    /// The root first.
    pub(crate) nodes: Vec<Node>,
    /// Node and slot of each emitter.
    pub(crate) place: Vec<[u32; 2]>,
}

/// Bounds of the children, a slot each, with their trigonometry done. Empty slots have no power. The GPU reads the same bytes.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub(crate) struct Node {
    pub(crate) centre: [[f32; WIDTH]; 3],
    pub(crate) radius_sq: [f32; WIDTH],
    pub(crate) axis: [[f32; WIDTH]; 3],
    pub(crate) cos_spread: [f32; WIDTH],
    pub(crate) sin_spread: [f32; WIDTH],
    pub(crate) cos_reach: [f32; WIDTH],
    pub(crate) power: [f32; WIDTH],
    /// A node, or an emitter with the bit [`LEAF`].
    pub(crate) children: [u32; WIDTH],
    /// Node and slot that this one hangs from; the root's says itself.
    pub(crate) parent: [u32; 2],
}

impl LightTree {
    /// Builds over emitters; those without power are never chosen. Each of `seconds` (ascending, none of them 0) is chosen as one with the
    /// emitter before it, whose bounds are those of both.
    pub fn new(bounds: &[LightBounds], seconds: &[u32]) -> Self {
        let mut tree = Self { nodes: Vec::new(), place: vec![[0; 2]; bounds.len()] };
        let chosen = |&i: &u32| bounds[i as usize].power > 0.0 && seconds.binary_search(&i).is_err();
        let mut order: Vec<u32> = (0..bounds.len() as u32).filter(chosen).collect();
        if order.is_empty() {
            return tree;
        }
        tree.nodes.push(Node::empty([0; 2]));
        // (node, range of `order` that hangs from it)
        let mut todo = vec![(0, 0..order.len())];
        while let Some((node, range)) = todo.pop() {
            for (slot, (part, whole)) in parts(bounds, &mut order, range).into_iter().enumerate() {
                let place = [node as u32, slot as u32];
                tree.nodes[node].set(slot, &whole);
                tree.nodes[node].children[slot] = if let [only] = order[part.clone()] {
                    tree.place[only as usize] = place;
                    only | LEAF
                } else {
                    tree.nodes.push(Node::empty(place));
                    todo.push((tree.nodes.len() - 1, part));
                    tree.nodes.len() as u32 - 1
                };
            }
        }
        for &second in seconds {
            tree.place[second as usize] = tree.place[second as usize - 1];
        }
        tree
    }

    /// Whether there is no emitter.
    pub fn is_empty(&self) -> bool {
        self.nodes.is_empty()
    }

    /// An emitter and the probability of its choice; `None` where no light can arrive. `u` in [0, 1).
    pub fn sample(&self, receiver: &Receiver, mut u: f32) -> Option<(u32, f32)> {
        let (mut node, mut probability) = (self.nodes.first()?, 1.0);
        loop {
            let shares = node.shares(receiver);
            let last = shares.iter().rposition(|&x| x > 0.0)?;
            let mut slot = 0;
            while slot < last && u >= shares[slot] {
                u -= shares[slot];
                slot += 1;
            }
            u = (u / shares[slot]).clamp(0.0, 1.0 - f32::EPSILON / 2.0);
            probability *= shares[slot];
            let child = node.children[slot];
            if child & LEAF != 0 {
                return Some((child & !LEAF, probability));
            }
            node = &self.nodes[child as usize];
        }
    }

    /// Probability with which [`LightTree::sample`] chooses `emitter`.
    pub fn probability(&self, receiver: &Receiver, emitter: u32) -> f32 {
        let Some(&[mut node, mut slot]) = self.place.get(emitter as usize) else { return 0.0 };
        let mut probability = 1.0;
        loop {
            probability *= self.nodes[node as usize].shares(receiver)[slot as usize];
            if node == 0 || probability == 0.0 {
                return probability;
            }
            [node, slot] = self.nodes[node as usize].parent;
        }
    }
}

/// [`Node::shares`] of many: written for one child at a time, compiled for eight where the machine has them.
struct Shares<'a>(&'a Node, &'a Receiver);

impl Kernel for Shares<'_> {
    type Output = [f32; WIDTH];

    #[inline(always)]
    fn run<S: Simd>(self, _: S) -> [f32; WIDTH] {
        self.0.shares_of_many(self.1)
    }
}

impl Node {
    fn empty(parent: [u32; 2]) -> Self {
        let zero = [0.0; WIDTH];
        Self {
            centre: [zero; 3],
            radius_sq: [1.0; WIDTH],
            axis: [zero; 3],
            cos_spread: zero,
            sin_spread: zero,
            cos_reach: zero,
            power: zero,
            children: [LEAF; WIDTH],
            parent,
        }
    }

    fn set(&mut self, slot: usize, bounds: &LightBounds) {
        let [low, high] = bounds.corners;
        for k in 0..3 {
            self.centre[k][slot] = 0.5 * (low[k] + high[k]);
            self.axis[k][slot] = bounds.axis[k];
        }
        self.radius_sq[slot] = (high - low).length_squared() * 0.25;
        (self.sin_spread[slot], self.cos_spread[slot]) = bounds.spread.sin_cos();
        // Light in all directions must not be lost to rounding.
        self.cos_reach[slot] = if bounds.spread + bounds.reach >= PI { -2.0 } else { bounds.reach.cos() };
        self.power[slot] = bounds.power;
    }

    /// Probability with which each child is chosen; all zero where no light can arrive, unless there is one child alone.
    fn shares(&self, receiver: &Receiver) -> [f32; WIDTH] {
        if self.power[1] == 0.0 {
            let mut shares = [0.0; WIDTH];
            shares[0] = 1.0;
            return shares;
        }
        Lanes::chosen().run(Shares(self, receiver))
    }

    #[inline(always)]
    fn shares_of_many(&self, receiver: &Receiver) -> [f32; WIDTH] {
        let importance = self.importance(receiver);
        let (mut total, mut count) = (0.0, 0.0);
        for x in importance {
            total += x;
            count += if x > 0.0 { 1.0 } else { 0.0 };
        }
        if total <= 0.0 || !total.is_finite() {
            return [0.0; WIDTH];
        }
        let (scale, even) = ((1.0 - EVEN) / total, EVEN / count);
        importance.map(|x| if x > 0.0 { x * scale + even } else { 0.0 })
    }

    /// For each child a bound on the light at the receiver, but for its visibility: power, both cosines at their largest, distance.
    #[inline(always)]
    fn importance(&self, receiver: &Receiver) -> [f32; WIDTH] {
        // Where light counts on both sides, every cosine is 1.
        let both = if receiver.n == Vec3::ZERO { 2.0 } else { 0.0 };
        let (p, n) = (receiver.p, receiver.n);
        let mut out = [0.0; WIDTH];
        for (k, out) in out.iter_mut().enumerate() {
            let d = [self.centre[0][k] - p.x, self.centre[1][k] - p.y, self.centre[2][k] - p.z];
            let distance_sq = (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).max(f32::MIN_POSITIVE);
            let inv = 1.0 / distance_sq.sqrt();
            // Angle within which the emitters appear; from inside, any.
            let sin_size_sq = (self.radius_sq[k] / distance_sq).min(1.0);
            let inside = distance_sq <= self.radius_sq[k];
            let sin_size = if inside { 0.0 } else { sin_size_sq.sqrt() };
            let cos_size = if inside { -1.0 } else { (1.0 - sin_size_sq).sqrt() };

            let cos_out = -(self.axis[0][k] * d[0] + self.axis[1][k] * d[1] + self.axis[2][k] * d[2]) * inv;
            let sin_out = (1.0 - cos_out * cos_out).max(0.0).sqrt();
            let (cos_x, sin_x) = less(cos_out, sin_out, self.cos_spread[k], self.sin_spread[k]);
            let cos_emitter = less(cos_x, sin_x, cos_size, sin_size).0;
            let cos_in = (n.x * d[0] + n.y * d[1] + n.z * d[2]) * inv;
            let sin_in = (1.0 - cos_in * cos_in).max(0.0).sqrt();
            let facing = less(cos_in + both, sin_in, cos_size, sin_size).0.max(BACK);
            let value = self.power[k] * cos_emitter.max(BACK) * facing / distance_sq.max(self.radius_sq[k]);
            *out = if cos_emitter > self.cos_reach[k] { value } else { 0.0 };
        }
        out
    }
}

/// Cosine and sine of the angle a - b, of 0 where that is negative.
#[inline(always)]
fn less(cos_a: f32, sin_a: f32, cos_b: f32, sin_b: f32) -> (f32, f32) {
    let (cos, sin) = (cos_a * cos_b + sin_a * sin_b, sin_a * cos_b - cos_a * sin_b);
    if cos_a > cos_b { (1.0, 0.0) } else { (cos, sin) }
}

/// Cuts a range of `order` into at most [`WIDTH`] parts, by halving the costliest again and again; each with its bounds.
fn parts(bounds: &[LightBounds], order: &mut [u32], range: Range<usize>) -> Vec<(Range<usize>, LightBounds)> {
    let with_bounds = |order: &[u32], part: Range<usize>| {
        let whole = LightBounds::of(bounds, &order[part.clone()]);
        (part, whole)
    };
    let mut parts = vec![with_bounds(order, range)];
    while parts.len() < WIDTH {
        let splittable = (0..parts.len()).filter(|&k| parts[k].0.len() > 1);
        let Some(widest) = splittable.max_by(|&a, &b| parts[a].1.cost().total_cmp(&parts[b].1.cost())) else { break };
        let part = parts[widest].0.clone();
        let middle = part.start + split(bounds, &mut order[part.clone()]);
        parts[widest] = with_bounds(order, part.start..middle);
        parts.push(with_bounds(order, middle..part.end));
    }
    parts
}

impl LightBounds {
    fn of(bounds: &[LightBounds], order: &[u32]) -> Self {
        let first = bounds[order[0] as usize];
        order[1..].iter().fold(first, |sum, &i| sum.and(&bounds[i as usize]))
    }

    fn and(&self, other: &Self) -> Self {
        if self.power == 0.0 {
            return *other;
        }
        if other.power == 0.0 {
            return *self;
        }
        let (axis, spread) = cone_union((self.axis, self.spread), (other.axis, other.spread));
        Self {
            corners: [self.corners[0].min(other.corners[0]), self.corners[1].max(other.corners[1])],
            axis,
            spread,
            reach: self.reach.max(other.reach),
            power: self.power + other.power,
        }
    }

    /// Solid angle that light leaves into, weighted by the cosine past the spread (Conty and Kulla, Eq. 1).
    fn orientation(&self) -> f32 {
        let full = (self.spread + self.reach).min(PI);
        let (sin, cos) = self.spread.sin_cos();
        let edge = 2.0 * full * sin - (self.spread - 2.0 * full).cos() - 2.0 * self.spread * sin + cos;
        2.0 * PI * (1.0 - cos) + 0.5 * PI * edge
    }

    fn cost(&self) -> f32 {
        let d = self.corners[1] - self.corners[0];
        let area = 2.0 * (d.x * d.y + d.y * d.z + d.z * d.x);
        // Flat and single emitters have no area, but an extent.
        self.power * self.orientation() * (area + d.length_squared() * 1e-3)
    }
}

/// The narrowest cone about two: unit axes and half angles.
fn cone_union((a, spread_a): (Vec3, f32), (b, spread_b): (Vec3, f32)) -> (Vec3, f32) {
    let ((a, spread_a), (b, spread_b)) =
        if spread_a >= spread_b { ((a, spread_a), (b, spread_b)) } else { ((b, spread_b), (a, spread_a)) };
    let between = a.angle_between(b);
    if (between + spread_b).min(PI) <= spread_a {
        return (a, spread_a);
    }
    let spread = (spread_a + between + spread_b) * 0.5;
    match a.cross(b).try_normalize() {
        Some(pivot) if spread < PI => (glam::Quat::from_axis_angle(pivot, spread - spread_a) * a, spread),
        _ => (a, PI),
    }
}

/// Sorts `order` into two halves by the least cost; returns the length of the first, neither being empty.
fn split(bounds: &[LightBounds], order: &mut [u32]) -> usize {
    let centre = |i: u32| (bounds[i as usize].corners[0] + bounds[i as usize].corners[1]) * 0.5;
    let (low, high) = order.iter().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(l, h), &i| (l.min(centre(i)), h.max(centre(i))));
    let extent = high - low;
    let mut best = (f32::INFINITY, 0, 0);
    let bin = |i: u32, axis: usize| (((centre(i)[axis] - low[axis]) / extent[axis] * BINS as f32) as usize).min(BINS - 1);
    for axis in (0..3).filter(|&k| extent[k] > 0.0) {
        let mut bins: [Option<LightBounds>; BINS] = [None; BINS];
        for &i in order.iter() {
            let b = &mut bins[bin(i, axis)];
            *b = Some(b.map_or(bounds[i as usize], |sum| sum.and(&bounds[i as usize])));
        }
        let sum = |part: &[Option<LightBounds>]| part.iter().flatten().copied().reduce(|a, b| a.and(&b));
        // Long thin nodes are split along their length.
        let stretch = extent.max_element() / extent[axis];
        for cut in 1..BINS {
            if let (Some(a), Some(b)) = (sum(&bins[..cut]), sum(&bins[cut..])) {
                let cost = stretch * (a.cost() + b.cost());
                if cost < best.0 {
                    best = (cost, axis, cut);
                }
            }
        }
    }
    let (cost, axis, cut) = best;
    if cost.is_finite() {
        order.sort_by_key(|&i| bin(i, axis));
        order.partition_point(|&i| bin(i, axis) < cut)
    } else {
        order.len() / 2
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::math::{hash_words, unit};

    fn random(words: &[u32]) -> f32 {
        unit(hash_words(words))
    }

    fn random_vector(seed: u32) -> Vec3 {
        Vec3::from([0, 1, 2].map(|k| random(&[seed, k]) * 2.0 - 1.0))
    }

    /// Small one-sided emitters in a cube, some of them dark.
    fn emitters(n: u32) -> Vec<LightBounds> {
        let of = |i: u32| {
            let p = random_vector(i) * 5.0;
            LightBounds {
                corners: [p, p + Vec3::splat(0.1)],
                axis: random_vector(i + 1000).normalize(),
                spread: 0.2 * random(&[i, 7]),
                reach: PI / 2.0,
                power: if i % 7 == 3 { 0.0 } else { 1.0 + 9.0 * random(&[i, 8]) },
            }
        };
        (0..n).map(of).collect()
    }

    #[test]
    fn emitters_are_chosen_as_often_as_said() {
        const N: u32 = 40_000;
        for count in [1, 2, 3, 50] {
            let tree = LightTree::new(&emitters(count), &[]);
            for k in 0..4 {
                let n = if k == 3 { Vec3::ZERO } else { random_vector(k + 50).normalize() };
                let receiver = Receiver { p: random_vector(k + 90) * 6.0, n };
                let mut counts = vec![0u32; count as usize];
                for i in 0..N {
                    if let Some((e, probability)) = tree.sample(&receiver, (i as f32 + 0.5) / N as f32) {
                        counts[e as usize] += 1;
                        let said = tree.probability(&receiver, e);
                        assert!((said / probability - 1.0).abs() < 1e-4, "{said}, {probability}");
                    }
                }
                for (e, &c) in counts.iter().enumerate() {
                    let said = if emitters(count)[e].power > 0.0 { tree.probability(&receiver, e as u32) } else { 0.0 };
                    assert!((c as f32 / N as f32 - said).abs() < 2.0 / N as f32 + 1e-3 * said, "{e}: {c} of {N}, {said}");
                }
            }
        }
    }

    #[test]
    fn an_emitter_that_can_be_seen_is_never_left_out() {
        let bounds = emitters(60);
        let tree = LightTree::new(&bounds, &[]);
        for k in 0..300u32 {
            let receiver = Receiver { p: random_vector(k + 300) * 6.0, n: random_vector(k + 700).normalize() };
            for (e, b) in bounds.iter().enumerate().filter(|(_, b)| b.power > 0.0) {
                let corner = b.corners[0];
                let to_receiver = (receiver.p - corner).normalize();
                if b.axis.dot(to_receiver) > 0.0 {
                    assert!(tree.probability(&receiver, e as u32) > 0.0, "emitter {e} from {receiver:?}");
                }
            }
        }
    }

    #[test]
    fn what_is_near_and_faces_the_point_is_preferred() {
        let lamp = |x: f32, axis: Vec3| LightBounds {
            corners: [Vec3::new(x, 2.0, 0.0), Vec3::new(x + 0.1, 2.0, 0.1)],
            axis,
            spread: 0.0,
            reach: PI / 2.0,
            power: 1.0,
        };
        let tree = LightTree::new(&[lamp(0.0, Vec3::NEG_Y), lamp(8.0, Vec3::NEG_Y), lamp(0.2, Vec3::Y)], &[]);
        let receiver = Receiver { p: Vec3::ZERO, n: Vec3::Y };
        let [near, far, away] = [0, 1, 2].map(|e| tree.probability(&receiver, e));
        assert!(near > 0.85 && far > 0.0 && away == 0.0, "{near} {far} {away}");
    }

    #[test]
    fn the_union_of_cones_holds_both() {
        for i in 0..500u32 {
            let cone = |k: u32| (random_vector(i * 4 + k).normalize(), random(&[i, k]) * 2.0);
            let (a, b) = (cone(0), cone(1));
            let (axis, spread) = cone_union(a, b);
            for (v, s) in [a, b] {
                assert!(axis.angle_between(v) + s <= spread + 1e-3 || spread >= PI, "{axis} {spread} {v} {s}");
            }
        }
    }
}
