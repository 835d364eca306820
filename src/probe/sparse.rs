//! Sparse radiance probes: evenly in the empty space next to surfaces, with one support radius ([Silvennoinen and Lehtinen 2017] §4.1).
//!
//! *Paper*: the scene is voxelised, its empty interior flood-filled; empty voxels with non-empty neighbours are candidates, and those in the densest
//! regions are removed until as many are left as a regular grid of the same spacing has points. *Reading*: that grid is the one of
//! `--method grid`, in the same box. *Ours*: the fill starts at the cameras and goes by free lines of sight ([`Space`]); "next to a surface" is
//! told by distance, so that walls just outside of the box count too; and probes are moved a little to where more is seen ([`super::shift`]).

use super::coverage::{Row, Sides};
use super::nonuniform::Reachable;
use super::placement::{Density, PROBES_MAX, cells};
use super::shift::{Watch, shift};
use super::skeleton::space::Space;
use super::support::{OVERLAP, mean_overlap, radius, weight};
use super::thin::thin;
use crate::base::math::hash64;
use crate::base::progress::Progress;
use crate::transport::World;
use crate::{Error, Result};
use glam::Vec3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// How many probes where nothing is asked for; *Paper* (§5): "typical numbers are [...] 200 probes".
pub const COUNT: u32 = 200;
/// Least voxels along each axis of a room, and a spacing.
const RESOLUTION: (f32, f32) = (96.0, 4.0);
/// How far from surfaces the middles of voxels next to non-empty ones are at most, voxels: half a diagonal, and one.
const NEXT: f32 = 1.87;

/// Parameters of [`place`].
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SparseParams {
    /// Distance of neighbours, ρ_probes: the radius of the density estimate's kernels, metres.
    pub spacing: f32,
    /// Number of probes.
    pub count: u32,
    /// Probes whose support covers a receiver, on average (N_overlap).
    pub overlap: f32,
    /// Voxels along the longest side of the box.
    pub resolution: u32,
    /// About how many texels of the surfaces are receivers.
    pub texels: u32,
}

impl SparseParams {
    /// For the box from `lower` to `upper`: as many probes as a grid of the spacing has, or the spacing that gives each of the count its share of
    /// the box.
    ///
    /// # Errors
    /// That grid has no probes, or too many.
    pub fn new((lower, upper): (Vec3, Vec3), density: Density) -> Result<Self> {
        let extent = upper - lower;
        let (count, spacing) = match density {
            Density::Count(n) if (1..=PROBES_MAX as u32).contains(&n) => (n, (extent.element_product() / n as f32).cbrt()),
            Density::Count(n) => return Err(Error::Request(format!("{n} probes: expected from 1 to {PROBES_MAX}"))),
            grid => {
                let (counts, spacing) = cells(lower, upper, grid)?;
                (counts.element_product(), spacing.element_product().cbrt())
            }
        };
        let fine = RESOLUTION.1 * (extent.max_element() / spacing).ceil();
        Ok(Self { spacing, count, overlap: OVERLAP, resolution: fine.max(RESOLUTION.0) as u32, texels: 30_000 })
    }
}

/// What came of a placement.
#[derive(Debug, Clone)]
pub struct Sparse {
    /// The probes, metres.
    pub positions: Vec<Vec3>,
    /// What each sees.
    pub rows: Vec<Row>,
    /// Their support radius, metres.
    pub radius: f32,
    /// Mean number of supports that cover a receiver.
    pub overlap: f64,
    /// How many candidates there were.
    pub candidates: usize,
    /// Share of the reachable surfaces that is under a probe's support.
    pub supported: f64,
    /// Share of them that a probe would see if none had moved.
    pub before: f64,
    /// Share of them that a probe sees.
    pub seen: f64,
}

/// Most candidates a probe, and most of them where probes are few: more take time, and change nothing.
const CROWD: usize = 256;
const LEAST_CROWD: usize = 8192;

/// A place of the surfaces, and how badly it is served by the probes that there are.
pub type Need = (Vec3, f32);

/// How far needs may thin probes out or crowd them, relative to their mean.
const NEEDS: (f32, f32) = (0.25, 8.0);

/// How dense probes shall be at points: the mean need around each, by the kernel of the density estimate.
fn wanted(points: &[Vec3], spacing: f32, needs: &[Need]) -> Vec<f32> {
    let mean = needs.iter().map(|need| need.1).sum::<f32>() / needs.len() as f32;
    let at = |p: &Vec3| {
        let (sum, weights) = needs.iter().fold((0.0, 0.0), |(sum, weights), (x, need)| {
            let w = weight(p.distance(*x) / spacing);
            (sum + w * need, weights + w)
        });
        let local = if weights > 0.0 { sum / weights } else { mean };
        (local / mean.max(f32::MIN_POSITIVE)).clamp(NEEDS.0, NEEDS.1)
    };
    points.par_iter().map(at).collect()
}

/// Places probes in the free space, more of them where there is more need (if any is told), and finds their radius for receivers on the
/// reachable surfaces.
///
/// # Errors
/// There is no empty voxel.
pub fn place(
    world: &World,
    reachable: &Reachable,
    params: &SparseParams,
    needs: &[Need],
    progress: &dyn Progress,
) -> Result<Sparse> {
    let sides = &reachable.sides;
    progress.start("placing", 2);
    let candidates = enough(candidates(&reachable.space), params.count);
    if candidates.is_empty() {
        return Err(Error::Request("no voxel of the free space is empty: give another --path or --bounds".into()));
    }
    let wanted = (!needs.is_empty()).then(|| wanted(&candidates, params.spacing, needs));
    let left = thin(&candidates, params.spacing, params.count as usize, wanted.as_deref());
    let positions: Vec<Vec3> = left.into_iter().map(|i| candidates[i]).collect();
    let mut watch = Watch { rows: sides.rows(world, &positions), positions };
    progress.advance(1);
    let before = share(sides, |i| watch.rows.iter().any(|row| row[i / 64] >> (i % 64) & 1 == 1));
    shift(world, sides, &candidates, params.spacing, &mut watch);
    progress.advance(1);
    let Watch { positions, rows } = watch;
    let receivers: Vec<Vec3> = sides.list.iter().map(|side| side.p).collect();
    let radius = radius(&positions, &receivers, params.overlap);
    let times = sides.times_seen(&rows);
    progress.finish();
    Ok(Sparse {
        candidates: candidates.len(),
        radius,
        overlap: mean_overlap(&positions, &receivers, radius),
        supported: share(sides, |i| positions.iter().any(|p| p.distance(receivers[i]) < radius)),
        before,
        seen: share(sides, |i| times[i] > 0),
        positions,
        rows,
    })
}

/// Share of the area that is of sides for which something holds.
fn share(sides: &Sides, holds: impl Fn(usize) -> bool) -> f64 {
    let area = |i: usize| f64::from(sides.list[i].area);
    (0..sides.list.len()).filter(|&i| holds(i)).map(area).sum::<f64>() / sides.area
}

/// Middles of empty voxels next to non-empty ones; of all empty voxels, where no surface is near any.
pub fn candidates(space: &Space) -> Vec<Vec3> {
    let voxels = &space.field.voxels;
    let within = |most: f32| {
        let open = (0..voxels.len()).filter(|&i| space.is_open(voxels.centre(i)));
        open.filter(|&i| space.field.distance[i] <= most).map(|i| voxels.centre(i)).collect::<Vec<_>>()
    };
    let near = within(NEXT * voxels.edge);
    if near.is_empty() { within(f32::INFINITY) } else { near }
}

/// Some of the candidates, scattered all over, where they are far more than there are probes to choose.
fn enough(candidates: Vec<Vec3>, count: u32) -> Vec<Vec3> {
    let most = (CROWD * count as usize).max(LEAST_CROWD);
    if candidates.len() <= most {
        return candidates;
    }
    let mut chosen: Vec<usize> = (0..candidates.len()).collect();
    chosen.sort_by_key(|&i| hash64(i as u64));
    chosen.truncate(most);
    chosen.sort_unstable();
    chosen.into_iter().map(|i| candidates[i]).collect()
}
