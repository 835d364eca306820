//! The operator in memory, and what it makes of the probes' radiance: cluster projection and receiver reconstruction (§4.2).

use super::clusters::{project, reconstruct};
use super::compress::Cluster;
use super::params::TransportParams;
use super::relight::RelightRays;
use super::seen::NO_RECEIVER;
use super::volume::Volume;
use crate::base::math::Rgb;
use crate::base::ray::Ray;
use crate::lightmap::Atlas;
use crate::lightmap::receivers::Receiver;
use crate::material::Surface;
use crate::transport::World;
use glam::Vec3;
use rayon::prelude::*;
use std::borrow::Cow;

/// All that `bake-transport` wrote.
pub struct Transport {
    /// How it was baked.
    pub params: TransportParams,
    /// Where the probes stand, metres.
    pub probes: Vec<Vec3>,
    /// Radius of their support, metres.
    pub radius: f32,
    /// Where receivers lie.
    pub atlas: Atlas,
    /// The receivers.
    pub receivers: Vec<Receiver>,
    /// Directions of relight rays.
    pub rays: RelightRays,
    /// The receiver that each of them meets, probe by probe.
    pub hits: Vec<u32>,
    /// The receivers' rows.
    pub clusters: Vec<Cluster>,
    /// Receivers in free space.
    pub volume: Option<Volume>,
}

impl Transport {
    /// λ, from what the receivers send out (diffuse radiance). `hits`: those of [`Self::hits`] that are not blocked.
    pub fn probe_radiance(&self, hits: &[u32], radiance: &[Rgb]) -> Vec<Rgb> {
        self.rays.project(hits, radiance)
    }

    /// What relight rays meet in a frame's world (§5.1), and the surfaces of shapes that it adds which block some of them: a ray that meets the
    /// k-th of these has the number of receivers and k. *Ours*: a probe that such a shape swallows sees what it saw without.
    pub fn hits_in(&self, world: &World) -> (Cow<'_, [u32]>, Vec<(Surface, Vec3)>) {
        if !world.has_added() {
            return (Cow::Borrowed(&self.hits), Vec::new());
        }
        let rays = self.rays.directions.len();
        let blocker = |p: Vec3, hit: u32| {
            let to = self.receivers.get(hit as usize)?.surface(world, 0).p;
            let d = (to - p).try_normalize()?;
            let ray = Ray { t_max: p.distance(to), ..Ray::new(p, d) };
            if world.occluded_by_added(&ray) { Some((world.intersect(&ray)?, -d)) } else { None }
        };
        let of_probe = |(hits, &p): (&[u32], &Vec3)| -> Vec<Option<(Surface, Vec3)>> {
            let found: Vec<_> = hits.iter().map(|&hit| blocker(p, hit)).collect();
            let is_swallowed = hits.iter().zip(&found).all(|(&hit, found)| match found {
                Some((surface, wo)) => surface.ng.dot(*wo) < 0.0,
                None => hit == NO_RECEIVER,
            });
            if is_swallowed { vec![None; found.len()] } else { found }
        };
        let all: Vec<_> = self.hits.par_chunks(rays).zip(&self.probes).flat_map_iter(of_probe).collect();
        let (mut hits, mut blockers) = (self.hits.clone(), Vec::new());
        for (hit, blocker) in hits.iter_mut().zip(all) {
            if let Some(blocker) = blocker {
                *hit = (self.receivers.len() + blockers.len()) as u32;
                blockers.push(blocker);
            }
        }
        (Cow::Owned(hits), blockers)
    }

    /// What the receivers get by way of the probes: `receiver.rows()` numbers each (Eq. 6).
    pub fn receive(&self, lambda: &[Rgb]) -> Vec<Rgb> {
        self.reconstruct(&self.project(lambda))
    }

    /// Cluster projection: the light of each cluster's own few dimensions.
    pub fn project(&self, lambda: &[Rgb]) -> Vec<Vec<Rgb>> {
        project(&self.clusters, lambda, self.params.terms())
    }

    /// Receiver reconstruction, from what [`Self::project`] gave: `receiver.rows()` numbers each.
    pub fn reconstruct(&self, spaces: &[Vec<Rgb>]) -> Vec<Rgb> {
        reconstruct(&self.clusters, spaces, self.params.receiver.rows(), self.receivers.len())
    }

    /// Bytes of receivers, relight rays and the operator.
    pub fn bytes(&self) -> usize {
        let clusters: usize = self.clusters.iter().map(Cluster::bytes).sum();
        let volume = self.volume.as_ref().map_or(0, Volume::bytes);
        clusters + 4 * self.hits.len() + self.receivers.len() * size_of::<Receiver>() + volume
    }
}
