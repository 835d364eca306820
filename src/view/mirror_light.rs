//! What mirrors show of lamps, of the environment and of diffuse light: looked up along the mirror ray.
//!
//! *Ours*: a lobe without width shows a single point, and the mirror ray ends there: its emission is known, and the light map knows its
//! diffuse light, without the texels of a probe in between; where it is a perfect mirror too, the ray goes on. Probes are left with what
//! rough surfaces in the mirror reflect: a bake tells of its texels that see a perfect mirror what the same lookup finds along their own
//! mirror ray; that is taken out before the gather, and the view's pixels get what is found along theirs after the filter.

use super::gbuffer::{GBuffer, GLOSSY, Pixel, is_glossy};
use super::mirror::{Reflected, SKY, mirror_direction, mirror_hit};
use crate::base::math::Rgb;
use crate::lightmap::LightMap;
use crate::material::Surface;
use crate::transport::World;
use glam::Vec3;
use rayon::prelude::*;

/// How far to follow mirror rays.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ChainParams {
    /// Mirror rays in a row.
    pub rays: u32,
    /// Alpha up to which what a ray meets is taken for a mirror, and the ray goes on.
    pub max_alpha: f32,
}

/// From perfect mirror to perfect mirror. *Ours*: sixteen; what follows comes from probes, which know where the first reflection leads alone,
/// and a room of mirrors that reflect .8 has a third of its light beyond four. Other scenes end the chain by themselves.
pub const PERFECT: ChainParams = ChainParams { rays: 16, max_alpha: 0.0 };

/// What a mirror shows.
#[derive(Debug, Clone, Copy)]
pub struct Shown {
    /// Radiance that arrives along the mirror direction: emission and diffuse light.
    pub light: Rgb,
    /// The unit mirror direction.
    pub direction: Vec3,
    /// The first hit; `None` for the environment.
    pub first: Option<Surface>,
}

/// Follows the mirror ray of `surface` for a viewer at direction `wo` (unit, away from it).
pub fn mirror_chain(world: &World, lightmap: &LightMap, surface: &Surface, wo: Vec3, params: &ChainParams) -> Shown {
    let mut shown = Shown { light: Rgb::ZERO, direction: mirror_direction(surface, wo), first: None };
    let (mut surface, mut d, mut throughput) = (*surface, shown.direction, Rgb::ONE);
    for bounce in 0..params.rays {
        let Some(hit) = world.intersect(&surface.spawn(d)) else {
            shown.light += throughput * world.lights.environment(d);
            break;
        };
        let wo = -d;
        let light = world.lights.emitted(&world.scene, &hit, wo) + lightmap.diffuse_radiance(&world.scene, &hit, wo);
        shown.light += throughput * light;
        if bounce == 0 {
            shown.first = Some(hit);
        }
        let alpha = world.scene.bsdf(&hit).alpha(&hit);
        if !(is_glossy(world, &hit, wo) && alpha.is_some_and(|alpha| alpha <= params.max_alpha)) {
            break;
        }
        throughput *= glossy_albedo(world, &hit, wo);
        (surface, d) = (hit, mirror_direction(&hit, wo));
    }
    shown
}

/// What `surface`, a perfect mirror, shows to `wo` (unit, away from it), and the radiance that it sends there of emission and diffuse
/// light.
pub fn mirror_light(world: &World, lightmap: &LightMap, surface: &Surface, wo: Vec3) -> (Reflected, Rgb) {
    let shown = mirror_chain(world, lightmap, surface, wo, &PERFECT);
    let reflected = match shown.first {
        Some(hit) => Reflected { point: hit.p, material: hit.material as u16 },
        None => Reflected { point: shown.direction, material: SKY },
    };
    (reflected, shown.light * glossy_albedo(world, surface, wo))
}

/// [`crate::view::mirror::mirror_pass`], and what the view's perfect mirrors show, by the same rays; black at other pixels.
pub fn mirror_light_pass(world: &World, lightmap: &LightMap, view: &GBuffer) -> (Vec<Reflected>, Vec<Rgb>) {
    view.pixels.par_iter().with_min_len(view.size()[0]).map(|pixel| mirrored(world, Some(lightmap), pixel)).unzip()
}

/// The mirror hit of a pixel, and what it shows where it is a perfect mirror and `lightmap` lights those.
pub(crate) fn mirrored(world: &World, lightmap: Option<&LightMap>, pixel: &Option<Pixel>) -> (Reflected, Rgb) {
    match (pixel, lightmap) {
        (Some(p), Some(lightmap)) if p.alpha == Some(0.0) => mirror_light(world, lightmap, &p.surface, p.wo),
        (Some(p), _) if p.alpha.is_some() => (mirror_hit(world, &p.surface, p.wo), Rgb::ZERO),
        _ => (Reflected::NONE, Rgb::ZERO),
    }
}

/// Both parts of a view's glossy layer together. What the probes are left with may be below zero by rounding or noise; the sum is not.
pub fn add_mirrored(rest: &[Rgb], mut mirrored: Vec<Rgb>) -> Vec<Rgb> {
    mirrored.par_iter_mut().zip(rest).for_each(|(b, &a)| *b = (a + *b).max(Rgb::ZERO));
    mirrored
}

/// Directional albedo of a surface's non-diffuse lobes towards `wo` (unit, world, away from it), at its own roughness.
pub(crate) fn glossy_albedo(world: &World, surface: &Surface, wo: Vec3) -> Rgb {
    let bsdf = world.scene.bsdf(surface);
    bsdf.glossy_albedo(surface, surface.frame.to_local(wo), GLOSSY)
}
