//! Scattering models. Directions are local to the shading frame, point away from the surface, and z is the normal.
//!
//! Semantics follow Mitsuba 3: `eval` includes the cosine of `wo`, `wi` is the viewer's side of the path tracer,
//! one-sided models are black from behind, `twosided` mirrors them.

pub mod adapters;
pub mod conductor;
pub mod dielectric;
pub mod diffuse;
pub mod microfacet;
pub mod plastic;
pub mod principled;
pub mod roughdielectric;
pub mod roughplastic;

pub use adapters::{Blend, BumpMap, NormalMap, TwoSided};
pub use conductor::{Conductor, RoughConductor};
pub use dielectric::{Dielectric, DielectricParams, ThinDielectric};
pub use diffuse::Diffuse;
pub use microfacet::Distribution;
pub use plastic::{Plastic, PlasticParams};
pub use principled::{Principled, PrincipledParams};
pub use roughdielectric::RoughDielectric;
pub use roughplastic::RoughPlastic;

use super::Surface;
use crate::math::Rgb;
use glam::{Vec2, Vec3};

bitflags::bitflags! {
    /// Which lobes a query asks for.
    #[derive(Debug, Clone, Copy, PartialEq, Eq)]
    pub struct Lobes: u8 {
        /// Mitsuba's `DiffuseReflection` (and transmission): what the light map stores.
        const DIFFUSE = 1;
        /// Everything else, glossy and delta, reflection and transmission: what the probes store.
        const NON_DIFFUSE = 2;
        /// Both.
        const ALL = 3;
    }
}

/// What is asked of a BSDF.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Query {
    /// The lobes that count; sampling then draws from these alone.
    pub lobes: Lobes,
    /// Multiplies alpha of every microfacet lobe (§6.1: 0.5 at the first vertex of a probe path).
    pub roughness_scale: f32,
}

impl Default for Query {
    fn default() -> Self {
        Self { lobes: Lobes::ALL, roughness_scale: 1.0 }
    }
}

/// A sampled direction.
#[derive(Debug, Clone, Copy)]
pub struct BsdfSample {
    /// Local direction, unit.
    pub wo: Vec3,
    /// f · |cos wo| / pdf.
    pub weight: Rgb,
    /// Density in solid angle over all lobes of the query; probability for a delta lobe.
    pub pdf: f32,
    /// A Dirac delta: no light sample can stand in for it.
    pub delta: bool,
    /// Relative index of refraction along the sampled path (1 for reflection), for Russian roulette.
    pub eta: f32,
}

/// A scattering model with its parameters.
#[derive(Debug, Clone)]
pub enum Bsdf {
    /// Lambertian.
    Diffuse(Diffuse),
    /// Smooth coating over a diffuse base.
    Plastic(Box<Plastic>),
    /// Rough coating over a diffuse base.
    RoughPlastic(Box<RoughPlastic>),
    /// Smooth metal or perfect mirror.
    Conductor(Conductor),
    /// Rough metal.
    RoughConductor(Box<RoughConductor>),
    /// Smooth interface.
    Dielectric(Box<Dielectric>),
    /// Thin sheet.
    ThinDielectric(Box<ThinDielectric>),
    /// Rough interface.
    RoughDielectric(Box<RoughDielectric>),
    /// A model for each side.
    TwoSided(TwoSided),
    /// Frame tilted by a height field.
    BumpMap(BumpMap),
    /// Frame tilted by stored normals.
    NormalMap(NormalMap),
    /// Linear mix.
    Blend(Blend),
    /// Burley's principled model.
    Principled(Box<Principled>),
}

impl Bsdf {
    /// f(wi, wo) · |cos wo|, without delta lobes.
    pub fn eval(&self, _s: &Surface, _wi: Vec3, _wo: Vec3, _query: Query) -> Rgb {
        todo!()
    }

    /// Density with which [`Bsdf::sample`] draws `wo`, per solid angle; 0 for delta lobes.
    pub fn pdf(&self, _s: &Surface, _wi: Vec3, _wo: Vec3, _query: Query) -> f32 {
        todo!()
    }

    /// Draws a direction; `u` chooses the lobe, `v` the direction.
    pub fn sample(&self, _s: &Surface, _wi: Vec3, _u: f32, _v: Vec2, _query: Query) -> Option<BsdfSample> {
        todo!()
    }

    /// The diffuse lobe factors as `f_d = diffuse_out(wi) · diffuse_in(wo) / π`. This is the view's factor,
    /// albedo texture included: the diffuse layer is `diffuse_out(wi) · E / π` with the light map's E.
    /// Models whose lobe does not factor (blends, principled) use their directional albedo here and 1 in `diffuse_in`.
    pub fn diffuse_out(&self, _s: &Surface, _wi: Vec3) -> Rgb {
        todo!()
    }

    /// The light's factor of the diffuse lobe (1 for `diffuse`, Fresnel transmission for plastics).
    pub fn diffuse_in(&self, _s: &Surface, _wo: Vec3) -> f32 {
        todo!()
    }

    /// Whether light passes through (dielectrics): such shapes are left out of the probe stages.
    pub fn is_transmissive(&self) -> bool {
        todo!()
    }

    /// The lobes that the model has at all.
    pub fn lobes(&self) -> Lobes {
        todo!()
    }

    /// Microfacet alpha of the non-diffuse lobe at a point: 0 for a mirror; `None` without such a lobe.
    pub fn alpha(&self, _s: &Surface) -> Option<f32> {
        todo!()
    }

    /// Whether the back side scatters like the front (`twosided`).
    pub fn is_two_sided(&self) -> bool {
        todo!()
    }
}
