//! The eight-wide tree, cut out of obvhs's binary tree: see [`crate::transport::bvh::cut`].
//!
//! Ours. Children take the slot of the octant they lie in, seen from the node's middle, so that a ray finds near children
//! first by visiting slots in the order slot xor (signs of its direction), without sorting (Garanzha and Loop 2010, Ylitie
//! et al. 2017).

use super::cut::Cut;
use crate::scene::Geometry;
use obvhs::bvh2::Bvh2;

/// Set in the ids of children that are leaves, and of triangles that may let rays pass.
pub const MARK: u32 = 1 << 31;

/// Eight children and their boxes, four cache lines.
#[derive(Clone)]
#[repr(C, align(64))]
pub struct Node {
    /// Lower x, y, z, upper x, y, z of each child; no ray meets the box (inf, -inf) of an empty slot.
    pub bounds: [[f32; 8]; 6],
    /// Index of a node, or of a block with [`MARK`].
    pub children: [u32; 8],
}

/// A leaf: up to eight triangles, five cache lines.
#[derive(Clone)]
#[repr(C, align(64))]
pub struct Block {
    /// Corner, axis, triangle. Empty lanes are NaN and are never hit.
    pub corners: [[[f32; 8]; 3]; 3],
    /// Triangle indices, with [`MARK`] where the material has an opacity.
    pub ids: [u32; 8],
}

/// Nodes and leaves of a tree.
pub struct Tree {
    /// Inner nodes.
    pub nodes: Vec<Node>,
    /// Leaves.
    pub blocks: Vec<Block>,
    /// Where to begin: a node, or the one block with [`MARK`]; none in an empty scene.
    pub root: Option<u32>,
    /// Stack entries that a traversal needs at most.
    pub stack: usize,
}

impl Tree {
    /// Widens `binary`, whose primitive i is triangle `kept[i]`; `masked` tells which triangles may let rays pass.
    pub fn new(binary: &Bvh2, kept: &[u32], geometry: &Geometry, masked: &dyn Fn(u32) -> bool) -> Self {
        let mut tree = Self { nodes: Vec::new(), blocks: Vec::new(), root: None, stack: 8 };
        if kept.is_empty() {
            return tree;
        }
        let block = |primitives: &[u32]| {
            let mut block = Block { corners: [[[f32::NAN; 8]; 3]; 3], ids: [0; 8] };
            for (lane, &i) in primitives.iter().enumerate() {
                let triangle = kept[i as usize];
                block.ids[lane] = triangle | if masked(triangle) { MARK } else { 0 };
                for (corner, p) in geometry.corners(triangle).into_iter().enumerate() {
                    for axis in 0..3 {
                        block.corners[corner][axis][lane] = p[axis];
                    }
                }
            }
            block
        };
        let cut = Cut::new(binary);
        if cut.is_leaf(0) {
            tree.blocks.push(block(&cut.primitives(0)));
            tree.root = Some(MARK);
            return tree;
        }
        tree.root = Some(0);
        tree.nodes.push(Node::EMPTY);
        // (node of the binary tree, node to fill, its depth)
        let mut todo = vec![(0, 0, 1)];
        while let Some((from, to, depth)) = todo.pop() {
            // A visit takes its own entry off the stack and puts at most eight on.
            tree.stack = tree.stack.max(7 * depth + 8);
            for (slot, child) in slots(binary, from, &cut.children(from)).into_iter().enumerate() {
                let Some(child) = child else { continue };
                let bounds = &binary.nodes[child as usize].aabb;
                for axis in 0..3 {
                    tree.nodes[to].bounds[axis][slot] = bounds.min[axis];
                    tree.nodes[to].bounds[axis + 3][slot] = bounds.max[axis];
                }
                tree.nodes[to].children[slot] = if cut.is_leaf(child) {
                    tree.blocks.push(block(&cut.primitives(child)));
                    (tree.blocks.len() - 1) as u32 | MARK
                } else {
                    tree.nodes.push(Node::EMPTY);
                    todo.push((child, tree.nodes.len() - 1, depth + 1));
                    (tree.nodes.len() - 1) as u32
                };
            }
        }
        tree
    }
}

impl Node {
    const EMPTY: Self = {
        let (low, high) = ([f32::INFINITY; 8], [f32::NEG_INFINITY; 8]);
        Self { bounds: [low, low, low, high, high, high], children: [0; 8] }
    };
}

/// Children in the slots of their octants: greedily, whichever child lies farthest out towards a free slot's corner.
fn slots(binary: &Bvh2, node: u32, children: &[u32]) -> [Option<u32>; 8] {
    let centre = binary.nodes[node as usize].aabb.center();
    let offsets: Vec<_> = children.iter().map(|&c| binary.nodes[c as usize].aabb.center() - centre).collect();
    let mut slots = [None; 8];
    let mut left: Vec<usize> = (0..children.len()).collect();
    while !left.is_empty() {
        let mut best = (f32::NEG_INFINITY, 0, 0);
        for (k, &child) in left.iter().enumerate() {
            for slot in (0..8).filter(|&s| slots[s].is_none()) {
                let sign = |axis: usize| if slot >> axis & 1 == 1 { 1.0 } else { -1.0 };
                let o = offsets[child];
                let score = o.x * sign(0) + o.y * sign(1) + o.z * sign(2);
                if score > best.0 || best.0 == f32::NEG_INFINITY {
                    best = (score, k, slot);
                }
            }
        }
        slots[best.2] = Some(children[left.swap_remove(best.1)]);
    }
    slots
}
