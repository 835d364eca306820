//! The passes before the filter, pass after pass over the whole view: for those who look at what one leaves to the next, and as the oracle of
//! [`super::tiles`], which leave the same.

use super::filter::{FilterInput, FilterParams, NOT_GLOSSY, filter};
use super::gather::{Gathered, gather};
use super::tiles::Tiles;
use crate::base::math::Rgb;
use crate::scene::Camera;
use crate::view::gbuffer::{GBuffer, Pixel, gbuffer};
use crate::view::mirror::Reflected;
use crate::view::mirror_light::mirrored;
use glam::Vec3;
use rayon::prelude::*;

/// Per-sub-pixel buffers of a frame, at `supersample` times its size, for inspection.
pub struct Buffers {
    /// Sub-pixels in a row.
    pub width: usize,
    /// Principal curvatures, 1/m.
    pub curvature: Vec<[f32; 2]>,
    /// Mirror hits.
    pub reflected: Vec<Reflected>,
    /// Before the filter.
    pub gathered: Vec<Gathered>,
    /// Footprint covariances, pixels².
    pub covariance: Vec<[f32; 3]>,
}

/// What the passes leave.
pub struct Whole {
    view: GBuffer,
    reflected: Vec<Reflected>,
    gathered: Vec<Gathered>,
    covariance: Vec<[f32; 3]>,
}

impl Tiles<'_> {
    /// All pixels of `camera`.
    pub fn whole(&self, camera: &Camera) -> Whole {
        let view = gbuffer(self.world, self.curvature, camera);
        let pixels = || view.pixels.par_iter().with_min_len(view.size()[0]);
        let reflected: Vec<_> = pixels().map(|pixel| mirrored(self.world, self.mirrors, pixel).0).collect();
        let mut gathered = gather(self.world, &view, &reflected, self.probes, self.roughness_scale, self.gather);
        let unserved = pixels().zip(&mut gathered).filter(|(_, g)| g.energy.is_infinite());
        unserved.for_each(|(pixel, gathered)| {
            gathered.or_previous(pixel, self.previous);
        });
        let of = |(pixel, reflected)| self.footprint.map_or([0.0; 3], |f| f.of_pixel(camera, pixel, reflected));
        let covariance = pixels().zip(&reflected).map(of).collect();
        Whole { view, reflected, gathered, covariance }
    }
}

impl Whole {
    /// The glossy layer.
    pub fn filtered(&self, params: &FilterParams) -> Vec<Rgb> {
        filter_pass(&self.view, &self.gathered, &self.covariance, params)
    }

    /// For inspection.
    pub fn buffers(self) -> Buffers {
        let Self { view, reflected, gathered, covariance } = self;
        let curvature = |p: &Option<Pixel>| p.as_ref().map_or([0.0; 2], |p| [p.curvature.k1, p.curvature.k2]);
        Buffers { width: view.size()[0], curvature: view.pixels.iter().map(curvature).collect(), reflected, gathered, covariance }
    }
}

/// The glossy filter (§6.2) over a view's gathered colours.
pub fn filter_pass(view: &GBuffer, gathered: &[Gathered], covariance: &[[f32; 3]], params: &FilterParams) -> Vec<Rgb> {
    let [width, height] = view.size();
    let of =
        |p: &Option<Pixel>| p.as_ref().map_or(NOT_GLOSSY, |p| if p.alpha.is_some() { p.surface.material } else { NOT_GLOSSY });
    let input = FilterInput {
        width,
        height,
        color: &gathered.iter().map(|g| g.color).collect::<Vec<_>>(),
        normal: &view.pixels.iter().map(|p| p.as_ref().map_or(Vec3::ZERO, |p| p.normal)).collect::<Vec<_>>(),
        depth: &view.pixels.iter().map(|p| p.as_ref().map_or(0.0, |p| p.depth)).collect::<Vec<_>>(),
        material: &view.pixels.iter().map(of).collect::<Vec<_>>(),
        covariance,
        energy: &gathered.iter().map(|g| g.energy).collect::<Vec<_>>(),
    };
    filter(&input, params)
}
