//! Paths that branch: one estimate of scattered radiance is a tree of vertices.

use super::lessons::{Lessons, Plan};
use super::moments::{Estimate, Kind, RAY_COST};
use crate::base::math::Rgb;
use crate::base::ray::Ray;
use crate::material::Surface;
use crate::material::bsdf::{Lobes, Query};
use crate::transport::light_tree::Receiver;
use crate::transport::met::{Found, emission_met, environment_met};
use crate::transport::path::{PathParams, keep_finite, survival};
use crate::transport::vertex::{Vertex, receiver};
use crate::transport::{Sampler, World};
use glam::{Vec2, Vec3};

/// Fewest and most estimates of a kind at a vertex, on average. Where a cell is wrong about a place, the least keeps the variance bounded.
const ESTIMATES: [f32; 2] = [0.05, 4.0];

/// Vertices after which paths thin out, whatever they bring and whatever the scene says of roulette: a vertex is a call within that of the
/// one before, and the stack has an end.
const DEEP: u32 = 64;

/// Most estimates there.
const AT_MOST_DEEP: f32 = 0.5;

/// Cost of an emitter sample with its shadow ray.
const DIRECT_COST: f32 = 0.8;

/// Cost of a direction that was drawn, and not followed.
const DRAW_COST: f32 = 0.2;

/// Follows paths, by a plan or, where there is none yet, by [`PathParams`]'s roulette.
pub struct Walk<'a> {
    /// Where they go.
    pub world: &'a World,
    /// Depth, and roulette without a plan.
    pub params: &'a PathParams,
    /// Of image and scene.
    pub plan: Option<&'a Plan>,
    /// Take in every estimate on the way.
    pub lessons: Option<Lessons>,
}

/// What a path has become when it reaches a vertex.
#[derive(Debug, Clone, Copy)]
pub struct Start {
    /// What radiance there is multiplied with on its way to the pixel, over the pixel's own radiance. Without a plan: on its way alone.
    pub weight: Rgb,
    /// Relative index of refraction so far.
    pub eta: f32,
    /// Vertices before it.
    pub depth: u32,
    /// On a mirror: where the ray seems to come from that goes on from it, and how that was found.
    behind: Option<(Receiver, Found)>,
}

impl Start {
    /// The first vertex, which a camera sees.
    pub fn seen(weight: Rgb) -> Self {
        Self { weight, eta: 1.0, depth: 0, behind: None }
    }
}

/// A vertex that a path has reached.
struct Reached<'a> {
    s: &'a Surface,
    query: Query,
    start: Start,
    /// As cells ask for it.
    direction: Option<Vec3>,
}

impl Walk<'_> {
    /// The numbers by which a vertex will choose an emitter, and a direction; best drawn before the ray to it is cast, so that tables are
    /// fetched while it is under way.
    #[inline]
    pub fn numbers(&self, sampler: &mut Sampler) -> [[f32; 4]; 2] {
        let numbers = sampler.next_two_4d();
        let [x, y, choice, _] = numbers[0];
        self.world.lights.prefetch(choice, Vec2::new(x, y));
        numbers
    }

    /// One estimate of the radiance that `s` scatters to `wo` by the lobes of `query`, by the [`Walk::numbers`] of this vertex.
    pub fn scattered(
        &mut self,
        [emitter, direction]: [[f32; 4]; 2],
        s: &Surface,
        wo: Vec3,
        query: Query,
        start: Start,
        sampler: &mut Sampler,
    ) -> Estimate {
        self.world.lights.prefetch_radiance(emitter[2], Vec2::new(emitter[0], emitter[1]));
        self.world.prefetch(s);
        let lobes = self.world.scene.bsdf(s).lobes();
        let reached = Reached { s, query, start, direction: lobes.intersects(Lobes::NON_DIFFUSE).then_some(wo) };
        let [direct, onward] = self.counts(&reached);
        let [emitters, rays] = [(direct + emitter[3]) as u32, (onward + direction[3]) as u32];
        let mut sum = Estimate::default();
        if emitters + rays == 0 {
            return sum;
        }
        let from = receiver(self.world, s, wo);
        let known = self.plan.and_then(|plan| plan.guide.at(&from));
        let light = |[x, y, choice, _]: [f32; 4]| self.world.light(&from, choice, Vec2::new(x, y));
        // Before the textures are read, which have been asked for only now.
        let first = if emitters > 0 { light(emitter) } else { None };
        let in_mirrors = self.params.max_depth - start.depth > 1;
        let mut vertex = Vertex::scattering(self.world, s, wo, query);
        if let Some(known) = &known {
            vertex.follow(known, &from);
        }
        let share = Rgb::splat(1.0 / direct);
        for k in 0..emitters {
            let numbers = if k == 0 { emitter } else { sampler.branch(k << 16 | start.depth).next_4d() };
            let mut direct = vertex.direct(if k == 0 { first } else { light(numbers) });
            if in_mirrors {
                direct += vertex.in_mirrors(&from, numbers);
            }
            let estimate = Estimate { light: keep_finite(direct), cost: DIRECT_COST };
            self.record(&reached, Kind::Direct, &estimate);
            sum.add(estimate, share);
        }
        let share = 1.0 / onward;
        for k in 0..rays {
            let estimate = if k == 0 {
                self.onward(&vertex, &from, &reached, direction, share, sampler)
            } else {
                let mut branch = sampler.branch(k << 16 | 1 << 15 | start.depth);
                let numbers = branch.next_4d();
                self.onward(&vertex, &from, &reached, numbers, share, &mut branch)
            };
            sum.add(estimate, Rgb::splat(share));
        }
        sum
    }

    fn record(&mut self, at: &Reached, kind: Kind, estimate: &Estimate) {
        if let Some(lessons) = self.lessons.as_mut().filter(|_| at.query.lobes == Lobes::ALL) {
            lessons.tally.record(at.s, at.direction, kind, estimate);
        }
    }

    /// What one ray from a vertex brings.
    fn onward(
        &mut self,
        vertex: &Vertex,
        from: &Receiver,
        at: &Reached,
        [x, y, lobe, live]: [f32; 4],
        share: f32,
        sampler: &mut Sampler,
    ) -> Estimate {
        let Some(sample) = vertex.sample(lobe, Vec2::new(x, y)) else {
            let nothing = Estimate { light: Rgb::ZERO, cost: DRAW_COST };
            self.record(at, Kind::Onward, &nothing);
            return nothing;
        };
        let mut weight = at.start.weight * sample.weight * share;
        let (eta, depth) = (at.start.eta * sample.eta, at.start.depth + 1);
        let mut lives = 1.0;
        if self.plan.is_none() && depth >= self.params.rr_depth.min(DEEP) {
            lives = survival(weight, eta);
            if depth > DEEP {
                lives = lives.min(AT_MOST_DEEP);
            }
            if live >= lives {
                return Estimate { light: Rgb::ZERO, cost: DRAW_COST };
            }
            weight /= lives;
        }
        let ray = at.s.spawn(at.s.frame.to_world(sample.wo));
        let (seen_from, found) = at.start.behind.unwrap_or((*from, Found::by(&sample)));
        let next = self.incident(&ray, &seen_from, found, Start { weight, eta, depth, behind: None }, sampler);
        if let Some(lessons) = self.lessons.as_mut().filter(|_| !sample.delta && vertex.is_diffuse()) {
            lessons.arrivals.record(from, ray.d, sample.pdf, keep_finite(next.light));
        }
        let estimate = Estimate { light: keep_finite(sample.weight * next.light), cost: RAY_COST + next.cost };
        self.record(at, Kind::Onward, &estimate);
        Estimate { light: estimate.light / lives, ..estimate }
    }

    /// Radiance along a ray: emission, weighted against the emitter sampling at its origin, and what is scattered there.
    fn incident(&mut self, ray: &Ray, from: &Receiver, found: Found, at: Start, sampler: &mut Sampler) -> Estimate {
        let world = self.world;
        let numbers = self.numbers(sampler);
        let Some(s) = world.intersect(ray) else {
            let (light, weight) = environment_met(world, ray.d, from, found);
            return Estimate { light: light * weight, cost: 0.0 };
        };
        let wo = -ray.d;
        let mut sum = Estimate::default();
        if s.emitter.is_some() {
            let (light, weight) = emission_met(world, &s, wo, from, found);
            sum.light = light * weight;
        }
        if at.depth < self.params.max_depth {
            let at = Start { behind: world.mirrors.behind(&s, from, found), ..at };
            sum.add(self.scattered(numbers, &s, wo, Query::default(), at, sampler), Rgb::ONE);
        }
        sum
    }

    /// How many emitters are drawn at a vertex, and how many rays leave it, on average; less than one is roulette.
    fn counts(&self, at: &Reached) -> [f32; 2] {
        let Some(plan) = self.plan else { return [1.0; 2] };
        if at.start.depth == 0 {
            return [1.0; 2];
        }
        let most = if at.start.depth > DEEP { AT_MOST_DEEP } else { ESTIMATES[1] };
        let Some(moments) = plan.moments.at(at.s, at.direction) else { return [most.min(1.0); 2] };
        let squared = at.start.weight * at.start.weight;
        moments.map(|moment| {
            let roulette = (squared.dot(moment.square) / 3.0).sqrt() * plan.efficiency;
            let splitting = roulette * moment.variance.sqrt();
            let best = if splitting > 1.0 { splitting } else { roulette.min(1.0) };
            best.clamp(ESTIMATES[0], most)
        })
    }
}
