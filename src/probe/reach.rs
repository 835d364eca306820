//! The free space that a camera can reach: where probes are worth their memory (§4).
//!
//! *Ours*, for the paper's grids were placed by hand. With a camera path the box of its positions, widened by a margin. With
//! one camera only, which may walk about, the box of what it sees in all directions. Either way cut to what is seen: the
//! tails of the seen points' distribution are trimmed, so that a view out of a window does not draw the grid after it.

use super::placement::ProbeGrid;
use crate::base::math::spread_over_sphere;
use crate::base::ray::Ray;
use crate::transport::World;
use crate::{Error, Result};
use glam::{IVec3, UVec3, Vec3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Parameters of [`reach`].
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ReachParams {
    /// Rays from each camera position.
    pub rays: u32,
    /// Share of the seen points that is cut off at either side of each axis.
    pub trim: f32,
    /// Widening of a camera path's box, metres.
    pub margin: f32,
    /// Camera positions that are looked around from, at most, spread evenly over the path.
    pub cameras_max: u32,
}

impl Default for ReachParams {
    fn default() -> Self {
        Self { rays: 4096, trim: 0.02, margin: 0.5, cameras_max: 32 }
    }
}

/// Lower and upper corner of the space that cameras at `cameras` (at least one) can reach.
pub fn reach(world: &World, cameras: &[Vec3], params: &ReachParams) -> Result<(Vec3, Vec3)> {
    let step = cameras.len().div_ceil(params.cameras_max.max(1) as usize).max(1);
    let chosen: Vec<Vec3> = cameras.iter().copied().step_by(step).collect();
    let seen: Vec<Vec3> = chosen
        .par_iter()
        .flat_map_iter(|&o| {
            let rays = (0..params.rays).map(move |i| Ray::new(o, spread_over_sphere(i, params.rays)));
            rays.filter_map(|ray| world.closest(&ray).map(|hit| ray.at(hit.t)))
        })
        .collect();
    if seen.is_empty() {
        return Err(Error::Request("the camera sees no surface in any direction: give --bounds".into()));
    }
    let (mut lower, mut upper) = (Vec3::ZERO, Vec3::ZERO);
    for axis in 0..3 {
        let mut along: Vec<f32> = seen.iter().map(|p| p[axis]).collect();
        along.sort_unstable_by(f32::total_cmp);
        let cut = ((along.len() - 1) as f32 * params.trim.clamp(0.0, 0.5)) as usize;
        lower[axis] = along[cut];
        upper[axis] = along[along.len() - 1 - cut];
    }
    let (mut path_lower, mut path_upper) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    for &c in cameras {
        path_lower = path_lower.min(c);
        path_upper = path_upper.max(c);
    }
    if cameras.len() > 1 {
        lower = lower.max(path_lower - params.margin);
        upper = upper.min(path_upper + params.margin);
    }
    Ok((lower.min(path_lower), upper.max(path_upper)))
}

/// Probes of the grid that are inside objects or behind walls: those which no chain of free lines of sight between near
/// probes connects with a camera. Ascending.
pub fn blocked(world: &World, grid: &ProbeGrid, cameras: &[Vec3]) -> Vec<u32> {
    let free = |a: Vec3, b: Vec3| match (b - a).try_normalize() {
        Some(d) => !world.occluded(&Ray { t_max: (b - a).length(), ..Ray::new(a, d) }),
        None => true,
    };
    let mut reached: Vec<bool> =
        (0..grid.len()).into_par_iter().map(|i| cameras.iter().any(|&c| free(c, grid.position(i)))).collect();
    let mut queue: Vec<usize> = (0..grid.len()).filter(|&i| reached[i]).collect();
    while let Some(from) = queue.pop() {
        for to in near(grid, from) {
            if !reached[to] && free(grid.position(from), grid.position(to)) {
                reached[to] = true;
                queue.push(to);
            }
        }
    }
    (0..grid.len() as u32).filter(|&i| !reached[i as usize]).collect()
}

/// Probes at most two steps away along each axis.
fn near(grid: &ProbeGrid, probe: usize) -> impl Iterator<Item = usize> {
    let counts = UVec3::from(grid.counts).as_ivec3();
    let centre = UVec3::from(grid.coordinates(probe)).as_ivec3();
    let steps = (0..125).map(|k| IVec3::new(k % 5 - 2, k / 5 % 5 - 2, k / 25 - 2));
    steps
        .map(move |s| centre + s)
        .filter(move |c| c.cmpge(IVec3::ZERO).all() && c.cmplt(counts).all())
        .map(move |c| ((c.z * counts.y + c.y) * counts.x + c.x) as usize)
}
