//! The layers of a view that light field probes light.

use super::LightFieldParams;
use super::ambient::irradiance;
use super::store::LightField;
use super::trace::{Found, trace};
use crate::base::math::{Rgb, hash_words};
use crate::material::bsdf::{Lobes, Query};
use crate::transport::path::{PathParams, scattered};
use crate::transport::{Sampler, World};
use crate::view::gbuffer::{GBuffer, GLOSSY, Pixel};
use glam::Vec2;
use rayon::prelude::*;
use std::f32::consts::FRAC_1_PI;

/// What a view is made of.
pub struct Shading<'a> {
    /// The scene, for direct light.
    pub world: &'a World,
    /// The probes, for all other light.
    pub field: &'a LightField,
    /// How.
    pub params: LightFieldParams,
    /// Seed of the random numbers.
    pub seed: u32,
    /// Frame of the path.
    pub frame: u32,
    /// Length of rays, metres: more than the scene is across.
    pub far: f32,
}

/// Direct light alone.
const DIRECT: PathParams = PathParams { max_depth: 1, rr_depth: u32::MAX };

impl Shading<'_> {
    /// The diffuse layer, linear radiance.
    pub fn diffuse(&self, view: &GBuffer) -> Vec<Rgb> {
        self.layer(view, |p, stream| {
            let surface = &p.surface;
            let bsdf = &self.world.scene.materials[surface.material as usize].bsdf;
            let albedo = bsdf.diffuse_albedo(surface, surface.frame.to_local(p.wo));
            if albedo == Rgb::ZERO {
                return Rgb::ZERO;
            }
            let query = Query { lobes: Lobes::DIFFUSE, ..Query::default() };
            let around = irradiance(&self.field.grid, &self.field.ambient, surface.p, p.normal);
            self.direct(p, query, stream, 1) + albedo * around * FRAC_1_PI
        })
    }

    /// The glossy layer, linear radiance.
    pub fn glossy(&self, view: &GBuffer) -> Vec<Rgb> {
        self.layer(view, |p, stream| {
            if p.alpha.is_none() {
                return Rgb::ZERO;
            }
            let sampler = |s| Sampler::new(hash_words(&[stream, 3]), s);
            let rays = (0..self.params.samples).map(|s| self.along_lobe(p, &mut sampler(s)));
            let sum: Rgb = rays.filter(|c| c.is_finite()).sum();
            self.direct(p, GLOSSY, stream, 2) + sum / self.params.samples as f32
        })
    }

    fn layer(&self, view: &GBuffer, of: impl Fn(&Pixel, u32) -> Rgb + Sync) -> Vec<Rgb> {
        let pixel = |(i, pixel): (usize, &Option<Pixel>)| {
            let stream = hash_words(&[self.seed, self.frame, i as u32]);
            pixel.as_ref().map_or(Rgb::ZERO, |p| of(p, stream))
        };
        view.pixels.par_iter().enumerate().with_min_len(view.size()[0]).map(pixel).collect()
    }

    /// Light straight from emitters.
    fn direct(&self, p: &Pixel, query: Query, stream: u32, branch: u32) -> Rgb {
        let count = self.params.direct_samples;
        let sample = |s| {
            let mut sampler = Sampler::new(hash_words(&[stream, branch]), s);
            scattered(self.world, &p.surface, p.wo, query, None, &DIRECT, &mut sampler)
        };
        (0..count).map(sample).sum::<Rgb>() / count as f32
    }

    /// One ray along the glossy lobe, and the radiance that the probes know of its end.
    fn along_lobe(&self, p: &Pixel, sampler: &mut Sampler) -> Rgb {
        let [x, y, lobe, _] = sampler.next_4d();
        let surface = &p.surface;
        let bsdf = &self.world.scene.materials[surface.material as usize].bsdf;
        let wi = surface.frame.to_local(p.wo);
        let Some(sample) = bsdf.sample(surface, wi, lobe, Vec2::new(x, y), GLOSSY) else { return Rgb::ZERO };
        let mut ray = surface.spawn(surface.frame.to_world(sample.wo));
        ray.t_max = self.far;
        let (probe, t, is_lost) = match trace(self.field, &ray, self.params.search, self.params.thickness) {
            Found::Surface { probe, t, .. } => (probe, t, false),
            Found::Lost { probe, t } => (probe, t, true),
            Found::Nothing => return Rgb::ZERO,
        };
        let to_end = ray.at(t) - self.field.grid.position(probe);
        let light = &self.field.light[probe];
        if is_lost {
            // What the probe sees in that direction is in front of the place; nothing better is known.
            return sample.weight * light.about(to_end, 0.0);
        }
        // Solid angle of the sample at its origin, and what it covers at its end as the probe sees it.
        let level = if sample.delta || self.params.footprint == 0.0 {
            0.0
        } else {
            let omega = self.params.footprint / (sample.pdf * self.params.samples as f32);
            let covered = omega * t * t / to_end.length_squared().max(f32::MIN_POSITIVE);
            let texel = 4.0 * std::f32::consts::PI / (light.size * light.size) as f32;
            0.5 * (covered / texel).max(1.0).log2()
        };
        sample.weight * light.about(to_end, level)
    }
}
