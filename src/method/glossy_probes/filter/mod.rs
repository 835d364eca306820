//! The glossy filter: blurs the gathered colours by what the probes lack of the material's roughness.
//!
//! *Paper* (§6.2, Eq. 4; §6.3): each pixel a mean of its neighbourhood with the weights Gaussian · range · 1/E, or the same by four passes along
//! the principal directions of each pixel's covariance ([`planes`], [`four_pass`]).
//! *Reading*: the confidence 1/E goes with the colour through the passes and is divided out at the end (normalised convolution, Knutsson and
//! Westin 1993), so that it counts once; each pass is normalised by its own spatial and range weights.
//! *Ours*, after measurements: E is not let below [`FilterParams::min_energy`], since one perfect sample must not outshine all others, and zero
//! must not divide; at 3, the most that a sample of the right reflected material reaches, 1/E only tells the wrong ones. The kernel may
//! have the tails of GGX, (1 + q)⁻², instead of a Gaussian's, which widen bright highlights too much. Normals must be closer, so that a
//! bevel keeps its edge; the depth threshold is a little wider, for 0.2 m can cut a floor's kernel at a visible line.
//!
//! In: linear radiance and its guides a pixel, covariance in pixels². Out: linear radiance. Pixels without a glossy surface neither
//! give nor take.

pub(crate) mod four_pass;
pub(crate) mod planes;

use crate::Result;
use crate::base::math::{Rgb, major_axis};
use crate::base::named::within;
use glam::{Vec2, Vec3};
use planes::Entry;
use rayon::prelude::*;

/// [`FilterInput::material`] of a pixel without a glossy surface.
pub const NOT_GLOSSY: u32 = u32::MAX;

/// Shape of the spatial weights.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Kernel {
    /// exp(-q / 2) with q = dᵀ Σ⁻¹ d.
    Gaussian,
    /// (1 + s² q)⁻², the lobe that the Gaussian was fitted to, cut where s² q = [`TAIL_END`]; s = [`CORE_SIGMA`].
    Ggx,
}

/// How the sum is evaluated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Convolution {
    /// Eq. 4 as it stands: quadratic in the radius.
    Full,
    /// Four one-dimensional passes (§6.3).
    FourPass,
    /// Two one-dimensional passes, the naive way that Fig. 10c warns of; for comparison.
    TwoPass,
}

/// Sigma of the least-squares Gaussian of (1 + m²)⁻² on a slice.
pub const CORE_SIGMA: f32 = 0.61;
/// Where the GGX kernel ends: a weight of 1/81.
pub const TAIL_END: f32 = 8.0;

/// How the filter weighs.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FilterParams {
    /// Spatial weights. *Paper*: Gaussian.
    pub kernel: Kernel,
    /// Evaluation. *Paper*: four passes.
    pub method: Convolution,
    /// Smallest cosine between two normals that may mix, α_n. *Paper*: 0.8. *Ours*: 0.98.
    pub min_normal_cos: f32,
    /// Largest difference in depth that may mix, α_d, m. *Paper*: 0.2. *Ours*: 0.15.
    pub depth_threshold: f32,
    /// Lower clamp of E in the confidence 1/E; very large for no confidence at all. *Paper*: none (a small one against 0).
    pub min_energy: f32,
    /// Radius of a Gaussian, in sigmas.
    pub radius_sigmas: f32,
    /// Longest radius, pixels; larger kernels are shrunk to it.
    pub max_radius: f32,
}

impl Default for FilterParams {
    fn default() -> Self {
        Self {
            kernel: Kernel::Gaussian,
            method: Convolution::FourPass,
            min_normal_cos: 0.98,
            depth_threshold: 0.15,
            min_energy: 3.0,
            radius_sigmas: 3.0,
            max_radius: 128.0,
        }
    }
}

impl FilterParams {
    /// The paper's text.
    pub fn paper() -> Self {
        Self { min_normal_cos: 0.8, depth_threshold: 0.2, min_energy: 1e-3, ..Self::default() }
    }

    /// An error where a parameter is out of its range.
    pub fn validate(&self) -> Result<()> {
        within("filter.min_normal_cos", self.min_normal_cos, -1.0..=1.0)?;
        within("filter.depth_threshold", self.depth_threshold, 0.0..=f32::MAX)?;
        within("filter.min_energy", self.min_energy, f32::MIN_POSITIVE..=f32::MAX)?;
        within("filter.radius_sigmas", self.radius_sigmas, 0.1..=16.0)?;
        within("filter.max_radius", self.max_radius, 0.0..=4096.0)
    }
}

/// One frame's glossy layer and its guides, a pixel an entry, rows from the top.
#[derive(Debug, Clone, Copy)]
pub struct FilterInput<'a> {
    /// Pixels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Gathered radiance, C of Eq. 2.
    pub color: &'a [Rgb],
    /// Unit normal of the reflector.
    pub normal: &'a [Vec3],
    /// Depth of the reflector, m.
    pub depth: &'a [f32],
    /// Material of the reflector; [`NOT_GLOSSY`] for none.
    pub material: &'a [u32],
    /// Covariance of the filter `[xx, xy, yy]`, pixels² (Eq. 3).
    pub covariance: &'a [[f32; 3]],
    /// Lowest energy of the pixel's probe samples (Eq. 1), >= 0.
    pub energy: &'a [f32],
}

/// The filtered frame.
///
/// # Panics
/// If the slices do not all hold width x height entries.
pub fn filter(input: &FilterInput, params: &FilterParams) -> Vec<Rgb> {
    let count = input.width * input.height;
    let lengths = [
        input.color.len(),
        input.normal.len(),
        input.depth.len(),
        input.material.len(),
        input.covariance.len(),
        input.energy.len(),
    ];
    assert!(lengths.iter().all(|&l| l == count), "{lengths:?} entries for {count} pixels");
    if count == 0 {
        return Vec::new();
    }
    match params.method {
        Convolution::Full => full(input, params),
        Convolution::FourPass | Convolution::TwoPass => planes::four_pass(input, params),
    }
}

impl FilterInput<'_> {
    /// Of one pixel.
    fn entry(&self, i: usize) -> Entry {
        Entry {
            color: self.color[i],
            normal: self.normal[i],
            depth: self.depth[i],
            material: self.material[i],
            covariance: self.covariance[i],
            energy: self.energy[i],
        }
    }
}

/// Confidence of a pixel: 1/E, clamped; 0 for a pixel that has nothing to give.
fn confidence(pixel: &Entry, params: &FilterParams) -> f32 {
    if pixel.material == NOT_GLOSSY || !pixel.color.is_finite() {
        return 0.0;
    }
    if params.min_energy == f32::INFINITY {
        return 1.0;
    }
    // `max` also takes the clamp for an energy that is not a number.
    1.0 / pixel.energy.max(params.min_energy.max(1e-6)).min(1e6)
}

/// w_r of Eq. 4: whether two pixels lie on one piece of surface.
fn in_range(input: &FilterInput, i: usize, j: usize, params: &FilterParams) -> bool {
    input.material[i] == input.material[j]
        && (input.depth[i] - input.depth[j]).abs() < params.depth_threshold
        && input.normal[i].dot(input.normal[j]) > params.min_normal_cos
}

/// Principal axes of a covariance: unit direction of the larger variance, and both variances.
fn principal([xx, xy, yy]: [f32; 3]) -> (Vec2, f32, f32) {
    let (mean, half) = (0.5 * (xx + yy), 0.5 * (xx - yy));
    let radius = (half * half + xy * xy).sqrt();
    let valid = |v: f32| if v.is_finite() { v.max(0.0) } else { 0.0 };
    (major_axis(half, xy, radius), valid(mean + radius), valid(mean - radius))
}

/// Eq. 4, pixel by pixel.
fn full(input: &FilterInput, params: &FilterParams) -> Vec<Rgb> {
    let (w, h) = (input.width as isize, input.height as isize);
    // In sigmas.
    let reach = match params.kernel {
        Kernel::Gaussian => params.radius_sigmas,
        Kernel::Ggx => TAIL_END.sqrt() / CORE_SIGMA,
    };
    let pixel = |i: usize| {
        if input.material[i] == NOT_GLOSSY {
            return input.color[i];
        }
        let (axis, major, minor) = principal(input.covariance[i]);
        // Thinner than this, a kernel misses all pixels but its own.
        let limit = (params.max_radius / reach).powi(2);
        let (major, minor) = (major.clamp(1e-3, limit), minor.clamp(1e-3, limit));
        let extent = |a: f32, b: f32| (reach * (a * a * major + b * b * minor).sqrt()).floor() as isize;
        let (rx, ry) = (extent(axis.x, axis.y), extent(axis.y, axis.x));
        if (rx, ry) == (0, 0) {
            return input.color[i];
        }
        let (x, y) = (i as isize % w, i as isize / w);
        let (mut sum, mut total) = (Rgb::ZERO, 0.0);
        for yy in (y - ry).max(0)..=(y + ry).min(h - 1) {
            for xx in (x - rx).max(0)..=(x + rx).min(w - 1) {
                let d = Vec2::new((xx - x) as f32, (yy - y) as f32);
                let q = d.dot(axis).powi(2) / major + d.dot(axis.perp()).powi(2) / minor;
                let j = (yy * w + xx) as usize;
                if q > reach * reach || !in_range(input, i, j, params) {
                    continue;
                }
                let spatial = match params.kernel {
                    Kernel::Gaussian => (-0.5 * q).exp(),
                    Kernel::Ggx => (1.0 + CORE_SIGMA * CORE_SIGMA * q).powi(-2),
                };
                let weight = spatial * confidence(&input.entry(j), params);
                if weight > 0.0 {
                    sum += input.color[j] * weight;
                    total += weight;
                }
            }
        }
        if total > 0.0 { sum / total } else { input.color[i] }
    };
    (0..input.color.len()).into_par_iter().with_min_len(input.width).map(pixel).collect()
}

#[cfg(test)]
mod tests;
