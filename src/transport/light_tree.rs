//! A hierarchy of emitters, descended at random by how much each half can send to a point.
//!
//! Conty Estevez and Kulla 2018, "Importance Sampling of Many Lights with Adaptive Tree Splitting": bounds of position, of
//! direction and of power, put together by the surface area orientation heuristic. Ours: no splitting, one emitter a
//! descent; and a surface's back counts as [`BACK`], not as nothing, so that no scattering model is ever cut off.

use glam::Vec3;
use std::f32::consts::PI;

/// What the cosine at the receiver counts at least.
const BACK: f32 = 0.05;

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

/// The hierarchy; emitters are numbers from 0 in the order in which their bounds came.
#[derive(Debug, Default)]
pub struct LightTree {
    /// The root first, children in pairs.
    nodes: Vec<Node>,
    /// The leaf of each emitter.
    leaf: Vec<u32>,
}

/// Bounds with their trigonometry done.
#[derive(Debug)]
struct Node {
    centre: Vec3,
    radius_sq: f32,
    axis: Vec3,
    cos_spread: f32,
    sin_spread: f32,
    cos_reach: f32,
    power: f32,
    parent: u32,
    /// Number of an emitter, or the first child.
    content: Content,
}

#[derive(Debug, Clone, Copy)]
enum Content {
    Emitter(u32),
    Children(u32),
}

impl LightTree {
    /// Builds over emitters; those without power are never chosen.
    pub fn new(bounds: &[LightBounds]) -> Self {
        let mut tree = Self { nodes: Vec::new(), leaf: vec![0; bounds.len()] };
        if bounds.is_empty() {
            return tree;
        }
        let mut order: Vec<u32> = (0..bounds.len() as u32).collect();
        tree.nodes.push(Node::new(&LightBounds::of(bounds, &order), 0));
        // (node, range of `order`)
        let mut todo = vec![(0, 0..order.len())];
        while let Some((node, range)) = todo.pop() {
            if let [only] = order[range.clone()] {
                tree.nodes[node].content = Content::Emitter(only);
                tree.leaf[only as usize] = node as u32;
                continue;
            }
            let middle = range.start + split(bounds, &mut order[range.clone()]);
            let first = tree.nodes.len();
            tree.nodes[node].content = Content::Children(first as u32);
            for (k, half) in [range.start..middle, middle..range.end].into_iter().enumerate() {
                tree.nodes.push(Node::new(&LightBounds::of(bounds, &order[half.clone()]), node as u32));
                todo.push((first + k, half));
            }
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
            let first = match node.content {
                Content::Emitter(emitter) => return (node.power > 0.0).then_some((emitter, probability)),
                Content::Children(first) => first as usize,
            };
            let [a, b] = [0, 1].map(|k| self.nodes[first + k].importance(receiver));
            let p = a / (a + b);
            if p.is_nan() {
                return None;
            }
            let left = u < p;
            let (chosen, q) = if left { (0, p) } else { (1, 1.0 - p) };
            u = (if left { u / q } else { (u - p) / q }).clamp(0.0, 1.0 - f32::EPSILON / 2.0);
            probability *= q;
            node = &self.nodes[first + chosen];
        }
    }

    /// Probability with which [`LightTree::sample`] chooses `emitter`.
    pub fn probability(&self, receiver: &Receiver, emitter: u32) -> f32 {
        let Some(&leaf) = self.leaf.get(emitter as usize) else { return 0.0 };
        let (mut at, mut probability) = (leaf as usize, 1.0);
        while at != 0 {
            // Children lie in pairs from 1 on.
            let sibling = if at % 2 == 1 { at + 1 } else { at - 1 };
            let own = self.nodes[at].importance(receiver);
            if own == 0.0 {
                return 0.0;
            }
            probability *= own / (own + self.nodes[sibling].importance(receiver));
            at = self.nodes[at].parent as usize;
        }
        probability
    }
}

impl Node {
    fn new(bounds: &LightBounds, parent: u32) -> Self {
        let [low, high] = bounds.corners;
        Self {
            centre: (low + high) * 0.5,
            radius_sq: (high - low).length_squared() * 0.25,
            axis: bounds.axis,
            cos_spread: bounds.spread.cos(),
            sin_spread: bounds.spread.sin(),
            cos_reach: bounds.reach.cos(),
            power: bounds.power,
            parent,
            content: Content::Emitter(0),
        }
    }

    /// A bound on the light at the receiver, but for its visibility: power, both cosines at their largest, distance.
    fn importance(&self, receiver: &Receiver) -> f32 {
        let to_light = self.centre - receiver.p;
        let distance_sq = to_light.length_squared();
        // Angle within which the emitters appear.
        let inside = distance_sq <= self.radius_sq;
        let inv = 1.0 / distance_sq.max(f32::MIN_POSITIVE).sqrt();
        let sin_size_sq = if inside { 1.0 } else { self.radius_sq / distance_sq };
        let (sin_size, cos_size) = if inside { (0.0, -1.0) } else { (sin_size_sq.sqrt(), (1.0 - sin_size_sq).sqrt()) };

        let cos_out = -self.axis.dot(to_light) * inv;
        let sin_out = (1.0 - cos_out * cos_out).max(0.0).sqrt();
        let (cos_x, sin_x) = less(cos_out, sin_out, self.cos_spread, self.sin_spread);
        let (cos_emitter, _) = less(cos_x, sin_x, cos_size, sin_size);
        if cos_emitter <= self.cos_reach && self.cos_reach > -1.0 && !inside {
            return 0.0;
        }
        let facing = if receiver.n == Vec3::ZERO {
            1.0
        } else {
            let cos_in = receiver.n.dot(to_light) * inv;
            let sin_in = (1.0 - cos_in * cos_in).max(0.0).sqrt();
            less(cos_in, sin_in, cos_size, sin_size).0.max(BACK)
        };
        self.power * cos_emitter.max(BACK) * facing / distance_sq.max(self.radius_sq).max(f32::MIN_POSITIVE)
    }
}

/// Cosine and sine of the angle a - b, of 0 where that is negative.
fn less(cos_a: f32, sin_a: f32, cos_b: f32, sin_b: f32) -> (f32, f32) {
    if cos_a > cos_b { (1.0, 0.0) } else { (cos_a * cos_b + sin_a * sin_b, sin_a * cos_b - cos_a * sin_b) }
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
    use crate::math::{hash_words, unit};

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
            let tree = LightTree::new(&emitters(count));
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
        let tree = LightTree::new(&bounds);
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
        let tree = LightTree::new(&[lamp(0.0, Vec3::NEG_Y), lamp(8.0, Vec3::NEG_Y), lamp(0.2, Vec3::Y)]);
        let receiver = Receiver { p: Vec3::ZERO, n: Vec3::Y };
        let [near, far, away] = [0, 1, 2].map(|e| tree.probability(&receiver, e));
        assert!(near > 0.9 && far > 0.0 && away == 0.0, "{near} {far} {away}");
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
