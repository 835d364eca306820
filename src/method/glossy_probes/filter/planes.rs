//! What the one-dimensional passes read and write, a pixel an entry: filled in by the pass before the filter, or from [`super::FilterInput`].

use super::four_pass::{Guides, gaussians, pass};
use super::{Convolution, FilterInput, FilterParams, NOT_GLOSSY, confidence, principal};
use crate::base::math::Rgb;
use crate::base::simd::Lanes;
use bytemuck::zeroed_vec;
use glam::{Vec3, Vec4, Vec4Swizzles};
use rayon::prelude::*;

/// What the passes read and write; empty at first.
#[derive(Default)]
pub(crate) struct Planes {
    /// A pixel's own kernel: the direction of its major axis, and the standard deviations of one pass along that and the minor axis, for a
    /// Gaussian of the covariance itself.
    axes: Vec<[f32; 4]>,
    /// Normal and depth.
    surface: Vec<[f32; 4]>,
    material: Vec<u32>,
    /// Colour times weight, and the weight.
    from: Vec<[f32; 4]>,
    to: Vec<[f32; 4]>,
}

/// Some rows of [`Planes`], to be filled in.
pub(crate) struct Rows<'a> {
    axes: &'a mut [[f32; 4]],
    surface: &'a mut [[f32; 4]],
    material: &'a mut [u32],
    from: &'a mut [[f32; 4]],
}

/// What the filter is told of a pixel with a glossy surface: [`super::FilterInput`]'s.
pub(crate) struct Entry {
    pub(crate) color: Rgb,
    pub(crate) normal: Vec3,
    pub(crate) depth: f32,
    pub(crate) material: u32,
    pub(crate) covariance: [f32; 3],
    pub(crate) energy: f32,
}

/// Filters a frame.
pub(super) fn four_pass(input: &FilterInput, params: &FilterParams) -> Vec<Rgb> {
    four_pass_by(Lanes::chosen(), input, params)
}

/// [`four_pass`] in one form of lanes.
pub(super) fn four_pass_by(lanes: Lanes, input: &FilterInput, params: &FilterParams) -> Vec<Rgb> {
    let mut planes = Planes::default();
    planes.resize(input.color.len());
    planes.chunks(input.width).enumerate().for_each(|(y, mut rows)| {
        (0..input.width).for_each(|x| rows.set(x, Some(&input.entry(y * input.width + x)), params));
    });
    let mut color = input.color.to_vec();
    planes.filter((lanes, input.width), &mut color, params);
    color
}

impl Planes {
    /// Makes room for so many pixels.
    pub(crate) fn resize(&mut self, count: usize) {
        if self.material.len() != count {
            *self = Self {
                axes: zeroed_vec(count),
                surface: zeroed_vec(count),
                material: zeroed_vec(count),
                from: zeroed_vec(count),
                to: zeroed_vec(count),
            };
        }
    }

    /// All of them, so many pixels at a time.
    pub(crate) fn chunks(&mut self, pixels: usize) -> impl IndexedParallelIterator<Item = Rows<'_>> {
        let Self { axes, surface, material, from, .. } = self;
        let all = (
            axes.par_chunks_mut(pixels),
            surface.par_chunks_mut(pixels),
            material.par_chunks_mut(pixels),
            from.par_chunks_mut(pixels),
        );
        all.into_par_iter().map(|(axes, surface, material, from)| Rows { axes, surface, material, from })
    }

    /// Filters colours, of the pixels that were filled in. What is there afterwards is of no use.
    pub(crate) fn filter(&mut self, (lanes, width): (Lanes, usize), color: &mut [Rgb], params: &FilterParams) {
        if color.is_empty() {
            return;
        }
        let number = passes(params);
        let gaussians = gaussians(params.kernel);
        let start = if gaussians.len() > 1 { self.from.clone() } else { Vec::new() };
        let mut sum = if gaussians.len() > 1 { vec![Rgb::ZERO; color.len()] } else { Vec::new() };
        for (i, &(share, variance)) in gaussians.iter().enumerate() {
            if i > 0 {
                self.from.copy_from_slice(&start);
            }
            let guides = Guides { axes: &self.axes, surface: &self.surface, material: &self.material };
            for number in 0..number {
                pass((lanes, width), params, &guides, &self.from, &mut self.to, (number % 2 == 0, variance.sqrt()));
                std::mem::swap(&mut self.from, &mut self.to);
            }
            let is_last = i + 1 == gaussians.len();
            let from = &self.from;
            let rows = color.par_iter_mut().enumerate().with_min_len(width);
            if gaussians.len() > 1 {
                rows.zip(&mut sum).for_each(|((i, c), sum)| {
                    *sum += share_of(from[i], *c, share);
                    if is_last && guides.is_filtered(i) {
                        *c = *sum;
                    }
                });
            } else {
                rows.filter(|(i, _)| guides.is_filtered(*i)).for_each(|(i, c)| *c = Rgb::ZERO + share_of(from[i], *c, share));
            }
        }
    }
}

/// What a Gaussian adds to a pixel's colour, which was `color`.
fn share_of(value: [f32; 4], color: Rgb, share: f32) -> Rgb {
    let value = Vec4::from_array(value);
    if value.w > 0.0 { value.xyz() / value.w * share } else { color * share }
}

/// Passes of the kernel's one or more Gaussians each.
fn passes(params: &FilterParams) -> usize {
    if params.method == Convolution::TwoPass { 2 } else { 4 }
}

impl Rows<'_> {
    /// Fills in a pixel; `None` for one without a glossy surface.
    #[inline]
    pub(crate) fn set(&mut self, i: usize, entry: Option<&Entry>, params: &FilterParams) {
        let Some(entry) = entry.filter(|entry| entry.material != NOT_GLOSSY) else {
            (self.material[i], self.from[i]) = (NOT_GLOSSY, [0.0; 4]);
            return;
        };
        let (major, a, b) = principal(entry.covariance);
        let split = 0.5 * passes(params) as f32;
        self.axes[i] = [major.x, major.y, (a / split).sqrt(), (b / split).sqrt()];
        self.surface[i] = entry.normal.extend(entry.depth).to_array();
        self.material[i] = entry.material;
        let w = confidence(entry, params);
        self.from[i] = if w > 0.0 { (entry.color * w).extend(w).to_array() } else { [0.0; 4] };
    }
}
