//! Scattering models. Directions are local to the shading frame, point away from the surface, and z is the normal.
//!
//! Semantics follow Mitsuba 3: `eval` includes the cosine of `wo`, `wi` is the viewer's side of the path tracer,
//! one-sided models are black from behind, `twosided` mirrors them.

pub(crate) mod albedo;
mod at;
pub mod blend;
pub mod bump;
mod change;
pub mod conductor;
pub mod dielectric;
pub mod diffuse;
pub mod fresnel;
pub mod microfacet;
pub mod plastic;
pub mod principled;
pub mod roughdielectric;
pub mod roughplastic;
pub mod twosided;
pub mod warp;

pub use at::At;
pub use blend::Blend;
pub use bump::{BumpMap, NormalMap};
pub use conductor::{Conductor, RoughConductor};
pub use dielectric::{Dielectric, DielectricParams, ThinDielectric};
pub use diffuse::Diffuse;
pub use microfacet::Distribution;
pub use plastic::{Plastic, PlasticParams};
pub use principled::{Principled, PrincipledParams};
pub use roughdielectric::RoughDielectric;
pub use roughplastic::RoughPlastic;
pub use twosided::TwoSided;

use super::{Surface, Texture};
use crate::base::math::{Rgb, luminance};
use crate::{Error, Result};
use at::Model;
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

impl BsdfSample {
    /// A sample of a lobe with a density; `None` where it is worth nothing or not a number.
    fn reflected(wo: Vec3, weight: Rgb, pdf: f32) -> Option<Self> {
        (pdf > 0.0 && pdf.is_finite() && weight.is_finite()).then_some(Self { wo, weight, pdf, delta: false, eta: 1.0 })
    }

    /// The mirror reflection of `wi` about the normal, drawn with probability `pdf`.
    fn mirrored(wi: Vec3, weight: Rgb, pdf: f32) -> Self {
        Self { wo: Vec3::new(-wi.x, -wi.y, wi.z), weight, pdf, delta: true, eta: 1.0 }
    }
}

/// What each model implements; [`Bsdf`]'s methods of the same names say what they mean.
trait Scatter {
    fn at<'a>(&'a self, s: &'a Surface, wi: Vec3, query: Query) -> At<'a>;

    fn lobes(&self) -> Lobes;

    fn diffuse_out(&self, _s: &Surface, _wi: Vec3) -> Rgb {
        Rgb::ZERO
    }

    fn diffuse_in(&self, _s: &Surface, _wo: Vec3) -> f32 {
        0.0
    }

    /// Directional albedo of the diffuse lobes under uniform light.
    fn diffuse_albedo(&self, _s: &Surface, _wi: Vec3) -> Rgb {
        Rgb::ZERO
    }

    fn glossy_albedo(&self, _s: &Surface, _wi: Vec3, _query: Query) -> Rgb {
        Rgb::ZERO
    }

    fn alpha(&self, _s: &Surface) -> Option<f32> {
        None
    }

    fn prefetch(&self, _s: &Surface) {}

    fn is_transmissive(&self) -> bool {
        false
    }

    fn is_two_sided(&self) -> bool {
        false
    }
}

/// A number stored as a texture: its luminance.
fn scalar(texture: &Texture, s: &Surface) -> f32 {
    luminance(texture.at(s))
}

/// Index of refraction of the inside over that of the outside, both checked.
fn positive_ratio(model: &str, inside: f32, outside: f32) -> Result<f32> {
    let ratio = inside / outside;
    if inside > 0.0 && outside > 0.0 && ratio.is_finite() && ratio > 0.0 {
        Ok(ratio)
    } else {
        Err(Error::Request(format!(
            "{model}: indices of refraction {inside} (inside) and {outside} (outside), expected positive numbers"
        )))
    }
}

/// A scattering model with its parameters.
#[derive(Debug, Clone, serde::Serialize)]
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

/// Calls the same expression on whichever model it is.
macro_rules! each {
    ($self:ident, $model:ident => $call:expr) => {
        match $self {
            Bsdf::Diffuse($model) => $call,
            Bsdf::Plastic($model) => $call,
            Bsdf::RoughPlastic($model) => $call,
            Bsdf::Conductor($model) => $call,
            Bsdf::RoughConductor($model) => $call,
            Bsdf::Dielectric($model) => $call,
            Bsdf::ThinDielectric($model) => $call,
            Bsdf::RoughDielectric($model) => $call,
            Bsdf::TwoSided($model) => $call,
            Bsdf::BumpMap($model) => $call,
            Bsdf::NormalMap($model) => $call,
            Bsdf::Blend($model) => $call,
            Bsdf::Principled($model) => $call,
        }
    };
}

impl Bsdf {
    /// The model at a point, for a viewer at `wi`: to be asked more than once.
    pub fn at<'a>(&'a self, s: &'a Surface, wi: Vec3, query: Query) -> At<'a> {
        each!(self, model => model.at(s, wi, query))
    }

    /// f(wi, wo) · |cos wo|, without delta lobes.
    pub fn eval(&self, s: &Surface, wi: Vec3, wo: Vec3, query: Query) -> Rgb {
        self.eval_pdf(s, wi, wo, query).0
    }

    /// Density with which [`Bsdf::sample`] draws `wo`, per solid angle; 0 for delta lobes.
    pub fn pdf(&self, s: &Surface, wi: Vec3, wo: Vec3, query: Query) -> f32 {
        self.eval_pdf(s, wi, wo, query).1
    }

    /// [`Bsdf::eval`] and [`Bsdf::pdf`] at the price of one.
    pub fn eval_pdf(&self, s: &Surface, wi: Vec3, wo: Vec3, query: Query) -> (Rgb, f32) {
        self.at(s, wi, query).eval_pdf(wo)
    }

    /// Draws a direction; `u` chooses the lobe, `v` the direction. `None` where the model is black or the facet drawn
    /// sends the light into the surface: a path that ends.
    pub fn sample(&self, s: &Surface, wi: Vec3, u: f32, v: Vec2, query: Query) -> Option<BsdfSample> {
        self.at(s, wi, query).sample(u, v)
    }

    /// The diffuse lobe factors as `f_d = diffuse_out(wi) · diffuse_in(wo) / π`. This is the view's factor,
    /// albedo texture included: the diffuse layer is `diffuse_out(wi) · E / π` with the light map's E.
    /// Models whose lobe does not factor (blends of two, principled) use their directional albedo here and 1 in `diffuse_in`.
    pub fn diffuse_out(&self, s: &Surface, wi: Vec3) -> Rgb {
        each!(self, model => model.diffuse_out(s, wi))
    }

    /// The light's factor of the diffuse lobe (1 for `diffuse`, Fresnel transmission for plastics); it does not depend on
    /// the albedo. Zero from behind a one-sided model and for models without a diffuse lobe. Under a bump or normal map
    /// it also turns the surface's cosine into the tilted one, and may exceed 1.
    pub fn diffuse_in(&self, s: &Surface, wo: Vec3) -> f32 {
        each!(self, model => model.diffuse_in(s, wo))
    }

    /// Directional albedo of the diffuse lobes under uniform light: `diffuse_out` times the mean of `diffuse_in`.
    pub fn diffuse_albedo(&self, s: &Surface, wi: Vec3) -> Rgb {
        each!(self, model => model.diffuse_albedo(s, wi))
    }

    /// Directional albedo of the non-diffuse lobes, reflection and transmission, at the query's roughness: the share of
    /// uniform light that they send to `wi`. Exact for smooth models, a table lookup and one Fresnel term for rough ones
    /// (within a few per cent).
    pub fn glossy_albedo(&self, s: &Surface, wi: Vec3, query: Query) -> Rgb {
        each!(self, model => model.glossy_albedo(s, wi, query))
    }

    /// Whether light passes through (dielectrics): such shapes are left out of the probe stages.
    pub fn is_transmissive(&self) -> bool {
        each!(self, model => model.is_transmissive())
    }

    /// The lobes that the model has at all.
    pub fn lobes(&self) -> Lobes {
        each!(self, model => model.lobes())
    }

    /// Microfacet alpha of the main non-diffuse lobe at a point, unscaled: 0 for a mirror, the geometric mean of an
    /// anisotropic pair, the smaller of a blend; `None` without such a lobe.
    pub fn alpha(&self, s: &Surface) -> Option<f32> {
        each!(self, model => model.alpha(s))
    }

    /// Tells the caches what the model will read of its textures at a point, as far as it is worth it.
    #[inline]
    pub fn prefetch(&self, s: &Surface) {
        each!(self, model => model.prefetch(s))
    }

    /// Whether the back side scatters like the front (`twosided`).
    pub fn is_two_sided(&self) -> bool {
        each!(self, model => model.is_two_sided())
    }
}
