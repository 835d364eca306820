//! How much of a receiver's light is lost on its way to the probes and back (§5.2, Eq. 12): where more probes are needed, whatever the lights.
//!
//! Light that comes to a receiver x is an expansion in spherical harmonics. P* takes it to the probes: each of them looks about, and sees what
//! x sees of the same points. P_x takes it back. The difference of the two irradiances is linear in the expansion; the length of that
//! functional is the largest error that light of unit length can make.

use super::harmonics::{Harmonics, MAX_TERMS};
use super::operator::Transport;
use super::seen::NO_RECEIVER;
use super::transport::{Gather, Kept};
use crate::base::math::Basis;
use crate::lightmap::receivers::POINTS;
use crate::lightmap::visible::facing;
use crate::scene::Scene;
use crate::transport::World;
use crate::{Error, Result};
use glam::Vec3;
use rayon::prelude::*;
use std::f32::consts::PI;
use std::path::Path;

/// Order of the light that comes to a receiver. *Paper*: 9.
const ORDER: u32 = 9;
/// Most relight rays of a probe that are followed: each of so many.
const RAYS: usize = 1000;

/// The norm at some receivers of an operator that keeps irradiance, relative to that of irradiance itself: 0 where nothing is lost, 1 where
/// everything is.
pub fn norms(world: &World, transport: &Transport, receivers: &[u32]) -> Vec<f32> {
    let places = transport.places();
    let gather = transport.params.gather();
    let harmonics = [Harmonics::new(ORDER), Harmonics::new(transport.params.sh_order)];
    let of = |&r: &u32| norm((world, transport), &gather, &harmonics, r, &transport.row(&places, r));
    receivers.par_iter().map(of).collect()
}

fn norm(
    (world, transport): (&World, &Transport),
    gather: &Gather,
    [incident, probes]: &[Harmonics; 2],
    receiver: u32,
    row: &[(u32, Vec<f32>)],
) -> f32 {
    let r = &transport.receivers[receiver as usize];
    let x = r.surface(world, 0);
    let normal = facing(&x, r.back);
    let frame = Basis::from_normal(x.frame.n * if r.back { -1.0 } else { 1.0 });
    let bsdf = world.scene.bsdf(&x);
    let mut y = [0.0; MAX_TERMS];
    // The irradiance of each harmonic, with the directions that the operator was made with.
    let mut own = [0.0; MAX_TERMS];
    for &local in gather.directions() {
        let d = frame.to_world(local);
        if d.dot(normal) > 0.0 {
            incident.evaluate(d, &mut y);
            let factor = PI * bsdf.diffuse_in(&x, x.frame.to_local(d)) / gather.directions().len() as f32;
            own.iter_mut().zip(&y).for_each(|(o, y)| *o += factor * y);
        }
    }
    let mut left = own;
    let rays = transport.rays.directions.len();
    let step = rays.div_ceil(RAYS);
    let share = 4.0 * PI / rays.div_ceil(step) as f32;
    for (probe, alpha) in row {
        let hits = &transport.hits[*probe as usize * rays..][..rays];
        for (d, hit) in transport.rays.directions.iter().zip(hits).step_by(step).filter(|(_, hit)| **hit != NO_RECEIVER) {
            probes.evaluate(*d, &mut y);
            let back: f32 = alpha.iter().zip(&y).map(|(a, y)| a * y).sum();
            let seen = transport.receivers[*hit as usize].surface(world, *hit as usize % POINTS).p;
            let Some(towards) = (seen - x.p).try_normalize() else { continue };
            if back == 0.0 || towards.dot(normal) <= 0.0 || world.occluded(&x.spawn_to(seen)) {
                continue;
            }
            incident.evaluate(towards, &mut y);
            left.iter_mut().zip(&y).for_each(|(l, y)| *l -= share * back * y);
        }
    }
    let length = |v: &[f32]| v.iter().map(|x| x * x).sum::<f32>().sqrt();
    length(&left) / length(&own).max(f32::MIN_POSITIVE)
}

/// An operator whose round trip can be measured.
///
/// # Errors
/// It cannot be read, or keeps sh1, whose first number is not irradiance.
pub fn load(folder: &Path, scene: &Scene) -> Result<Transport> {
    let transport = Transport::load(folder, scene)?;
    match transport.params.receiver {
        Kept::Irradiance => Ok(transport),
        Kept::Sh1 => Err(Error::input(folder, "its texels keep sh1: bake with --receiver irradiance")),
    }
}

impl Transport {
    /// Cluster of each receiver, and its place there.
    pub fn places(&self) -> Vec<(u32, u32)> {
        let mut places = vec![(0, 0); self.receivers.len()];
        for (c, cluster) in self.clusters.iter().enumerate() {
            cluster.receivers.iter().enumerate().for_each(|(k, &r)| places[r as usize] = (c as u32, k as u32));
        }
        places
    }

    /// The first number of a receiver's row: α of each probe that has a part in it.
    pub fn row(&self, places: &[(u32, u32)], receiver: u32) -> Vec<(u32, Vec<f32>)> {
        let (c, k) = places[receiver as usize];
        let cluster = &self.clusters[c as usize];
        let (terms, width) = (self.params.terms(), self.params.terms() * cluster.probes.len());
        let at = k as usize * self.params.receiver.rows() * cluster.rank;
        let u = &cluster.reconstruction[at..at + cluster.rank];
        let value = |v: usize| -> f32 {
            u.iter().enumerate().map(|(n, u)| u.to_f32() * cluster.projection[n * width + v].to_f32()).sum()
        };
        let alpha = |slot: usize| (slot * terms..(slot + 1) * terms).map(value).collect::<Vec<f32>>();
        cluster.probes.iter().enumerate().map(|(slot, &probe)| (probe, alpha(slot))).collect()
    }

    /// Where a receiver is, metres.
    pub fn place(&self, world: &World, receiver: u32) -> Vec3 {
        self.receivers[receiver as usize].surface(world, 0).p
    }
}
