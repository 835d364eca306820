//! The tree over the lights: halves by two-cluster k-means, in depth-first order with skip links (§2.2, §2.4).
//!
//! *Paper*: the distance to a cluster's centre adds positions, in half diagonals of the bounding box, and normals (Eq. 5); what is nearer to one
//! centre than to the other by more than half of the cluster is becomes that one's child. *Ours*: the box is that of the lights.

use crate::base::math::hash_words;
use glam::Vec3;

/// No light: an inner node.
pub const NONE: u32 = u32::MAX;
/// *Paper*: "a few iterations". More change the halves by a few lights in a thousand.
const ITERATIONS: u32 = 4;
/// *Paper* (Eq. 5): the part of the normals.
const NORMAL_PART: f32 = 0.25;
/// Lights of a node whose halves are split side by side.
const PARALLEL: usize = 512;

/// A light's place in a frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spot {
    /// Position.
    pub p: Vec3,
    /// Unit normal on its side.
    pub n: Vec3,
    /// Area that it stands for, m².
    pub area: f32,
}

/// A cluster of lights.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cluster {
    /// Mean position, by area.
    pub p: Vec3,
    /// Mean normal, by area, as short as they differ.
    pub n: Vec3,
    /// Area of all its lights.
    pub area: f32,
    /// The node after its last descendant; its children are the next node and that one's `skip`.
    pub skip: u32,
    /// The first of its lights in [`Tree::order`].
    pub first: u32,
    /// How many it has.
    pub count: u32,
    /// Mean squared distance (Eq. 5) of its lights from their centre.
    pub variance: f32,
}

impl Cluster {
    /// Whether it is a single light.
    pub fn is_leaf(&self) -> bool {
        self.count == 1
    }
}

/// The tree.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Tree {
    /// Depth first; n lights have 2n - 1.
    pub clusters: Vec<Cluster>,
    /// The lights, as the leaves have them.
    pub order: Vec<u32>,
}

/// A centre, and how far from it things are.
#[derive(Clone, Copy)]
struct Centre {
    p: Vec3,
    /// Unit, or zero where normals cancel out.
    n: Vec3,
    half_diagonal: f32,
}

impl Centre {
    /// Eq. 5.
    fn distance(&self, spot: &Spot) -> f32 {
        let normals = (2.0 - 2.0 * spot.n.dot(self.n)).max(0.0).sqrt();
        spot.p.distance(self.p) / self.half_diagonal + NORMAL_PART * normals
    }
}

impl Tree {
    /// Over lights at `spots`; centres are drawn first by a hash of the seed.
    pub fn new(spots: &[Spot], seed: u32) -> Self {
        if spots.is_empty() {
            return Self::default();
        }
        let (lower, upper) =
            spots.iter().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(lower, upper), s| (lower.min(s.p), upper.max(s.p)));
        let build = Build { spots, seed, half_diagonal: (0.5 * lower.distance(upper)).max(f32::MIN_POSITIVE) };
        let empty = Cluster { p: Vec3::ZERO, n: Vec3::ZERO, area: 0.0, skip: 0, first: 0, count: 0, variance: 0.0 };
        let mut tree = Self { clusters: vec![empty; 2 * spots.len() - 1], order: (0..spots.len() as u32).collect() };
        build.node(&mut tree.order, &mut tree.clusters, 0, 0);
        tree
    }
}

struct Build<'a> {
    spots: &'a [Spot],
    seed: u32,
    half_diagonal: f32,
}

impl Build<'_> {
    /// Fills the nodes of the lights in `order`, the first of which is node `index` and light `first` of the whole.
    fn node(&self, order: &mut [u32], clusters: &mut [Cluster], index: u32, first: u32) {
        let count = order.len();
        let (p, n, area) = self.mean(order);
        let centre = self.centre(p, n);
        let squares: f32 = order.iter().map(|&i| centre.distance(&self.spots[i as usize]).powi(2)).sum();
        let skip = index + 2 * count as u32 - 1;
        clusters[0] = Cluster { p, n, area, skip, first, count: count as u32, variance: squares / count as f32 };
        if count == 1 {
            return;
        }
        let half = count.div_ceil(2);
        self.split(order, half, index);
        let (left, right) = order.split_at_mut(half);
        let (left_nodes, right_nodes) = clusters[1..].split_at_mut(2 * half - 1);
        let at = index + 2 * half as u32;
        let mut both = || self.node(left, left_nodes, index + 1, first);
        if count > PARALLEL {
            rayon::join(both, || self.node(right, right_nodes, at, first + half as u32));
        } else {
            both();
            self.node(right, right_nodes, at, first + half as u32);
        }
    }

    /// Brings the `half` lights that are nearer to one of two centres to the front.
    fn split(&self, order: &mut [u32], half: usize, index: u32) {
        let draw = |k: u32| hash_words(&[self.seed, index, k]) as usize % order.len();
        let (a, b) = (draw(0), draw(1));
        let b = if a == b { (a + 1) % order.len() } else { b };
        let [mut left, mut right] = [a, b].map(|i| {
            let spot = &self.spots[order[i] as usize];
            self.centre(spot.p, spot.n)
        });
        let mut keys: Vec<(f32, u32)> = Vec::with_capacity(order.len());
        for _ in 0..ITERATIONS {
            keys.clear();
            keys.extend(order.iter().map(|&i| {
                let spot = &self.spots[i as usize];
                (left.distance(spot) - right.distance(spot), i)
            }));
            keys.select_nth_unstable_by(half - 1, |a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            order.iter_mut().zip(&keys).for_each(|(slot, key)| *slot = key.1);
            [left, right] = [&order[..half], &order[half..]].map(|part| {
                let (p, n, _) = self.mean(part);
                self.centre(p, n)
            });
        }
    }

    /// Means by area, and the area.
    fn mean(&self, order: &[u32]) -> (Vec3, Vec3, f32) {
        let (p, n, area) = order.iter().fold((Vec3::ZERO, Vec3::ZERO, 0.0), |(p, n, area), &i| {
            let spot = &self.spots[i as usize];
            (p + spot.p * spot.area, n + spot.n * spot.area, area + spot.area)
        });
        let share = 1.0 / area.max(f32::MIN_POSITIVE);
        (p * share, n * share, area)
    }

    fn centre(&self, p: Vec3, n: Vec3) -> Centre {
        Centre { p, n: n.normalize_or_zero(), half_diagonal: self.half_diagonal }
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::base::math::{spread_over_sphere, unit};

    /// Lights on the walls of a room of 2 x 2 x 2, facing inwards.
    pub fn room(count: u32) -> Vec<Spot> {
        let of = |i: u32| {
            let [u, v] = [0, 1].map(|k| 2.0 * unit(hash_words(&[i, k, 3])) - 1.0);
            let sign = if i % 6 < 3 { 1.0 } else { -1.0 };
            let (p, n) = match i % 3 {
                0 => (Vec3::new(sign, u, v), Vec3::X),
                1 => (Vec3::new(u, sign, v), Vec3::Y),
                _ => (Vec3::new(u, v, sign), Vec3::Z),
            };
            Spot { p, n: -n * sign, area: 0.5 + 0.25 * v }
        };
        (0..count).map(of).collect()
    }

    #[test]
    fn every_node_is_what_its_lights_say_and_halves_are_even() {
        for count in [1u32, 2, 3, 7, 64, 1000] {
            let spots = room(count);
            let tree = Tree::new(&spots, 5);
            assert_eq!(tree.clusters.len() as u32, 2 * count - 1);
            let mut seen = tree.order.clone();
            seen.sort_unstable();
            assert!(seen.into_iter().eq(0..count), "every light is in it once");
            for (i, node) in tree.clusters.iter().enumerate() {
                let lights = &tree.order[node.first as usize..(node.first + node.count) as usize];
                let area: f32 = lights.iter().map(|&l| spots[l as usize].area).sum();
                let mean: Vec3 = lights.iter().map(|&l| spots[l as usize].p * spots[l as usize].area).sum::<Vec3>() / area;
                assert!(mean.distance(node.p) < 1e-4 && (node.area / area - 1.0).abs() < 1e-4);
                assert_eq!(node.skip, i as u32 + 2 * node.count - 1);
                if !node.is_leaf() {
                    let left = &tree.clusters[i + 1];
                    let right = &tree.clusters[left.skip as usize];
                    assert_eq!((left.first, right.first), (node.first, node.first + left.count));
                    assert_eq!((left.count + right.count, right.skip), (node.count, node.skip));
                    assert!(left.count - right.count < 2);
                }
            }
        }
        assert_eq!(Tree::new(&[], 1), Tree::default());
    }

    /// The mean spread of nodes with `count` lights, in positions and normals.
    fn spread(tree: &Tree, count: u32) -> f32 {
        let of_level: Vec<f32> = tree.clusters.iter().filter(|n| n.count == count).map(|n| n.variance).collect();
        of_level.iter().sum::<f32>() / of_level.len() as f32
    }

    #[test]
    fn clusters_are_tight_in_place_and_normal() {
        let spots = room(4096);
        let tree = Tree::new(&spots, 5);
        // In the order in which they come, no two neighbours have anything in common.
        let chance = Tree { clusters: tree.clusters.clone(), order: (0..4096).collect() };
        let by_chance: f32 = chance
            .order
            .chunks(64)
            .map(|c| {
                let build = Build { spots: &spots, seed: 0, half_diagonal: 3f32.sqrt() };
                let (p, n, _) = build.mean(c);
                let centre = build.centre(p, n);
                c.iter().map(|&i| centre.distance(&spots[i as usize]).powi(2)).sum::<f32>() / 64.0
            })
            .sum::<f32>()
            / 64.0;
        let found = spread(&tree, 64);
        assert!(found < 0.05 * by_chance, "{found}, by chance {by_chance}");
        // Walls are told apart: most nodes of 64 lights lie on one, though six walls do not make even halves.
        let coherent = tree.clusters.iter().filter(|n| n.count == 64).filter(|n| n.n.length() > 0.99).count();
        assert!(coherent >= 40, "{coherent} of 64");
        let on_sphere: Vec<Spot> = (0..512).map(|i| spread_over_sphere(i, 512)).map(|p| Spot { p, n: p, area: 1.0 }).collect();
        let ball = Tree::new(&on_sphere, 1);
        assert!(ball.clusters.iter().filter(|n| n.count == 32).all(|n| n.n.length() > 0.8));
    }

    #[test]
    fn the_tree_is_the_same_on_any_number_of_threads() {
        let spots = room(3000);
        let on = |threads| rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(|| Tree::new(&spots, 2));
        assert_eq!(on(1), on(4));
    }
}
