//! Light straight from emitters, for methods that sample it in every view.

use super::gbuffer::Pixel;
use crate::base::math::Rgb;
use crate::material::Surface;
use crate::material::bsdf::Query;
use crate::transport::path::{PathParams, scattered};
use crate::transport::{Sampler, World};
use glam::Vec3;

/// Branch of a pixel's random stream: direct light of the glossy layer, where the diffuse one has the stream itself.
pub(crate) const GLOSSY_BRANCH: u32 = 1;

/// What the lobes of `query` send to the camera of light straight from emitters: the mean of `count` samples of a random stream. 0 for none.
pub fn direct(world: &World, p: &Pixel, query: Query, count: u32, stream: u32) -> Rgb {
    direct_at(world, (&p.surface, p.wo), query, count, stream)
}

/// The same at a surface that is seen from a unit direction.
pub fn direct_at(world: &World, (surface, wo): (&Surface, Vec3), query: Query, count: u32, stream: u32) -> Rgb {
    let sample = |s| scattered(world, surface, wo, query, None, &PathParams::DIRECT, &mut Sampler::new(stream, s));
    (0..count).map(sample).sum::<Rgb>() / count.max(1) as f32
}
