//! Gutters, and texels that no valid sample reached, take the mean of their valid neighbours, ring by ring.

use super::atlas::{Atlas, GUTTER};
use crate::base::math::Rgb;
use rayon::prelude::*;

/// What a neighbour across a corner counts for, beside one across a side.
pub const CORNER: f32 = 0.25;

/// Grows valid values over each chart's rectangle until it is full. Charts without a valid texel stay black.
pub fn dilate(atlas: &Atlas, pixels: &mut [Rgb], valid: &[bool]) {
    Rings::new(atlas, valid, None).fill(pixels);
}

/// Which neighbours each pixel without a value takes the mean of: those of the first ring lie beside valid pixels, those of the next beside
/// the first. It is the same whatever the values are.
#[derive(Debug, Default)]
pub struct Rings {
    /// The first of each ring's pixels; at the end their number.
    pub starts: Vec<u32>,
    /// Pixels that are filled, ring by ring.
    pub pixels: Vec<u32>,
    /// The first of each pixel's neighbours; at the end their number.
    pub firsts: Vec<u32>,
    /// Twice the neighbour's pixel, and one more if it lies across a corner.
    pub neighbours: Vec<u32>,
}

/// A pixel of a ring, and where its neighbours begin in its chart's list.
struct Row {
    ring: u32,
    pixel: u32,
    first: u32,
    count: u32,
}

/// The pixels of a chart's rectangle that are filled, in order, and their neighbours.
type Filled = (Vec<Row>, Vec<u32>);

impl Rings {
    /// For an atlas whose `valid` pixels have values. Where only some pixels are `wanted`, those alone and what they follow from.
    pub fn new(atlas: &Atlas, valid: &[bool], wanted: Option<&[bool]>) -> Self {
        let of = |chart: &super::chart::Chart| {
            let corner = chart.corner.map(|c| c - GUTTER);
            rectangle(atlas.size[0] as usize, corner, chart.size.map(|s| s + 2 * GUTTER), valid)
        };
        Self::of(&atlas.charts.par_iter().map(of).collect::<Vec<_>>(), valid.len(), wanted)
    }

    fn of(charts: &[Filled], pixels: usize, wanted: Option<&[bool]>) -> Self {
        let mut is_wanted = wanted.map_or_else(|| vec![true; pixels], <[bool]>::to_vec);
        let mut rings: Vec<Vec<(u32, &[u32])>> = Vec::new();
        for (rows, neighbours) in charts {
            // A pixel comes after those that it follows from.
            for row in rows.iter().rev() {
                if is_wanted[row.pixel as usize] {
                    let from = &neighbours[row.first as usize..][..row.count as usize];
                    from.iter().for_each(|n| is_wanted[(n >> 1) as usize] = true);
                    rings.resize_with(rings.len().max(row.ring as usize + 1), Vec::new);
                    rings[row.ring as usize].push((row.pixel, from));
                }
            }
        }
        let mut out = Self { firsts: vec![0], ..Self::default() };
        for ring in rings {
            out.starts.push(out.pixels.len() as u32);
            for (pixel, from) in ring {
                out.pixels.push(pixel);
                out.neighbours.extend(from);
                out.firsts.push(out.neighbours.len() as u32);
            }
        }
        out.starts.push(out.pixels.len() as u32);
        out
    }

    /// Gives the pixels of all rings their values.
    pub fn fill(&self, pixels: &mut [Rgb]) {
        for ring in self.starts.windows(2) {
            let (from, to) = (ring[0] as usize, ring[1] as usize);
            let values: Vec<Rgb> = (from..to).into_par_iter().with_min_len(1024).map(|i| self.mean(i, pixels)).collect();
            self.pixels[from..to].iter().zip(values).for_each(|(&pixel, value)| pixels[pixel as usize] = value);
        }
    }

    fn mean(&self, i: usize, pixels: &[Rgb]) -> Rgb {
        let (mut sum, mut weight) = (Rgb::ZERO, 0.0);
        for n in &self.neighbours[self.firsts[i] as usize..self.firsts[i + 1] as usize] {
            let k = if n & 1 == 0 { 1.0 } else { CORNER };
            sum += pixels[(n >> 1) as usize] * k;
            weight += k;
        }
        sum / weight
    }
}

fn rectangle(width: usize, corner: [u32; 2], size: [u32; 2], valid: &[bool]) -> Filled {
    let (w, h) = (size[0] as usize, size[1] as usize);
    let pixel = |i: usize| ((corner[1] as usize + i / w) * width + corner[0] as usize + i % w) as u32;
    let mut known: Vec<bool> = (0..w * h).map(|i| valid[pixel(i) as usize]).collect();
    let neighbours = |i: usize| {
        let (x, y) = (i % w, i / w);
        let rows = y.saturating_sub(1)..(y + 2).min(h);
        rows.flat_map(move |ny| (x.saturating_sub(1)..(x + 2).min(w)).map(move |nx| (ny * w + nx, nx == x || ny == y)))
    };
    let (mut rows, mut list) = (Vec::new(), Vec::new());
    let mut ring: Vec<usize> = (0..w * h).filter(|&i| !known[i] && neighbours(i).any(|(n, _)| known[n])).collect();
    for number in 0.. {
        if ring.is_empty() {
            break;
        }
        for &i in &ring {
            let first = list.len() as u32;
            list.extend(neighbours(i).filter(|&(n, _)| known[n]).map(|(n, side)| 2 * pixel(n) + u32::from(!side)));
            rows.push(Row { ring: number, pixel: pixel(i), first, count: list.len() as u32 - first });
        }
        ring.iter().for_each(|&i| known[i] = true);
        let mut next: Vec<usize> = ring.iter().flat_map(|&i| neighbours(i)).map(|(n, _)| n).filter(|&n| !known[n]).collect();
        next.sort_unstable();
        next.dedup();
        ring = next;
    }
    (rows, list)
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
        let of = |valid: &[bool], wanted| Rings::of(&[rectangle(w, [0, 0], [w as u32, h as u32], valid)], w * h, wanted);
        let rings = of(&valid, None);
        let mut filled = rings.pixels.clone();
        filled.sort_unstable();
        filled.dedup();
        assert_eq!((rings.pixels.len(), filled.len()), (w * h - 9, w * h - 9), "each texel once");
        let before = pixels.clone();
        rings.fill(&mut pixels);
        let at = |x: usize, y: usize| pixels[y * w + x].x;
        // Sides 1, 2, 2, corners 1, 1.
        assert!((at(1, 2) - (5.0 + 0.5) / 3.5).abs() < 1e-6, "{}", at(1, 2));
        assert!((at(8, 0) - 2.0).abs() < 0.05 && at(8, 4) > 1.5);
        assert!(of(&vec![false; w * h], None).pixels.is_empty());
        // A few of them alone: the same values by fewer others.
        let wanted: Vec<bool> = (0..w * h).map(|i| i == 3 * w + 4 || i == 2 * w + 1).collect();
        let (few, mut some) = (of(&valid, Some(&wanted)), before);
        few.fill(&mut some);
        assert!(few.pixels.len() < 16 && few.starts.len() == 4, "{few:?}");
        assert!((0..w * h).filter(|&i| wanted[i]).all(|i| some[i] == pixels[i]));
    }
}
