//! What rays through probes meet, held against what they meet in the scene.

use super::march::Search;
use super::store::LightField;
use super::trace::{Found, trace};
use crate::base::math::hash_words;
use crate::base::ray::Ray;
use crate::transport::{Sampler, World};
use crate::view::gbuffer::{GBuffer, GLOSSY};
use glam::Vec2;
use rayon::prelude::*;
use serde::Serialize;
use std::ops::AddAssign;

/// Share of a ray's length by which a place may be off and still be the right one.
const TOLERANCE: f32 = 0.01;
/// The same, in texels of the probe that sees it.
const TEXELS: f32 = 2.0;

/// How many rays met what.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct Hits {
    /// All rays.
    pub rays: u64,
    /// Those that meet what they meet in the scene, or nothing where there is nothing.
    pub right: u64,
    /// Those that meet another place.
    pub wrong: u64,
    /// Those that meet nothing where there is something.
    pub missed: u64,
    /// Those that meet something where there is nothing.
    pub false_hits: u64,
    /// Those that all probes lose.
    pub lost: u64,
    /// Those of which the other search finds something else.
    pub differ: u64,
}

impl AddAssign for Hits {
    fn add_assign(&mut self, o: Self) {
        self.rays += o.rays;
        self.right += o.right;
        self.wrong += o.wrong;
        self.missed += o.missed;
        self.false_hits += o.false_hits;
        self.lost += o.lost;
        self.differ += o.differ;
    }
}

/// Rays along the glossy lobes of a view, `samples` a pixel, no longer than `far` metres.
pub fn lobe_rays(world: &World, view: &GBuffer, samples: u32, far: f32) -> Vec<Ray> {
    let rays = |(i, pixel): (usize, &Option<crate::view::gbuffer::Pixel>)| {
        let Some(p) = pixel.as_ref().filter(|p| p.alpha.is_some()) else { return Vec::new() };
        let (surface, stream) = (&p.surface, hash_words(&[i as u32]));
        let bsdf = &world.scene.materials[surface.material as usize].bsdf;
        let ray = |s| {
            let [x, y, lobe, _] = Sampler::new(stream, s).next_4d();
            let sample = bsdf.sample(surface, surface.frame.to_local(p.wo), lobe, Vec2::new(x, y), GLOSSY)?;
            Some(Ray { t_max: far, ..surface.spawn(surface.frame.to_world(sample.wo)) })
        };
        (0..samples).filter_map(ray).collect()
    };
    view.pixels.par_iter().enumerate().flat_map_iter(rays).collect()
}

/// Follows all rays by one search, and by the other to see where they differ.
pub fn hits(world: &World, field: &LightField, rays: &[Ray], search: Search, thickness: f32) -> Hits {
    let other = if search == Search::HiZ { Search::TwoScale } else { Search::HiZ };
    let one = |ray: &Ray| {
        let found = trace(field, ray, search, thickness);
        let mut hits = judge(world, field, ray, found);
        hits.differ = u64::from(differ(found, trace(field, ray, other, thickness)));
        hits
    };
    let add = |mut a: Hits, b: Hits| {
        a += b;
        a
    };
    rays.par_iter().map(one).reduce(Hits::default, add)
}

/// Whether two searches disagree by more than rounding.
fn differ(a: Found, b: Found) -> bool {
    match (a, b) {
        (Found::Surface { t, .. }, Found::Surface { t: other, .. }) | (Found::Lost { t, .. }, Found::Lost { t: other, .. }) => {
            (t - other).abs() > 1e-3 * t.max(other)
        }
        _ => a != b,
    }
}

fn judge(world: &World, field: &LightField, ray: &Ray, found: Found) -> Hits {
    let mut hits = Hits { rays: 1, ..Hits::default() };
    let truth = world.closest(ray).map(|hit| hit.t);
    match (found, truth) {
        (Found::Lost { .. }, _) => hits.lost = 1,
        (Found::Nothing, None) => hits.right = 1,
        (Found::Nothing, Some(_)) => hits.missed = 1,
        (Found::Surface { .. }, None) => hits.false_hits = 1,
        (Found::Surface { probe, t, .. }, Some(truth)) => {
            let texel = field.maps[probe].surfels.texel_angle() * ray.at(t).distance(field.places.position(probe));
            let is_right = (t - truth).abs() < TOLERANCE * truth + TEXELS * texel;
            hits.right = is_right.into();
            hits.wrong = (!is_right).into();
        }
    }
    hits
}
