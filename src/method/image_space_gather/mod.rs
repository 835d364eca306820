//! Baseline: image-space gathering (Robison and Shirley 2009, "Image Space Gathering").
//!
//! A picture of perfect mirror reflections is blurred in image space until it looks glossy, as percentage-closer soft shadows blur
//! a hard shadow: first a search averages the distance of what is reflected about a pixel, then a gather over the cone's footprint at
//! that distance averages the picture. Both weigh their taps bilaterally, so that no light crosses the reflector's edges.
//!
//! *Paper* (§7.3.2): the perfect reflections are traced rays shaded from the light map.
//! *Reading*: a hit that is glossy itself is mirrored on, weighted by its directional albedo: without that, metal in a mirror is black.
//! *Ours*, where the texts that we have are silent: a Gaussian lobe of slope sigma 2 x 0.61 alpha (what fits GGX's core); the search
//! averages the blur's width, not the distance, which may be infinite; the weights: same material, close normals, and a
//! Gaussian in the distance from the pixel's tangent plane, which a slanted floor passes; the reflector's albedo is multiplied
//! in after the blur, so that its own texture stays sharp.
//!
//! In: a view's G-buffer. Out: its glossy layer, linear radiance.

pub mod gpu;
mod row;

pub use row::METHOD;

use crate::Result;
use crate::base::math::{Rgb, hash_words, unit};
use crate::base::named::{Parameters, within};
use crate::lightmap::LightMap;
use crate::transport::World;
use crate::view::MOST_SUPERSAMPLES;
use crate::view::gbuffer::{GBuffer, Pixel, glossy};
use crate::view::mirror_light::{ChainParams, glossy_albedo, mirror_chain};
use glam::Vec2;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::f32::consts::TAU;

/// Standard deviation of the Gaussian that fits a slice of GGX's lobe, in units of alpha.
pub(crate) const LOBE_SIGMA: f32 = 0.61;
/// Where a Gaussian ends, in standard deviations.
pub(crate) const REACH: f32 = 2.5;
/// Longest radius that can be asked for, pixels.
const MAX_RADIUS: f32 = 4096.0;
/// Most mirror rays in a row: between mirrors that take nothing they would never end.
const MOST_RAYS: u32 = 1 << 12;
/// Most taps.
const MOST_TAPS: u32 = 1 << 24;
/// Angle between the directions of successive taps: the golden one.
const GOLDEN_ANGLE: f32 = 2.399_963_2;

/// Parameters of the method.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ImageSpaceGatherParams {
    /// N x N rays a pixel through all passes.
    pub supersample: u32,
    /// Taps of a pixel's gather; a footprint of fewer pixels is summed up whole.
    pub samples: u32,
    /// Taps of the search for the reflected distance.
    pub search_samples: u32,
    /// Mirror rays in a row.
    pub mirror_depth: u32,
    /// Greatest alpha of a hit that is mirrored on.
    pub max_mirror_alpha: f32,
    /// Longest radius of gather and search, pixels.
    pub max_radius: f32,
    /// Least cosine between two normals that mix.
    pub min_normal_cos: f32,
    /// Standard deviation of the distance from the tangent plane, as a fraction of the depth.
    pub plane_sigma: f32,
}

impl Default for ImageSpaceGatherParams {
    fn default() -> Self {
        Self {
            supersample: 1,
            samples: 64,
            search_samples: 16,
            mirror_depth: 4,
            max_mirror_alpha: 1.0,
            max_radius: 128.0,
            min_normal_cos: 0.95,
            plane_sigma: 0.01,
        }
    }
}

impl ImageSpaceGatherParams {
    /// Largest standard deviation of a footprint, pixels.
    pub(crate) fn max_sigma(&self) -> f32 {
        self.max_radius.min(MAX_RADIUS) / REACH
    }

    /// Mirror rays in a row, bounded.
    pub(crate) fn rays(&self) -> u32 {
        self.mirror_depth.min(MOST_RAYS)
    }
}

impl Parameters for ImageSpaceGatherParams {
    fn validate(&self) -> Result<()> {
        within("supersample", self.supersample, 1..=MOST_SUPERSAMPLES)?;
        within("samples", self.samples, 1..=MOST_TAPS)?;
        within("search_samples", self.search_samples, 1..=MOST_TAPS)?;
        within("mirror_depth", self.mirror_depth, 1..=MOST_RAYS)?;
        within("max_mirror_alpha", self.max_mirror_alpha, 0.0..=1.0)?;
        within("max_radius", self.max_radius, 0.0..=MAX_RADIUS)?;
        within("min_normal_cos", self.min_normal_cos, -1.0..=1.0)?;
        within("plane_sigma", self.plane_sigma, 1e-6..=1e6)
    }
}

/// What a pixel's mirror shows.
#[derive(Debug, Clone, Copy)]
pub struct Mirrored {
    /// Radiance that arrives along the mirror direction.
    pub light: Rgb,
    /// d_r, distance to the first hit; infinite for the environment.
    pub distance: f32,
}

/// The picture of perfect reflections: one mirror chain a pixel; `None` where the surface has no glossy lobe.
pub fn mirror_image(
    world: &World,
    lightmap: &LightMap,
    view: &GBuffer,
    params: &ImageSpaceGatherParams,
) -> Vec<Option<Mirrored>> {
    let pixel = |pixel: &Option<Pixel>| {
        let p = glossy(pixel)?;
        let chain = ChainParams { rays: params.rays(), max_alpha: params.max_mirror_alpha };
        let shown = mirror_chain(world, lightmap, &p.surface, p.wo, &chain);
        Some(Mirrored { light: shown.light, distance: shown.first.map_or(f32::INFINITY, |hit| hit.t) })
    };
    view.pixels.par_iter().with_min_len(view.size()[0]).map(pixel).collect()
}

/// The glossy layer: the mirror picture, gathered over each pixel's footprint, times the reflector's albedo.
pub fn gather_image(world: &World, view: &GBuffer, mirror: &[Option<Mirrored>], params: &ImageSpaceGatherParams) -> Vec<Rgb> {
    let [search, gather] = [params.search_samples, params.samples].map(spiral);
    let image = Image { view, mirror, params, focal: view.camera.focal_px(), search, gather };
    let pixel = |i: usize| {
        let (Some(p), Some(m)) = (glossy(&view.pixels[i]), &mirror[i]) else { return Rgb::ZERO };
        let light = if p.alpha.unwrap_or(0.0) > 0.0 { image.blurred(i, p, m) } else { m.light };
        light * glossy_albedo(world, &p.surface, p.wo)
    };
    (0..mirror.len()).into_par_iter().with_min_len(view.size()[0]).map(pixel).collect()
}

/// Taps for a standard deviation of 1 on a spiral, as dense as the Gaussian: each counts alike.
pub(crate) fn spiral(count: u32) -> Vec<Vec2> {
    let cut = 1.0 - (-0.5 * REACH * REACH).exp();
    let tap = |k: u32| {
        let u = (k as f32 + 0.5) / count as f32;
        Vec2::from_angle(k as f32 * GOLDEN_ANGLE) * (-2.0 * (1.0 - u * cut).ln()).sqrt()
    };
    (0..count.min(MOST_TAPS)).map(tap).collect()
}

struct Image<'a> {
    view: &'a GBuffer,
    mirror: &'a [Option<Mirrored>],
    params: &'a ImageSpaceGatherParams,
    focal: f32,
    search: Vec<Vec2>,
    gather: Vec<Vec2>,
}

impl Image<'_> {
    /// Standard deviation of the lobe's footprint in the image, pixels, for a reflector at distance `d_c` and its hit at `d_r`:
    /// the virtual image of the hit lies at d_c + d_r.
    fn sigma(&self, alpha: f32, d_c: f32, d_r: f32) -> f32 {
        let share = if d_r.is_finite() { d_r / (d_c + d_r) } else { 1.0 };
        (2.0 * LOBE_SIGMA * alpha * share * self.focal).min(self.params.max_sigma())
    }

    /// Search and gather.
    fn blurred(&self, i: usize, p: &Pixel, m: &Mirrored) -> Rgb {
        let alpha = p.alpha.unwrap_or(0.0);
        let own = self.sigma(alpha, p.depth, m.distance);
        let widest = self.sigma(alpha, p.depth, f32::INFINITY);
        let (mut sum, mut total) = (own, 1.0);
        self.taps(i, p, widest, &self.search, |weight, tap, there| {
            sum += weight * self.sigma(alpha, tap.depth, there.distance);
            total += weight;
        });
        let sigma = sum / total;
        let (mut light, mut total) = (Rgb::ZERO, 0.0);
        self.taps(i, p, sigma, &self.gather, |weight, _, there| {
            light += there.light * weight;
            total += weight;
        });
        if total > 0.0 { light / total } else { m.light }
    }

    /// Calls `tap` with the bilateral weight of each pixel that a pattern of taps meets within a Gaussian of `sigma`.
    fn taps(&self, i: usize, p: &Pixel, sigma: f32, pattern: &[Vec2], mut tap: impl FnMut(f32, &Pixel, &Mirrored)) {
        let [width, height] = self.view.size();
        let (x, y) = ((i % width) as i32, (i / width) as i32);
        let radius = REACH * sigma;
        let mut visit = |dx: i32, dy: i32, spatial: f32| {
            let (x, y) = (x + dx, y + dy);
            if x < 0 || y < 0 || x >= width as i32 || y >= height as i32 {
                return;
            }
            let j = y as usize * width + x as usize;
            if let (Some(there), Some(m)) = (glossy(&self.view.pixels[j]), &self.mirror[j]) {
                let weight = spatial * self.range(p, there);
                if weight > 0.0 {
                    tap(weight, there, m);
                }
            }
        };
        let r = radius as i32;
        if (2 * r + 1).pow(2) as usize <= pattern.len() {
            let q = -0.5 / (sigma * sigma).max(1e-6);
            (-r..=r).for_each(|dy| (-r..=r).for_each(|dx| visit(dx, dy, (q * (dx * dx + dy * dy) as f32).exp())));
            return;
        }
        // Each pixel turns the spiral by an angle of its own.
        let turn = Vec2::from_angle(unit(hash_words(&[i as u32, pattern.len() as u32])) * TAU);
        for &tap in pattern {
            let at = turn.rotate(tap) * sigma;
            visit(at.x.round() as i32, at.y.round() as i32, 1.0);
        }
    }

    /// Whether, and how well, two pixels lie on one piece of surface.
    fn range(&self, p: &Pixel, tap: &Pixel) -> f32 {
        if tap.surface.material != p.surface.material || tap.normal.dot(p.normal) < self.params.min_normal_cos {
            return 0.0;
        }
        let off = (tap.surface.p - p.surface.p).dot(p.normal) / (self.params.plane_sigma * p.depth).max(f32::MIN_POSITIVE);
        (-0.5 * off * off).exp()
    }
}
