//! Which probes see a place: a sparse octree of probe indices (Wang 2019, §4.1), for probes that stand in no grid.
//!
//! *Paper*: voxels hold up to four probes, those that see them, by projected solid angle; a probe's region of influence is a box that ends at
//! the median of its distances on each side. The paper's tree takes more memory than its probes. *Ours*: eight equal children are one leaf,
//! and a leaf is an index into a table of the few sets of probes that there are. As half of what a probe sees lies outside its
//! region, others than those whose region a voxel is in come last, but are not left out; and those are preferred that see what
//! no other one of the four sees.

use super::probe::Surfels;
use crate::base::octahedral::encode;
use crate::probe::places::Places;
use crate::{Error, Result};
use glam::{UVec3, Vec3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::collections::HashMap;

/// Probes of a leaf, at most.
pub const WIDTH: usize = 4;
/// Voxels along the tree's edge, a power of two: 2^DEPTH.
const DEPTH: u32 = 6;
/// Marks a leaf among the nodes.
pub const LEAF: u32 = 1 << 31;
/// Stands for no probe.
pub const NO_PROBE: u32 = u32::MAX;
/// What a probe counts outside its region of influence.
const OUTSIDE: f32 = 0.01;
/// Share of what probes see that may lie outside the tree, at either side of each axis: a view out of a window.
const OUTLIERS: f32 = 0.005;
/// Room about what they see, as a share of the longest side.
const ROOM: f32 = 0.01;
/// Where a voxel is looked at, from its middle, in halves of its edge.
const POINTS: [Vec3; 5] =
    [Vec3::ZERO, Vec3::new(-0.6, -0.6, -0.6), Vec3::new(0.6, 0.6, -0.6), Vec3::new(0.6, -0.6, 0.6), Vec3::new(-0.6, 0.6, 0.6)];

/// Indices of the probes of a leaf, the best first; [`NO_PROBE`] fills the rest.
pub type Set = [u32; WIDTH];

/// The tree.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Octree {
    /// The corner of its cube at the lowest x, y and z, metres.
    pub lower: [f32; 3],
    /// Edge of the cube, metres.
    pub edge: f32,
    /// Sets of probes. Set 0 has none.
    pub sets: Vec<Set>,
    /// The root comes first. A leaf is [`LEAF`] and the index of its set; another node the index of its first child, of eight that follow one
    /// another, x fastest.
    pub nodes: Vec<u32>,
}

/// A probe as the tree sees it.
pub struct Candidate<'a> {
    /// Where it stands, metres.
    pub position: Vec3,
    /// What it sees.
    pub surfels: &'a Surfels,
    /// Its index.
    pub index: u32,
}

impl Candidate<'_> {
    /// Directions and distances of some 32 x 32 texels: enough for a median.
    fn sampled(&self) -> impl Iterator<Item = (Vec3, f32)> {
        let n = self.surfels.size;
        let step = (n / 32).max(1);
        let texels = (0..n).step_by(step).flat_map(move |y| (0..n).step_by(step).map(move |x| y * n + x));
        texels.map(|i| (self.surfels.middle(i), self.surfels.distance[i])).filter(|(_, distance)| distance.is_finite())
    }
}

/// A box about a probe.
struct Region {
    lower: Vec3,
    upper: Vec3,
}

impl Region {
    /// *Paper* (§4.1): on each side the median of the distances seen through that face of a cube, here along the face's axis.
    fn of(probe: &Candidate) -> Self {
        let mut along: [Vec<f32>; 6] = Default::default();
        for (d, distance) in probe.sampled() {
            let axis = d.abs().max_position();
            along[2 * axis + usize::from(d[axis] > 0.0)].push(distance * d[axis].abs());
        }
        let median = |list: &mut Vec<f32>| {
            list.sort_unstable_by(f32::total_cmp);
            list.get(list.len() / 2).copied().unwrap_or(0.0)
        };
        let [x0, x1, y0, y1, z0, z1] = along.each_mut().map(median);
        Self { lower: probe.position - Vec3::new(x0, y0, z0), upper: probe.position + Vec3::new(x1, y1, z1) }
    }

    fn holds(&self, p: Vec3) -> bool {
        p.cmpge(self.lower).all() && p.cmple(self.upper).all()
    }
}

impl Octree {
    /// For all probes of a set, in the box of what they see but for its outliers.
    pub fn of(places: &Places, surfels: &[Surfels]) -> Self {
        let used = places.used();
        let probe = |&i: &usize| Candidate { position: places.position(i), surfels: &surfels[i], index: i as u32 };
        let probes: Vec<Candidate> = used.iter().map(probe).collect();
        let mut along: [Vec<f32>; 3] = Default::default();
        for probe in &probes {
            along.iter_mut().zip(probe.position.to_array()).for_each(|(list, x)| list.push(x));
            for (d, distance) in probe.sampled() {
                along.iter_mut().zip((probe.position + d * distance).to_array()).for_each(|(list, x)| list.push(x));
            }
        }
        let [x, y, z] = along.each_mut().map(|list| {
            list.sort_unstable_by(f32::total_cmp);
            let cut = (list.len() as f32 * OUTLIERS) as usize;
            (list.get(cut).copied().unwrap_or(0.0), list.get(list.len().saturating_sub(cut + 1)).copied().unwrap_or(1.0))
        });
        let (lower, upper) = (Vec3::new(x.0, y.0, z.0), Vec3::new(x.1, y.1, z.1));
        let room = (upper - lower).max_element() * ROOM;
        Self::new(&probes, lower - room, upper + room)
    }

    /// For probes in the box from `lower` to `upper`, which should be a little larger than what they see.
    pub fn new(probes: &[Candidate], lower: Vec3, upper: Vec3) -> Self {
        let edge = (upper - lower).max_element().max(f32::MIN_POSITIVE);
        let side = 1usize << DEPTH;
        let regions: Vec<Region> = probes.par_iter().map(Region::of).collect();
        let cells = (0..side.pow(3)).into_par_iter().map(|code| {
            let at = from_morton(code as u32).as_vec3() + 0.5;
            let voxel = edge / side as f32;
            let middle = lower + at * voxel;
            if (middle - 0.5 * voxel).cmpgt(upper).any() { None } else { best(probes, &regions, middle, voxel) }
        });
        let mut tree = Self { lower: lower.to_array(), edge, sets: vec![[NO_PROBE; WIDTH]], nodes: vec![LEAF] };
        let cells: Vec<Option<Set>> = cells.collect();
        let mut known = HashMap::new();
        let root = tree.join(&cells, &mut known);
        tree.nodes[0] = root.unwrap_or(LEAF);
        tree
    }

    /// The node of the voxels `cells`, in Morton order; `None` where no probe sees any of them.
    fn join(&mut self, cells: &[Option<Set>], known: &mut HashMap<Set, u32>) -> Option<u32> {
        if let [cell] = cells {
            return cell.map(|set| {
                LEAF | *known.entry(set).or_insert_with(|| {
                    self.sets.push(set);
                    self.sets.len() as u32 - 1
                })
            });
        }
        let children: Vec<Option<u32>> = cells.chunks(cells.len() / 8).map(|part| self.join(part, known)).collect();
        // What no probe sees may be as what is beside it.
        let first = children.iter().flatten().next().copied()?;
        if first & LEAF != 0 && children.iter().flatten().all(|c| *c == first) {
            return Some(first);
        }
        let at = self.nodes.len() as u32;
        self.nodes.extend(children.into_iter().map(|c| c.unwrap_or(LEAF)));
        Some(at)
    }

    /// The probes that see a place, the best first; none outside the cube, and where no probe sees.
    pub fn at(&self, p: Vec3) -> Set {
        let mut q = (p - Vec3::from(self.lower)) / self.edge;
        if !(q.cmpge(Vec3::ZERO).all() && q.cmplt(Vec3::ONE).all()) {
            return self.sets[0];
        }
        let mut node = self.nodes[0];
        while node & LEAF == 0 {
            q *= 2.0;
            let upper = q.cmpge(Vec3::ONE);
            q -= Vec3::select(upper, Vec3::ONE, Vec3::ZERO);
            node = self.nodes[(node + upper.bitmask()) as usize];
        }
        self.sets[(node & !LEAF) as usize]
    }

    /// Memory that it takes.
    pub fn bytes(&self) -> usize {
        size_of_val(self.nodes.as_slice()) + size_of_val(self.sets.as_slice())
    }

    /// Refuses what is no tree of `probes` probes: every path from the root must end, at a set of theirs.
    ///
    /// # Errors
    /// What is wrong with it.
    pub fn check(&self, probes: usize) -> Result<()> {
        let is_set = |set: &Set| set.iter().all(|&i| i == NO_PROBE || (i as usize) < probes);
        let last = self.nodes.len() as u64;
        // Children come after the root and before their parents, so that there is no way in circles.
        let ends = |(at, &node): (usize, &u32)| match node & LEAF != 0 {
            true => ((node & !LEAF) as usize) < self.sets.len(),
            false => node > 0 && u64::from(node) + 8 <= last && (at == 0 || node as usize + 8 <= at),
        };
        let is_sound = Vec3::from(self.lower).is_finite()
            && self.edge.is_finite()
            && self.edge > 0.0
            && !self.sets.is_empty()
            && !self.nodes.is_empty()
            && self.sets.iter().all(is_set)
            && self.nodes.iter().enumerate().all(ends);
        if is_sound { Ok(()) } else { Err(Error::Request("is no octree of these probes".into())) }
    }
}

/// The place of a voxel from its bits, x first.
fn from_morton(code: u32) -> UVec3 {
    let axis = |k: u32| (0..DEPTH).map(|b| (code >> (3 * b + k) & 1) << b).sum();
    UVec3::new(axis(0), axis(1), axis(2))
}

/// The up to four best probes for a voxel.
fn best(probes: &[Candidate], regions: &[Region], middle: Vec3, voxel: f32) -> Option<Set> {
    let mut list: Vec<(f32, u32, u32)> = Vec::new();
    for (probe, region) in probes.iter().zip(regions) {
        let mut seen = 0;
        for (k, point) in POINTS.iter().enumerate() {
            seen |= u32::from(sees(probe, middle + *point * (0.5 * voxel))) << k;
        }
        if seen != 0 {
            let weight = seen.count_ones() as f32 / probe.position.distance(middle).max(0.5 * voxel);
            let weight = if region.holds(middle) { weight } else { OUTSIDE * weight };
            list.push((weight, seen, probe.index));
        }
    }
    list.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.2.cmp(&b.2)));
    let mut set = [NO_PROBE; WIDTH];
    let (mut count, mut seen) = (0, 0);
    // First what adds to what is seen, then the rest.
    for adds in [true, false] {
        for &(_, sees, index) in &list {
            if count < WIDTH && !set.contains(&index) && (!adds || sees & !seen != 0) {
                set[count] = index;
                seen |= sees;
                count += 1;
            }
        }
    }
    (count > 0).then_some(set)
}

/// Whether a probe sees a point: it is no farther than the surface in its direction, give or take a texel.
fn sees(probe: &Candidate, p: Vec3) -> bool {
    let (to, n) = (p - probe.position, probe.surfels.size);
    let distance = to.length();
    if distance == 0.0 {
        return true;
    }
    let [x, y] = (encode(to) * n as f32).to_array().map(|v| (v as usize).min(n - 1));
    distance <= probe.surfels.distance[y * n + x] * (1.0 + probe.surfels.texel_angle())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::math::{hash_words, unit};
    use crate::base::octahedral::{middle, pack};

    /// Two probes in rooms of their own beside each other, and what each sees.
    fn two_rooms(n: usize) -> Vec<(Vec3, Surfels)> {
        let room = |position: Vec3| {
            let to_walls = |i: usize| {
                let d = middle(i, n);
                // A cube of edge 2 about the probe.
                (1.0 / d.abs().max_element(), pack(-d))
            };
            let (distance, normal) = (0..n * n).map(to_walls).unzip();
            (position, Surfels { size: n, distance, normal })
        };
        vec![room(Vec3::new(-1.0, 0.0, 0.0)), room(Vec3::new(1.0, 0.0, 0.0))]
    }

    #[test]
    fn every_place_has_the_probe_that_sees_it_first() {
        let rooms = two_rooms(64);
        let candidates: Vec<Candidate> =
            rooms.iter().enumerate().map(|(i, (p, s))| Candidate { position: *p, surfels: s, index: i as u32 }).collect();
        let tree = Octree::new(&candidates, Vec3::splat(-2.0), Vec3::splat(2.0));
        tree.check(2).unwrap();
        let random = |i: u32, k: u32| 2.0 * unit(hash_words(&[i, k])) - 1.0;
        for i in 0..1000 {
            let p = Vec3::new(2.0 * random(i, 1), random(i, 2), random(i, 3));
            if p.x.abs() > 0.1 {
                assert_eq!(tree.at(p)[0], u32::from(p.x > 0.0), "{p}");
            }
        }
        assert_eq!(tree.at(Vec3::splat(5.0)), [NO_PROBE; WIDTH]);
        assert_eq!(tree.at(Vec3::NAN), [NO_PROBE; WIDTH]);
        // Four sets, and as few nodes as a wall in the middle needs.
        assert!(tree.sets.len() <= 5 && tree.bytes() < 100_000, "{} sets, {} bytes", tree.sets.len(), tree.bytes());
    }

    #[test]
    fn a_tree_that_runs_in_circles_or_past_its_end_is_refused() {
        let rooms = two_rooms(16);
        let candidates: Vec<Candidate> =
            rooms.iter().enumerate().map(|(i, (p, s))| Candidate { position: *p, surfels: s, index: i as u32 }).collect();
        let tree = Octree::new(&candidates, Vec3::splat(-2.0), Vec3::splat(2.0));
        assert!(tree.check(1).is_err());
        let wrong = |change: &dyn Fn(&mut Octree)| {
            let mut tree = tree.clone();
            change(&mut tree);
            assert!(tree.check(2).is_err());
        };
        wrong(&|t| t.nodes[9] = 9);
        wrong(&|t| t.nodes[3] = 0);
        wrong(&|t| t.nodes[0] = t.nodes.len() as u32 - 7);
        wrong(&|t| t.nodes[5] = LEAF | 900);
        wrong(&|t| t.edge = 0.0);
        wrong(&|t| t.nodes.clear());
    }
}
