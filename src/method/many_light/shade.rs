//! Indirect light at a view's points (Eq. 2).
//!
//! *Paper*: materials are a diffuse and a Phong lobe. *Ours*: the Phong lobe stands for the material's non-diffuse lobes, with their directional
//! albedo towards the viewer and the exponent of their roughness; what is gathered leaves both albedos out, so that textures stay sharp where
//! light is interpolated.

use super::arrival::{Arrival, Received};
use super::bounce::Structure;
use super::descend::{Cone, Receiver};
use super::emit::{Site, exponent};
use super::gather::Gather;
use super::lobe::density;
use super::params::ManyLightParams;
use crate::base::math::{Rgb, hash_words, luminance, reflect};
use crate::material::Surface;
use crate::material::bsdf::Lobes;
use crate::transport::World;
use crate::view::gbuffer::{GBuffer, Pixel};
use crate::view::mirror_light::glossy_albedo;
use glam::Vec3;
use std::f32::consts::{FRAC_1_PI, PI};

/// Marks random numbers of gathers at pixels.
pub(crate) const PIXEL: u32 = 0x7069_7865;

/// Light at a point, without its albedos.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Light {
    /// E_T: what enters the diffuse lobe.
    pub irradiance: Rgb,
    /// Radiance, averaged over the glossy lobe.
    pub glossy: Rgb,
}

impl Received for Light {
    fn add(&mut self, other: &Self, scale: f32) {
        self.irradiance += other.irradiance * scale;
        self.glossy += other.glossy * scale;
    }

    fn weight(&self) -> f32 {
        luminance(self.irradiance) * FRAC_1_PI + luminance(self.glossy)
    }
}

/// A frame's light and how it is gathered.
pub struct Shading<'a> {
    /// The frame's world.
    pub world: &'a World,
    /// The lights.
    pub sites: &'a [Site<'a>],
    /// Their tree.
    pub structure: &'a Structure,
    /// Their light.
    pub gather: &'a Gather,
    /// How.
    pub params: &'a ManyLightParams,
    /// Seed and frame.
    pub seeds: [u32; 2],
}

impl Shading<'_> {
    /// Indirect light at a pixel, and the nodes that were visited for it.
    pub fn light(&self, i: usize, p: &Pixel) -> (Light, u32) {
        let [seed, frame] = self.seeds;
        let alpha = p.alpha.filter(|&alpha| !self.params.follows(alpha));
        self.gathered(&p.surface, p.wo, alpha, hash_words(&[seed, frame, PIXEL, i as u32]))
    }

    /// The same at a surface that is seen from the unit direction `wo`, of whose glossy lobe the alpha is given, if light is gathered for it.
    pub fn gathered(&self, surface: &Surface, wo: Vec3, alpha: Option<f32>, stream: u32) -> (Light, u32) {
        let bsdf = self.world.scene.bsdf(surface);
        let side = 1f32.copysign(surface.frame.to_local(wo).z);
        let n = surface.frame.n * side;
        let takes_diffuse = bsdf.lobes().contains(Lobes::DIFFUSE);
        let lobe = alpha.map(|alpha| (reflect(wo, n), exponent(alpha, self.params)));
        let cone = lobe.and_then(|(mirrored, exponent)| Cone::new(mirrored, exponent, self.params));
        let receive = |arrival: &Arrival| {
            let Arrival { direction, solid_angle, radiance } = *arrival;
            let cos = direction.dot(n);
            let mut light = Light::default();
            if cos <= 0.0 {
                return light;
            }
            let clamp = self.params.clamp;
            if takes_diffuse {
                let factor = bsdf.diffuse_in(surface, surface.frame.to_local(direction));
                light.irradiance = radiance * (factor * (cos * solid_angle).min(clamp * PI));
            }
            if let Some((mirrored, exponent)) = lobe {
                let density = density(self.params.kernel, exponent, direction.dot(mirrored));
                light.glossy = radiance * (solid_angle * density).min(clamp);
            }
            light
        };
        let is_seen = |light: u32| {
            let site = &self.sites[self.structure.tree.order[light as usize] as usize];
            !self.world.occluded(&surface.spawn_to(site.surface.p))
        };
        self.gather.at(&Receiver { p: surface.p, n, lobe: cone }, receive, is_seen, stream)
    }

    /// The diffuse and glossy layers of indirect light.
    pub fn layers(&self, view: &GBuffer, lights: &[Light]) -> [Vec<Rgb>; 2] {
        let of = |diffuse: bool| {
            let pixel = |(pixel, light): (&Option<Pixel>, &Light)| match pixel {
                Some(p) if diffuse => light.irradiance * self.diffuse_out(&p.surface, p.wo),
                Some(p) if p.alpha.is_some() => light.glossy * glossy_albedo(self.world, &p.surface, p.wo),
                _ => Rgb::ZERO,
            };
            view.pixels.iter().zip(lights).map(pixel).collect()
        };
        [of(true), of(false)]
    }

    /// What a surface sends to `wo` of what enters its diffuse lobe.
    pub fn diffuse_out(&self, surface: &Surface, wo: Vec3) -> Rgb {
        let bsdf = self.world.scene.bsdf(surface);
        bsdf.diffuse_out(surface, surface.frame.to_local(wo)) * FRAC_1_PI
    }
}
