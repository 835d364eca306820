//! Places that something is learned for: how far they reach, and which way their surfaces face.

use super::light_tree::Receiver;
use glam::{UVec3, Vec3};

/// Sides of a cell: normals by their largest component and its sign, and one for receivers on both sides.
pub(crate) const SIDES: usize = 7;
pub(crate) const BOTH: usize = 6;

/// Cells along an edge of a block, whose mean stands for what its cells have not seen.
const BLOCK: u32 = 4;

/// Lower and upper corner of all points but the furthest fiftieth on either side of each axis; zero where there are none.
pub(super) fn middle_of(mut points: Vec<Vec3>) -> [Vec3; 2] {
    let few = points.len() / 50;
    let mut corners = [Vec3::ZERO; 2];
    for k in 0..3 {
        points.sort_by(|a, b| a[k].total_cmp(&b[k]));
        if let (Some(low), Some(high)) = (points.get(few), points.iter().rev().nth(few)) {
            (corners[0][k], corners[1][k]) = (low[k], high[k]);
        }
    }
    corners
}

/// Which of six ways a normal points: its largest component, and that one's sign.
pub(super) fn side_of(n: Vec3) -> u32 {
    let size = n.abs();
    let axis = if size.x >= size.y && size.x >= size.z { 0 } else { 1 + usize::from(size.z > size.y) };
    2 * axis as u32 + u32::from(n[axis] > 0.0)
}

/// Cubes of space.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Grid {
    pub(crate) corner: Vec3,
    pub(crate) per_metre: f32,
    pub(crate) size: UVec3,
}

impl Grid {
    /// Over [`middle_of`] points, with so many cells along the longest side.
    pub(super) fn over(points: Vec<Vec3>, across: f32) -> Self {
        let [corner, end] = middle_of(points);
        let extent = end - corner;
        let longest = extent.max_element();
        let per_metre = if longest > 0.0 { across / longest } else { 0.0 };
        let size = (extent * per_metre).ceil().clamp(Vec3::ONE, Vec3::splat(across)).as_uvec3();
        Self { corner, per_metre, size }
    }

    /// How many there are.
    pub(super) fn cells(&self) -> usize {
        self.size.element_product() as usize
    }

    fn index(&self, cell: UVec3) -> u32 {
        (cell.z * self.size.y + cell.y) * self.size.x + cell.x
    }

    /// The side of a cell that a receiver is on.
    pub(super) fn side(&self, receiver: &Receiver) -> u32 {
        let at = ((receiver.p - self.corner) * self.per_metre).max(Vec3::ZERO).as_uvec3().min(self.size - 1);
        let side = if receiver.n == Vec3::ZERO { BOTH as u32 } else { side_of(receiver.n) };
        self.index(at) * SIDES as u32 + side
    }

    /// The same side of the block that a cell is in, by the block's first cell.
    pub(super) fn block(&self, side: u32) -> usize {
        let (cell, side) = (side / SIDES as u32, side % SIDES as u32);
        let at = UVec3::new(cell, cell / self.size.x, cell / self.size.x / self.size.y) % self.size / BLOCK * BLOCK;
        (self.index(at) * SIDES as u32 + side) as usize
    }
}
