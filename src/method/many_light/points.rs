//! Where virtual point lights lie: evenly on all surfaces that may matter, as triangles and barycentric weights (§2.4).
//!
//! *Paper*: spread over the surfaces by point repulsion ([`super::repel`]). *Ours*: then each moves into the middle of what is nearest to it,
//! and stands for that area ([`super::settle`]). *Ours*: a side of a surface counts where a chain of at most
//! [`STEPS`] + 1 free lines of sight joins it with the scene's sensor, so that no lights are spent on the outside of a room's walls and the
//! inside of its furniture; everywhere, if the scene has no sensor, or hardly any side can be joined with it. Both sides count of materials
//! that have two.

use super::place::Place;
use super::repel::{point, spread};
use super::settle::{Sample, settle};
use crate::base::math::{Basis, hash_words};
use crate::lightmap::visible::facing;
use crate::material::Surface;
use crate::material::bsdf::warp::cosine_hemisphere;
use crate::transport::{Sampler, World};
use glam::{Vec2, Vec3};
use rayon::prelude::*;

/// Random walks from a candidate towards what the sensor sees.
const WALKS: u32 = 8;
/// Their steps.
const STEPS: u32 = 3;
/// Samples of the surfaces for each light.
const SAMPLES: u32 = 16;
/// Most candidates for a light.
const MOST_DRAWS: u32 = 16 * SAMPLES;

/// Lights and what they stand for.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Places {
    /// Where they are.
    pub list: Vec<Place>,
    /// The area of each, m².
    pub areas: Vec<f32>,
}

/// Spreads `count` lights, which push one another apart in `repulsion` steps. `world` is that of a path's first frame.
pub fn place(world: &World, count: u32, repulsion: u32, seed: u32) -> Places {
    let sides = sides(world);
    let Some(&(_, _, total)) = sides.last() else { return Places::default() };
    let (samples, drawn) = samples(world, &sides, total, count, seed);
    // The area of all samples, of which each has its share.
    let share = total / f64::from(drawn);
    let step = samples.len() as f64 / f64::from(count);
    let start: Vec<Place> = (0..count).map(|i| samples[(f64::from(i) * step) as usize]).collect();
    let geometry = &world.scene.geometry;
    let area = share * step;
    let spacing = (area * 2.0 / 3f64.sqrt()).sqrt() as f32;
    let spread = spread(geometry, &start, spacing, repulsion);
    let sample = |place: &Place| {
        let point = point(geometry, *place);
        Sample { p: point.p, n: point.n }
    };
    let [all, points] = [&samples, &spread].map(|list| list.par_iter().map(sample).collect::<Vec<_>>());
    let settled = settle(&all, points, spacing);
    let (list, areas) = settled.into_iter().flatten().map(|(k, n)| (samples[k as usize], (share * f64::from(n)) as f32)).unzip();
    Places { list, areas }
}

/// Places on sides that matter, evenly by area, [`SAMPLES`] or more a light, and of how many candidates.
fn samples(world: &World, sides: &[Side], total: f64, count: u32, seed: u32) -> (Vec<Place>, u32) {
    let eye = world.scene.sensor.as_ref().map(|s| s.position());
    let matters = |place: &Place, stream: u32| eye.is_none_or(|eye| is_joined(world, place, eye, stream));
    let wanted = (SAMPLES * count) as usize;
    let mut found = Vec::new();
    let mut batches = 0;
    let candidates = |batch: u32| {
        let stream = move |i: u32| hash_words(&[seed, batch, i]);
        (0..count).into_par_iter().with_min_len(64).map(move |i| (draw(sides, total, (i, count), stream(i)), stream(i)))
    };
    while found.len() < wanted && batches < MOST_DRAWS {
        found.par_extend(candidates(batches).filter(|(place, stream)| matters(place, *stream)).map(|(place, _)| place));
        batches += 1;
    }
    if found.len() < wanted {
        batches = SAMPLES;
        found = (0..batches).into_par_iter().flat_map(candidates).map(|(place, _)| place).collect();
    }
    // In order along the surfaces, so that every so-manieth are spread as all are.
    found.sort_by_key(|place| (place.triangle, place.back));
    (found, batches * count)
}

/// Triangle, whether its back is meant, and the area up to here.
type Side = (u32, bool, f64);

/// All sides of opaque surfaces.
fn sides(world: &World) -> Vec<Side> {
    let geometry = &world.scene.geometry;
    let mut sum = 0.0;
    let mut sides = Vec::new();
    for triangle in 0..geometry.triangles.len() as u32 {
        let bsdf = &world.scene.materials[geometry.object(triangle).material as usize].bsdf;
        let area = 0.5 * f64::from(geometry.area_normal(triangle).length());
        if bsdf.is_transmissive() || !area.is_finite() || area <= 0.0 {
            continue;
        }
        for back in if bsdf.is_two_sided() { &[false, true][..] } else { &[false] } {
            sum += area;
            sides.push((triangle, *back, sum));
        }
    }
    sides
}

/// A place in the `i`-th of `n` equal shares of the area.
fn draw(sides: &[Side], total: f64, (i, n): (u32, u32), stream: u32) -> Place {
    let [u, x, y, _] = Sampler::new(stream, 0).next_4d();
    let at = (f64::from(i) + f64::from(u)) / f64::from(n) * total;
    let index = sides.partition_point(|side| side.2 <= at).min(sides.len() - 1);
    let root = x.sqrt();
    Place { triangle: sides[index].0, barycentric: Vec2::new(root * (1.0 - y), root * y), back: sides[index].1 }
}

/// Whether random walks from a side get to where the eye sees.
fn is_joined(world: &World, place: &Place, eye: Vec3, stream: u32) -> bool {
    let surface = place.surface(world);
    let sees = |s: &Surface, n: Vec3| n.dot(eye - s.p) > 0.0 && !world.occluded(&s.spawn_to(eye));
    let n = facing(&surface, place.back);
    sees(&surface, n)
        || (0..WALKS).any(|walk| {
            let mut sampler = Sampler::new(stream, walk);
            let (mut at, mut n) = (surface, n);
            (0..STEPS).any(|_| {
                let d = Basis::from_normal(n).to_world(cosine_hemisphere(sampler.next_2d()));
                let Some(next) = world.intersect(&at.spawn(d)) else { return false };
                n = if next.ng.dot(d) > 0.0 { -next.ng } else { next.ng };
                at = next;
                sees(&at, n)
            })
        })
}
