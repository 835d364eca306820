//! A linear mix of two models (Mitsuba's `blendbsdf`).

use super::{At, Bsdf, BsdfSample, Lobes, Model, Query, Scatter, Surface, scalar};
use crate::base::math::Rgb;
use crate::material::{Opacity, Texture};
use glam::{Vec2, Vec3};

/// A linear mix.
#[derive(Debug, Clone, serde::Serialize)]
pub struct Blend {
    /// Share of `b`; clamped to [0, 1].
    pub weight: Texture,
    /// Where the weight is 0.
    pub a: Box<Bsdf>,
    /// Where the weight is 1.
    pub b: Box<Bsdf>,
    /// How much of either is there, where one is masked: the weight is a share of both, masked or not.
    pub coverage: Option<Box<[Opacity; 2]>>,
}

impl Blend {
    fn share_of_b(&self, s: &Surface) -> f32 {
        let share = scalar(&self.weight, s).clamp(0.0, 1.0);
        let Some(coverage) = &self.coverage else { return share };
        let [a, b] = [0, 1].map(|i| coverage[i].eval(s.uv, true).clamp(0.0, 1.0));
        let all = a * (1.0 - share) + b * share;
        if all > 0.0 { b * share / all } else { share }
    }

    /// Probability of drawing from `b`: its share, where both have a lobe that is asked for.
    fn probability_of_b(&self, share: f32, query: Query) -> f32 {
        match (self.a.lobes().intersects(query.lobes), self.b.lobes().intersects(query.lobes)) {
            (false, true) => 1.0,
            (true, false) => 0.0,
            _ => share,
        }
    }

    /// Whether only `a` or only `b` has a diffuse lobe, which then still factors.
    pub(crate) fn only_diffuse(&self) -> Option<&Bsdf> {
        match (self.a.lobes().contains(Lobes::DIFFUSE), self.b.lobes().contains(Lobes::DIFFUSE)) {
            (true, false) => Some(&self.a),
            (false, true) => Some(&self.b),
            _ => None,
        }
    }

    fn mix(&self, s: &Surface, f: impl Fn(&Bsdf) -> Rgb) -> Rgb {
        f(&self.a).lerp(f(&self.b), self.share_of_b(s))
    }
}

/// A mix at a point. What is within is asked anew each time.
#[derive(Clone, Copy)]
pub(super) struct BlendAt<'a> {
    model: &'a Blend,
    s: &'a Surface,
    wi: Vec3,
    query: Query,
    /// Of `b`.
    share: f32,
    /// Of drawing from `b`.
    probability: f32,
}

impl BlendAt<'_> {
    pub(super) fn eval_pdf(&self, wo: Vec3) -> (Rgb, f32) {
        let (share, p) = (self.share, self.probability);
        let (value_a, pdf_a) = self.model.a.eval_pdf(self.s, self.wi, wo, self.query);
        let (value_b, pdf_b) = self.model.b.eval_pdf(self.s, self.wi, wo, self.query);
        (value_a * (1.0 - share) + value_b * share, pdf_a * (1.0 - p) + pdf_b * p)
    }

    pub(super) fn sample(&self, u: f32, v: Vec2) -> Option<BsdfSample> {
        let (share, p) = (self.share, self.probability);
        let (sample, share, p) = if u < p {
            (self.model.b.sample(self.s, self.wi, u / p, v, self.query)?, share, p)
        } else {
            (self.model.a.sample(self.s, self.wi, (u - p) / (1.0 - p), v, self.query)?, 1.0 - share, 1.0 - p)
        };
        if sample.delta {
            return Some(BsdfSample { weight: sample.weight * (share / p), pdf: sample.pdf * p, ..sample });
        }
        let (value, pdf) = self.eval_pdf(sample.wo);
        let mixed = BsdfSample::reflected(sample.wo, value / pdf, pdf)?;
        Some(BsdfSample { eta: sample.eta, ..mixed })
    }
}

impl Scatter for Blend {
    fn at<'a>(&'a self, s: &'a Surface, wi: Vec3, query: Query) -> At<'a> {
        let share = self.share_of_b(s);
        let probability = self.probability_of_b(share, query);
        At::of(Model::Blend(BlendAt { model: self, s, wi, query, share, probability }))
    }

    fn lobes(&self) -> Lobes {
        self.a.lobes() | self.b.lobes()
    }

    fn diffuse_out(&self, s: &Surface, wi: Vec3) -> Rgb {
        if self.only_diffuse().is_some() { self.mix(s, |m| m.diffuse_out(s, wi)) } else { self.diffuse_albedo(s, wi) }
    }

    fn diffuse_in(&self, s: &Surface, wo: Vec3) -> f32 {
        match self.only_diffuse() {
            Some(model) => model.diffuse_in(s, wo),
            None => f32::from(u8::from(wo.z > 0.0 || self.is_two_sided())),
        }
    }

    fn diffuse_albedo(&self, s: &Surface, wi: Vec3) -> Rgb {
        self.mix(s, |m| m.diffuse_albedo(s, wi))
    }

    fn glossy_albedo(&self, s: &Surface, wi: Vec3, query: Query) -> Rgb {
        self.mix(s, |m| m.glossy_albedo(s, wi, query))
    }

    fn alpha(&self, s: &Surface) -> Option<f32> {
        match (self.a.alpha(s), self.b.alpha(s)) {
            (Some(a), Some(b)) => Some(a.min(b)),
            (a, b) => a.or(b),
        }
    }

    fn is_transmissive(&self) -> bool {
        self.a.is_transmissive() || self.b.is_transmissive()
    }

    fn is_two_sided(&self) -> bool {
        self.a.is_two_sided() || self.b.is_two_sided()
    }
}
