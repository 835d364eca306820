//! A model at a point, as one viewer sees it: what textures say there, and all else that does not depend on where the light comes from,
//! is worked out once, however often it is then asked.

use super::BsdfSample;
use super::blend::BlendAt;
use super::bump::TiltedAt;
use super::conductor::{ConductorAt, RoughConductorAt};
use super::dielectric::{DielectricAt, ThinDielectricAt};
use super::diffuse::DiffuseAt;
use super::plastic::PlasticAt;
use super::principled::PrincipledAt;
use super::roughdielectric::RoughDielectricAt;
use super::roughplastic::RoughPlasticAt;
use crate::base::math::Rgb;
use glam::{Vec2, Vec3};

/// What [`super::Bsdf::at`] gives.
#[derive(Clone, Copy)]
pub struct At<'a> {
    model: Model<'a>,
    /// Seen from the back of a two-sided model: directions are those of its front, mirrored.
    behind: bool,
}

#[derive(Clone, Copy)]
pub(super) enum Model<'a> {
    /// Nothing comes to this viewer, by the lobes that are asked for.
    Black,
    Diffuse(DiffuseAt),
    Plastic(PlasticAt<'a>),
    RoughPlastic(RoughPlasticAt<'a>),
    Conductor(ConductorAt<'a>),
    RoughConductor(RoughConductorAt<'a>),
    Dielectric(DielectricAt<'a>),
    ThinDielectric(ThinDielectricAt<'a>),
    RoughDielectric(RoughDielectricAt<'a>),
    Tilted(TiltedAt<'a>),
    Blend(BlendAt<'a>),
    Principled(PrincipledAt<'a>),
}

impl<'a> At<'a> {
    pub(super) fn of(model: Model<'a>) -> Self {
        Self { model, behind: false }
    }

    /// Of a model that is there, or is black.
    pub(super) fn some<T>(model: Option<T>, wrap: impl FnOnce(T) -> Model<'a>) -> Self {
        Self::of(model.map_or(Model::Black, wrap))
    }

    /// The same, seen from the back of a two-sided model, or from its front.
    pub(super) fn on_side(self, behind: bool) -> Self {
        Self { behind: self.behind != behind, ..self }
    }

    fn towards(&self, w: Vec3) -> Vec3 {
        if self.behind { w.with_z(-w.z) } else { w }
    }

    /// [`super::Bsdf::eval_pdf`].
    pub fn eval_pdf(&self, wo: Vec3) -> (Rgb, f32) {
        let wo = self.towards(wo);
        match &self.model {
            Model::Black | Model::Conductor(_) | Model::Dielectric(_) | Model::ThinDielectric(_) => (Rgb::ZERO, 0.0),
            Model::Diffuse(model) => model.eval_pdf(wo),
            Model::Plastic(model) => model.eval_pdf(wo),
            Model::RoughPlastic(model) => model.eval_pdf(wo),
            Model::RoughConductor(model) => model.eval_pdf(wo),
            Model::RoughDielectric(model) => model.eval_pdf(wo),
            Model::Tilted(model) => model.eval_pdf(wo),
            Model::Blend(model) => model.eval_pdf(wo),
            Model::Principled(model) => model.eval_pdf(wo),
        }
    }

    /// The first of the numbers `u` by which [`At::sample`] draws a cosine-weighted direction of the diffuse lobe; `None` of models that have none,
    /// or more than one.
    pub fn first_diffuse(&self) -> Option<f32> {
        match &self.model {
            Model::Diffuse(_) => Some(0.0),
            Model::Plastic(model) => Some(model.first_diffuse()),
            Model::RoughPlastic(model) => Some(model.first_diffuse()),
            _ => None,
        }
    }

    /// [`super::Bsdf::sample`].
    pub fn sample(&self, u: f32, v: Vec2) -> Option<BsdfSample> {
        let sample = match &self.model {
            Model::Black => None,
            Model::Diffuse(model) => model.sample(v),
            Model::Plastic(model) => model.sample(u, v),
            Model::RoughPlastic(model) => model.sample(u, v),
            Model::Conductor(model) => Some(model.sample()),
            Model::RoughConductor(model) => model.sample(v),
            Model::Dielectric(model) => Some(model.sample(u)),
            Model::ThinDielectric(model) => Some(model.sample(u)),
            Model::RoughDielectric(model) => model.sample(u, v),
            Model::Tilted(model) => model.sample(u, v),
            Model::Blend(model) => model.sample(u, v),
            Model::Principled(model) => model.sample(u, v),
        }?;
        Some(BsdfSample { wo: self.towards(sample.wo), ..sample })
    }
}
