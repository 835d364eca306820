//! Probes where a scene's shape asks for them ([Wang et al. 2019] §3): candidates on its skeleton, a choice among them, and a refinement.
//!
//! *Ours*: all lengths follow from the box that is filled, by way of its voxels, so that a doll's house and a hall get the same probes.

use super::coverage::{Row, Sides, is_opaque};
use super::placement::Placement;
use super::refine::{Fitness, RefineParams, refine};
use super::select::{Enough, choose};
use super::skeleton::field::Field;
use super::skeleton::space::Space;
use super::skeleton::voxels::Voxels;
use super::skeleton::{medial_axis, ridge};
use crate::base::progress::Progress;
use crate::probe::placement::PROBES_MAX;
use crate::transport::World;
use crate::{Error, Result};
use glam::Vec3;
use serde::{Deserialize, Serialize};

/// Share of the reachable surfaces that probes are to see where nothing else is asked for.
pub const COVERAGE: f64 = 0.999;

/// Parameters of [`place`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NonuniformParams {
    /// Where candidates come from.
    pub method: Placement,
    /// So many probes, if the scene has as many places for them.
    pub count: Option<u32>,
    /// Probes enough to see this share of the reachable surfaces; with a count, no more than those.
    pub coverage: Option<f64>,
    /// Voxels along the longest side of the box.
    pub resolution: u32,
    /// Least distance of candidates from surfaces, voxels.
    pub cull: f32,
    /// Most candidates; four a probe where many are asked for.
    pub candidates: u32,
    /// About how many texels of the surfaces say what is seen.
    pub texels: u32,
    /// How probes are moved in the end.
    pub refine: RefineParams,
}

impl Default for NonuniformParams {
    /// *Ours*: what places the probes of a room in less than a minute on two cores.
    fn default() -> Self {
        Self {
            method: Placement::Sdf,
            count: None,
            coverage: None,
            resolution: 96,
            cull: 2.0,
            candidates: 512,
            texels: 30_000,
            refine: RefineParams::default(),
        }
    }
}

/// Boxes, each by its lower and upper corner, metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounds {
    /// Where probes may stand.
    pub filled: (Vec3, Vec3),
    /// What cameras see.
    pub seen: (Vec3, Vec3),
}

/// The free space of a box, and the surfaces that it sees.
pub struct Reachable {
    /// The space.
    pub space: Space,
    /// The surfaces.
    pub sides: Sides,
}

/// What came of a placement.
#[derive(Debug, Clone)]
pub struct Placed {
    /// The probes, metres.
    pub positions: Vec<Vec3>,
    /// What each sees.
    pub rows: Vec<Row>,
    /// How many candidates there were.
    pub candidates: usize,
    /// Before refinement.
    pub before: Fitness,
    /// After it; the same without.
    pub after: Fitness,
}

impl Reachable {
    /// What `cameras` reach in the box from `lower` to `upper`, and the surfaces that this sees in the larger one that also holds `seen`,
    /// the box of what the cameras see.
    ///
    /// # Errors
    /// There is no free space, or it sees no surface.
    pub fn new(world: &World, bounds: &Bounds, cameras: &[Vec3], params: &NonuniformParams) -> Result<Self> {
        let ((lower, upper), seen) = (bounds.filled, bounds.seen);
        let voxels = Voxels::in_box(lower, upper, params.resolution)?;
        // Walls that bound the box lie on its border, give or take.
        let within = (lower.min(seen.0) - 2.0 * voxels.edge, upper.max(seen.1) + 2.0 * voxels.edge);
        let field = Field::of(&world.scene.geometry, &|t| is_opaque(world, t), voxels);
        let space = Space::reached(world, field, cameras)?;
        let mut sides = Sides::new(world, &space, within, params.texels)?;
        sides.weigh(world, cameras);
        if sides.list.is_empty() {
            return Err(Error::Request(
                "the free space that the camera reaches sees no opaque surface: nothing to place probes for".into(),
            ));
        }
        Ok(Self { space, sides })
    }

    /// Least distance of candidates from surfaces, metres; in a space that is narrow everywhere, less.
    fn cull(&self, params: &NonuniformParams) -> f32 {
        let distances = self.space.free.iter().zip(&self.space.field.distance).filter(|(free, _)| **free).map(|(_, d)| *d);
        let widest = distances.filter(|d| d.is_finite()).fold(0.0, f32::max);
        (params.cull * self.space.field.voxels.edge).min(0.5 * widest)
    }
}

/// Places probes in the free space.
///
/// # Errors
/// There is no place for any.
pub fn place(
    world: &World,
    reachable: &Reachable,
    params: &NonuniformParams,
    (seed, progress): (u32, &dyn Progress),
) -> Result<Placed> {
    let (space, sides, cull) = (&reachable.space, &reachable.sides, reachable.cull(params));
    let most = params.candidates.max(params.count.unwrap_or(0).saturating_mul(4)).min(4 * PROBES_MAX as u32) as usize;
    progress.start("placing", 2);
    let mut candidates = match params.method {
        Placement::MedialAxis => medial_axis::candidates(world, space, sides, cull, most),
        Placement::Sdf | Placement::Grid | Placement::Voxel => ridge::candidates(world, space, cull, most),
    };
    if candidates.is_empty() {
        // A space without a ridge, such as that beside one wall: wherever it is widest.
        candidates.extend(widest(space));
    }
    progress.advance(1);
    let enough = match (params.count, params.coverage) {
        (Some(count), None) => Enough::Count { count: count as usize, near: space.spacing(count) },
        (count, share) => {
            let most = count.map_or(PROBES_MAX, |n| n as usize);
            Enough::Coverage { share: share.unwrap_or(COVERAGE), most }
        }
    };
    let chosen = choose(world, sides, candidates, &enough);
    progress.finish();
    if chosen.positions.is_empty() {
        return Err(Error::Request("no place in the free space sees any surface: give another --path or --bounds".into()));
    }
    let refined = refine((world, space, sides), &chosen.positions, cull, &params.refine, (seed, progress));
    Ok(Placed {
        positions: refined.positions,
        rows: refined.rows,
        candidates: chosen.candidates,
        before: refined.before,
        after: refined.after,
    })
}

/// The middle of the free voxel that is farthest from surfaces.
fn widest(space: &Space) -> Option<Vec3> {
    let distance = &space.field.distance;
    let free = (0..distance.len()).rev().filter(|&i| space.free[i]);
    free.max_by(|&a, &b| distance[a].total_cmp(&distance[b])).map(|i| space.field.voxels.centre(i))
}
