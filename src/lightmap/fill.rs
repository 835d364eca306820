//! Gutters, and texels that no valid sample reached, take the mean of their valid neighbours, ring by ring.

use super::atlas::{Atlas, GUTTER};
use crate::math::Rgb;
use rayon::prelude::*;

/// Grows valid values over each chart's rectangle until it is full. Charts without a valid texel stay black.
pub fn dilate(atlas: &Atlas, pixels: &mut [Rgb], valid: &[bool]) {
    let filled: Vec<Vec<(usize, Rgb)>> = atlas
        .charts
        .par_iter()
        .map(|chart| {
            let corner = chart.corner.map(|c| c - GUTTER);
            dilate_rectangle(atlas.size[0] as usize, corner, chart.size.map(|s| s + 2 * GUTTER), pixels, valid)
        })
        .collect();
    for (pixel, value) in filled.into_iter().flatten() {
        pixels[pixel] = value;
    }
}

fn dilate_rectangle(width: usize, corner: [u32; 2], size: [u32; 2], pixels: &[Rgb], valid: &[bool]) -> Vec<(usize, Rgb)> {
    let (w, h) = (size[0] as usize, size[1] as usize);
    let pixel = |i: usize| (corner[1] as usize + i / w) * width + corner[0] as usize + i % w;
    let mut value: Vec<Rgb> = (0..w * h).map(|i| pixels[pixel(i)]).collect();
    let mut known: Vec<bool> = (0..w * h).map(|i| valid[pixel(i)]).collect();
    let mut missing: Vec<usize> = (0..w * h).filter(|&i| !known[i]).collect();
    let mut filled = Vec::with_capacity(missing.len());
    loop {
        let ring: Vec<(usize, Rgb)> = missing
            .iter()
            .filter_map(|&i| {
                let (x, y) = (i % w, i / w);
                let (mut sum, mut weight) = (Rgb::ZERO, 0.0);
                for ny in y.saturating_sub(1)..(y + 2).min(h) {
                    for nx in x.saturating_sub(1)..(x + 2).min(w) {
                        if known[ny * w + nx] {
                            // Neighbours across a side count for more than those across a corner.
                            let k = if nx == x || ny == y { 1.0 } else { 0.25 };
                            sum += value[ny * w + nx] * k;
                            weight += k;
                        }
                    }
                }
                (weight > 0.0).then(|| (i, sum / weight))
            })
            .collect();
        if ring.is_empty() {
            return filled;
        }
        for &(i, v) in &ring {
            value[i] = v;
            known[i] = true;
            filled.push((pixel(i), v));
        }
        missing.retain(|&i| !known[i]);
    }
}
