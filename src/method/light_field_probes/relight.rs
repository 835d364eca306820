//! Light field probes under light that changes: what they see is made anew in every frame, lit by diffuse light that is known from elsewhere.
//!
//! *Ours*: the papers' probes hold the light of their bake.

use super::field::LightField;
use super::march::Map;
use super::probe::{Light, Surfels};
use crate::base::math::{Rgb, hash_words};
use crate::base::octahedral::pack;
use crate::base::ray::Ray;
use crate::material::Surface;
use crate::method::diffuse::DiffuseLight;
use crate::transport::path::{PathParams, scattered};
use crate::transport::{Sampler, World};
use crate::view::gbuffer::{GLOSSY, view_alpha};
use glam::Vec3;
use rayon::prelude::*;

/// Gives `field` the light of a frame: at each texel the diffuse radiance that is known of the surface there, and one path along its glossy
/// lobes. Surfaces stay those that `field` has, unless the frame's `world` adds shapes.
pub fn relight(field: &mut LightField, world: &World, diffuse: &dyn DiffuseLight, seed: u32) {
    for i in field.places.used() {
        let (position, surfels) = (field.places.position(i), &field.maps[i].surfels);
        let size = surfels.size;
        let texel = |k: usize| {
            let d = surfels.middle(k);
            let Some(surface) = world.intersect(&Ray::new(position, d)) else { return (f32::INFINITY, -d, Rgb::ZERO) };
            let normal = if surface.ng.dot(d) > 0.0 { -surface.ng } else { surface.ng };
            (surface.t, normal, sent(world, diffuse, (&surface, -d), hash_words(&[seed, i as u32, k as u32])))
        };
        let texels: Vec<(f32, Vec3, Rgb)> = (0..size * size).into_par_iter().with_min_len(64).map(texel).collect();
        let radiance: Vec<Rgb> = texels.iter().map(|t| t.2).collect();
        if world.has_added() {
            let (distance, normal) = texels.iter().map(|t| (t.0, pack(t.1))).unzip();
            field.maps[i] = Map::new(Surfels { size, distance, normal });
        }
        field.light[i] = Light::new(&radiance, size);
    }
}

/// Radiance that a surface scatters towards `wo`.
fn sent(world: &World, diffuse: &dyn DiffuseLight, (surface, wo): (&Surface, Vec3), stream: u32) -> Rgb {
    let known = |s: &Surface, wo: Vec3| diffuse.radiance(world, s, wo);
    let glossy = match view_alpha(world, surface, wo) {
        None => Rgb::ZERO,
        Some(_) => scattered(world, surface, wo, GLOSSY, Some(&known), &PathParams::default(), &mut Sampler::new(stream, 0)),
    };
    known(surface, wo) + glossy
}
