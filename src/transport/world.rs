//! A scene made ready for rays.

use super::bvh::Bvh;
use super::facet::Facet;
use super::lights::Lights;
use crate::base::math::Rgb;
use crate::base::ray::{Hit, Ray};
use crate::material::Surface;
use crate::scene::Scene;
use glam::Vec3;
use rayon::prelude::*;

/// Scene, BVH and emitter distributions: what every ray-tracing stage takes.
pub struct World {
    /// The scene.
    pub scene: Scene,
    /// Its acceleration structure.
    pub bvh: Bvh,
    /// Its emitters, ready for sampling.
    pub lights: Lights,
    pub(crate) facets: Vec<Facet>,
}

impl World {
    /// All shapes, transmissive ones too: for `path-trace`.
    pub fn new(scene: Scene) -> Self {
        Self::with_filter(scene, |_, _| true)
    }

    /// Opaque shapes only: for the probe stages. Also says how many shapes were left out.
    pub fn opaque(scene: Scene) -> (Self, usize) {
        let transmissive: Vec<bool> = scene.materials.iter().map(|m| m.bsdf.is_transmissive()).collect();
        let left_out = scene.geometry.objects.iter().filter(|o| transmissive[o.material as usize]).count();
        (Self::with_filter(scene, |s, t| !transmissive[s.geometry.object(t).material as usize]), left_out)
    }

    fn with_filter(scene: Scene, keep: impl Fn(&Scene, u32) -> bool) -> Self {
        let bvh = Bvh::build(&scene, &|t| keep(&scene, t));
        let lights = Lights::new(&scene);
        let count = scene.geometry.triangles.len() as u32;
        let facets = (0..count).into_par_iter().map(|t| Facet::new(&scene.geometry, t)).collect();
        Self { scene, bvh, lights, facets }
    }

    /// First hit of a ray.
    pub fn closest(&self, ray: &Ray) -> Option<Hit> {
        self.bvh.closest(&self.scene, ray)
    }

    /// First surface along a ray.
    #[inline]
    pub fn intersect(&self, ray: &Ray) -> Option<Surface> {
        self.closest(ray).map(|hit| self.surface(&hit))
    }

    /// The surface that a camera's ray shows: where the scene hides its emitters, the first that is none.
    pub fn seen(&self, ray: &Ray) -> Option<Surface> {
        let mut surface = self.intersect(ray)?;
        if !self.scene.hide_emitters {
            return Some(surface);
        }
        let mut way = 0.0;
        while surface.emitter.is_some() {
            way += surface.t;
            let next = Ray { t_max: ray.t_max - way, ..surface.spawn(ray.d) };
            surface = self.intersect(&next)?;
        }
        surface.t += way;
        Some(surface)
    }

    /// Radiance of the environment as a camera's ray in direction `d` shows it.
    pub fn backdrop(&self, d: Vec3) -> Rgb {
        if self.scene.hide_emitters { Rgb::ZERO } else { self.lights.environment(d) }
    }

    /// The surface that a hit lies on.
    #[inline]
    pub fn surface(&self, hit: &Hit) -> Surface {
        let facet = &self.facets[hit.triangle as usize];
        match facet.round(&self.scene.geometry) {
            None => facet.surface(hit),
            Some(round) => facet.surface_of(round, hit),
        }
    }

    /// Whether something blocks a ray.
    pub fn occluded(&self, ray: &Ray) -> bool {
        self.bvh.occluded(&self.scene, ray)
    }
}
