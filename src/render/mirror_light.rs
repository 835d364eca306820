//! What perfect mirrors show of lamps, of the environment and of diffuse light: looked up along the mirror ray, in place of being fetched
//! from probes.
//!
//! *Ours*. A lobe without width shows a single point, and the mirror ray ends there: its emission is known, and the light map knows its
//! diffuse light, without the texels of a probe in between. Probes are left with what that point reflects in its turn: a bake tells of its
//! texels that see a perfect mirror what the same lookup finds along their own mirror ray; that is taken out before the gather, and
//! the view's pixels get what is found along theirs after the filter.

use super::gbuffer::GBuffer;
use super::mirror::{Reflected, SKY, mirror_direction};
use crate::lightmap::LightMap;
use crate::math::Rgb;
use crate::transport::bsdf::{Lobes, Query};
use crate::transport::{Surface, World};
use glam::Vec3;
use rayon::prelude::*;

/// What a view's perfect mirrors show; black at other pixels.
pub fn mirror_light_pass(world: &World, lightmap: &LightMap, view: &GBuffer) -> Vec<Rgb> {
    let pixels = view.pixels.par_iter().with_min_len(view.size()[0]);
    pixels
        .map(|pixel| match pixel {
            Some(p) if p.alpha == Some(0.0) => mirror_light(world, lightmap, &p.surface, p.wo).1,
            _ => Rgb::ZERO,
        })
        .collect()
}

/// What `surface`, a perfect mirror, shows to `wo` (unit, away from it), and the radiance that it sends there of that point's emission and
/// diffuse light.
pub fn mirror_light(world: &World, lightmap: &LightMap, surface: &Surface, wo: Vec3) -> (Reflected, Rgb) {
    let d = mirror_direction(surface, wo);
    let (reflected, light) = match world.intersect(&surface.spawn(d)) {
        Some(hit) => {
            let light = world.lights.emitted(&world.scene, &hit, -d) + lightmap.diffuse_radiance(&world.scene, &hit, -d);
            (Reflected { point: hit.p, material: hit.material as u16 }, light)
        }
        None => (Reflected { point: d, material: SKY }, world.lights.environment(d)),
    };
    let query = Query { lobes: Lobes::NON_DIFFUSE, roughness_scale: 1.0 };
    let bsdf = &world.scene.materials[surface.material as usize].bsdf;
    (reflected, light * bsdf.glossy_albedo(surface, surface.frame.to_local(wo), query))
}

/// Both parts of a view's glossy layer together. What the probes are left with may be below zero by rounding or noise; the sum is not.
pub fn add_mirrored(rest: &[Rgb], mirrored: &[Rgb]) -> Vec<Rgb> {
    rest.par_iter().zip(mirrored).map(|(&a, &b)| (a + b).max(Rgb::ZERO)).collect()
}
