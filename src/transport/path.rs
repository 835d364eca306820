//! The path tracer, with the split of the first vertex into its diffuse and non-diffuse lobes.

use super::bsdf::{Lobes, Query};
use super::{Ray, Sampler, Surface, World};
use crate::math::Rgb;

/// Depth and termination.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PathParams {
    /// Most scattering vertices a path may have; `u32::MAX` is unbounded.
    pub max_depth: u32,
    /// Russian roulette starts after this many vertices.
    pub rr_depth: u32,
}

impl Default for PathParams {
    fn default() -> Self {
        Self { max_depth: u32::MAX, rr_depth: 5 }
    }
}

/// The three layers of a pixel; their sum is the full image.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Layers {
    /// Emission seen directly: LE.
    pub emission: Rgb,
    /// Diffuse lobe of the first vertex: L(S|D)*DE.
    pub diffuse: Rgb,
    /// Non-diffuse lobes of the first vertex: L(S|D)*S+E.
    pub glossy: Rgb,
}

/// One sample of the three layers along a camera ray.
pub fn trace_layers(_world: &World, _ray: &Ray, _params: &PathParams, _sampler: &mut Sampler) -> Layers {
    todo!()
}

/// Radiance scattered at `surface` towards `wo_world` (unit, away from the surface) by the lobes and at the roughness of
/// `query`; later vertices scatter in full. Emission of `surface` itself is not included.
/// The probe bake calls this with `Lobes::NON_DIFFUSE` and the halved roughness, the path tracer with either half.
pub fn scattered(
    _world: &World,
    _surface: &Surface,
    _wo_world: glam::Vec3,
    _query: Query,
    _params: &PathParams,
    _sampler: &mut Sampler,
) -> Rgb {
    let _ = Lobes::ALL;
    todo!()
}

/// Incident, not scattered light: one sample of the light map's quantity ∫ T_in(ω) L(ω) cos θ dω at `surface`, on the side of
/// `frame.n` (or its back with `back`), with T_in = [`super::bsdf::Bsdf::diffuse_in`]. L holds all paths, direct light included.
pub fn transmitted_irradiance(
    _world: &World,
    _surface: &Surface,
    _back: bool,
    _params: &PathParams,
    _sampler: &mut Sampler,
) -> Rgb {
    todo!()
}
