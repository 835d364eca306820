//! The nearest of many points: a k-d tree in one array.

use glam::Vec3;

/// Points that are left as a list.
const LEAF: usize = 8;

/// A point of the tree.
#[derive(Debug, Clone, Copy)]
struct Node {
    p: Vec3,
    /// Its number.
    index: u32,
    /// The axis along which it parts its slice, where it is the slice's middle.
    axis: u8,
}

/// The tree: the median along a slice's longest side splits it in two.
#[derive(Debug, Clone)]
pub struct Nearest {
    nodes: Vec<Node>,
}

impl Nearest {
    /// A tree of points, which keep their numbers.
    pub fn new(points: impl Iterator<Item = Vec3>) -> Self {
        let mut nodes: Vec<Node> =
            points.zip(0..).filter(|(p, _)| p.is_finite()).map(|(p, index)| Node { p, index, axis: 0 }).collect();
        sort(&mut nodes);
        Self { nodes }
    }

    /// Number of the point nearest to `q` among those for which `keep` holds, and its squared distance; of equally near ones the first.
    pub fn find(&self, q: Vec3, keep: &dyn Fn(u32) -> bool) -> Option<(u32, f32)> {
        let mut best = (u32::MAX, f32::INFINITY);
        search(&self.nodes, q, keep, &mut best);
        (best.0 != u32::MAX).then_some(best)
    }
}

fn sort(nodes: &mut [Node]) {
    if nodes.len() <= LEAF {
        return;
    }
    let (low, high) = nodes.iter().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(lo, hi), n| (lo.min(n.p), hi.max(n.p)));
    let (axis, middle) = ((high - low).max_position(), nodes.len() / 2);
    nodes.select_nth_unstable_by(middle, |a, b| a.p[axis].total_cmp(&b.p[axis]).then(a.index.cmp(&b.index)));
    nodes[middle].axis = axis as u8;
    let (low, high) = nodes.split_at_mut(middle);
    sort(low);
    sort(&mut high[1..]);
}

fn search(nodes: &[Node], q: Vec3, keep: &dyn Fn(u32) -> bool, best: &mut (u32, f32)) {
    let mut test = |n: &Node| {
        let square = n.p.distance_squared(q);
        if (square < best.1 || square == best.1 && n.index < best.0) && keep(n.index) {
            *best = (n.index, square);
        }
    };
    if nodes.len() <= LEAF {
        nodes.iter().for_each(test);
        return;
    }
    let middle = nodes.len() / 2;
    test(&nodes[middle]);
    let axis = usize::from(nodes[middle].axis);
    let beyond = q[axis] - nodes[middle].p[axis];
    let (low, high) = (&nodes[..middle], &nodes[middle + 1..]);
    let (near, far) = if beyond < 0.0 { (low, high) } else { (high, low) };
    search(near, q, keep, best);
    if beyond * beyond <= best.1 {
        search(far, q, keep, best);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::math::{hash_words, unit};

    #[test]
    fn it_finds_what_a_list_finds() {
        // On a lattice, so that many are equally near.
        let at = |i: u32, k: u32| (unit(hash_words(&[i, k])) * 12.0).floor();
        let point = |i: u32| Vec3::new(at(i, 0), at(i, 1), at(i, 2));
        let tree = Nearest::new((0..2000).map(point));
        for i in 0..300 {
            let q = point(i + 5000) + 0.25 * (i % 3) as f32;
            let keep = |k: u32| k % 7 != i % 7;
            let square = |k: u32| point(k).distance_squared(q);
            let expected = (0..2000).filter(|&k| keep(k)).min_by(|&a, &b| square(a).total_cmp(&square(b))).unwrap();
            assert_eq!(tree.find(q, &keep), Some((expected, square(expected))));
        }
        assert_eq!(tree.find(Vec3::ZERO, &|_| false), None);
    }
}
