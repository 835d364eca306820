//! What lights send out: light straight from emitters, shadowed, as diffuse radiance and one lobe, or a few (§2.1, §2.4).
//!
//! *Paper*: shadow maps of a few point lights, a lobe each, merged by filtering. *Ours*: shadow rays to samples of all emitters, those with area
//! and the environment too; each sample is a small light whose lobe is filtered with the others, so that a wide light makes a wide lobe.
//! The magnitude of a lobe is the directional albedo of the material's non-diffuse lobes times the irradiance across the light's direction: a
//! narrow lobe then carries the energy that the material reflects.

use super::arrival::{Arrival, Received};
use super::lobe::{Lobe, exponent_of};
use super::mixture::Mixture;
use super::params::ManyLightParams;
use super::place::Place;
use super::tree::Spot;
use crate::base::math::{Rgb, hash_words, luminance, reflect};
use crate::material::Surface;
use crate::material::bsdf::warp::cosine_hemisphere;
use crate::material::bsdf::{Bsdf, Lobes};
use crate::transport::light_tree::Receiver;
use crate::transport::{Sampler, World};
use crate::view::gbuffer::GLOSSY;
use glam::{Vec2, Vec3};
use rayon::prelude::*;
use std::f32::consts::FRAC_1_PI;

/// Directions over which a diffuse lobe's share towards viewers is averaged.
pub(crate) const VIEWS: u32 = 4;

/// Light that leaves a virtual point light.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Emission {
    /// l_d: diffuse radiance, the same in all directions.
    pub diffuse: Rgb,
    /// Glossy lobes, filtered.
    pub lobes: Mixture,
}

impl Received for Emission {
    fn add(&mut self, other: &Self, scale: f32) {
        self.diffuse += other.diffuse * scale;
        self.lobes.merge(&other.lobes, scale);
    }

    fn weight(&self) -> f32 {
        luminance(self.diffuse) + self.lobes.weight() * FRAC_1_PI
    }
}

/// A light's surface in a frame.
pub struct Site<'w> {
    /// The point.
    pub surface: Surface,
    /// 1 on the side of the shading normal, -1 behind.
    pub(super) side: f32,
    /// Unit shading normal on its side.
    pub n: Vec3,
    bsdf: &'w Bsdf,
    /// What of E_T it sends out as diffuse radiance.
    reflectance: Rgb,
    /// Area that it stands for.
    area: f32,
    /// Exponent of its lobe; `None` without one.
    exponent: Option<f32>,
    /// Most lobes that it keeps of what it reflects.
    lobes: usize,
    clamp: f32,
}

impl<'w> Site<'w> {
    /// Of a light's place, which stands for `area`.
    pub fn new(world: &'w World, place: &Place, area: f32, params: &ManyLightParams) -> Self {
        let (surface, side) = (place.surface(world), place.side());
        let bsdf = world.scene.bsdf(&surface);
        let out = |k: u32| {
            let d = cosine_hemisphere(Vec2::new((k as f32 + 0.5) / VIEWS as f32, (0.618 * k as f32 + 0.3).fract()));
            bsdf.diffuse_out(&surface, Vec3::new(d.x, d.y, d.z * side))
        };
        let reflectance = (0..VIEWS).map(out).sum::<Rgb>() * (FRAC_1_PI / VIEWS as f32);
        let is_glossy = params.lobes > 0 && bsdf.lobes().contains(Lobes::NON_DIFFUSE);
        let exponent = bsdf.alpha(&surface).filter(|_| is_glossy).map(|alpha| exponent(alpha, params));
        let (lobes, clamp) = (params.lobes as usize, params.clamp);
        Self { n: surface.frame.n * side, surface, side, bsdf, reflectance, area, exponent, lobes, clamp }
    }

    /// Where it is.
    pub fn spot(&self) -> Spot {
        Spot { p: self.surface.p, n: self.n, area: self.area }
    }

    /// What it sends out of irradiance across the unit direction `w` that light comes from; `None` from behind.
    fn reflected(&self, w: Vec3, across: Rgb) -> Emission {
        let local = self.surface.frame.to_local(w);
        let cos = local.z * self.side;
        if cos <= 0.0 {
            return Emission::default();
        }
        let taken = across * (cos * self.bsdf.diffuse_in(&self.surface, local));
        let mut emission = Emission { diffuse: taken * self.reflectance, lobes: Mixture::default() };
        if let Some(exponent) = self.exponent {
            let magnitude = across * self.bsdf.glossy_albedo(&self.surface, local, GLOSSY);
            emission.lobes = Mixture::of(&Lobe { direction: reflect(w, self.n), exponent, magnitude }, 1.0, self.lobes);
        }
        emission
    }

    /// What it sends out of light from other lights.
    pub fn receive(&self, arrival: &Arrival) -> Emission {
        let cos = arrival.direction.dot(self.n).max(f32::MIN_POSITIVE);
        // A light that fills the hemisphere has an irradiance of π.
        let solid_angle = arrival.solid_angle.min(self.clamp / (cos * FRAC_1_PI));
        self.reflected(arrival.direction, arrival.radiance * solid_angle)
    }

    /// Of light straight from emitters, the mean of `count` samples.
    fn direct(&self, world: &World, count: u32, stream: u32) -> Emission {
        let mut sum = Emission::default();
        let receiver = Receiver { p: self.surface.p, n: self.n };
        for i in 0..count {
            let [x, y, choice, _] = Sampler::new(stream, i).next_4d();
            let Some(light) = world.light(&receiver, choice, Vec2::new(x, y)) else { continue };
            if light.wi.dot(self.n) <= 0.0 || light.weight == Rgb::ZERO || !light.weight.is_finite() {
                continue;
            }
            if !world.occluded(&light.shadow_ray(&self.surface)) {
                sum.add(&self.reflected(light.wi, light.weight / count as f32), 1.0);
            }
        }
        sum
    }
}

/// The Phong exponent that a roughness has here.
pub fn exponent(alpha: f32, params: &ManyLightParams) -> f32 {
    exponent_of(alpha).clamp(params.min_exponent, params.max_exponent)
}

/// Light straight from emitters that all lights send on. A light's random numbers are the same in every frame, so that light which stays where
/// it is does not flicker.
pub fn direct(world: &World, sites: &[Site], samples: u32, seed: u32) -> Vec<Emission> {
    let of = |(i, site): (usize, &Site)| site.direct(world, samples, hash_words(&[seed, i as u32]));
    sites.par_iter().enumerate().with_min_len(64).map(of).collect()
}
