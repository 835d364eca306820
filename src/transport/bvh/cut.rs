//! Which nodes of a binary tree become the nodes and leaves of the eight-wide one: those of least surface area cost.
//!
//! Ylitie, Karras and Laine 2017, §3.2, by dynamic programming from the leaves up: the least cost of a subtree as at most i
//! children of a wide node, i = 1 to 7, is found from those of its halves. Ours: a leaf costs the same whatever it holds, as its
//! triangles are tested all at once. Opening the largest child first, top down, left half of all slots empty.

use obvhs::bvh2::Bvh2;

/// Children of a wide node, and triangles of a leaf.
const WIDTH: usize = 8;

/// Cost of a leaf's visit over that of a node's.
const LEAF_COST: f32 = 0.7;

/// What a subtree costs, and how it is cut.
#[derive(Clone)]
struct Costs {
    /// As at most i + 1 children of a wide node.
    least: [f32; WIDTH - 1],
    /// Children that go to the first half, of i + 1; 0 where one child fewer is as good, and for a single child.
    first: [u8; WIDTH - 1],
    /// Children that go to the first half where this is a wide node itself.
    own: u8,
    /// Whether a single child is a leaf.
    leaf: bool,
    primitives: u32,
}

/// The cut of a binary tree.
pub struct Cut<'a> {
    binary: &'a Bvh2,
    costs: Vec<Costs>,
}

impl<'a> Cut<'a> {
    /// Finds the cut of least cost of a tree with at least one primitive, at most eight a leaf.
    pub fn new(binary: &'a Bvh2) -> Self {
        let none = Costs { least: [0.0; WIDTH - 1], first: [0; WIDTH - 1], own: 0, leaf: true, primitives: 0 };
        let mut this = Self { binary, costs: vec![none; binary.nodes.len()] };
        // A node comes after its parent here, so the list backwards has children first.
        let mut order = vec![0];
        let mut next = 0;
        while let Some(&node) = order.get(next) {
            next += 1;
            if !binary.nodes[node as usize].is_leaf() {
                let first = binary.nodes[node as usize].first_index;
                order.extend([first, first + 1]);
            }
        }
        for node in order.into_iter().rev() {
            this.costs[node as usize] = this.of(node);
        }
        this
    }

    fn of(&self, node: u32) -> Costs {
        let n = &self.binary.nodes[node as usize];
        let area = n.aabb.half_area();
        if n.is_leaf() {
            let least = [area * LEAF_COST; WIDTH - 1];
            return Costs { least, first: [0; WIDTH - 1], own: 0, leaf: true, primitives: n.prim_count };
        }
        let [a, b] = [n.first_index, n.first_index + 1].map(|i| &self.costs[i as usize]);
        // Least cost with `children` for both halves together, and how many the first gets.
        let share = |children: usize| {
            let cost = |k: usize| a.least[k.min(WIDTH - 1) - 1] + b.least[(children - k).min(WIDTH - 1) - 1];
            (1..children).map(|k| (cost(k), k as u8)).fold((f32::INFINITY, 1), |best, x| if x.0 < best.0 { x } else { best })
        };
        let primitives = a.primitives + b.primitives;
        let (inside, own) = share(WIDTH);
        let as_node = inside + area;
        let as_leaf = if primitives as usize <= WIDTH { area * LEAF_COST } else { f32::INFINITY };
        let mut costs =
            Costs { least: [as_node.min(as_leaf); WIDTH - 1], first: [0; WIDTH - 1], own, leaf: as_leaf <= as_node, primitives };
        for i in 1..WIDTH - 1 {
            let (cost, first) = share(i + 1);
            (costs.least[i], costs.first[i]) = if cost < costs.least[i - 1] { (cost, first) } else { (costs.least[i - 1], 0) };
        }
        costs
    }

    /// Whether a child becomes a leaf.
    pub fn is_leaf(&self, child: u32) -> bool {
        self.costs[child as usize].leaf
    }

    /// The children of a wide node.
    pub fn children(&self, node: u32) -> Vec<u32> {
        let mut out = Vec::with_capacity(WIDTH);
        let (first, own) = (self.binary.nodes[node as usize].first_index, self.costs[node as usize].own as usize);
        // (subtree, slots for it)
        let mut todo = vec![(first + 1, WIDTH - own), (first, own)];
        while let Some((node, slots)) = todo.pop() {
            let costs = &self.costs[node as usize];
            let mut slots = slots.min(WIDTH - 1);
            while slots > 1 && costs.first[slots - 1] == 0 {
                slots -= 1;
            }
            if slots == 1 {
                out.push(node);
                continue;
            }
            let (half, k) = (self.binary.nodes[node as usize].first_index, costs.first[slots - 1] as usize);
            todo.extend([(half + 1, slots - k), (half, k)]);
        }
        out
    }

    /// The primitives below a child that becomes a leaf.
    pub fn primitives(&self, child: u32) -> Vec<u32> {
        let mut out = Vec::with_capacity(WIDTH);
        let mut todo = vec![child];
        while let Some(node) = todo.pop() {
            let n = &self.binary.nodes[node as usize];
            if n.is_leaf() {
                out.extend((n.first_index..n.first_index + n.prim_count).map(|i| self.binary.primitive_indices[i as usize]));
            } else {
                todo.extend([n.first_index + 1, n.first_index]);
            }
        }
        out
    }
}
