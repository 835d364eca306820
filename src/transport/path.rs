//! The path tracer, with the split of the first vertex into its diffuse and non-diffuse lobes.
//!
//! At each vertex one emitter sample and one BSDF sample, combined by the power heuristic (Veach 1997, §9.2), as Mitsuba's
//! `path`. *Ours*: the two halves of the first vertex are two paths of their own that share the camera ray, so one pass gives all
//! layers, each with the noise of a render of that layer alone; and the roulette's throughput leaves the first vertex's
//! weight out, so that a weak lobe's layer is as well sampled as a strong one's.

use super::light_tree::Receiver;
use super::met::{Found, emission_met, environment_met};
use super::vertex::{Vertex, receiver};
use super::{Sampler, World};
use crate::base::math::Rgb;
use crate::base::ray::Ray;
use crate::material::Surface;
use crate::material::bsdf::warp::cosine_hemisphere;
use crate::material::bsdf::{Bsdf, Lobes, Query};
use crate::scene::Scene;
use glam::{Vec2, Vec3};
use serde::{Deserialize, Serialize};
use std::sync::atomic::{AtomicU64, Ordering};

/// Largest probability with which the roulette lets a path live.
pub(crate) const ROULETTE_CAP: f32 = 0.98;

/// How much likelier than its throughput a path lives. *Ours*: with 1, Mitsuba's, every survivor weighs as much as a path that
/// has lost nothing, and where light is found late (caustics, bright corners) few heavy paths make most of the noise. Starting
/// earlier pays for it.
pub(crate) const ROULETTE_MERCY: f32 = 4.0;

/// Depth and termination.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PathParams {
    /// Most scattering vertices a path may have; `u32::MAX` is unbounded.
    pub max_depth: u32,
    /// Russian roulette starts after this many vertices.
    pub rr_depth: u32,
}

impl Default for PathParams {
    fn default() -> Self {
        Self { max_depth: u32::MAX, rr_depth: 2 }
    }
}

impl PathParams {
    /// Light straight from emitters alone.
    pub const DIRECT: Self = Self { max_depth: 1, rr_depth: u32::MAX };

    /// So many rays in a row: the hit of the last is a vertex, too, and none is left out by chance.
    pub fn of_rays(rays: u32) -> Self {
        Self { max_depth: rays + 1, rr_depth: u32::MAX }
    }

    /// What the scene's integrator says, with the defaults for what it does not.
    pub fn of(scene: &Scene) -> Self {
        let default = Self::default();
        // Mitsuba counts the last vertex too, which only emits.
        let max_depth = scene.max_depth.map_or(default.max_depth, |depth| depth.saturating_sub(1));
        Self { max_depth, rr_depth: scene.rr_depth.unwrap_or(default.rr_depth) }
    }
}

/// The three layers of a pixel; their sum is the full image.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Layers {
    /// Emission seen directly: LE.
    pub emission: Rgb,
    /// Diffuse lobe of the first vertex: L(S|D)*DE.
    pub diffuse: Rgb,
    /// Non-diffuse lobes of the first vertex: L(S|D)*S+E.
    pub glossy: Rgb,
}

impl Layers {
    /// The full image.
    pub fn sum(&self) -> Rgb {
        self.emission + self.diffuse + self.glossy
    }
}

/// Diffuse radiance that leaves a surface in a direction (unit, world, away from it), known from elsewhere: a light map.
/// Paths that are given one read it at every vertex but their first, and go on by the non-diffuse lobes alone: less noise, far
/// shorter paths, and the bias of what is known.
pub type KnownDiffuse<'a> = &'a (dyn Fn(&Surface, Vec3) -> Rgb + Sync);

/// One sample of the three layers along a camera ray.
pub fn trace_layers(world: &World, ray: &Ray, params: &PathParams, sampler: &mut Sampler) -> Layers {
    let Some(surface) = world.seen(ray) else {
        return Layers { emission: keep_finite(world.backdrop(ray.d)), ..Layers::default() };
    };
    let wo = -ray.d;
    let present = world.scene.bsdf(&surface).lobes();
    let layer = |lobes: Lobes, branch| {
        if !present.intersects(lobes) {
            return Rgb::ZERO;
        }
        let query = Query { lobes, ..Query::default() };
        scattered(world, &surface, wo, query, None, params, &mut sampler.branch(branch))
    };
    Layers {
        emission: keep_finite(world.lights.emitted(&world.scene, &surface, wo)),
        diffuse: layer(Lobes::DIFFUSE, 0),
        glossy: layer(Lobes::NON_DIFFUSE, 1),
    }
}

/// Radiance scattered at `surface` towards `wo_world` (unit, away from the surface) by the lobes and at the roughness of
/// `query`; later vertices scatter in full. Emission of `surface` itself is not included.
/// The probe bake calls this with `Lobes::NON_DIFFUSE` and the halved roughness, the path tracer with either half.
pub fn scattered(
    world: &World,
    surface: &Surface,
    wo_world: Vec3,
    query: Query,
    known: Option<KnownDiffuse>,
    params: &PathParams,
    sampler: &mut Sampler,
) -> Rgb {
    integrate(&Vertex::scattering(world, surface, wo_world, query), receiver(world, surface, wo_world), known, params, sampler)
}

/// Incident, not scattered light: one sample of the light map's quantity ∫ T_in(ω) L(ω) cos θ dω at `surface`, on the side of
/// `frame.n` (or its back with `back`), with T_in = [`crate::material::bsdf::Bsdf::diffuse_in`]. L holds all paths, direct light included.
pub fn transmitted_irradiance(
    world: &World,
    surface: &Surface,
    back: bool,
    known: Option<KnownDiffuse>,
    params: &PathParams,
    sampler: &mut Sampler,
) -> Rgb {
    let side = if back { -1.0 } else { 1.0 };
    let from = Receiver { p: surface.p, n: surface.frame.n * side };
    integrate(&Vertex::irradiance(world, surface, side), from, known, params, sampler)
}

/// Ambient occlusion: one sample of ∫ V(ω) cos θ / π dω over the hemisphere of `frame.n`, or of its back, where V is 1 if nothing is met
/// within `distance`.
pub fn openness(world: &World, surface: &Surface, back: bool, distance: f32, sampler: &mut Sampler) -> Rgb {
    let local = cosine_hemisphere(sampler.next_2d());
    let direction = surface.frame.to_world(if back { -local } else { local });
    let ray = Ray { t_max: distance, ..surface.spawn(direction) };
    if world.occluded(&ray) { Rgb::ZERO } else { Rgb::ONE }
}

/// Radiance that a camera sees along `ray`, emission included (unless the scene hides its emitters), without a split.
pub fn radiance(world: &World, ray: &Ray, params: &PathParams, sampler: &mut Sampler) -> Rgb {
    if world.scene.hide_emitters {
        let of = |surface: Surface| past_emitters(world, surface, -ray.d, params, sampler);
        return world.seen(ray).map_or(Rgb::ZERO, of);
    }
    let from = Receiver { p: ray.o, n: Vec3::ZERO };
    let start = Start { ray: *ray, from, found: Found::SEEN, eta: 1.0, depth: 0 };
    keep_finite(incident(world, start, None, params, sampler))
}

/// [`scattered`] where cameras see no emitters: as in Mitsuba, no environment behind thin glass either that lets the ray straight
/// through; but lamps there are seen.
fn past_emitters(world: &World, mut surface: Surface, mut wo: Vec3, params: &PathParams, sampler: &mut Sampler) -> Rgb {
    let (mut sum, mut throughput) = (Rgb::ZERO, Rgb::ONE);
    for depth in 0..params.max_depth {
        let bsdf = world.scene.bsdf(&surface);
        if !matches!(bsdf, Bsdf::ThinDielectric(_)) {
            let rest = PathParams { max_depth: params.max_depth - depth, ..*params };
            return sum + throughput * scattered(world, &surface, wo, Query::default(), None, &rest, sampler);
        }
        let [x, y, lobe, _] = sampler.next_4d();
        let wi = surface.frame.to_local(wo);
        let Some(sample) = bsdf.sample(&surface, wi, lobe, Vec2::new(x, y), Query::default()) else { return sum };
        throughput *= sample.weight;
        let ray = surface.spawn(surface.frame.to_world(sample.wo));
        if sample.wo.z * wi.z > 0.0 {
            let from = Receiver { p: surface.p, n: Vec3::ZERO };
            let start = Start { ray, from, found: Found::SEEN, eta: sample.eta, depth: depth + 1 };
            return keep_finite(sum + throughput * incident(world, start, None, params, sampler));
        }
        let Some(next) = world.intersect(&ray) else { return sum };
        (surface, wo) = (next, -ray.d);
        sum += throughput * world.lights.emitted(&world.scene, &surface, wo);
    }
    sum
}

/// Samples that were not finite and counted as zero, since the program started (debug builds only).
pub fn dropped_samples() -> u64 {
    DROPPED.load(Ordering::Relaxed)
}

static DROPPED: AtomicU64 = AtomicU64::new(0);

pub(super) fn keep_finite(c: Rgb) -> Rgb {
    if c.is_finite() {
        return c;
    }
    if cfg!(debug_assertions) {
        DROPPED.fetch_add(1, Ordering::Relaxed);
    }
    Rgb::ZERO
}

/// A ray of a path and how it was found.
#[derive(Clone, Copy)]
struct Start {
    ray: Ray,
    /// For whom the emitter sample that competes with it was drawn.
    from: Receiver,
    found: Found,
    /// Relative index of refraction so far.
    eta: f32,
    /// Vertices that have scattered before it.
    depth: u32,
}

/// One sample of the integral of incident radiance at the first vertex of a path.
fn integrate(vertex: &Vertex, from: Receiver, known: Option<KnownDiffuse>, params: &PathParams, sampler: &mut Sampler) -> Rgb {
    let world = vertex.world;
    if params.max_depth == 0 {
        return Rgb::ZERO;
    }
    let [[light_x, light_y, light_choice, _], [x, y, lobe, _]] = sampler.next_two_4d();
    let mut sum = vertex.direct(world.light(&from, light_choice, Vec2::new(light_x, light_y)));
    // Direct light alone, and no ray could meet any.
    if params.max_depth == 1 && world.lights.never_met {
        return keep_finite(sum);
    }
    if let Some(sample) = vertex.sample(lobe, Vec2::new(x, y)) {
        let ray = vertex.surface.spawn(vertex.surface.frame.to_world(sample.wo));
        let start = Start { ray, from, found: Found::by(&sample), eta: sample.eta, depth: 1 };
        sum += sample.weight * incident(world, start, known, params, sampler);
    }
    keep_finite(sum)
}

/// Radiance along a ray: emission weighted against the emitter sampling at its origin, and all that is scattered on.
fn incident(world: &World, start: Start, known: Option<KnownDiffuse>, params: &PathParams, sampler: &mut Sampler) -> Rgb {
    let Start { mut ray, mut from, mut found, mut eta, mut depth } = start;
    let mut sum = Rgb::ZERO;
    let mut throughput = Rgb::ONE;
    loop {
        // Drawn before the ray is cast, so that tables can be fetched while it is under way.
        let [[light_x, light_y, light_choice, live], [x, y, lobe, _]] = sampler.next_two_4d();
        world.lights.prefetch(light_choice, Vec2::new(light_x, light_y));
        let Some(surface) = world.intersect(&ray) else {
            let (light, weight) = environment_met(world, ray.d, &from, found);
            return sum + throughput * light * weight;
        };
        world.lights.prefetch_radiance(light_choice, Vec2::new(light_x, light_y));
        world.prefetch(&surface);
        let wo = -ray.d;
        if surface.emitter.is_some() {
            let (light, weight) = emission_met(world, &surface, wo, &from, found);
            sum += throughput * light * weight;
        }
        if depth >= params.max_depth {
            return sum;
        }
        let mut query = Query::default();
        if let Some(known) = known {
            sum += throughput * known(&surface, wo);
            query.lobes = Lobes::NON_DIFFUSE;
            if !world.scene.bsdf(&surface).lobes().intersects(query.lobes) {
                return sum;
            }
        }
        from = receiver(world, &surface, wo);
        // Before the textures are read, which have been asked for only now.
        let light = world.light(&from, light_choice, Vec2::new(light_x, light_y));
        let vertex = Vertex::scattering(world, &surface, wo, query);
        sum += throughput * vertex.direct(light);
        let Some(sample) = vertex.sample(lobe, Vec2::new(x, y)) else { return sum };
        throughput *= sample.weight;
        eta *= sample.eta;
        depth += 1;
        if depth >= params.rr_depth {
            let lives = survival(throughput, eta);
            if live >= lives {
                return sum;
            }
            throughput /= lives;
        }
        found = Found::by(&sample);
        ray = surface.spawn(surface.frame.to_world(sample.wo));
    }
}

/// The roulette's probability that a path goes on, by what has become of its radiance and the relative index of refraction.
pub(super) fn survival(throughput: Rgb, eta: f32) -> f32 {
    (throughput.max_element() * eta * eta * ROULETTE_MERCY).min(ROULETTE_CAP)
}
