//! A point of a path where light arrives: what it makes of light straight from emitters, and where a path may go on.

use super::World;
use super::guide::{Guided, Known};
use super::light_sample::LightSample;
use super::light_tree::Receiver;
use super::met::power_heuristic;
use super::mirrors::Mirror;
use crate::base::math::Rgb;
use crate::material::Surface;
use crate::material::bsdf::{At, Bsdf, BsdfSample, Query};
use glam::{Vec2, Vec3};
use std::f32::consts::{FRAC_1_PI, PI, TAU};

/// What incident radiance is integrated against at a vertex.
enum Measure<'a> {
    /// BSDF times cosine.
    Scattering(At<'a>),
    /// Transmission into the diffuse layer times cosine, on the side of the frame's normal (1) or behind it (-1).
    Irradiance { side: f32 },
}

/// A point of a path where light arrives.
pub(super) struct Vertex<'a> {
    pub(super) world: &'a World,
    pub(super) surface: &'a Surface,
    measure: Measure<'a>,
    guided: Option<Guided<'a>>,
}

/// Where a surface that scatters light to `wo` sees emitters from: on the viewer's side, or on both where light passes through it.
pub(super) fn receiver(world: &World, surface: &Surface, wo: Vec3) -> Receiver {
    let n = surface.frame.n;
    let both = world.scene.bsdf(surface).is_transmissive();
    Receiver { p: surface.p, n: n * if both { 0.0 } else { 1f32.copysign(n.dot(wo)) } }
}

impl<'a> Vertex<'a> {
    /// Where light is scattered to `wo` (unit, world, away from the surface).
    pub(super) fn scattering(world: &'a World, surface: &'a Surface, wo: Vec3, query: Query) -> Self {
        let at = world.scene.bsdf(surface).at(surface, surface.frame.to_local(wo), query);
        Self { world, surface, measure: Measure::Scattering(at), guided: None }
    }

    /// Where light is to pass into the diffuse layer, on the side of the frame's normal (1) or behind it (-1).
    pub(super) fn irradiance(world: &'a World, surface: &'a Surface, side: f32) -> Self {
        Self { world, surface, measure: Measure::Irradiance { side }, guided: None }
    }

    /// From now on draws directions as a guide has it.
    #[inline]
    pub(super) fn follow(&mut self, known: &Known<'a>, from: &Receiver) {
        if let Measure::Scattering(at) = &self.measure {
            self.guided = Guided::new(known, from, &self.surface.frame, at);
        }
    }

    /// Whether directions may be drawn from a diffuse lobe.
    pub(super) fn is_diffuse(&self) -> bool {
        matches!(&self.measure, Measure::Scattering(at) if at.first_diffuse().is_some_and(|first| first < 1.0))
    }

    fn bsdf(&self) -> &Bsdf {
        self.world.scene.bsdf(self.surface)
    }

    /// Next-event estimation: what light straight from an emitter comes to, weighted against finding it by [`Vertex::sample`].
    pub(super) fn direct(&self, light: Option<LightSample>) -> Rgb {
        let Some(light) = light else { return Rgb::ZERO };
        let wo = self.surface.frame.to_local(light.wi);
        let (value, pdf) = self.eval_pdf(wo);
        if value == Rgb::ZERO || light.weight == Rgb::ZERO || self.world.occluded(&light.shadow_ray(self.surface)) {
            return Rgb::ZERO;
        }
        light.weight * value * power_heuristic(light.pdf, if light.delta { 0.0 } else { pdf })
    }

    /// Next-event estimation by way of the mirrors, by the numbers that the sample of [`Vertex::direct`] was drawn by.
    #[inline]
    pub(super) fn in_mirrors(&self, from: &Receiver, [x, y, choice, _]: [f32; 4]) -> Rgb {
        let mut sum = Rgb::ZERO;
        for (mirror, behind) in self.world.mirrors.before(from) {
            sum += self.in_mirror(mirror, &behind, choice, Vec2::new(x, y)).unwrap_or(Rgb::ZERO);
        }
        sum
    }

    /// Light straight from an emitter that was drawn for the receiver's image behind a mirror.
    fn in_mirror(&self, mirror: &Mirror, behind: &Receiver, choice: f32, v: Vec2) -> Option<Rgb> {
        let world = self.world;
        let light = world.lights.sample_near(&world.scene, behind, choice, v, 1.0)?;
        if light.delta || light.weight == Rgb::ZERO || !mirror.is_passed(behind, light.wi, light.distance) {
            return None;
        }
        let wi = mirror.reflected(light.wi);
        let (value, pdf) = self.eval_pdf(self.surface.frame.to_local(wi));
        if value == Rgb::ZERO {
            return None;
        }
        let met = world.intersect(&self.surface.spawn(wi)).filter(|met| mirror.has(met.triangle))?;
        let reflection = Vertex::scattering(world, &met, -wi, Query::default()).sample(0.5, Vec2::splat(0.5))?;
        let seen = !world.occluded(&light.shadow_ray(&met));
        seen.then(|| light.weight * value * reflection.weight * power_heuristic(light.pdf, pdf))
    }

    /// What radiance from the local direction `wo` is multiplied with, cosine included, and the density (solid angle) with
    /// which [`Vertex::sample`] finds it.
    fn eval_pdf(&self, wo: Vec3) -> (Rgb, f32) {
        match &self.measure {
            Measure::Scattering(at) => {
                let (value, pdf) = at.eval_pdf(wo);
                match &self.guided {
                    Some(guided) if value != Rgb::ZERO => (value, guided.pdf(pdf, wo)),
                    _ => (value, pdf),
                }
            }
            &Measure::Irradiance { side } if wo.z * side > 0.0 => {
                let cos = wo.z * side;
                (Rgb::splat(self.bsdf().diffuse_in(self.surface, wo) * cos), cos * FRAC_1_PI)
            }
            Measure::Irradiance { .. } => (Rgb::ZERO, 0.0),
        }
    }

    /// Draws a local direction; its weight is the value of [`Vertex::eval_pdf`] over the density.
    pub(super) fn sample(&self, u: f32, v: Vec2) -> Option<BsdfSample> {
        match &self.measure {
            Measure::Scattering(at) => {
                let sample = match &self.guided {
                    Some(guided) => guided.sample(at, u, v),
                    None => at.sample(u, v),
                };
                sample.filter(|s| s.weight != Rgb::ZERO)
            }
            &Measure::Irradiance { side } => {
                let (sin_phi, cos_phi) = (v.x * TAU).sin_cos();
                let (cos, sin) = ((1.0 - v.y).sqrt(), v.y.sqrt());
                let wo = Vec3::new(sin * cos_phi, sin * sin_phi, cos * side);
                let weight = Rgb::splat(self.bsdf().diffuse_in(self.surface, wo) * PI);
                (cos > 0.0).then_some(BsdfSample { wo, weight, pdf: cos * FRAC_1_PI, delta: false, eta: 1.0 })
            }
        }
    }
}
