//! The free space: what a camera can walk to. It gives the distance field its sign, and no probe stands outside of it.
//!
//! *Paper* (§3.1): distances are positive outside of what is solid, negative within. *Ours*: a mesh need not be closed, nor its normals
//! point anywhere in particular; a voxel is free where a chain of unobstructed steps between neighbouring voxels connects it with a camera.
//! A step is five rays side by side, so that a crack between two walls is no door.

use super::field::Field;
use crate::base::ray::Ray;
use crate::transport::World;
use crate::{Error, Result};
use glam::{UVec3, Vec3};
use rayon::prelude::*;

/// Cameras that are asked about every voxel where none stands near one.
const FAR_CAMERAS: usize = 8;
/// Half the width of a step, voxels.
const STEP_WIDTH: f32 = 0.25;
/// A voxel whose middle lies so near to a surface is in it, voxels: a ray that starts there may start on either side.
const ON_SURFACE: f32 = 1e-3;

/// Voxels that cameras reach, and how far surfaces are from them.
#[derive(Debug, Clone)]
pub struct Space {
    /// Distances, without a sign.
    pub field: Field,
    /// Whether each voxel is free.
    pub free: Vec<bool>,
}

/// Whether nothing lies between two points.
pub fn clear(world: &World, a: Vec3, b: Vec3) -> bool {
    match (b - a).try_normalize() {
        Some(d) => !world.occluded(&Ray { t_max: (b - a).length(), ..Ray::new(a, d) }),
        None => true,
    }
}

impl Space {
    /// What `cameras` reach within the field's box.
    ///
    /// # Errors
    /// Nothing.
    pub fn reached(world: &World, field: Field, cameras: &[Vec3]) -> Result<Self> {
        let steps = steps(world, &field);
        let voxels = field.voxels;
        let mut free = vec![false; voxels.len()];
        let mut queue = starts(world, &field, cameras);
        queue.iter().for_each(|&i| free[i] = true);
        while let Some(from) = queue.pop() {
            let c = voxels.coordinates(from);
            for axis in 0..3 {
                let unit = UVec3::from_array(std::array::from_fn(|a| u32::from(a == axis)));
                let after = (c[axis] + 1 < voxels.counts[axis] && steps[from] >> axis & 1 == 1).then(|| voxels.index(c + unit));
                let before = (c[axis] > 0).then(|| voxels.index(c - unit)).filter(|&i| steps[i] >> axis & 1 == 1);
                for to in [after, before].into_iter().flatten() {
                    if !free[to] {
                        free[to] = true;
                        queue.push(to);
                    }
                }
            }
        }
        if !free.contains(&true) {
            let (lower, upper) = (voxels.lower, voxels.upper());
            return Err(Error::Request(format!(
                "no camera reaches any free space in the box from {lower:.2} to {upper:.2}: give another --path or --bounds"
            )));
        }
        Ok(Self { field, free })
    }

    /// Signed distance of a voxel, metres: negative inside of objects and behind walls.
    pub fn signed(&self, i: usize) -> f32 {
        if self.free[i] { self.field.distance[i] } else { -self.field.distance[i] }
    }

    /// Whether `p` lies in the free space: in the box, and seen from a free voxel next to it.
    pub fn has(&self, world: &World, p: Vec3) -> bool {
        let voxels = &self.field.voxels;
        voxels.contains(p)
            && voxels.corners(p).into_iter().any(|c| self.free[voxels.index(c)] && clear(world, voxels.centre_at(c), p))
    }

    /// Edge of the cube that each of `count` probes has for itself, metres.
    pub fn spacing(&self, count: u32) -> f32 {
        let volume = self.free.iter().filter(|free| **free).count() as f32 * self.field.voxels.edge.powi(3);
        (volume / count.max(1) as f32).cbrt()
    }

    /// Whether the voxel of `p` is free and no surface crosses it, so that all of it is free.
    pub fn is_open(&self, p: Vec3) -> bool {
        let voxels = &self.field.voxels;
        let i = voxels.index(voxels.nearest(p));
        self.free[i] && self.field.distance[i] > 0.87 * voxels.edge
    }
}

/// For each voxel, bit `axis` says whether one can step to the next one along that axis.
fn steps(world: &World, field: &Field) -> Vec<u8> {
    let voxels = field.voxels;
    let edge = voxels.edge;
    let inside = |i: usize| field.distance[i] < ON_SURFACE * edge;
    (0..voxels.len())
        .into_par_iter()
        .map(|i| {
            let (c, p) = (voxels.coordinates(i), voxels.centre(i));
            let mut bits = 0;
            for axis in 0..3 {
                let unit = UVec3::from_array(std::array::from_fn(|a| u32::from(a == axis)));
                if c[axis] + 1 >= voxels.counts[axis] {
                    continue;
                }
                let next = voxels.index(c + unit);
                // Nothing is as near as the whole step is wide.
                let far = field.distance[i].max(field.distance[next]) > 1.5 * edge;
                if far || (!inside(i) && !inside(next) && step(world, p, axis, edge)) {
                    bits |= 1 << axis;
                }
            }
            bits
        })
        .collect()
}

fn step(world: &World, p: Vec3, axis: usize, edge: f32) -> bool {
    let along = |axis: usize| Vec3::AXES[axis % 3];
    let (s, t) = (along(axis + 1) * (STEP_WIDTH * edge), along(axis + 2) * (STEP_WIDTH * edge));
    let free = |from: Vec3| !world.occluded(&Ray { t_max: edge, ..Ray::new(from, along(axis)) });
    [p, p + s, p - s, p + t, p - t].into_iter().all(free)
}

/// Voxels that cameras see: those near a camera, or any where no camera stands near the box.
fn starts(world: &World, field: &Field, cameras: &[Vec3]) -> Vec<usize> {
    let voxels = field.voxels;
    let counts = |i: usize| field.distance[i] >= ON_SURFACE * voxels.edge;
    let sees = |camera: Vec3, i: usize| counts(i) && clear(world, camera, voxels.centre(i));
    let within = |camera: Vec3| {
        let near = voxels.around(voxels.nearest(camera), 2).collect::<Vec<_>>();
        near.into_iter().filter(move |&i| sees(camera, i))
    };
    let mut found: Vec<usize> = cameras.iter().filter(|&&c| voxels.contains(c)).flat_map(|&c| within(c)).collect();
    found.sort_unstable();
    found.dedup();
    if found.is_empty() {
        let step = cameras.len().div_ceil(FAR_CAMERAS).max(1);
        let some: Vec<Vec3> = cameras.iter().copied().step_by(step).collect();
        found = (0..voxels.len()).into_par_iter().filter(|&i| some.iter().any(|&c| sees(c, i))).collect();
    }
    found
}
