//! What light field probes store, by rays from where they stand.
//!
//! Radiance holds light that surfaces scatter towards the probe, and not what they emit: frames sample emitters themselves. The first bounce
//! is sampled at every texel; each further one is what frames would show of the surface there, lit by the bounces before (Wang 2019, §5:
//! "iteratively re-injecting").

use super::LightFieldParams;
use super::field::LightField;
use super::lobe::along_lobes;
use super::probe::{Ambient, Light, Surfels};
use crate::base::math::{Rgb, hash_words};
use crate::base::named::{Parameters, within};
use crate::base::octahedral::{middle, pack};
use crate::base::ray::Ray;
use crate::material::bsdf::Query;
use crate::transport::path::{PathParams, scattered};
use crate::transport::{Sampler, World};
use crate::view::gbuffer::view_alpha;
use crate::{Error, Result};
use glam::Vec3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::f32::consts::FRAC_1_PI;

/// What is baked.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LightFieldBakeParams {
    /// Texels along an edge of the maps: a power of two. *Paper*: 512.
    pub size: u32,
    /// Texels along an edge of the maps of irradiance and of moments.
    pub ambient_size: u32,
    /// Samples of direct light a texel.
    pub spp: u32,
    /// Rays along glossy lobes a texel and bounce.
    pub lobe_samples: u32,
    /// Bounces of light that radiance holds; 1 is direct light alone.
    pub bounces: u32,
}

impl Default for LightFieldBakeParams {
    fn default() -> Self {
        Self { size: 512, ambient_size: 32, spp: 8, lobe_samples: 2, bounces: 3 }
    }
}

impl Parameters for LightFieldBakeParams {
    fn validate(&self) -> Result<()> {
        if !self.size.is_power_of_two() {
            return Err(Error::Request(format!("--size {}: expected a power of two, like 512", self.size)));
        }
        within("--size", self.size, 16..=4096)?;
        within("ambient_size", self.ambient_size, 4..=256)?;
        within("--spp", self.spp, 1..=1 << 16)?;
        within("lobe_samples", self.lobe_samples, 1..=1 << 16)?;
        within("--bounces", self.bounces, 1..=64)
    }
}

/// What a probe sees before light has bounced more than once.
#[derive(Debug, Clone)]
pub struct Seen {
    /// The surfaces.
    pub surfels: Surfels,
    /// Direct light that they scatter towards the probe.
    pub direct: Vec<Rgb>,
    /// Directional albedo of their diffuse lobes, towards the probe.
    pub albedo: Vec<Rgb>,
    /// Where they face for diffuse light: the shading normal on the probe's side.
    pub facing: Vec<Vec3>,
}

/// Casts a ray through the middle of every texel. The random stream of a texel is a hash of (seed, probe, texel).
pub fn look(world: &World, position: Vec3, index: u32, params: &LightFieldBakeParams, seed: u32) -> Seen {
    let n = params.size as usize;
    let path = PathParams { max_depth: 1, ..PathParams::default() };
    let texel = |i: usize| {
        let d = middle(i, n);
        let Some(surface) = world.intersect(&Ray::new(position, d)) else {
            return (f32::INFINITY, -d, Rgb::ZERO, Rgb::ZERO, -d);
        };
        let stream = hash_words(&[seed, index, i as u32]);
        let light = |s| scattered(world, &surface, -d, Query::default(), None, &path, &mut Sampler::new(stream, s));
        let direct = (0..params.spp).map(light).sum::<Rgb>() / params.spp as f32;
        let bsdf = world.scene.bsdf(&surface);
        let albedo = bsdf.diffuse_albedo(&surface, surface.frame.to_local(-d));
        let towards = |n: Vec3| if n.dot(d) > 0.0 { -n } else { n };
        (surface.t, towards(surface.ng), direct, albedo, towards(surface.frame.n))
    };
    let all: Vec<_> = (0..n * n).into_par_iter().map(texel).collect();
    let mut seen = Seen {
        surfels: Surfels { size: n, distance: Vec::new(), normal: Vec::new() },
        direct: Vec::new(),
        albedo: Vec::new(),
        facing: Vec::new(),
    };
    for (distance, normal, direct, albedo, facing) in all {
        seen.surfels.distance.push(distance);
        seen.surfels.normal.push(pack(normal));
        seen.direct.push(direct);
        seen.albedo.push(albedo);
        seen.facing.push(facing);
    }
    seen
}

/// Is told of each probe's radiance and ambient light.
pub type Each<'a> = &'a mut dyn FnMut(usize, &[Rgb], &Ambient) -> Result<()>;

/// Gives `field` one bounce more than it holds; an unlit one direct light. `seen` gives what a probe sees, `each` is told what comes of it.
pub fn bounce(
    (world, field): (&World, &mut LightField),
    seen: &dyn Fn(usize) -> Result<Seen>,
    params: &LightFieldBakeParams,
    (far, seed): (f32, u32),
    each: Each,
) -> Result<()> {
    let mut next = Vec::new();
    for i in field.places.used() {
        let seen = seen(i)?;
        let radiance = if field.is_lit() { reinjected((world, field), (&seen, i), params, (far, seed)) } else { seen.direct };
        let ambient = Ambient::new(&seen.surfels, &radiance, params.ambient_size as usize, far);
        each(i, &radiance, &ambient)?;
        next.push((i, Light::new(&radiance, params.size as usize), ambient));
    }
    for (i, light, ambient) in next {
        (field.light[i], field.ambient[i]) = (light, ambient);
    }
    Ok(())
}

/// Radiance with one bounce more than `field` holds: what the method itself shows of the surfaces that a probe sees, by the irradiance of its
/// diffuse lobes and `lobe_samples` rays along the others. `far`: length of rays, metres.
fn reinjected(
    (world, field): (&World, &LightField),
    (seen, index): (&Seen, usize),
    params: &LightFieldBakeParams,
    (far, seed): (f32, u32),
) -> Vec<Rgb> {
    let position = field.places.position(index);
    let lobes = LightFieldParams { samples: params.lobe_samples, ..LightFieldParams::default() };
    let texel = |i: usize| {
        let (d, distance) = (seen.surfels.middle(i), seen.surfels.distance[i]);
        if !distance.is_finite() {
            return Rgb::ZERO;
        }
        let diffuse = match seen.albedo[i] {
            Rgb::ZERO => Rgb::ZERO,
            albedo => albedo * field.irradiance(position + d * distance, seen.facing[i]) * FRAC_1_PI,
        };
        let glossy = match world.intersect(&Ray::new(position, d)) {
            Some(surface) if view_alpha(world, &surface, -d).is_some() => {
                let stream = hash_words(&[seed, index as u32, i as u32, 1]);
                along_lobes((world, field), (&surface, -d), (&lobes, far), stream)
            }
            _ => Rgb::ZERO,
        };
        seen.direct[i] + diffuse + glossy
    };
    (0..seen.direct.len()).into_par_iter().map(texel).collect()
}
