//! The bake: the rows of all receivers, in groups that can be made in any order and kept.

use super::cluster::groups;
use super::compress::{Cluster, compress};
use super::interpolate::Row;
use super::operator::Transport;
use super::params::TransportParams;
use super::relight::RelightRays;
use super::seen::Ground;
use super::transport::{Gather, mean_square, sample};
use super::volume::{Space, Volume};
use crate::base::progress::Progress;
use crate::lightmap::{Atlas, Plan};
use crate::transport::World;
use crate::{Error, Result};
use glam::Vec3;
use rayon::prelude::*;
use std::ops::Range;

/// A bake that is ready to start.
pub struct Bake<'a> {
    /// What is baked from.
    pub ground: Ground<'a>,
    params: TransportParams,
    atlas: Atlas,
    gather: Gather,
    scale: f64,
    groups: Vec<Vec<u32>>,
    /// Receivers in free space, the mean square of their rows, and their groups.
    space: Option<(Space, f64, Vec<Vec<u32>>)>,
}

/// Rows that say how large those in free space are.
const SCALE_ROWS: u32 = 128;

impl<'a> Bake<'a> {
    /// Finds the receivers of `world`, and what `probes` see of them.
    ///
    /// # Errors
    /// Nothing receives light.
    pub fn new(world: &'a World, probes: Vec<Vec3>, params: &TransportParams, progress: &dyn Progress) -> Result<Self> {
        let plan = Plan::for_any_light(world, params.atlas)?;
        let ground = Ground::new(&plan, world, probes, params.radius, progress);
        let count = ground.receivers.list.len() as u32;
        if count == 0 {
            let message = "no probe sees a surface with a diffuse lobe: nothing would receive light";
            return Err(Error::input(&world.scene.path, message));
        }
        let points: Vec<Vec3> = (0..count).map(|r| ground.receivers.surface(world, r, 0).p).collect();
        let groups = groups(&points, params.compress.most_receivers as usize);
        let gather = params.gather();
        let scale = gather.scale(&ground);
        let space = params.volume.map(|spacing| space(&ground, spacing, params)).transpose()?;
        Ok(Self { ground, params: *params, atlas: plan.atlas, gather, scale, groups, space })
    }

    /// Number of groups: those of texels, and after them those in free space.
    pub fn groups(&self) -> usize {
        self.groups.len() + self.groups_in_space()
    }

    /// Number of groups of receivers in free space.
    pub fn groups_in_space(&self) -> usize {
        self.space.as_ref().map_or(0, |(_, _, groups)| groups.len())
    }

    /// The volume, without its clusters.
    pub fn volume(&self) -> Option<Volume> {
        self.space.as_ref().map(|(space, ..)| Volume { grid: space.grid, cells: space.cells.clone(), clusters: Vec::new() })
    }

    /// The clusters of a group's receivers; of those in free space, by their number there.
    pub fn group(&self, i: usize) -> Vec<Cluster> {
        let (terms, compression) = (self.params.terms(), &self.params.compress);
        match (self.groups.get(i), &self.space) {
            (Some(group), _) => {
                let rows: Vec<Row> = group.par_iter().map(|&r| self.gather.row(&self.ground, r)).collect();
                compress(group.clone(), rows, terms, (compression, self.scale))
            }
            (None, Some((space, scale, groups))) => {
                let group = &groups[i - self.groups.len()];
                let rows: Vec<Row> = group.par_iter().map(|&point| space.row(&self.ground, point)).collect();
                compress(group.clone(), rows, terms, (compression, *scale))
            }
            (None, None) => Vec::new(),
        }
    }

    /// The receiver that each relight ray of each probe meets.
    pub fn hits(&self) -> Vec<u32> {
        self.rays().hits(&self.ground)
    }

    fn rays(&self) -> RelightRays {
        RelightRays::new(self.params.relight_rays, self.params.sh_order)
    }

    /// The whole operator.
    pub fn all(self) -> Transport {
        let clusters = |groups: Range<usize>| groups.into_par_iter().flat_map_iter(|i| self.group(i)).collect();
        let texels = self.groups.len();
        Transport {
            clusters: clusters(0..texels),
            volume: self.volume().map(|volume| Volume { clusters: clusters(texels..self.groups()), ..volume }),
            rays: self.rays(),
            hits: self.hits(),
            radius: self.ground.radius,
            params: self.params,
            atlas: self.atlas,
            probes: self.ground.probes,
            receivers: self.ground.receivers.list,
        }
    }
}

fn space(ground: &Ground, spacing: f32, params: &TransportParams) -> Result<(Space, f64, Vec<Vec<u32>>)> {
    let space = Space::new(ground, spacing, params.rays, (params.sh_order, params.interpolation))?;
    let points = space.points();
    let chosen = sample(points.len(), SCALE_ROWS);
    let scale = mean_square(&chosen.par_iter().map(|&point| space.row(ground, point)).collect::<Vec<_>>());
    let groups = groups(&points, params.compress.most_receivers as usize);
    Ok((space, scale, groups))
}
