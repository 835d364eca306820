//! The filter as one-dimensional passes.
//!
//! Paper: §6.3. Passes 1 and 3 run along the first principal direction of each pixel's covariance, 2 and 4 along the second, with
//! halved covariances, so that a neighbour round the corner of an edge is still reached.
//! Ours: a pass steps a pixel at a time along the axis nearest its direction and reads the two pixels nearest the line, each with its own range weight.

use super::{FilterInput, FilterParams, Method, NOT_GLOSSY, confidence, in_range, principal};
use crate::math::Rgb;
use glam::{Vec2, Vec4, Vec4Swizzles};
use rayon::prelude::*;

/// Below this standard deviation (pixels) a pass changes nothing: the nearest neighbour's weight is 3e-6.
const MIN_SIGMA: f32 = 0.2;

/// A pixel's own kernel.
#[derive(Clone, Copy)]
struct Axes {
    major: Vec2,
    /// Standard deviations of one pass along the major and the minor axis, for a Gaussian of the covariance itself.
    sigma: Vec2,
}

/// Filters by a sum of Gaussians, each a (share, variance over the covariance).
pub fn filter(input: &FilterInput, params: &FilterParams, gaussians: &[(f32, f32)]) -> Vec<Rgb> {
    let count = input.color.len();
    let split = if params.method == Method::TwoPass { 1.0 } else { 2.0 };
    let axes: Vec<Axes> = (0..count)
        .into_par_iter()
        .map(|i| {
            let (major, a, b) = principal(input.covariance[i]);
            Axes { major, sigma: Vec2::new((a / split).sqrt(), (b / split).sqrt()) }
        })
        .collect();
    let start: Vec<Vec4> = (0..count)
        .into_par_iter()
        .map(|i| {
            let w = confidence(input, i, params);
            if w > 0.0 { (input.color[i] * w).extend(w) } else { Vec4::ZERO }
        })
        .collect();
    let mut out = vec![Rgb::ZERO; count];
    for &(share, variance) in gaussians {
        let mut buffer = start.clone();
        for number in 0..2 * split as usize {
            let along_major = number % 2 == 0;
            buffer = pass(input, params, &axes, &buffer, along_major, variance.sqrt());
        }
        out.par_iter_mut().zip(&buffer).zip(input.color).for_each(|((o, b), &c)| {
            *o += if b.w > 0.0 { b.xyz() / b.w * share } else { c * share };
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

/// One pass. Weighted colour and weight are carried alike; each pixel's result is their mean over its line.
fn pass(input: &FilterInput, params: &FilterParams, axes: &[Axes], from: &[Vec4], along_major: bool, scale: f32) -> Vec<Vec4> {
    let (w, h) = (input.width as i32, input.height as i32);
    let pixel = |i: usize| {
        let own = from[i];
        let Axes { major, sigma } = axes[i];
        let (direction, sigma) = if along_major { (major, sigma.x) } else { (major.perp(), sigma.y) };
        let sigma = (sigma * scale).min(params.max_radius / params.radius_sigmas);
        if input.material[i] == NOT_GLOSSY || sigma < MIN_SIGMA {
            return own;
        }
        let (x, y) = (i as i32 % w, i as i32 / w);
        let upright = direction.y.abs() > direction.x.abs();
        let (long, short) = if upright { (direction.y, direction.x) } else { (direction.x, direction.y) };
        let slope = short / long;
        // Length of one step along the line.
        let step = (1.0 + slope * slope).sqrt();
        let reach = (params.radius_sigmas * sigma / step) as i32;
        // exp(-(k step)² / 2σ²) by two products a step.
        let ratio = (-(step / sigma).powi(2)).exp();
        let first = (-0.5 * (step / sigma).powi(2)).exp();
        let (mut sum, mut total) = (own, 1.0);
        for side in [-1, 1] {
            let (mut g, mut factor) = (1.0, first);
            for k in 1..=reach {
                g *= factor;
                factor *= ratio;
                let across = (side * k) as f32 * slope;
                let low = across.floor();
                let fraction = across - low;
                let mut tap = |offset: i32, weight: f32| {
                    let (xx, yy) = if upright { (x + offset, y + side * k) } else { (x + side * k, y + offset) };
                    if xx < 0 || yy < 0 || xx >= w || yy >= h {
                        return;
                    }
                    let j = (yy * w + xx) as usize;
                    if in_range(input, i, j, params) {
                        sum += from[j] * weight;
                        total += weight;
                    }
                };
                tap(low as i32, g * (1.0 - fraction));
                if fraction > 0.0 {
                    tap(low as i32 + 1, g * fraction);
                }
            }
        }
        sum / total
    };
    (0..from.len()).into_par_iter().with_min_len(input.width).map(pixel).collect()
}
