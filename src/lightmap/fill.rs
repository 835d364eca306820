//! Gutters, and texels that no valid sample reached, take the mean of their valid neighbours, ring by ring.

use super::atlas::{Atlas, GUTTER};
use crate::base::math::Rgb;
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
    let neighbours = |i: usize| {
        let (x, y) = (i % w, i / w);
        let rows = y.saturating_sub(1)..(y + 2).min(h);
        rows.flat_map(move |ny| (x.saturating_sub(1)..(x + 2).min(w)).map(move |nx| (ny * w + nx, nx == x || ny == y)))
    };
    let mut filled = Vec::new();
    let mut ring: Vec<usize> = (0..w * h).filter(|&i| !known[i] && neighbours(i).any(|(n, _)| known[n])).collect();
    while !ring.is_empty() {
        let values: Vec<Rgb> = ring
            .iter()
            .map(|&i| {
                let (mut sum, mut weight) = (Rgb::ZERO, 0.0);
                for (n, side) in neighbours(i).filter(|&(n, _)| known[n]) {
                    // Neighbours across a side count for more than those across a corner.
                    let k = if side { 1.0 } else { 0.25 };
                    sum += value[n] * k;
                    weight += k;
                }
                sum / weight
            })
            .collect();
        for (&i, v) in ring.iter().zip(values) {
            value[i] = v;
            known[i] = true;
            filled.push((pixel(i), v));
        }
        let mut next: Vec<usize> = ring.iter().flat_map(|&i| neighbours(i)).map(|(n, _)| n).filter(|&n| !known[n]).collect();
        next.sort_unstable();
        next.dedup();
        ring = next;
    }
    filled
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hole_takes_its_neighbours_mean_and_far_texels_the_nearest_value() {
        let (w, h) = (9usize, 5usize);
        let mut valid = vec![false; w * h];
        let mut pixels = vec![Rgb::ZERO; w * h];
        // The left column is 1, the second but for its middle 2: everything to the right is to be filled.
        for y in 0..h {
            (valid[y * w], pixels[y * w]) = (true, Rgb::ONE);
            (valid[y * w + 1], pixels[y * w + 1]) = (y != 2, Rgb::splat(2.0));
        }
        let filled = dilate_rectangle(w, [0, 0], [w as u32, h as u32], &pixels, &valid);
        assert_eq!(filled.len(), w * h - 9, "each texel once");
        let at = |x: usize, y: usize| filled.iter().find(|f| f.0 == y * w + x).unwrap().1.x;
        // Sides 1, 2, 2, corners 1, 1.
        assert!((at(1, 2) - (5.0 + 0.5) / 3.5).abs() < 1e-6, "{}", at(1, 2));
        assert!((at(8, 0) - 2.0).abs() < 0.05 && at(8, 4) > 1.5);
        assert!(dilate_rectangle(w, [0, 0], [3, 3], &pixels, &vec![false; w * h]).is_empty());
    }
}
