//! A probe's texels, made ready for the gather: what it reads most often lies closest together.

use crate::base::math::Rgb;
use crate::base::ray::Hit;
use crate::material::bsdf::{Lobes, Query};
use crate::probe::file::{NO_TRIANGLE, Probe, Texel};
use crate::transport::World;
use crate::view::mirror::Reflected;
use bytemuck::{Pod, Zeroable};
use glam::{Vec2, Vec3};
use rayon::prelude::*;
use std::collections::BTreeMap;

/// [`ReflectedTexel::material`] of a texel that sees no surface.
const NO_SURFACE: u16 = u16::MAX;

/// A probe's texels as the gather sees them, an entry a texel in each list. 76 bytes a texel in all, the same on a GPU.
#[derive(Default)]
pub struct Candidates {
    /// What rules most texels out.
    pub seen: Vec<ReflectedTexel>,
    /// What the energy compares besides.
    pub directions: Vec<Directions>,
    /// What is fetched in the end.
    pub light: Vec<Light>,
    /// [`crate::probe::parameter_map::ParameterMap::search_scale`] at half the probe's resolution, and one more, so that two can be read of the
    /// last; not on a GPU.
    pub(crate) scale: Vec<Vec2>,
}

/// A probe that takes part.
pub struct WeightedProbe<'a> {
    /// Index in the set.
    pub index: usize,
    /// The probe.
    pub probe: &'a Probe,
    /// Its texels, ready for the search.
    pub candidates: &'a Candidates,
    /// Its weight at equal energy ([`super::gather::GatherParams::probe_weight`]).
    pub weight: f32,
}

/// The reflector's material, and what a mirror there shows.
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(C, align(16))]
pub struct ReflectedTexel {
    pub(crate) reflected_point: Vec3,
    pub(crate) reflected_material: u16,
    /// Material of the reflector.
    pub material: u16,
}

impl ReflectedTexel {
    /// R.
    #[inline]
    pub fn reflected(&self) -> Reflected {
        Reflected { point: self.reflected_point, material: self.reflected_material }
    }
}

/// The reflector's normal and roughness, and the direction from it to what it reflects.
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(C)]
pub struct Directions {
    /// n, unit shading normal facing the probe; zero where there is no surface.
    pub normal: Vec3,
    /// Unit direction of the reflected ray.
    pub reflected: Vec3,
    /// Microfacet alpha of the reflector's non-diffuse lobe, unscaled; 0 where it has none.
    pub alpha: f32,
}

/// Colour, and what decides whether it may be blended.
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(C, align(16))]
pub struct Light {
    /// Glossy radiance.
    pub glossy: Rgb,
    /// Object of the reflector.
    pub object: u32,
    /// Directional albedo of the reflector's non-diffuse lobe towards the probe, at the probe's roughness; 1 where nobody asked.
    pub albedo: Rgb,
    /// Material of the reflected hit.
    pub reflected_material: u32,
}

impl Candidates {
    /// The candidates of a probe; with albedos where the scale of roughness that it was baked at is given; without the light that perfect
    /// mirrors show, where the view looks for that itself (`mirror_light`).
    pub fn new(world: &World, probe: &Probe, roughness_scale: Option<f32>, mirror_light: bool) -> Self {
        let width = probe.size[0] as usize;
        let rows = || probe.texels.par_iter().with_min_len(width);
        let reflectors: Vec<_> = rows().map(|texel| reflector(world, texel, probe.position, roughness_scale)).collect();
        let with_reflectors = || rows().zip(&reflectors);
        let material = |object: u32| world.scene.geometry.objects[object as usize].material as u16;
        let seen = |(texel, r): (&Texel, &Option<Reflector>)| {
            let Reflected { point: reflected_point, material: reflected_material } = texel.reflected();
            ReflectedTexel {
                reflected_point,
                reflected_material,
                material: r.as_ref().map_or(NO_SURFACE, |r| material(r.object)),
            }
        };
        let directions = |(texel, r): (&Texel, &Option<Reflector>)| match r {
            Some(r) => Directions { normal: r.normal, reflected: texel.reflected().direction_from(r.position), alpha: r.alpha },
            None => Directions { normal: Vec3::ZERO, reflected: Vec3::ZERO, alpha: 0.0 },
        };
        let light = |(texel, r): (&Texel, &Option<Reflector>)| Light {
            glossy: if mirror_light { texel.glossy() - texel.mirrored() } else { texel.glossy() },
            albedo: r.as_ref().map_or(Rgb::ONE, |r| r.albedo),
            reflected_material: u32::from(texel.reflected_material),
            object: r.as_ref().map_or(u32::MAX, |r| r.object),
        };
        Self {
            seen: with_reflectors().map(seen).collect(),
            directions: with_reflectors().map(directions).collect(),
            light: with_reflectors().map(light).collect(),
            scale: probe.map.search_scales().chain([Vec2::ONE]).collect(),
        }
    }
}

/// r_p and n_p of a texel: position, and shading normal facing the probe.
struct Reflector {
    position: Vec3,
    normal: Vec3,
    object: u32,
    alpha: f32,
    albedo: Rgb,
}

fn reflector(world: &World, texel: &Texel, eye: Vec3, roughness_scale: Option<f32>) -> Option<Reflector> {
    if texel.triangle == NO_TRIANGLE {
        return None;
    }
    let geometry = &world.scene.geometry;
    let b = texel.barycentric();
    let weights = [1.0 - b.x - b.y, b.x, b.y];
    let [i, j, k] = geometry.triangles[texel.triangle as usize].map(|v| v as usize);
    let mix = |v: &[Vec3]| v[i] * weights[0] + v[j] * weights[1] + v[k] * weights[2];
    let position = mix(&geometry.positions);
    let ng = geometry.area_normal(texel.triangle);
    let n = if geometry.object(texel.triangle).face_normals { ng } else { mix(&geometry.normals) };
    let n = n.try_normalize().unwrap_or(Vec3::Y);
    let eye_side = ng.dot(eye - position) * ng.dot(n);
    let object = geometry.triangle_object[texel.triangle as usize];
    let (alpha, albedo) = lobe(world, texel, eye, roughness_scale);
    Some(Reflector { position, normal: if eye_side < 0.0 { -n } else { n }, object, alpha, albedo })
}

/// Alpha of a texel's non-diffuse lobe, and its directional albedo towards the probe; 1 where nobody asks.
fn lobe(world: &World, texel: &Texel, eye: Vec3, roughness_scale: Option<f32>) -> (f32, Rgb) {
    let b = texel.barycentric();
    let surface = world.surface(&Hit { t: 0.0, triangle: texel.triangle, u: b.x, v: b.y });
    let bsdf = world.scene.bsdf(&surface);
    let wo = (eye - surface.p).try_normalize().unwrap_or(surface.frame.n);
    let query = |roughness_scale| Query { lobes: Lobes::NON_DIFFUSE, roughness_scale };
    let albedo = roughness_scale.map(|scale| bsdf.glossy_albedo(&surface, surface.frame.to_local(wo), query(scale)));
    (bsdf.alpha(&surface).unwrap_or(0.0), albedo.unwrap_or(Rgb::ONE))
}

/// The candidates of the probes around the camera, for as long as they are around it: quickly made, and more memory than the probe.
#[derive(Default)]
pub struct NearCandidates(BTreeMap<usize, Candidates>);

impl NearCandidates {
    /// The probes `near` the camera (index, probe, weight), ready for the gather. Makes the candidates that are missing, and drops
    /// those of all other probes. Always to be called with the same `roughness_scale` and `mirror_light`: [`Candidates::new`]'s.
    pub fn of<'a>(
        &'a mut self,
        world: &World,
        near: &[(usize, &'a Probe, f32)],
        roughness_scale: Option<f32>,
        mirror_light: bool,
    ) -> Vec<WeightedProbe<'a>> {
        self.0.retain(|index, _| near.iter().any(|(i, ..)| i == index));
        for &(index, probe, _) in near {
            self.0.entry(index).or_insert_with(|| Candidates::new(world, probe, roughness_scale, mirror_light));
        }
        let of = |&(index, probe, weight)| WeightedProbe { index, probe, candidates: &self.0[&index], weight };
        near.iter().map(of).collect()
    }
}
