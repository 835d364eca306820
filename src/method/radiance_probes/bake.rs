//! The bake: the rows of all receivers, in groups that can be made in any order and kept.

use super::cluster::groups;
use super::compress::{Cluster, compress};
use super::operator::Transport;
use super::params::TransportParams;
use super::relight::RelightRays;
use super::seen::Ground;
use super::transport::{Gather, Row};
use crate::base::progress::Progress;
use crate::lightmap::{Atlas, Plan};
use crate::transport::World;
use crate::{Error, Result};
use glam::Vec3;
use rayon::prelude::*;

/// A bake that is ready to start.
pub struct Bake<'a> {
    /// What is baked from.
    pub ground: Ground<'a>,
    params: TransportParams,
    atlas: Atlas,
    gather: Gather,
    scale: f64,
    groups: Vec<Vec<u32>>,
}

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
        Ok(Self { ground, params: *params, atlas: plan.atlas, gather, scale, groups })
    }

    /// Number of groups.
    pub fn groups(&self) -> usize {
        self.groups.len()
    }

    /// The clusters of a group's receivers.
    pub fn group(&self, i: usize) -> Vec<Cluster> {
        let rows: Vec<Row> = self.groups[i].par_iter().map(|&r| self.gather.row(&self.ground, r)).collect();
        compress(self.groups[i].clone(), rows, &self.gather, (&self.params.compress, self.scale))
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
        Transport {
            clusters: (0..self.groups()).into_par_iter().flat_map_iter(|i| self.group(i)).collect(),
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
