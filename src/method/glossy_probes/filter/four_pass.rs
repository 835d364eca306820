//! The filter as one-dimensional passes.
//!
//! Paper: §6.3. Passes 1 and 3 run along the first principal direction of each pixel's covariance, 2 and 4 along the second, with
//! halved covariances, so that a neighbour round the corner of an edge is still reached.
//! Ours: a pass steps along the axis nearest its direction and reads the two pixels nearest the line, each with its own range weight.

use super::{FilterInput, FilterParams, Kernel, Method, NOT_GLOSSY, confidence, principal};
use crate::base::math::{Rgb, floor};
use glam::{Vec2, Vec3, Vec4, Vec4Swizzles};
use rayon::prelude::*;

/// Steps a standard deviation at most: a wider kernel's are longer. The sum of a Gaussian at these steps is its integral to
/// one part in a million, and what lies between is smooth after the passes before and noise otherwise.
pub(crate) const STEPS: f32 = 4.0;

/// Below this standard deviation (pixels) a pass changes nothing: the nearest neighbour's weight is 3e-6.
pub(crate) const MIN_SIGMA: f32 = 0.2;

/// Rows of a task, and columns that it goes through at a time: upright lines then stay in the cache.
const TILE: (usize, usize) = (32, 64);

/// (1 + q)⁻² as a sum of Gaussians: each one's share of the kernel's volume and its variance over Σ. Fitted over 0 <= q <= 8, with 3 % of
/// the volume in the wrong place.
const GGX_GAUSSIANS: [(f32, f32); 2] = [(0.6167, 3.0786), (0.3833, 0.6322)];

/// The Gaussians that make a kernel.
pub(crate) fn gaussians(kernel: Kernel) -> &'static [(f32, f32)] {
    match kernel {
        Kernel::Gaussian => &[(1.0, 1.0)],
        Kernel::Ggx => &GGX_GAUSSIANS,
    }
}

/// A pixel's own kernel.
#[derive(Clone, Copy)]
struct Axes {
    major: Vec2,
    /// Standard deviations of one pass along the major and the minor axis, for a Gaussian of the covariance itself.
    sigma: Vec2,
}

/// What a pass reads of a pixel, side by side in memory.
#[derive(Clone, Copy)]
struct Tap {
    /// Colour times weight, and the weight.
    value: Vec4,
    normal: Vec3,
    depth: f32,
    material: u32,
}

/// Filters a frame.
pub(super) fn four_pass(input: &FilterInput, params: &FilterParams) -> Vec<Rgb> {
    let count = input.color.len();
    let split = if params.method == Method::TwoPass { 1.0 } else { 2.0 };
    let axes: Vec<Axes> = (0..count)
        .into_par_iter()
        .map(|i| {
            let (major, a, b) = principal(input.covariance[i]);
            Axes { major, sigma: Vec2::new((a / split).sqrt(), (b / split).sqrt()) }
        })
        .collect();
    let start: Vec<Tap> = (0..count)
        .into_par_iter()
        .map(|i| {
            let w = confidence(input, i, params);
            let value = if w > 0.0 { (input.color[i] * w).extend(w) } else { Vec4::ZERO };
            Tap { value, normal: input.normal[i], depth: input.depth[i], material: input.material[i] }
        })
        .collect();
    let mut out = vec![Rgb::ZERO; count];
    for &(share, variance) in gaussians(params.kernel) {
        let (mut from, mut to) = (start.clone(), start.clone());
        for number in 0..2 * split as usize {
            pass(input.width, params, &axes, &from, &mut to, (number % 2 == 0, variance.sqrt()));
            std::mem::swap(&mut from, &mut to);
        }
        out.par_iter_mut().zip(&from).zip(input.color).for_each(|((o, Tap { value, .. }), &c)| {
            *o += if value.w > 0.0 { value.xyz() / value.w * share } else { c * share };
        });
    }
    // Bit for bit what came in, where nothing was to be filtered.
    out.par_iter_mut().enumerate().for_each(|(i, o)| {
        if input.material[i] == NOT_GLOSSY || axes[i].sigma.x < MIN_SIGMA * 0.5 {
            *o = input.color[i];
        }
    });
    out
}

/// One pass: each pixel's value becomes the mean over its line. Weighted colour and weight are carried alike.
/// `kernel` says whether the line is the major axis, and what multiplies its standard deviation.
fn pass(width: usize, params: &FilterParams, axes: &[Axes], from: &[Tap], to: &mut [Tap], kernel: (bool, f32)) {
    let (rows, columns) = TILE;
    to.par_chunks_mut(width * rows).enumerate().for_each(|(strip, out)| {
        let first = strip * rows * width;
        for left in (0..width).step_by(columns) {
            for row in 0..out.len() / width {
                for x in left..(left + columns).min(width) {
                    let at = row * width + x;
                    out[at].value = line_mean(width, params, axes[first + at], from, first + at, kernel);
                }
            }
        }
    });
}

/// The mean over one pixel's line.
fn line_mean(width: usize, params: &FilterParams, axes: Axes, from: &[Tap], i: usize, (along_major, scale): (bool, f32)) -> Vec4 {
    let own = from[i];
    let Axes { major, sigma } = axes;
    let (direction, sigma) = if along_major { (major, sigma.x) } else { (major.perp(), sigma.y) };
    let sigma = (sigma * scale).min(params.max_radius / params.radius_sigmas);
    if own.material == NOT_GLOSSY || sigma < MIN_SIGMA {
        return own.value;
    }
    let (w, h) = (width as i32, (from.len() / width) as i32);
    let (x, y) = (i as i32 % w, i as i32 / w);
    // `long` is the axis nearest the line, `short` the other one.
    let upright = direction.y.abs() > direction.x.abs();
    let (long, short) = if upright { ((y, h, w), (x, w, 1)) } else { ((x, w, 1), (y, h, w)) };
    let slope = if upright { direction.x / direction.y } else { direction.y / direction.x };
    // Pixels of one step along the long axis, and its length.
    let stride = ((sigma / STEPS) as i32).max(1);
    let step = stride as f32 * (1.0 + slope * slope).sqrt();
    let reach = (params.radius_sigmas * sigma / step) as i32;
    // exp(-(k step)² / 2σ²) by two products a step.
    let ratio = (-(step / sigma).powi(2)).exp();
    let first = (-0.5 * (step / sigma).powi(2)).exp();
    let (mut sum, mut total) = (own.value, 1.0);
    for side in [-1, 1] {
        let room = if side < 0 { long.0 } else { long.1 - 1 - long.0 };
        let (mut g, mut factor) = (1.0, first);
        for k in 1..=reach.min(room / stride) {
            g *= factor;
            factor *= ratio;
            let along = side * k * stride;
            let across = along as f32 * slope;
            let low = floor(across) as i32;
            let fraction = across - low as f32;
            let on_axis = i as i32 + along * long.2;
            for (offset, weight) in [(low, g * (1.0 - fraction)), (low + 1, g * fraction)] {
                if (short.0 + offset) as u32 >= short.1 as u32 {
                    continue;
                }
                let tap = &from[(on_axis + offset * short.2) as usize];
                let near = (own.depth - tap.depth).abs() < params.depth_threshold;
                let facing = own.normal.dot(tap.normal) > params.min_normal_cos;
                if near & facing & (own.material == tap.material) {
                    sum += tap.value * weight;
                    total += weight;
                }
            }
        }
    }
    sum / total
}
