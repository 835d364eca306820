//! Emitter sampling for next-event estimation.
//!
//! An emitter at a finite distance is chosen by the hierarchy of [`LightTree`], a triangle of an area light at a time; those at infinity
//! have equal shares with all the others together. A point on a triangle is uniform by area, and an area light shines from
//! the side that its shading normal points to, as Mitsuba's. Ours: a density by solid angle always uses the geometric
//! normal, which Mitsuba replaces by the shading normal on smooth meshes.

use super::envmap::Envmap;
use super::light_sample::LightSample;
use super::light_tree::{LightBounds, LightTree, Receiver};
use super::light_triangle::{LightTriangle, is_parallelogram};
use super::outlook::Outlook;
use super::round_light;
use super::sun::Sun;
use crate::base::math::{Rgb, luminance};
use crate::material::Surface;
use crate::scene::{Emitter, Scene};
use glam::{Vec2, Vec3};
use std::f32::consts::PI;
use std::sync::Arc;

/// Sampling distributions of a scene's emitters.
#[derive(Debug, Default)]
pub struct Lights {
    /// What `tree` chooses from.
    pub(crate) near: Vec<Near>,
    pub(crate) tree: LightTree,
    /// For each of `Scene::emitters`: the first of its triangles in `near`; `None` for those that are no area lights.
    pub(crate) first: Vec<Option<u32>>,
    pub(crate) environments: Vec<Environment>,
    /// What is seen of them from where, once that is known.
    pub(crate) outlook: Option<Arc<Outlook>>,
    /// Directional emitters: indices into `Scene::emitters`.
    pub(crate) suns: Vec<u32>,
    /// Whether no ray can meet light: there is neither an area light that is not dark, nor an environment.
    pub(crate) never_met: bool,
}

/// An emitter, or a part of one, at a finite distance.
#[derive(Debug)]
pub(crate) enum Near {
    Triangle(LightTriangle),
    /// Index into `Geometry::rounds`.
    Round(u32),
    /// Point or spot: index into `Scene::emitters`.
    Delta(u32),
}

#[derive(Debug)]
pub(crate) enum Environment {
    Map(Envmap),
    Constant(Rgb),
    Sun(Sun),
}

impl Lights {
    /// Prepares the emitters of a scene.
    pub fn new(scene: &Scene) -> Self {
        let mut this = Self { first: vec![None; scene.emitters.len()], never_met: true, ..Self::default() };
        let (mut bounds, mut halves) = (Vec::new(), Vec::new());
        for (i, emitter) in scene.emitters.iter().enumerate() {
            match emitter {
                Emitter::Area { object, radiance } => {
                    this.never_met &= radiance.mean() == Rgb::ZERO;
                    let object = &scene.geometry.objects[*object as usize];
                    let mean = luminance(radiance.mean());
                    if mean > 0.0 && mean.is_finite() {
                        this.first[i] = Some(this.near.len() as u32);
                        if let Some(round) = scene.geometry.round(object.triangles.start) {
                            bounds.push(round_light::bounds(&scene.geometry.rounds[round as usize], mean));
                            this.near.push(Near::Round(round));
                            continue;
                        }
                        let parallelogram = is_parallelogram(&scene.geometry, object);
                        for t in object.triangles.clone() {
                            let triangle = LightTriangle::new(&scene.geometry, t, i as u32, parallelogram);
                            bounds.push(triangle.bounds(&scene.geometry, mean));
                            this.near.push(Near::Triangle(triangle));
                        }
                        if parallelogram {
                            halves.push(bounds.len() as u32 - 1);
                        }
                    }
                }
                Emitter::Envmap { image, scale, to_world } => {
                    this.environments.extend(Envmap::new(image, *scale, to_world).map(Environment::Map));
                }
                Emitter::Constant { radiance: Rgb::ZERO } => {}
                Emitter::Constant { radiance } => this.environments.push(Environment::Constant(*radiance)),
                Emitter::Sun { direction, up, angle_rad, radiance } => {
                    this.environments.extend(Sun::new(*direction, *up, *angle_rad, *radiance).map(Environment::Sun));
                }
                Emitter::Directional { .. } => this.suns.push(i as u32),
                Emitter::Point { position, intensity } => {
                    bounds.push(delta_bounds(*position, *intensity, Vec3::Z, PI, PI));
                    this.near.push(Near::Delta(i as u32));
                }
                Emitter::Spot { position, direction, intensity, cutoff_rad, pattern, .. } => {
                    let mean = pattern.as_ref().map_or(Rgb::ONE, |p| p.texture.mean());
                    bounds.push(delta_bounds(*position, *intensity * mean, *direction, 0.0, *cutoff_rad));
                    this.near.push(Near::Delta(i as u32));
                }
                Emitter::Projector { position, direction, image, cutoff_rad } => {
                    bounds.push(delta_bounds(*position, image.texture.mean() * PI, *direction, 0.0, *cutoff_rad));
                    this.near.push(Near::Delta(i as u32));
                }
            }
        }
        this.tree = LightTree::new(&bounds, &halves);
        this.never_met &= this.environments.is_empty();
        this
    }

    /// Those of a frame's scene. What these know of the sky goes on being of use: whatever has moved, each part has a share.
    pub(super) fn of(&self, scene: &Scene) -> Self {
        let lights = Self::new(scene);
        let outlook = self.outlook.clone().filter(|outlook| outlook.environments == lights.environments.len());
        Self { outlook, ..lights }
    }

    /// Whether nothing emits.
    pub fn is_empty(&self) -> bool {
        self.shares() == 0
    }

    /// Emitters at infinity, and one for all the others.
    fn shares(&self) -> usize {
        self.environments.len() + self.suns.len() + usize::from(!self.tree.is_empty())
    }

    fn share(&self) -> f32 {
        1.0 / self.shares().max(1) as f32
    }

    /// Tells the caches what [`Lights::sample`] will read first with the same numbers.
    #[inline]
    pub fn prefetch(&self, u: f32, v: Vec2) {
        if let Some(map) = self.map(u) {
            map.prefetch(v);
        }
    }

    /// Tells the caches what it will read then; best some time after [`Lights::prefetch`].
    #[inline]
    pub fn prefetch_radiance(&self, u: f32, v: Vec2) {
        if let Some(map) = self.map(u) {
            map.prefetch_radiance(v);
        }
    }

    /// The image that `u` chooses, where what is read of it does not depend on the receiver.
    fn map(&self, u: f32) -> Option<&Envmap> {
        if self.outlook.is_some() {
            return None;
        }
        match self.environments.get((u * self.shares() as f32) as usize)? {
            Environment::Map(map) => Some(map),
            _ => None,
        }
    }

    /// Draws an emitter and a direction to it. `u` chooses the emitter, `v` the point. Visibility is the caller's.
    pub fn sample(&self, scene: &Scene, receiver: &Receiver, u: f32, v: Vec2) -> Option<LightSample> {
        let shares = self.shares();
        let place = u * shares as f32;
        let choice = (place as usize).min(shares.checked_sub(1)?);
        if choice < self.environments.len() {
            return self.sample_environment(choice, receiver, v);
        }
        if let Some(&sun) = self.suns.get(choice - self.environments.len()) {
            let mut sample = sample_delta(&scene.emitters[sun as usize], receiver.p)?;
            sample.weight *= shares as f32;
            return Some(sample);
        }
        let rest = (place - choice as f32).clamp(0.0, 1.0 - f32::EPSILON / 2.0);
        self.sample_near(scene, receiver, rest, v, self.share())
    }

    /// [`Lights::sample`] among the emitters at a finite distance, which have this share of the choice.
    pub(super) fn sample_near(&self, scene: &Scene, receiver: &Receiver, u: f32, v: Vec2, share: f32) -> Option<LightSample> {
        let (index, probability) = self.tree.sample(receiver, u)?;
        let probability = probability * share;
        match &self.near[index as usize] {
            Near::Triangle(triangle) => triangle.sample(scene, receiver.p, probability, v),
            Near::Round(round) => {
                let round = &scene.geometry.rounds[*round as usize];
                let emitter = scene.geometry.objects[round.object as usize].emitter?;
                let Emitter::Area { radiance, .. } = &scene.emitters[emitter as usize] else { return None };
                round_light::sample(round, radiance, receiver.p, probability, v)
            }
            Near::Delta(emitter) => {
                let mut sample = sample_delta(&scene.emitters[*emitter as usize], receiver.p)?;
                sample.weight /= probability;
                Some(sample)
            }
        }
    }

    fn sample_environment(&self, index: usize, receiver: &Receiver, v: Vec2) -> Option<LightSample> {
        let (v, density) = self.outlook.as_ref().map_or((v, 1.0), |outlook| outlook.draw(index, receiver, v));
        let (wi, mut pdf, mut radiance) = self.environments[index].sample(v);
        pdf *= self.share() * density;
        if self.environments.len() > 1 {
            (pdf, radiance) = (self.pdf_environment(receiver, wi), self.environment(wi));
        }
        let sample = LightSample { wi, distance: f32::INFINITY, point: Vec3::ZERO, weight: radiance / pdf, pdf, delta: false };
        (pdf > 0.0).then_some(sample)
    }

    /// Density with which [`Lights::sample`] finds the emitting point `s`.
    pub fn pdf_surface(&self, scene: &Scene, receiver: &Receiver, s: &Surface) -> f32 {
        self.share() * self.pdf_near(scene, receiver, s)
    }

    /// Density with which [`Lights::sample_near`] finds it where the share is 1.
    pub(super) fn pdf_near(&self, scene: &Scene, receiver: &Receiver, s: &Surface) -> f32 {
        let Some(first) = s.emitter.and_then(|e| self.first.get(e as usize).copied().flatten()) else { return 0.0 };
        if let Some(Near::Round(round)) = self.near.get(first as usize) {
            let round = &scene.geometry.rounds[*round as usize];
            return self.tree.probability(receiver, first) * round_light::pdf(round, receiver.p, s.p);
        }
        let index = first + (s.triangle - scene.geometry.objects[s.object as usize].triangles.start);
        let Some(Near::Triangle(triangle)) = self.near.get(index as usize) else { return 0.0 };
        let to_light = s.p - receiver.p;
        let distance = to_light.length();
        let cos = s.ng.dot(to_light).abs() / distance;
        if cos > 0.0 { self.tree.probability(receiver, index) * distance * distance / (triangle.area * cos) } else { 0.0 }
    }

    /// Density with which [`Lights::sample`] finds the environment in direction `d`.
    pub fn pdf_environment(&self, receiver: &Receiver, d: Vec3) -> f32 {
        let pdf = |(i, e): (usize, &Environment)| {
            let density = self.outlook.as_ref().map_or(1.0, |outlook| outlook.density(i, receiver, || e.numbers(d)));
            e.pdf(d) * density
        };
        self.share() * self.environments.iter().enumerate().map(pdf).sum::<f32>()
    }

    /// Radiance of the environment from direction `d` (pointing away from the scene).
    pub fn environment(&self, d: Vec3) -> Rgb {
        self.environments.iter().map(|e| e.eval(d)).sum()
    }

    /// Radiance that an emitting surface sends to the side of `w` (unit, away from the surface); zero from behind.
    pub fn emitted(&self, scene: &Scene, s: &Surface, w: Vec3) -> Rgb {
        match s.emitter.map(|e| &scene.emitters[e as usize]) {
            Some(Emitter::Area { radiance, .. }) if s.frame.n.dot(w) > 0.0 => radiance.eval(s.uv),
            _ => Rgb::ZERO,
        }
    }
}

fn delta_bounds(position: Vec3, intensity: Rgb, axis: Vec3, spread: f32, reach: f32) -> LightBounds {
    LightBounds { corners: [position; 2], axis, spread, reach, power: luminance(intensity) }
}

impl Environment {
    fn eval(&self, d: Vec3) -> Rgb {
        match self {
            Self::Map(map) => map.eval(d),
            Self::Constant(radiance) => *radiance,
            Self::Sun(sun) => sun.eval(d),
        }
    }

    /// A direction, its density and the radiance from there.
    pub(super) fn sample(&self, v: Vec2) -> (Vec3, f32, Rgb) {
        match self {
            Self::Map(map) => map.sample(v),
            Self::Sun(sun) => sun.sample(v),
            Self::Constant(radiance) => {
                let z = 1.0 - 2.0 * v.y;
                let (sin_phi, cos_phi) = (v.x * 2.0 * PI).sin_cos();
                let r = (1.0 - z * z).max(0.0).sqrt();
                (Vec3::new(r * cos_phi, r * sin_phi, z), 0.25 / PI, *radiance)
            }
        }
    }

    /// The numbers with which [`Environment::sample`] finds a direction.
    fn numbers(&self, d: Vec3) -> Vec2 {
        match self {
            Self::Map(map) => map.numbers(d),
            Self::Constant(_) => Vec2::new((d.y.atan2(d.x) / (2.0 * PI)).rem_euclid(1.0), 0.5 * (1.0 - d.z)),
            Self::Sun(_) => Vec2::splat(0.5),
        }
    }

    /// Whether it is large enough for parts of it to be seen, and [`Environment::numbers`] tells which.
    pub(super) fn has_parts(&self) -> bool {
        !matches!(self, Self::Sun(_))
    }

    fn pdf(&self, d: Vec3) -> f32 {
        match self {
            Self::Map(map) => map.pdf(d),
            Self::Constant(_) => 0.25 / PI,
            Self::Sun(sun) => sun.pdf(d),
        }
    }
}

/// Irradiance that a delta emitter sends to a surface at `p` that faces it, as the `weight` of a sample.
#[inline(never)]
fn sample_delta(emitter: &Emitter, p: Vec3) -> Option<LightSample> {
    let (point, intensity, falloff) = match emitter {
        Emitter::Directional { direction, irradiance } => {
            let sample = LightSample {
                wi: -*direction,
                distance: f32::INFINITY,
                point: Vec3::ZERO,
                weight: *irradiance,
                pdf: 1.0,
                delta: true,
            };
            return Some(sample);
        }
        Emitter::Point { position, intensity } => (*position, *intensity, 1.0),
        Emitter::Spot { position, direction, intensity, cutoff_rad, beam_rad, pattern } => {
            let cos = direction.dot((p - *position).try_normalize()?);
            let colour = pattern.as_ref().map_or(Rgb::ONE, |t| t.texture.eval(t.uv(t.to_local.transform_point3(p))));
            (*position, *intensity * colour, spot_falloff(cos, *cutoff_rad, *beam_rad))
        }
        Emitter::Projector { position, direction, image, .. } => {
            let local = image.to_local.transform_point3(p);
            let uv = image.uv(local);
            if local.z <= 0.0 || !(uv.cmpge(Vec2::ZERO) & uv.cmple(Vec2::ONE)).all() {
                return None;
            }
            // As Mitsuba: irradiance falls with the squared depth; a surface that faces the axis gets what the image says.
            let to_point = p - *position;
            let scale = PI * to_point.length().powi(3) / (local.z * local.z * direction.dot(to_point));
            (*position, image.texture.eval(uv), scale)
        }
        Emitter::Area { .. } | Emitter::Envmap { .. } | Emitter::Constant { .. } | Emitter::Sun { .. } => return None,
    };
    let distance = point.distance(p);
    let wi = (point - p).try_normalize()?;
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
    use crate::material::Texture;
    use crate::scene::{Geometry, Object};
    use crate::transport::Sampler;

    /// A point in space.
    fn at(p: impl Into<Vec3>) -> Receiver {
        Receiver { p: p.into(), n: Vec3::ZERO }
    }

    fn scene(emitters: Vec<Emitter>) -> Scene {
        Scene { emitters, ..Scene::default() }
    }

    /// A quadrilateral at height `y` over [-1, 1] x [-2, 2] that shines down with radiance 1 to 3 (RGB), and its scene.
    fn lamp(y: f32, others: Vec<Emitter>) -> Scene {
        let corner = |x: f32, z: f32| Vec3::new(x, y, z);
        let geometry = Geometry {
            rounds: Vec::new(),
            positions: vec![corner(-1.0, -2.0), corner(1.0, -2.0), corner(1.0, 2.0), corner(-1.0, 2.0)],
            normals: vec![Vec3::NEG_Y; 4],
            uvs: vec![Vec2::ZERO; 4],
            light_uvs: Vec::new(),
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
        Scene { geometry: geometry.into(), emitters, ..Scene::default() }
    }

    #[test]
    fn spot_point_and_directional_are_those_of_mitsuba() {
        // Mitsuba 3.9.1: cutoff 40, beam 25 degrees, from (0, 3, 0) to (1, 0, 0.5).
        let spot = Emitter::Spot {
            pattern: None,
            position: Vec3::new(0.0, 3.0, 0.0),
            direction: Vec3::new(1.0, -3.0, 0.5).normalize(),
            intensity: Rgb::new(5.0, 4.0, 3.0),
            cutoff_rad: 40f32.to_radians(),
            beam_rad: 25f32.to_radians(),
        };
        let s = scene(vec![spot]);
        let lights = Lights::new(&s);
        for (p, red) in [([1.0, 0.0, 0.5], 0.487_804_9), ([0.0, 0.0, 0.0], 0.555_555_6), ([-0.5, 0.5, 0.0], 0.463_948_55)] {
            let sample = lights.sample(&s, &at(p), 0.5, Vec2::splat(0.5)).unwrap();
            assert!((sample.weight.x - red).abs() < 1e-5, "{p:?}: {} where Mitsuba has {red}", sample.weight.x);
            assert!((sample.weight.z - red * 0.6).abs() < 1e-5 && sample.delta && sample.pdf == 1.0);
        }
        assert!(lights.sample(&s, &at([-3.0, 0.0, 0.0]), 0.5, Vec2::splat(0.5)).is_none(), "outside of the cone");

        let two = vec![
            Emitter::Point { position: Vec3::Y * 2.0, intensity: Rgb::splat(8.0) },
            Emitter::Directional { direction: Vec3::NEG_Y, irradiance: Rgb::splat(7.0) },
        ];
        let s = scene(two);
        let lights = Lights::new(&s);
        let point = lights.sample(&s, &at([0.0; 3]), 0.7, Vec2::ZERO).unwrap();
        assert_eq!((point.wi, point.distance, point.weight), (Vec3::Y, 2.0, Rgb::splat(2.0 * 8.0 / 4.0)));
        let sun = lights.sample(&s, &at([0.0; 3]), 0.2, Vec2::ZERO).unwrap();
        assert_eq!((sun.wi, sun.distance, sun.weight), (Vec3::Y, f32::INFINITY, Rgb::splat(2.0 * 7.0)));
    }

    #[test]
    fn a_lamp_seen_from_below_fills_its_solid_angle() {
        const N: u32 = 4096;
        let s = lamp(1.5, vec![]);
        let lights = Lights::new(&s);
        let p = Vec3::new(0.3, 0.0, -0.2);
        let weight = |i| {
            let [u, x, y, _] = Sampler::new(1, i).next_4d();
            lights.sample(&s, &at(p), u, Vec2::new(x, y)).unwrap().weight
        };
        let sum: Rgb = (0..N).map(|i| weight(i) / N as f32).sum();
        // Solid angle of a rectangle, corner by corner: atan(a b / (h sqrt(a² + b² + h²))).
        let corner = |a: f32, b: f32| (a * b / (1.5 * (a * a + b * b + 1.5 * 1.5).sqrt())).atan();
        let solid_angle = corner(1.3, 1.8) + corner(0.7, 1.8) + corner(1.3, 2.2) + corner(0.7, 2.2);
        assert!((sum / Rgb::new(1.0, 2.0, 3.0) / solid_angle - 1.0).abs().max_element() < 2e-3, "{sum}, {solid_angle} sr");
        let above = Vec3::new(0.0, 3.0, 0.0);
        assert!(lights.sample(&s, &at(above), 0.0, Vec2::splat(0.4)).is_none(), "dark from behind");
    }

    #[test]
    fn only_parallelograms_are_sampled_as_one() {
        const N: u32 = 4096;
        let skewed = |by: f32, uv: bool| {
            let mut s = lamp(1.5, vec![]);
            let mut geometry = (*s.geometry).clone();
            geometry.positions[3].x += by;
            geometry.objects[0].has_uvs = uv;
            geometry.uvs[3] = Vec2::new(0.3, 0.2);
            s.geometry = geometry.into();
            s
        };
        let p = Vec3::new(0.3, 0.0, -0.2);
        for (s, one) in [(skewed(0.0, false), true), (skewed(0.5, false), false), (skewed(0.0, true), false)] {
            let lights = Lights::new(&s);
            let Near::Triangle(first) = &lights.near[0] else { panic!("a triangle") };
            assert_eq!((first.parallelogram, lights.tree.place[0] == lights.tree.place[1]), (one, one));
            // All parts of the lamp are found, at the density of their area.
            let area = |t| 0.5 * s.geometry.area_normal(t).length();
            let side = |point: Vec3| point.x * 4.0 > point.z * 2.0;
            let mut found = [0.0; 2];
            for i in 0..N {
                let [u, x, y, _] = Sampler::new(4, i).next_4d();
                let sample = lights.sample(&s, &at(p), u, Vec2::new(x, y)).unwrap();
                let per_area = sample.pdf * sample.wi.y / sample.distance.powi(2);
                found[usize::from(!side(sample.point))] += 1.0 / per_area / N as f32;
            }
            for (t, found) in found.iter().enumerate() {
                assert!((found / area(t as u32) - 1.0).abs() < 0.03, "{one}: triangle {t} has {found} of {}", area(t as u32));
            }
        }
    }

    #[test]
    fn the_density_of_a_found_point_is_the_one_it_is_sampled_with() {
        let s = lamp(1.5, vec![Emitter::Constant { radiance: Rgb::ONE }, Emitter::Constant { radiance: Rgb::ZERO }]);
        let lights = Lights::new(&s);
        let p = Vec3::new(-0.6, 0.1, 0.4);
        for i in 0..64 {
            let [u, x, y, _] = Sampler::new(2, i).next_4d();
            let v = Vec2::new(x, y);
            let receiver = Receiver { p, n: if i % 2 == 0 { Vec3::Y } else { Vec3::ZERO } };
            let sample = lights.sample(&s, &receiver, 0.5 + 0.5 * u, v).unwrap();
            let triangle = if sample.point.x > sample.point.z / 2.0 { 0 } else { 1 };
            let flat = Surface::flat(sample.point, Vec3::NEG_Y);
            let found = Surface { t: sample.distance, triangle, emitter: Some(0), ..flat };
            assert!((lights.pdf_surface(&s, &receiver, &found) / sample.pdf - 1.0).abs() < 1e-4);
            assert_eq!(lights.emitted(&s, &found, -sample.wi), Rgb::new(1.0, 2.0, 3.0));
            assert_eq!(lights.emitted(&s, &found, sample.wi), Rgb::ZERO);
            let sky = lights.sample(&s, &receiver, 0.25, v).unwrap();
            assert!(
                (sky.pdf - 0.5 * 0.25 / PI).abs() < 1e-6
                    && (sky.pdf - lights.pdf_environment(&at([0.0; 3]), sky.wi)).abs() < 1e-7
            );
        }
    }

    #[test]
    fn a_scene_without_light_gives_no_sample() {
        let s = scene(vec![]);
        assert!(Lights::new(&s).is_empty());
        assert!(Lights::new(&s).sample(&s, &at([0.0; 3]), 0.5, Vec2::ZERO).is_none());
    }
}
