//! A model for each side of a surface (Mitsuba's `twosided`).

use super::{At, Bsdf, Lobes, Query, Scatter, Surface};
use crate::base::math::Rgb;
use crate::{Error, Result};
use glam::Vec3;

/// Different models in front and behind.
#[derive(Debug, Clone, serde::Serialize)]
pub struct TwoSided {
    /// Seen where cos > 0.
    pub front: Box<Bsdf>,
    /// Seen from behind; the same as `front` where the scene names one only.
    pub back: Box<Bsdf>,
}

impl TwoSided {
    /// Refuses models that let light through, which have two sides of their own.
    pub fn new(front: Bsdf, back: Bsdf) -> Result<Self> {
        if front.is_transmissive() || back.is_transmissive() {
            return Err(Error::Request("twosided: the model within lets light through, expected an opaque one".into()));
        }
        Ok(Self { front: Box::new(front), back: Box::new(back) })
    }

    /// The model that `w` sees.
    fn side(&self, w: Vec3) -> &Bsdf {
        if w.z > 0.0 { &self.front } else { &self.back }
    }
}

/// A direction as the side that it sees has it: mirrored behind.
fn towards(w: Vec3) -> Vec3 {
    if w.z > 0.0 { w } else { w.with_z(-w.z) }
}

impl Scatter for TwoSided {
    fn at<'a>(&'a self, s: &'a Surface, wi: Vec3, query: Query) -> At<'a> {
        let front = wi.z > 0.0;
        self.side(wi).at(s, towards(wi), query).on_side(!front)
    }

    fn prefetch(&self, s: &Surface) {
        self.front.prefetch(s);
    }

    fn lobes(&self) -> Lobes {
        self.front.lobes() | self.back.lobes()
    }

    fn diffuse_out(&self, s: &Surface, wi: Vec3) -> Rgb {
        self.side(wi).diffuse_out(s, towards(wi))
    }

    fn diffuse_in(&self, s: &Surface, wo: Vec3) -> f32 {
        self.side(wo).diffuse_in(s, towards(wo))
    }

    fn diffuse_albedo(&self, s: &Surface, wi: Vec3) -> Rgb {
        self.side(wi).diffuse_albedo(s, towards(wi))
    }

    fn glossy_albedo(&self, s: &Surface, wi: Vec3, query: Query) -> Rgb {
        self.side(wi).glossy_albedo(s, towards(wi), query)
    }

    fn alpha(&self, s: &Surface) -> Option<f32> {
        self.front.alpha(s).or_else(|| self.back.alpha(s))
    }

    fn is_two_sided(&self) -> bool {
        true
    }
}
