//! Which nodes of the tree a traversal sees: all, the leaves, or those between the min and the max cut, with skip links to match (§2.2).
//!
//! *Paper*: nodes count whose normal variance lies between sigma2 = 9 and sigma1 = 40, in a unit that it does not say. By normals alone a flat
//! wall would be a single node, whatever sigma2 is, where the paper visits 500 to 1000. *Reading*: the variance is that of the metric by which
//! the tree is built (Eq. 5: positions and normals), in units of 1/25: a traversal then visits about as many as the paper's (docs/results.md).
//! *Reading*: a node between the cuts is there with all its kin, so that no light is lost where one child has a smaller variance than the other.
//! *Ours*: a traversal goes down past the max cut where a node would be wrong as a whole ([`super::descend`]).

use super::params::{ManyLightParams, Traversal};
use super::tree::{Cluster, Tree};

/// The unit of the variances, to the power of -1.
const UNIT: f32 = 25.0 * 25.0;

/// Nodes that are left, and links among them.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Forest {
    /// Nodes of the tree, ascending: depth first.
    pub nodes: Vec<u32>,
    /// For each, the place in `nodes` where a traversal goes on that takes it as a whole.
    pub skip: Vec<u32>,
    /// For each, whether it lies on the max cut or below, or has no children.
    pub last: Vec<bool>,
}

impl Forest {
    /// Of a tree.
    pub fn new(tree: &Tree, params: &ManyLightParams) -> Self {
        let all = || tree.clusters.iter();
        let (valid, last): (Vec<bool>, Vec<bool>) = match params.traversal {
            Traversal::Full => all().map(|c| (true, c.is_leaf())).unzip(),
            Traversal::Leaves => all().map(|c| (c.is_leaf(), true)).unzip(),
            Traversal::Cuts => between(
                tree,
                params.min_cut / UNIT,
                params.max_cut / UNIT,
                params.near.max(params.horizon).max(params.fill) > 0.0,
            ),
        };
        // How many valid nodes come before each: where the next one from there on lies among them.
        let mut before = Vec::with_capacity(valid.len() + 1);
        let mut sum = 0;
        for is_valid in &valid {
            before.push(sum);
            sum += u32::from(*is_valid);
        }
        before.push(sum);
        let nodes: Vec<u32> = (0..valid.len() as u32).filter(|&i| valid[i as usize]).collect();
        let skip = nodes.iter().map(|&i| before[tree.clusters[i as usize].skip as usize]).collect();
        let last = nodes.iter().map(|&i| last[i as usize]).collect();
        Self { nodes, skip, last }
    }
}

/// Nodes from the first on each path with a variance of at most `most`, down to the first with at most `least` or, where `deeper` holds, to the
/// leaves; and which lie on the latter cut or below.
fn between(tree: &Tree, most: f32, least: f32, deeper: bool) -> (Vec<bool>, Vec<bool>) {
    // Ends of the subtrees that the traversal is in: below the min cut, and below the max cut.
    let (mut inside, mut past) = (0, 0);
    let of = |(i, node): (usize, &Cluster)| {
        let is_past = i < past;
        if i >= inside && (node.variance <= most || node.is_leaf()) {
            inside = node.skip as usize;
        }
        let is_inside = i < inside;
        if is_inside && !is_past && (node.variance <= least || node.is_leaf()) {
            past = node.skip as usize;
        }
        (is_inside && (deeper || !is_past), i < past)
    };
    tree.clusters.iter().enumerate().map(of).unzip()
}

#[cfg(test)]
mod tests {
    use super::super::tree::tests::room;
    use super::*;
    use crate::base::math::hash_words;

    /// The leaves under the nodes that a traversal takes, if it goes down wherever `goes_down` holds.
    fn covered(tree: &Tree, forest: &Forest, goes_down: impl Fn(u32) -> bool) -> Vec<u32> {
        let (mut place, mut lights) = (0, Vec::new());
        while place < forest.nodes.len() {
            let node = &tree.clusters[forest.nodes[place] as usize];
            if forest.skip[place] as usize == place + 1 || !goes_down(forest.nodes[place]) {
                lights.extend(&tree.order[node.first as usize..(node.first + node.count) as usize]);
                place = forest.skip[place] as usize;
            } else {
                place += 1;
            }
        }
        lights.sort_unstable();
        lights
    }

    #[test]
    fn every_traversal_takes_every_light_once() {
        let tree = Tree::new(&room(1500), 1);
        for traversal in [Traversal::Cuts, Traversal::Full, Traversal::Leaves] {
            for (min_cut, max_cut, near) in
                [(40.0, 9.0, 0.0), (40.0, 9.0, 3.0), (20.0, 10.0, 0.0), (1e6, 0.0, 0.0), (0.0, 0.0, 0.0)]
            {
                let params = ManyLightParams {
                    traversal,
                    min_cut,
                    max_cut,
                    near,
                    horizon: near,
                    fill: near,
                    ..ManyLightParams::default()
                };
                let forest = Forest::new(&tree, &params);
                for way in 0..4u32 {
                    let down = |node: u32| match way {
                        0 => true,
                        1 => false,
                        k => hash_words(&[node, k]) & 3 > 0,
                    };
                    assert!(covered(&tree, &forest, down).into_iter().eq(0..1500), "{traversal} {min_cut} {max_cut} {way}");
                }
            }
        }
    }

    #[test]
    fn cuts_lie_where_the_variance_says() {
        let tree = Tree::new(&room(4096), 1);
        let (most, least) = (0.02, 0.002);
        let (valid, last) = between(&tree, most, least, false);
        let (deeper, _) = between(&tree, most, least, true);
        let mut path: Vec<usize> = Vec::new();
        for (i, node) in tree.clusters.iter().enumerate() {
            path.retain(|&above| tree.clusters[above].skip as usize > i);
            let variances = || path.iter().map(|&above| tree.clusters[above].variance);
            let above_min = node.variance > most && variances().all(|v| v > most) && !node.is_leaf();
            let first = path.iter().position(|&above| tree.clusters[above].variance <= most).unwrap_or(path.len());
            let below_max = path[first..].iter().any(|&above| tree.clusters[above].variance <= least);
            assert_eq!((valid[i], deeper[i]), (!above_min && !below_max, !above_min), "{i}");
            assert!(!deeper[i] || last[i] == (below_max || node.variance <= least || node.is_leaf()), "{i}");
            path.push(i);
        }
        let everything = between(&tree, f32::MAX, 0.0, false).0.into_iter().filter(|v| *v).count();
        assert_eq!(everything, tree.clusters.len());
    }
}
