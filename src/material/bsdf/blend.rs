//! A linear mix of two models (Mitsuba's `blendbsdf`).

use super::{Bsdf, BsdfSample, Lobes, Query, Scatter, Surface, scalar};
use crate::base::math::Rgb;
use crate::material::Texture;
use glam::{Vec2, Vec3};

/// A linear mix.
#[derive(Debug, Clone)]
pub struct Blend {
    /// Share of `b`; clamped to [0, 1].
    pub weight: Texture,
    /// Where the weight is 0.
    pub a: Box<Bsdf>,
    /// Where the weight is 1.
    pub b: Box<Bsdf>,
}

impl Blend {
    fn share_of_b(&self, s: &Surface) -> f32 {
        scalar(&self.weight, s.uv).clamp(0.0, 1.0)
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

impl Scatter for Blend {
    fn eval_pdf(&self, s: &Surface, wi: Vec3, wo: Vec3, query: Query) -> (Rgb, f32) {
        let share = self.share_of_b(s);
        let p = self.probability_of_b(share, query);
        let (value_a, pdf_a) = self.a.eval_pdf(s, wi, wo, query);
        let (value_b, pdf_b) = self.b.eval_pdf(s, wi, wo, query);
        (value_a * (1.0 - share) + value_b * share, pdf_a * (1.0 - p) + pdf_b * p)
    }

    fn sample(&self, s: &Surface, wi: Vec3, u: f32, v: Vec2, query: Query) -> Option<BsdfSample> {
        let share = self.share_of_b(s);
        let p = self.probability_of_b(share, query);
        let (sample, share, p) = if u < p {
            (self.b.sample(s, wi, u / p, v, query)?, share, p)
        } else {
            (self.a.sample(s, wi, (u - p) / (1.0 - p), v, query)?, 1.0 - share, 1.0 - p)
        };
        if sample.delta {
            return Some(BsdfSample { weight: sample.weight * (share / p), pdf: sample.pdf * p, ..sample });
        }
        let (value, pdf) = self.eval_pdf(s, wi, sample.wo, query);
        let mixed = BsdfSample::reflected(sample.wo, value / pdf, pdf)?;
        Some(BsdfSample { eta: sample.eta, ..mixed })
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
