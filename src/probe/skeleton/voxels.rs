//! A box cut into cubes.

use crate::{Error, Result};
use glam::{IVec3, UVec3, Vec3};

/// Most cubes along the longest side of a box.
pub const RESOLUTION_MAX: u32 = 512;

/// Equal cubes that fill a box. Index order: x fastest, then y, then z.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Voxels {
    /// The box's lower corner, metres.
    pub lower: Vec3,
    /// Edge of a cube, metres.
    pub edge: f32,
    /// Cubes along each axis.
    pub counts: UVec3,
}

impl Voxels {
    /// `resolution` cubes along the longest side of the box from `lower` to `upper`; along the others as many as cover it.
    pub fn in_box(lower: Vec3, upper: Vec3, resolution: u32) -> Result<Self> {
        let extent = upper - lower;
        if !(extent.is_finite() && extent.min_element() > 0.0) {
            return Err(Error::Request(format!(
                "the box from {lower:.3} to {upper:.3} holds no space for probes: give --bounds"
            )));
        }
        let edge = extent.max_element() / resolution.clamp(1, RESOLUTION_MAX) as f32;
        let counts = (extent / edge - 1e-3).ceil().as_uvec3().max(UVec3::ONE);
        let lower = (lower + upper) * 0.5 - counts.as_vec3() * (0.5 * edge);
        Ok(Self { lower, edge, counts })
    }

    /// Number of cubes.
    pub fn len(&self) -> usize {
        self.counts.as_usizevec3().element_product()
    }

    /// Never true.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The box's upper corner, metres.
    pub fn upper(&self) -> Vec3 {
        self.lower + self.counts.as_vec3() * self.edge
    }

    /// Index of the cube at `c`.
    pub fn index(&self, c: UVec3) -> usize {
        ((c.z * self.counts.y + c.y) * self.counts.x + c.x) as usize
    }

    /// The cube's place along each axis.
    pub fn coordinates(&self, i: usize) -> UVec3 {
        let (x, y) = (self.counts.x as usize, self.counts.y as usize);
        UVec3::new((i % x) as u32, (i / x % y) as u32, (i / (x * y)) as u32)
    }

    /// Middle of a cube, metres.
    pub fn centre(&self, i: usize) -> Vec3 {
        self.centre_at(self.coordinates(i))
    }

    /// Middle of the cube at `c`, metres.
    pub fn centre_at(&self, c: UVec3) -> Vec3 {
        self.lower + (c.as_vec3() + 0.5) * self.edge
    }

    /// The cube that `p` lies in; of a point outside the box, the nearest one.
    pub fn nearest(&self, p: Vec3) -> UVec3 {
        ((p - self.lower) / self.edge).max(Vec3::ZERO).as_uvec3().min(self.counts - 1)
    }

    /// Whether `p` lies in the box.
    pub fn contains(&self, p: Vec3) -> bool {
        p.cmpge(self.lower).all() && p.cmple(self.upper()).all()
    }

    /// Indices of cubes at most `steps` away from `c` along each axis, itself among them, in index order.
    pub fn around(&self, c: UVec3, steps: u32) -> impl Iterator<Item = usize> + use<> {
        let voxels = *self;
        let low = (c.as_ivec3() - steps as i32).max(IVec3::ZERO).as_uvec3();
        let high = (c + steps).min(self.counts - 1);
        let (xs, ys) = (move || low.x..=high.x, move || low.y..=high.y);
        (low.z..=high.z)
            .flat_map(move |z| ys().flat_map(move |y| xs().map(move |x| UVec3::new(x, y, z))))
            .map(move |c| voxels.index(c))
    }

    /// The eight cubes whose middles surround `p`; at the border some coincide.
    pub fn corners(&self, p: Vec3) -> [UVec3; 8] {
        let low = ((p - self.lower) / self.edge - 0.5).max(Vec3::ZERO).as_uvec3().min(self.counts - 1);
        std::array::from_fn(|k| {
            let side = UVec3::new(k as u32 & 1, k as u32 >> 1 & 1, k as u32 >> 2);
            (low + side).min(self.counts - 1)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cubes_fill_the_box_and_are_found_again() {
        let voxels = Voxels::in_box(Vec3::new(-1.0, 0.0, 2.0), Vec3::new(3.0, 1.0, 4.0), 8).unwrap();
        assert_eq!((voxels.counts, voxels.edge, voxels.len()), (UVec3::new(8, 2, 4), 0.5, 64));
        for i in 0..voxels.len() {
            assert_eq!(voxels.index(voxels.nearest(voxels.centre(i))), i);
        }
        assert_eq!(voxels.nearest(Vec3::splat(-9.0)), UVec3::ZERO);
        assert_eq!(voxels.around(UVec3::ZERO, 1).count(), 8);
        assert_eq!(voxels.corners(Vec3::new(0.0, 0.5, 3.0))[7], UVec3::new(2, 1, 2));
        for upper in [Vec3::ZERO, Vec3::new(1.0, 0.0, 1.0), Vec3::NAN, Vec3::INFINITY] {
            assert!(Voxels::in_box(Vec3::ZERO, upper, 8).is_err(), "{upper}");
        }
    }
}
