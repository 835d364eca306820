//! Emitter sampling for next-event estimation.
//!
//! As Mitsuba: an emitter is chosen uniformly among those that emit, a point on an area light uniformly by area, and an area
//! light shines from the side that its shading normal points to. Ours: a density by solid angle always uses the geometric
//! normal, which Mitsuba replaces by the shading normal on smooth meshes.

use super::Surface;
use super::envmap::Envmap;
use super::steps::Steps;
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
    /// Index into `Scene::emitters`, and the distribution of its triangles' areas.
    Area { emitter: u32, triangles: Steps },
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
                    let (triangles, area) = Steps::new(areas);
                    if area > 0.0 && area.is_finite() {
                        this.pdf_area[i] = (1.0 / area) as f32;
                        this.lights.push(Light::Area { emitter: index, triangles });
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
            Light::Area { emitter, triangles } => self.sample_area(scene, p, *emitter, triangles, v),
            Light::Environment(environment) => {
                let (wi, mut pdf, mut radiance) = environment.sample(v);
                if self.environments().nth(1).is_some() {
                    (pdf, radiance) = (self.environments().map(|e| e.pdf(wi)).sum(), self.environment(wi));
                }
                pdf *= self.choice_pdf();
                let weight = radiance / pdf;
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

    fn sample_area(&self, scene: &Scene, p: Vec3, emitter: u32, triangles: &Steps, v: Vec2) -> Option<LightSample> {
        let Emitter::Area { object, radiance } = &scene.emitters[emitter as usize] else { return None };
        let (geometry, object) = (&scene.geometry, &scene.geometry.objects[*object as usize]);
        let (step, rest) = triangles.pick(v.x);
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
        let Some(pdf_area) = s.emitter.and_then(|e| self.pdf_area.get(e as usize)) else { return 0.0 };
        let to_light = s.p - p;
        let distance = to_light.length();
        let cos = s.ng.dot(to_light).abs() / distance;
        if cos > 0.0 { self.choice_pdf() * pdf_area * distance * distance / cos } else { 0.0 }
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
        1.0 / self.lights.len().max(1) as f32
    }
}

impl Environment {
    fn eval(&self, d: Vec3) -> Rgb {
        match self {
            Self::Map(map) => map.eval(d),
            Self::Constant(radiance) => *radiance,
        }
    }

    /// A direction, its density and the radiance from there.
    fn sample(&self, v: Vec2) -> (Vec3, f32, Rgb) {
        match self {
            Self::Map(map) => map.sample(v),
            Self::Constant(radiance) => {
                let z = 1.0 - 2.0 * v.y;
                let (sin_phi, cos_phi) = (v.x * 2.0 * PI).sin_cos();
                let r = (1.0 - z * z).max(0.0).sqrt();
                (Vec3::new(r * cos_phi, r * sin_phi, z), 0.25 / PI, *radiance)
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Geometry, Object};
    use crate::transport::Sampler;

    fn scene(emitters: Vec<Emitter>) -> Scene {
        Scene { emitters, ..Scene::default() }
    }

    /// A quadrilateral at height `y` over [-1, 1] x [-2, 2] that shines down with radiance 1 to 3 (RGB), and its scene.
    fn lamp(y: f32, others: Vec<Emitter>) -> Scene {
        let corner = |x: f32, z: f32| Vec3::new(x, y, z);
        let geometry = Geometry {
            positions: vec![corner(-1.0, -2.0), corner(1.0, -2.0), corner(1.0, 2.0), corner(-1.0, 2.0)],
            normals: vec![Vec3::NEG_Y; 4],
            uvs: vec![Vec2::ZERO; 4],
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            triangle_object: vec![0, 0],
            objects: vec![Object {
                name: "lamp".into(),
                triangles: 0..2,
                vertices: 0..4,
                material: 0,
                emitter: Some(0),
                face_normals: false,
                has_uvs: false,
            }],
        };
        let mut emitters = vec![Emitter::Area { object: 0, radiance: Texture::Constant(Rgb::new(1.0, 2.0, 3.0)) }];
        emitters.extend(others);
        Scene { geometry, emitters, ..Scene::default() }
    }

    #[test]
    fn spot_point_and_directional_are_those_of_mitsuba() {
        // Mitsuba 3.9.1: cutoff 40, beam 25 degrees, from (0, 3, 0) to (1, 0, 0.5).
        let spot = Emitter::Spot {
            position: Vec3::new(0.0, 3.0, 0.0),
            direction: Vec3::new(1.0, -3.0, 0.5).normalize(),
            intensity: Rgb::new(5.0, 4.0, 3.0),
            cutoff_rad: 40f32.to_radians(),
            beam_rad: 25f32.to_radians(),
        };
        let s = scene(vec![spot]);
        let lights = Lights::new(&s);
        for (p, red) in [([1.0, 0.0, 0.5], 0.487_804_9), ([0.0, 0.0, 0.0], 0.555_555_6), ([-0.5, 0.5, 0.0], 0.463_948_55)] {
            let sample = lights.sample(&s, p.into(), 0.5, Vec2::splat(0.5)).unwrap();
            assert!((sample.weight.x - red).abs() < 1e-5, "{p:?}: {} where Mitsuba has {red}", sample.weight.x);
            assert!((sample.weight.z - red * 0.6).abs() < 1e-5 && sample.delta && sample.pdf == 1.0);
        }
        assert!(lights.sample(&s, Vec3::new(-3.0, 0.0, 0.0), 0.5, Vec2::splat(0.5)).is_none(), "outside of the cone");

        let two = vec![
            Emitter::Point { position: Vec3::Y * 2.0, intensity: Rgb::splat(8.0) },
            Emitter::Directional { direction: Vec3::NEG_Y, irradiance: Rgb::splat(7.0) },
        ];
        let s = scene(two);
        let lights = Lights::new(&s);
        let point = lights.sample(&s, Vec3::ZERO, 0.2, Vec2::ZERO).unwrap();
        assert_eq!((point.wi, point.distance, point.weight), (Vec3::Y, 2.0, Rgb::splat(2.0 * 8.0 / 4.0)));
        let sun = lights.sample(&s, Vec3::ZERO, 0.7, Vec2::ZERO).unwrap();
        assert_eq!((sun.wi, sun.distance, sun.weight), (Vec3::Y, f32::INFINITY, Rgb::splat(2.0 * 7.0)));
    }

    #[test]
    fn a_lamp_seen_from_below_fills_its_solid_angle() {
        const N: u32 = 4096;
        let s = lamp(1.5, vec![]);
        let lights = Lights::new(&s);
        let p = Vec3::new(0.3, 0.0, -0.2);
        let sum: Rgb = (0..N).map(|i| lights.sample(&s, p, 0.0, Sampler::new(1, i).next_2d()).unwrap().weight / N as f32).sum();
        // Solid angle of a rectangle, corner by corner: atan(a b / (h sqrt(a² + b² + h²))).
        let corner = |a: f32, b: f32| (a * b / (1.5 * (a * a + b * b + 1.5 * 1.5).sqrt())).atan();
        let solid_angle = corner(1.3, 1.8) + corner(0.7, 1.8) + corner(1.3, 2.2) + corner(0.7, 2.2);
        assert!((sum / Rgb::new(1.0, 2.0, 3.0) / solid_angle - 1.0).abs().max_element() < 2e-3, "{sum}, {solid_angle} sr");
        let above = Vec3::new(0.0, 3.0, 0.0);
        assert!(lights.sample(&s, above, 0.0, Vec2::splat(0.4)).is_none(), "dark from behind");
    }

    #[test]
    fn the_density_of_a_found_point_is_the_one_it_is_sampled_with() {
        let s = lamp(1.5, vec![Emitter::Constant { radiance: Rgb::ONE }, Emitter::Constant { radiance: Rgb::ZERO }]);
        let lights = Lights::new(&s);
        let p = Vec3::new(-0.6, 0.1, 0.4);
        for i in 0..64 {
            let v = Sampler::new(2, i).next_2d();
            let sample = lights.sample(&s, p, 0.25, v).unwrap();
            let found = Surface {
                p: sample.point,
                ng: Vec3::NEG_Y,
                frame: crate::math::Frame::from_normal(Vec3::NEG_Y),
                uv: Vec2::ZERO,
                dp_du: Vec3::ZERO,
                dp_dv: Vec3::ZERO,
                t: sample.distance,
                triangle: 0,
                barycentric: Vec2::ZERO,
                object: 0,
                material: 0,
                emitter: Some(0),
                offset: 0.0,
            };
            assert!((lights.pdf_surface(p, &found) / sample.pdf - 1.0).abs() < 1e-4);
            assert_eq!(lights.emitted(&s, &found, -sample.wi), Rgb::new(1.0, 2.0, 3.0));
            assert_eq!(lights.emitted(&s, &found, sample.wi), Rgb::ZERO);
            let sky = lights.sample(&s, p, 0.75, v).unwrap();
            assert!((sky.pdf - 0.5 * 0.25 / PI).abs() < 1e-6 && (sky.pdf - lights.pdf_environment(sky.wi)).abs() < 1e-7);
        }
    }

    #[test]
    fn a_scene_without_light_gives_no_sample() {
        let s = scene(vec![]);
        assert!(Lights::new(&s).is_empty());
        assert!(Lights::new(&s).sample(&s, Vec3::ZERO, 0.5, Vec2::ZERO).is_none());
    }
}
