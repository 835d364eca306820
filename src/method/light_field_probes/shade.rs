//! The layers of a view that light field probes light.

use super::LightFieldParams;
use super::field::LightField;
use super::lobe::along_lobes;
use crate::base::math::{Rgb, hash_words};
use crate::material::bsdf::{Lobes, Query};
use crate::transport::World;
use crate::view::direct::direct;
use crate::view::gbuffer::{GBuffer, GLOSSY, Pixel};
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

/// Branches of a pixel's random stream: direct light of either layer, and rays along the glossy lobes.
pub(crate) const BRANCHES: [u32; 3] = [1, 2, 3];

impl Shading<'_> {
    /// The length of rays in a scene.
    pub fn far(world: &World) -> f32 {
        let (low, high) = world.scene.geometry.bounds();
        2.0 * low.distance(high).max(f32::MIN_POSITIVE)
    }

    /// The diffuse layer, linear radiance.
    pub fn diffuse(&self, view: &GBuffer) -> Vec<Rgb> {
        view.shade([self.seed, self.frame], |p, stream| {
            let surface = &p.surface;
            let bsdf = self.world.scene.bsdf(surface);
            let albedo = bsdf.diffuse_albedo(surface, surface.frame.to_local(p.wo));
            if albedo == Rgb::ZERO {
                return Rgb::ZERO;
            }
            let query = Query { lobes: Lobes::DIFFUSE, ..Query::default() };
            let around = self.field.irradiance(surface.p, p.normal);
            self.direct(p, query, hash_words(&[stream, BRANCHES[0]])) + albedo * around * FRAC_1_PI
        })
    }

    /// The glossy layer, linear radiance.
    pub fn glossy(&self, view: &GBuffer) -> Vec<Rgb> {
        view.shade([self.seed, self.frame], |p, stream| {
            if p.alpha.is_none() {
                return Rgb::ZERO;
            }
            let rays = hash_words(&[stream, BRANCHES[2]]);
            let along = along_lobes((self.world, self.field), (&p.surface, p.wo), (&self.params, self.far), rays);
            self.direct(p, GLOSSY, hash_words(&[stream, BRANCHES[1]])) + along
        })
    }

    fn direct(&self, p: &Pixel, query: Query, stream: u32) -> Rgb {
        direct(self.world, p, query, self.params.direct_samples, stream)
    }
}
