//! What rays through probes meet, held against what they meet in the scene.

use super::field::LightField;
use super::lobe::lobe_ray;
use super::march::Search;
use super::trace::{Found, trace};
use crate::base::clock::seconds;
use crate::base::math::hash_words;
use crate::base::ray::Ray;
use crate::transport::{Sampler, World};
use crate::view::gbuffer::{GBuffer, Pixel};
use rayon::prelude::*;

/// Share of a ray's length by which a place may be off and still be the right one.
const TOLERANCE: f32 = 0.01;
/// The same, in texels of the probe that sees it.
const TEXELS: f32 = 2.0;
/// Times that all rays are followed; the fastest counts.
const REPEATS: u32 = 3;

/// What became of a ray.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Verdict {
    /// It meets what it meets in the scene, or nothing where there is nothing.
    Right,
    /// It meets another place.
    Wrong,
    /// It meets nothing where there is something.
    Missed,
    /// It meets something where there is nothing.
    False,
    /// All probes lose it.
    Lost,
}

impl Verdict {
    /// All of them, with their names.
    pub const ALL: [(Self, &str); 5] =
        [(Self::Right, "right"), (Self::Wrong, "wrong"), (Self::Missed, "missed"), (Self::False, "false"), (Self::Lost, "lost")];
}

/// A ray along a glossy lobe.
#[derive(Debug, Clone, Copy)]
pub struct LobeRay {
    /// Index of the view's pixel that it leaves.
    pub pixel: usize,
    /// The ray.
    pub ray: Ray,
}

/// Rays along the glossy lobes of a view, `samples` a pixel, no longer than `far` metres.
pub fn lobe_rays(world: &World, view: &GBuffer, samples: u32, far: f32) -> Vec<LobeRay> {
    let rays = |(i, pixel): (usize, &Option<Pixel>)| {
        let Some(p) = pixel.as_ref().filter(|p| p.alpha.is_some()) else { return Vec::new() };
        let stream = hash_words(&[i as u32]);
        let ray = |s| {
            let (ray, _) = lobe_ray(world, (&p.surface, p.wo), far, &mut Sampler::new(stream, s))?;
            Some(LobeRay { pixel: i, ray })
        };
        (0..samples).filter_map(ray).collect()
    };
    view.pixels.par_iter().enumerate().flat_map_iter(rays).collect()
}

/// What probes find of rays, in their order, and the nanoseconds that each takes on all threads together.
pub fn found(field: &LightField, rays: &[LobeRay], search: Search, thickness: f32) -> (Vec<Found>, f64) {
    let mut best = f64::INFINITY;
    let mut found = Vec::new();
    for _ in 0..REPEATS {
        let clock = seconds();
        found = rays.par_iter().map(|lobe| trace(field, &lobe.ray, search, thickness)).collect();
        best = best.min(clock());
    }
    (found, 1e9 * best / rays.len().max(1) as f64)
}

/// Whether two searches disagree on a ray by more than rounding.
pub fn differ(a: Found, b: Found) -> bool {
    match (a, b) {
        (Found::Surface { t, .. }, Found::Surface { t: other, .. }) | (Found::Lost { t, .. }, Found::Lost { t: other, .. }) => {
            (t - other).abs() > 1e-3 * t.max(other)
        }
        _ => a != b,
    }
}

/// Holds what probes find of rays against the scene.
pub fn judge(world: &World, field: &LightField, rays: &[LobeRay], found: &[Found]) -> Vec<Verdict> {
    let one = |(LobeRay { ray, .. }, found): (&LobeRay, &Found)| {
        let truth = world.closest(ray).map(|hit| hit.t);
        match (*found, truth) {
            (Found::Lost { .. }, _) => Verdict::Lost,
            (Found::Nothing, None) => Verdict::Right,
            (Found::Nothing, Some(_)) => Verdict::Missed,
            (Found::Surface { .. }, None) => Verdict::False,
            (Found::Surface { probe, t, .. }, Some(truth)) => {
                let texel = field.maps[probe].surfels.texel_angle() * ray.at(t).distance(field.places.position(probe));
                let is_right = (t - truth).abs() < TOLERANCE * truth + TEXELS * texel;
                if is_right { Verdict::Right } else { Verdict::Wrong }
            }
        }
    };
    rays.par_iter().zip(found).map(one).collect()
}
