//! Emitter sampling for next-event estimation.
//!
//! As Mitsuba: an emitter is chosen uniformly among those that emit, a point on an area light uniformly by area, and an area
//! light shines from the side that its shading normal points to. Ours: a density by solid angle always uses the geometric
//! normal, which Mitsuba replaces by the shading normal on smooth meshes.

use super::Surface;
use super::envmap::{Envmap, normalised_sums, pick};
use crate::math::Rgb;
use crate::scene::{Emitter, Scene, Texture};
use glam::{Vec2, Vec3};
use std::f32::consts::PI;

/// Sampling distributions of a scene's emitters.
#[derive(Debug, Default)]
pub struct Lights {
    lights: Vec<Light>,
    /// Density per area of each `Scene::emitters`; 0 for those that are no area lights.
    pdf_area: Vec<f32>,
}

/// An emitter that emits.
#[derive(Debug)]
enum Light {
    /// Index into `Scene::emitters`, and the running sums of its triangles' areas.
    Area { emitter: u32, sums: Vec<f32> },
    /// Light from infinity.
    Environment(Environment),
    /// Point, spot or directional: index into `Scene::emitters`.
    Delta(u32),
}

#[derive(Debug)]
enum Environment {
    Map(Envmap),
    Constant(Rgb),
}

/// A direction towards an emitter.
#[derive(Debug, Clone, Copy)]
pub struct LightSample {
    /// Unit direction from the reference point.
    pub wi: Vec3,
    /// Distance to the emitter; infinite for environments.
    pub distance: f32,
    /// The emitting point; meaningless where the distance is infinite.
    pub point: Vec3,
    /// Radiance over pdf.
    pub weight: Rgb,
    /// Density in solid angle, emitter choice included; 1 for a delta emitter.
    pub pdf: f32,
    /// Whether no BSDF sample can find it (point, spot, directional).
    pub delta: bool,
}

impl Lights {
    /// Prepares the emitters of a scene.
    pub fn new(scene: &Scene) -> Self {
        let mut this = Self { lights: Vec::new(), pdf_area: vec![0.0; scene.emitters.len()] };
        for (i, emitter) in scene.emitters.iter().enumerate() {
            let index = i as u32;
            match emitter {
                Emitter::Area { radiance: Texture::Constant(Rgb::ZERO), .. } => {}
                Emitter::Area { object, .. } => {
                    let triangles = scene.geometry.objects[*object as usize].triangles.clone();
                    let areas = triangles.map(|t| 0.5 * f64::from(scene.geometry.area_normal(t).length()));
                    let (sums, area) = normalised_sums(areas);
                    if area > 0.0 && area.is_finite() {
                        this.pdf_area[i] = (1.0 / area) as f32;
                        this.lights.push(Light::Area { emitter: index, sums });
                    }
                }
                Emitter::Envmap { image, scale, to_world } => {
                    this.lights.extend(Envmap::new(image, *scale, to_world).map(|e| Light::Environment(Environment::Map(e))));
                }
                Emitter::Constant { radiance: Rgb::ZERO } => {}
                Emitter::Constant { radiance } => this.lights.push(Light::Environment(Environment::Constant(*radiance))),
                Emitter::Point { .. } | Emitter::Spot { .. } | Emitter::Directional { .. } => {
                    this.lights.push(Light::Delta(index));
                }
            }
        }
        this
    }

    /// Whether nothing emits.
    pub fn is_empty(&self) -> bool {
        self.lights.is_empty()
    }

    /// Draws an emitter and a direction to it from `p`. `u` chooses the emitter, `v` the point. Visibility is the caller's.
    pub fn sample(&self, scene: &Scene, p: Vec3, u: f32, v: Vec2) -> Option<LightSample> {
        let count = self.lights.len();
        let light = self.lights.get(((u * count as f32) as usize).min(count.saturating_sub(1)))?;
        match light {
            Light::Area { emitter, sums } => self.sample_area(scene, p, *emitter, sums, v),
            Light::Environment(environment) => {
                let wi = environment.sample(v);
                let pdf = self.pdf_environment(wi);
                let weight = self.environment(wi) / pdf;
                let sample = LightSample { wi, distance: f32::INFINITY, point: Vec3::ZERO, weight, pdf, delta: false };
                (pdf > 0.0).then_some(sample)
            }
            Light::Delta(emitter) => {
                let mut sample = sample_delta(&scene.emitters[*emitter as usize], p)?;
                sample.weight *= count as f32;
                Some(sample)
            }
        }
    }

    fn sample_area(&self, scene: &Scene, p: Vec3, emitter: u32, sums: &[f32], v: Vec2) -> Option<LightSample> {
        let Emitter::Area { object, radiance } = &scene.emitters[emitter as usize] else { return None };
        let (geometry, object) = (&scene.geometry, &scene.geometry.objects[*object as usize]);
        let (step, rest) = pick(sums, v.x);
        let triangle = object.triangles.start + step as u32;
        let root = (1.0 - rest).sqrt();
        let [b, c] = [root * v.y, 1.0 - root];
        let a = 1.0 - b - c;

        let corners = geometry.corners(triangle);
        let point = corners[0] * a + corners[1] * b + corners[2] * c;
        let (to_light, normal) = (point - p, geometry.area_normal(triangle).try_normalize()?);
        let distance = to_light.length();
        let wi = to_light.try_normalize()?;
        let indices = geometry.triangles[triangle as usize].map(|i| i as usize);
        let front = if object.face_normals {
            normal
        } else {
            let [n0, n1, n2] = indices.map(|i| geometry.normals[i]);
            n0 * a + n1 * b + n2 * c
        };
        let cos = normal.dot(wi).abs();
        if front.dot(wi) >= 0.0 || cos == 0.0 {
            return None;
        }
        let uv = if object.has_uvs {
            let [t0, t1, t2] = indices.map(|i| geometry.uvs[i]);
            t0 * a + t1 * b + t2 * c
        } else {
            Vec2::new(b, c)
        };
        let pdf = self.choice_pdf() * self.pdf_area[emitter as usize] * distance * distance / cos;
        Some(LightSample { wi, distance, point, weight: radiance.eval(uv) / pdf, pdf, delta: false })
    }

    /// Density with which [`Lights::sample`] from `p` finds the emitting point `s`.
    pub fn pdf_surface(&self, p: Vec3, s: &Surface) -> f32 {
        let Some(emitter) = s.emitter else { return 0.0 };
        let to_light = s.p - p;
        let distance = to_light.length();
        let cos = s.ng.dot(to_light).abs() / distance;
        if cos > 0.0 { self.choice_pdf() * self.pdf_area[emitter as usize] * distance * distance / cos } else { 0.0 }
    }

    /// Density with which [`Lights::sample`] finds the environment in direction `d`.
    pub fn pdf_environment(&self, d: Vec3) -> f32 {
        self.choice_pdf() * self.environments().map(|e| e.pdf(d)).sum::<f32>()
    }

    /// Radiance of the environment from direction `d` (pointing away from the scene).
    pub fn environment(&self, d: Vec3) -> Rgb {
        self.environments().map(|e| e.eval(d)).sum()
    }

    /// Radiance that an emitting surface sends to the side of `w` (unit, away from the surface); zero from behind.
    pub fn emitted(&self, scene: &Scene, s: &Surface, w: Vec3) -> Rgb {
        match s.emitter.map(|e| &scene.emitters[e as usize]) {
            Some(Emitter::Area { radiance, .. }) if s.frame.n.dot(w) > 0.0 => radiance.eval(s.uv),
            _ => Rgb::ZERO,
        }
    }

    fn environments(&self) -> impl Iterator<Item = &Environment> {
        self.lights.iter().filter_map(|l| match l {
            Light::Environment(e) => Some(e),
            _ => None,
        })
    }

    fn choice_pdf(&self) -> f32 {
        1.0 / self.lights.len() as f32
    }
}

impl Environment {
    fn eval(&self, d: Vec3) -> Rgb {
        match self {
            Self::Map(map) => map.eval(d),
            Self::Constant(radiance) => *radiance,
        }
    }

    fn sample(&self, v: Vec2) -> Vec3 {
        match self {
            Self::Map(map) => map.sample(v).0,
            Self::Constant(_) => {
                let z = 1.0 - 2.0 * v.y;
                let (sin_phi, cos_phi) = (v.x * 2.0 * PI).sin_cos();
                let r = (1.0 - z * z).max(0.0).sqrt();
                Vec3::new(r * cos_phi, r * sin_phi, z)
            }
        }
    }

    fn pdf(&self, d: Vec3) -> f32 {
        match self {
            Self::Map(map) => map.pdf(d),
            Self::Constant(_) => 0.25 / PI,
        }
    }
}

/// Irradiance that a delta emitter sends to a surface at `p` that faces it, as the `weight` of a sample.
fn sample_delta(emitter: &Emitter, p: Vec3) -> Option<LightSample> {
    let (point, intensity, cone) = match *emitter {
        Emitter::Directional { direction, irradiance } => {
            let sample = LightSample {
                wi: -direction,
                distance: f32::INFINITY,
                point: Vec3::ZERO,
                weight: irradiance,
                pdf: 1.0,
                delta: true,
            };
            return Some(sample);
        }
        Emitter::Point { position, intensity } => (position, intensity, None),
        Emitter::Spot { position, direction, intensity, cutoff_rad, beam_rad } => {
            (position, intensity, Some((direction, cutoff_rad, beam_rad)))
        }
        Emitter::Area { .. } | Emitter::Envmap { .. } | Emitter::Constant { .. } => return None,
    };
    let distance = point.distance(p);
    let wi = (point - p).try_normalize()?;
    let falloff = cone.map_or(1.0, |(axis, cutoff, beam)| spot_falloff(axis.dot(-wi), cutoff, beam));
    let weight = intensity * (falloff / (distance * distance));
    (falloff > 0.0).then_some(LightSample { wi, distance, point, weight, pdf: 1.0, delta: true })
}

/// Mitsuba's `spot`: 1 up to the beam angle, then linear in the angle down to 0 at the cutoff.
fn spot_falloff(cos: f32, cutoff_rad: f32, beam_rad: f32) -> f32 {
    let angle = cos.clamp(-1.0, 1.0).acos();
    match angle {
        a if a >= cutoff_rad => 0.0,
        a if a <= beam_rad => 1.0,
        a => (cutoff_rad - a) / (cutoff_rad - beam_rad),
    }
}
