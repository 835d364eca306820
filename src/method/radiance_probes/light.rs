//! A frame's light: direct light at the receivers, and what comes of it by way of the probes (§4.2).

use super::harmonics::cosine_factor;
use super::operator::Transport;
use super::params::RadianceProbeParams;
use super::transport::{Kept, first_four};
use super::volume::{NUMBERS, Volume, irradiance};
use crate::Result;
use crate::base::clock::Clock;
use crate::base::math::{Rgb, hash_words};
use crate::lightmap::LightMap;
use crate::lightmap::lookup::sides;
use crate::lightmap::receivers::{POINTS, Receiver, spread};
use crate::material::Surface;
use crate::material::bsdf::warp::cosine_hemisphere;
use crate::method::Setup;
use crate::scene::Animation;
use crate::transport::path::{PathParams, transmitted_irradiance};
use crate::transport::{Sampler, World};
use crate::view::gbuffer::GLOSSY;
use glam::{Vec2, Vec3};
use rayon::prelude::*;
use std::borrow::Cow;
use std::f32::consts::FRAC_1_PI;

/// Light at the receivers.
#[derive(Debug, Clone)]
pub struct Light {
    /// E_T straight from emitters.
    pub direct: Vec<Rgb>,
    /// What comes by way of the probes, as many numbers a receiver as it keeps.
    pub indirect: Vec<Rgb>,
    /// The same in free space; empty without a volume.
    pub volume: Vec<Rgb>,
}

/// E_T that emitters send to each receiver. The random numbers of a receiver are the same in every frame, so that light which stays where it
/// is does not flicker.
pub fn direct(world: &World, receivers: &[Receiver], samples: u32, seed: u32) -> Vec<Rgb> {
    let of = |r: &Receiver| {
        let stream = hash_words(&[seed, r.pixel, u32::from(r.back)]);
        let sample = |i: u32| {
            let at = r.surface(world, i as usize);
            transmitted_irradiance(world, &at, r.back, None, &PathParams::DIRECT, &mut Sampler::new(stream, i))
        };
        (0..samples).map(sample).sum::<Rgb>() / samples as f32
    };
    receivers.par_iter().with_min_len(64).map(of).collect()
}

/// What of E_T a receiver sends on as diffuse radiance: the mean over directions of `diffuse_out`, over π. *Ours*: what its other lobes reflect
/// goes on as if it were diffuse, of an irradiance that is E_T before the coat; in the paper it is lost.
fn reflectance(world: &World, r: &Receiver) -> Rgb {
    let side = if r.back { -1.0 } else { 1.0 };
    let (mut diffuse, mut others, mut entering) = (Rgb::ZERO, Rgb::ZERO, 0.0);
    for k in 0..POINTS {
        let at = r.surface(world, k);
        let d = cosine_hemisphere(Vec2::new((k as f32 + 0.5) / POINTS as f32, (0.618 * k as f32 + 0.3).fract()));
        let d = Vec3::new(d.x, d.y, d.z * side);
        let bsdf = world.scene.bsdf(&at);
        diffuse += bsdf.diffuse_out(&at, d);
        others += bsdf.glossy_albedo(&at, d, GLOSSY);
        entering += bsdf.diffuse_in(&at, d);
    }
    let before = if entering > 0.0 { POINTS as f32 / entering } else { 0.0 };
    (diffuse + others * before) * (FRAC_1_PI / POINTS as f32)
}

/// What lights frames: the operator, and what receivers send on.
pub struct Lighting {
    /// The operator.
    pub transport: Transport,
    /// Of each receiver, in the scene's own colours.
    reflectance: Vec<Rgb>,
    /// Receivers whose material changes from frame to frame.
    changing: Vec<u32>,
    /// Where receivers that keep sh1 face; empty for others.
    normals: Vec<Vec3>,
}

impl Lighting {
    /// Of a setup's frames.
    pub fn load(setup: &Setup) -> Result<Self> {
        let transport = Transport::load(&setup.required_probes()?, &setup.world.scene)?;
        Ok(Self::new(setup.world, transport, setup.animation))
    }

    /// In `world`, the scene's own, whose materials may change from frame to frame.
    pub fn new(world: &World, transport: Transport, animation: Option<&Animation>) -> Self {
        let changed = animation.map_or_else(Vec::new, Animation::changed_materials);
        let reflectance = transport.receivers.par_iter().with_min_len(64).map(|r| reflectance(world, r)).collect();
        let material = |r: &Receiver| world.scene.geometry.object(r.points[0].triangle).material;
        let changes = |r: &u32| changed.binary_search(&material(&transport.receivers[*r as usize])).is_ok();
        let changing = (0..transport.receivers.len() as u32).filter(changes).collect();
        let normal = |r: &Receiver| r.surface(world, 0).frame.n * if r.back { -1.0 } else { 1.0 };
        let keeps_sh1 = transport.params.receiver == Kept::Sh1;
        let normals = transport.receivers.iter().filter(|_| keeps_sh1).map(normal).collect();
        Self { transport, reflectance, changing, normals }
    }

    /// What of E_T each receiver sends on as diffuse radiance in a frame, whose world this is.
    pub fn reflectances(&self, world: &World) -> Cow<'_, [Rgb]> {
        let mut all = Cow::Borrowed(self.reflectance.as_slice());
        if !self.changing.is_empty() {
            let of = |&r: &u32| reflectance(world, &self.transport.receivers[r as usize]);
            let changed: Vec<Rgb> = self.changing.par_iter().with_min_len(64).map(of).collect();
            let all = all.to_mut();
            self.changing.iter().zip(changed).for_each(|(&r, value)| all[r as usize] = value);
        }
        all
    }

    /// Where receivers that keep sh1 face; empty for others.
    pub fn normals(&self) -> &[Vec3] {
        &self.normals
    }

    /// Whether frames differ in what receivers send on.
    pub fn changes(&self) -> bool {
        !self.changing.is_empty()
    }

    /// All light of a frame, whose world this is; passes are timed as the paper does (Table 2). `before`: light that bounces go on from, of
    /// the frame before (§4.2); none for darkness.
    pub fn light(
        &self,
        world: &World,
        params: &RadianceProbeParams,
        (before, seed): (Option<Light>, u32),
        clock: &mut Clock,
    ) -> Light {
        let transport = &self.transport;
        let reflectances = self.reflectances(world);
        let direct = direct(world, &transport.receivers, params.map_samples, seed);
        clock.lap("scene relight");
        let (hits, blockers) = transport.hits_in(world);
        let volume = transport.volume.as_ref();
        let blockers = Blocker::all(world, &blockers, volume, seed);
        let rows = transport.params.receiver.rows();
        let dark = || Light {
            direct: Vec::new(),
            indirect: vec![Rgb::ZERO; direct.len() * rows],
            volume: vec![Rgb::ZERO; volume.map_or(0, |v| v.cells.len() * NUMBERS)],
        };
        let mut light = before.unwrap_or_else(dark);
        for _ in 0..params.bounces {
            let mut radiance = radiance(&direct, &self.irradiance(&light.indirect), &reflectances);
            radiance.par_extend(blockers.par_iter().map(|blocker| blocker.radiance(&light.volume)));
            let lambda = transport.probe_radiance(&hits, &radiance);
            clock.lap("probe relight");
            let spaces = transport.project(&lambda);
            clock.lap("cluster projection");
            light.indirect = transport.reconstruct(&spaces);
            clock.lap("receivers");
            if let Some(volume) = volume {
                light.volume = volume.receive(&lambda, transport.params.terms());
                clock.lap("volume");
            }
        }
        Light { direct, ..light }
    }

    /// Irradiance of what receivers keep: of sh1, by the two factors of Ramamoorthi and Hanrahan 2001.
    fn irradiance<'l>(&self, kept: &'l [Rgb]) -> Cow<'l, [Rgb]> {
        if self.normals.is_empty() {
            return Cow::Borrowed(kept);
        }
        let of = |(light, &n): (&[Rgb], &Vec3)| {
            let [y0, y1 @ ..] = first_four(n);
            let linear: Rgb = light[1..].iter().zip(y1).map(|(&l, y)| l * y).sum();
            light[0] * (y0 * cosine_factor(0) as f32) + linear * cosine_factor(1) as f32
        };
        Cow::Owned(kept.par_chunks_exact(4).zip(&self.normals).map(of).collect())
    }

    /// E_T of all light, from emitters and by way of the probes.
    pub fn total(&self, light: &Light) -> Vec<Rgb> {
        light.direct.iter().zip(self.irradiance(&light.indirect).iter()).map(|(&d, i)| d + i.max(Rgb::ZERO)).collect()
    }
}

/// Of the random stream of a blocker.
pub(crate) const BLOCKER: u32 = 2;

/// A surface that a frame adds in the way of a relight ray. *Ours*: it sends diffuse light back along the ray; in the paper it is black.
struct Blocker {
    /// `diffuse_out` over π.
    out: Rgb,
    /// E_T straight from emitters, by one sample.
    direct: Rgb,
    /// How it takes E_T from a volume.
    taps: Vec<(u32, [f32; NUMBERS])>,
}

impl Blocker {
    /// Of surfaces and the directions towards the probes.
    fn all(world: &World, surfaces: &[(Surface, Vec3)], volume: Option<&Volume>, seed: u32) -> Vec<Self> {
        let of = |(i, (surface, wo)): (usize, &(Surface, Vec3))| {
            let wi = surface.frame.to_local(*wo);
            let out = world.scene.bsdf(surface).diffuse_out(surface, wi) * FRAC_1_PI;
            let mut sampler = Sampler::new(hash_words(&[seed, i as u32, BLOCKER]), 0);
            let direct = transmitted_irradiance(world, surface, wi.z < 0.0, None, &PathParams::DIRECT, &mut sampler);
            Self { out, direct, taps: volume.map_or_else(Vec::new, |v| v.taps(world, surface, *wo)) }
        };
        surfaces.par_iter().enumerate().with_min_len(64).map(of).collect()
    }

    /// What it sends to the probe.
    fn radiance(&self, volume: &[Rgb]) -> Rgb {
        self.out * (self.direct + irradiance(&self.taps, volume))
    }
}

/// Diffuse radiance that receivers send out.
fn radiance(direct: &[Rgb], indirect: &[Rgb], reflectance: &[Rgb]) -> Vec<Rgb> {
    direct.par_iter().zip(indirect).zip(reflectance).map(|((d, i), &r)| (*d + i.max(Rgb::ZERO)) * r).collect()
}

/// A light map of irradiance at receivers, its seams closed, as files have it.
pub fn as_light_map(transport: &Transport, world: &World, values: &[Rgb]) -> LightMap {
    let (geometry, pixels) = (&world.scene.geometry, (transport.atlas.size[0] * transport.atlas.size[1]) as usize);
    let side = |back: bool| {
        let (mut image, mut valid) = (vec![Rgb::ZERO; pixels], vec![false; pixels]);
        for (r, value) in transport.receivers.iter().zip(values).filter(|(r, _)| r.back == back) {
            (image[r.pixel as usize], valid[r.pixel as usize]) = (value.max(Rgb::ZERO), true);
        }
        let any = valid.contains(&true);
        if any {
            spread(geometry, &transport.atlas, &mut image, &valid);
        }
        any.then_some(image)
    };
    let front = side(false).unwrap_or_else(|| vec![Rgb::ZERO; pixels]);
    sides(geometry, &transport.atlas, front, side(true))
}
