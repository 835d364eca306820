//! A scene made ready for rays.

use super::bvh::{BEAM, Bvh};
use super::facet::Facet;
use super::light_sample::LightSample;
use super::light_tree::Receiver;
use super::lights::Lights;
use super::mirrors::Mirrors;
use super::outlook::Outlook;
use crate::base::math::Rgb;
use crate::base::ray::{Hit, Ray};
use crate::material::Surface;
use crate::scene::{Animation, Scene};
use glam::{Vec2, Vec3};
use rayon::prelude::*;
use std::sync::Arc;

/// Scene, BVH and emitter distributions: what every ray-tracing stage takes.
///
/// The world of an animation's frame shares with that of the scene whatever is the same in both.
pub struct World {
    /// The scene.
    pub scene: Scene,
    /// Acceleration structure over the scene's own triangles.
    pub bvh: Arc<Bvh>,
    /// Its emitters, ready for sampling.
    pub lights: Arc<Lights>,
    /// In which emitters are drawn, too.
    pub mirrors: Mirrors,
    pub(crate) facets: Arc<Vec<Facet>>,
    /// What an animation adds to the scene's own triangles.
    pub(crate) added: Option<Box<Added>>,
    /// Whether shapes emit that do not in the scene file: `facets` do not tell of them.
    pub(crate) relit: bool,
}

/// Triangles after those of the scene.
///
/// *Ours*: a tree of their own, asked after the scene's, as the latter takes seconds to build.
pub(crate) struct Added {
    pub(crate) bvh: Bvh,
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
        let bvh = Bvh::build(&scene, &|t| keep(&scene, t)).into();
        let lights = Lights::new(&scene).into();
        let facets = facets(&scene, 0).into();
        Self { scene, bvh, lights, mirrors: Mirrors::default(), facets, added: None, relit: false }.with_mirrors()
    }

    /// The world of a frame: this one's, which is that of `animation`'s scene, with the animation's lights, materials and objects. A world
    /// without transmissive shapes stays without.
    pub fn at(&self, animation: &Animation, frame: u32) -> Self {
        let scene = animation.scene_at(&self.scene, frame);
        let (own, all) = (&self.scene.geometry, &scene.geometry);
        let first = own.triangles.len() as u32;
        let added = (all.triangles.len() as u32 > first)
            .then(|| Box::new(Added { bvh: self.bvh.beside(&scene, first), facets: facets(&scene, first) }));
        let relit = own.objects.iter().zip(&all.objects).any(|(a, b)| a.emitter != b.emitter);
        let lights = if animation.changes_light() { self.lights.of(&scene).into() } else { self.lights.clone() };
        let (bvh, facets, mirrors) = (self.bvh.clone(), self.facets.clone(), Mirrors::default());
        Self { scene, bvh, lights, mirrors, facets, added, relit }.with_mirrors()
    }

    fn with_mirrors(mut self) -> Self {
        self.mirrors = Mirrors::of(&self);
        self
    }

    /// The same world, whose paths draw little of its environment but what is seen from where they are.
    pub fn with_outlook(mut self) -> Self {
        let outlook = Outlook::new(&self).map(Arc::new);
        if let Some(lights) = Arc::get_mut(&mut self.lights) {
            lights.outlook = outlook;
        }
        self
    }

    /// First hit of a ray.
    #[inline]
    pub fn closest(&self, ray: &Ray) -> Option<Hit> {
        let own = self.bvh.closest(&self.scene, &self.facets, ray);
        match &self.added {
            None => own,
            Some(added) => added.closest(&self.scene, ray, own),
        }
    }

    /// First hits of at most [`BEAM`] rays: each one's [`World::closest`], sooner where they begin at one point and go in much the same
    /// direction.
    pub fn closest_of(&self, rays: &[Ray]) -> [Option<Hit>; BEAM] {
        let mut hits = [None; BEAM];
        self.bvh.closest_of(&self.scene, &self.facets, rays, &mut hits);
        if let Some(added) = &self.added {
            hits.iter_mut().zip(rays).for_each(|(hit, ray)| *hit = added.closest(&self.scene, ray, *hit));
        }
        hits
    }

    /// First surface along a ray.
    #[inline]
    pub fn intersect(&self, ray: &Ray) -> Option<Surface> {
        self.closest(ray).map(|hit| self.surface(&hit))
    }

    /// Tells the caches what the scattering model at a surface will read.
    #[inline]
    pub fn prefetch(&self, surface: &Surface) {
        self.scene.bsdf(surface).prefetch(surface);
    }

    /// The surface that a camera's ray shows: where the scene hides its emitters, the first that is none.
    pub fn seen(&self, ray: &Ray) -> Option<Surface> {
        self.seen_from(ray, self.closest(ray))
    }

    /// [`World::seen`] of a ray whose first hit is known.
    pub fn seen_from(&self, ray: &Ray, first: Option<Hit>) -> Option<Surface> {
        let mut surface = self.surface(&first?);
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

    /// Draws an emitter for a receiver, and a direction to it: [`Lights::sample`].
    #[inline]
    pub(crate) fn light(&self, receiver: &Receiver, choice: f32, v: Vec2) -> Option<LightSample> {
        self.lights.sample(&self.scene, receiver, choice, v)
    }

    /// Radiance of the environment as a camera's ray in direction `d` shows it.
    pub fn backdrop(&self, d: Vec3) -> Rgb {
        if self.scene.hide_emitters { Rgb::ZERO } else { self.lights.environment(d) }
    }

    /// The surface that a hit lies on.
    #[inline]
    pub fn surface(&self, hit: &Hit) -> Surface {
        let facet = self.facets.get(hit.triangle as usize).unwrap_or_else(|| self.added_facet(hit.triangle));
        let mut surface = match facet.round(&self.scene.geometry) {
            None => facet.surface(hit),
            Some(round) => facet.surface_of(round, hit),
        };
        if self.relit {
            surface.emitter = self.scene.geometry.objects[surface.object as usize].emitter;
        }
        surface
    }

    /// Where a hit lies: [`World::surface`]'s point.
    pub fn point(&self, hit: &Hit) -> Vec3 {
        let facet = self.facets.get(hit.triangle as usize).unwrap_or_else(|| self.added_facet(hit.triangle));
        match facet.round(&self.scene.geometry) {
            None => facet.point(hit),
            Some(round) => facet.surface_of(round, hit).p,
        }
    }

    #[cold]
    fn added_facet(&self, triangle: u32) -> &Facet {
        let own = self.facets.len();
        self.added.as_ref().map_or(&self.facets[0], |added| &added.facets[triangle as usize - own])
    }

    /// Whether an animation adds shapes to the scene's.
    pub fn has_added(&self) -> bool {
        self.added.is_some()
    }

    /// Whether a surface is of a shape that an animation adds.
    pub fn is_added(&self, surface: &Surface) -> bool {
        surface.triangle as usize >= self.facets.len()
    }

    /// Whether a shape that an animation adds blocks a ray.
    pub fn occluded_by_added(&self, ray: &Ray) -> bool {
        self.added.as_deref().is_some_and(|added| added.bvh.occluded(&self.scene, ray))
    }

    /// Whether something blocks a ray.
    #[inline]
    pub fn occluded(&self, ray: &Ray) -> bool {
        let by_added = |added: &Added| added.bvh.occluded(&self.scene, ray);
        self.bvh.occluded(&self.scene, ray) || self.added.as_deref().is_some_and(by_added)
    }
}

impl Added {
    /// The closer of `own`, the scene's hit, and one of these triangles; at the same distance `own`, which has the lower index.
    fn closest(&self, scene: &Scene, ray: &Ray, own: Option<Hit>) -> Option<Hit> {
        let nearer = Ray { t_max: own.map_or(ray.t_max, |hit| hit.t), ..*ray };
        let found = self.bvh.closest(scene, &[], &nearer);
        match (&found, own) {
            (Some(hit), Some(other)) if hit.t >= other.t => own,
            (None, _) => own,
            _ => found,
        }
    }
}

/// The facets of a scene's triangles from `first` on.
fn facets(scene: &Scene, first: u32) -> Vec<Facet> {
    (first..scene.geometry.triangles.len() as u32).into_par_iter().map(|t| Facet::new(&scene.geometry, t)).collect()
}
