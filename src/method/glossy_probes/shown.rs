//! What a ray shows, as far as it decides whether two rays show the same.

use crate::view::gbuffer::{GBuffer, Pixel};
use crate::view::mirror::Reflected;
use bytemuck::Zeroable;
use glam::Vec3;
use rayon::prelude::*;

// No measurement told values about these apart.
/// Least cosine between the normals of one surface.
pub(crate) const MIN_NORMAL_COS: f32 = 0.9;
/// How far from the other's plane a point of one surface may lie, as a fraction of its depth.
pub(crate) const DEPTH_TOLERANCE: f32 = 0.02;
/// Alpha up to which what a surface mirrors counts as an edge. (Twice the rays at 0.15, for nothing.)
pub(crate) const SHARP_ALPHA: f32 = 0.05;
/// Most that two reflected points of one surface differ, as a fraction of their distance.
pub(crate) const REFLECTED_TOLERANCE: f32 = 0.05;

/// What decides whether two rays see the same.
#[derive(Debug, Clone, Copy, PartialEq, Zeroable)]
pub struct Shown {
    pub(crate) p: Vec3,
    pub(crate) depth: f32,
    pub(crate) normal: Vec3,
    /// [`NOTHING_SEEN`] for the environment.
    pub(crate) material: u32,
    /// Negative where the surface has no glossy lobe.
    pub(crate) alpha: f32,
    pub(crate) reflected: Reflected,
}

/// [`Shown::material`] of what shows no surface.
pub(crate) const NOTHING_SEEN: u32 = u32::MAX;

/// What the pixels of a view show, with their mirror hits.
pub fn shown(view: &GBuffer, reflected: &[Reflected]) -> Vec<Shown> {
    view.pixels.par_iter().zip(reflected).with_min_len(view.size()[0]).map(|(p, r)| Shown::of(p, r)).collect()
}

impl Shown {
    pub(crate) fn of(pixel: &Option<Pixel>, reflected: &Reflected) -> Self {
        match pixel {
            Some(p) => Self {
                p: p.surface.p,
                depth: p.depth,
                normal: p.normal,
                material: p.surface.material,
                alpha: p.alpha.unwrap_or(-1.0),
                reflected: *reflected,
            },
            None => Self {
                p: Vec3::ZERO,
                depth: 0.0,
                normal: Vec3::ZERO,
                material: NOTHING_SEEN,
                alpha: -1.0,
                reflected: Reflected::NONE,
            },
        }
    }

    pub(crate) fn is_glossy(&self) -> bool {
        self.alpha >= 0.0
    }

    pub(crate) fn is_sharp(&self) -> bool {
        self.is_glossy() && self.alpha <= SHARP_ALPHA
    }

    /// Whether the two are on either side of an edge.
    pub(crate) fn differs(&self, other: &Self) -> bool {
        if self.material == NOTHING_SEEN || other.material == NOTHING_SEEN {
            return self.material != other.material;
        }
        !(self.same_surface(other) && self.same_reflected(&other.reflected))
    }

    pub(crate) fn same_surface(&self, other: &Self) -> bool {
        self.material == other.material
            && self.normal.dot(other.normal) > MIN_NORMAL_COS
            // Along a plane seen at a grazing angle depth changes quickly: its distance from the other's plane is what counts.
            && self.normal.dot(other.p - self.p).abs() < DEPTH_TOLERANCE * self.depth
    }

    /// Whether another mirror hit is the same as that from here; of no account where the surface is rough.
    pub(crate) fn same_reflected(&self, b: &Reflected) -> bool {
        if !self.is_sharp() {
            return true;
        }
        let a = &self.reflected;
        let reach = if a.is_sky() { 1.0 } else { a.point.distance(self.p) + self.depth };
        a.material == b.material && a.point.distance(b.point) < REFLECTED_TOLERANCE * reach
    }
}
