//! The filter as one-dimensional passes.
//!
//! *Paper* (§6.3): passes 1 and 3 run along the first principal direction of each pixel's covariance, 2 and 4 along the second, with
//! halved covariances, so that a neighbour round the corner of an edge is still reached.
//! *Ours*: a pass steps along the axis nearest its direction and reads the two pixels nearest the line, each with its own range weight. Lanes
//! hold eight steps of one pixel's line, four to either side.

use super::{Convolution, FilterInput, FilterParams, Kernel, NOT_GLOSSY, confidence, principal};
use crate::base::math::Rgb;
use crate::base::simd::functions::exp_down;
use crate::base::simd::lane::{F8, M8, V3};
use crate::base::simd::{self, Lanes, Simd};
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

/// What stays the same from pass to pass, a pixel an entry.
struct Guides<'a> {
    axes: Vec<Axes>,
    /// Normal and depth.
    surface: Vec<[f32; 4]>,
    material: &'a [u32],
}

/// Filters a frame.
pub(super) fn four_pass(input: &FilterInput, params: &FilterParams) -> Vec<Rgb> {
    four_pass_by(Lanes::chosen(), input, params)
}

/// [`four_pass`] in one form of lanes.
pub(super) fn four_pass_by(lanes: Lanes, input: &FilterInput, params: &FilterParams) -> Vec<Rgb> {
    let count = input.color.len();
    let split = if params.method == Convolution::TwoPass { 1.0 } else { 2.0 };
    let rows = || (0..count).into_par_iter().with_min_len(input.width);
    let axes = |i: usize| {
        let (major, a, b) = principal(input.covariance[i]);
        Axes { major, sigma: Vec2::new((a / split).sqrt(), (b / split).sqrt()) }
    };
    let surface = |i: usize| input.normal[i].extend(input.depth[i]).to_array();
    // Colour times weight, and the weight.
    let start = |i: usize| {
        let w = confidence(input, i, params);
        if w > 0.0 { (input.color[i] * w).extend(w).to_array() } else { [0.0; 4] }
    };
    let guides = Guides { axes: rows().map(axes).collect(), surface: rows().map(surface).collect(), material: input.material };
    let start: Vec<[f32; 4]> = rows().map(start).collect();
    let mut out = vec![Rgb::ZERO; count];
    let mut spare = vec![[0.0; 4]; count];
    for &(share, variance) in gaussians(params.kernel) {
        let (mut from, mut to) = (start.clone(), spare);
        for number in 0..2 * split as usize {
            pass((lanes, input.width), params, &guides, &from, &mut to, (number % 2 == 0, variance.sqrt()));
            std::mem::swap(&mut from, &mut to);
        }
        out.par_iter_mut().zip(&from).zip(input.color).for_each(|((o, value), &c)| {
            let value = Vec4::from_array(*value);
            *o += if value.w > 0.0 { value.xyz() / value.w * share } else { c * share };
        });
        spare = to;
    }
    // Bit for bit what came in, where nothing was to be filtered.
    out.par_iter_mut().enumerate().for_each(|(i, o)| {
        if input.material[i] == NOT_GLOSSY || guides.axes[i].sigma.x < MIN_SIGMA * 0.5 {
            *o = input.color[i];
        }
    });
    out
}

/// One pass: each pixel's value becomes the mean over its line. Weighted colour and weight are carried alike.
/// `kernel` says whether the line is the major axis, and what multiplies its standard deviation.
fn pass(
    (lanes, width): (Lanes, usize),
    params: &FilterParams,
    guides: &Guides,
    from: &[[f32; 4]],
    to: &mut [[f32; 4]],
    kernel: (bool, f32),
) {
    let rows = TILE.0;
    to.par_chunks_mut(width * rows).enumerate().for_each(|(strip, out)| {
        lanes.run(Strip { width, first: strip * rows * width, params, guides, from, out, kernel });
    });
}

/// Some rows of a pass.
struct Strip<'a> {
    width: usize,
    /// Index of the first pixel.
    first: usize,
    params: &'a FilterParams,
    guides: &'a Guides<'a>,
    from: &'a [[f32; 4]],
    out: &'a mut [[f32; 4]],
    kernel: (bool, f32),
}

impl simd::Kernel for Strip<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, s: S) {
        let Self { width, first, params, guides, from, out, kernel } = self;
        let image = Image { s, width, height: from.len() / width, params, guides, from: from.as_flattened() };
        for left in (0..width).step_by(TILE.1) {
            for row in 0..out.len() / width {
                for x in left..(left + TILE.1).min(width) {
                    let at = row * width + x;
                    let Axes { major, sigma } = guides.axes[first + at];
                    let (direction, sigma) = if kernel.0 { (major, sigma.x) } else { (major.perp(), sigma.y) };
                    let sigma = (sigma * kernel.1).min(params.max_radius / params.radius_sigmas);
                    let own = from[first + at];
                    let is_filtered = guides.material[first + at] != NOT_GLOSSY && sigma >= MIN_SIGMA;
                    out[at] = if is_filtered { image.line_mean([x, first / width + row], own, direction, sigma) } else { own };
                }
            }
        }
    }
}

/// What a pass reads.
struct Image<'a, S: Simd> {
    s: S,
    width: usize,
    height: usize,
    params: &'a FilterParams,
    guides: &'a Guides<'a>,
    from: &'a [f32],
}

/// Of lanes: which step along the line, and to which side.
const STEP: [f32; 8] = [1.0, 2.0, 3.0, 4.0, 1.0, 2.0, 3.0, 4.0];
const SIDE: [f32; 8] = [-1.0, -1.0, -1.0, -1.0, 1.0, 1.0, 1.0, 1.0];

impl<S: Simd> Image<'_, S> {
    /// The mean over the line through pixel (x, y).
    #[inline(always)]
    fn line_mean(&self, [x, y]: [usize; 2], own: [f32; 4], direction: Vec2, sigma: f32) -> [f32; 4] {
        let (s, i) = (self.s, y * self.width + x);
        let (horizontal, vertical) = ((x, self.width, 1), (y, self.height, self.width));
        // `long` is the axis nearest the line, `short` the other one.
        let upright = direction.y.abs() > direction.x.abs();
        let (long, short) = if upright { (vertical, horizontal) } else { (horizontal, vertical) };
        let slope = if upright { direction.x / direction.y } else { direction.y / direction.x };
        // Pixels of one step along the long axis, and its length.
        let stride = ((sigma / STEPS) as usize).max(1);
        let step = stride as f32 * (1.0 + slope * slope).sqrt();
        let reach = self.params.radius_sigmas * sigma / step;
        let most = [long.0, long.1 - 1 - long.0].map(|room| ((room / stride) as f32).min(reach.floor()));
        let falls = -0.5 * (step / sigma) * (step / sigma);
        let side = F8::load(s, &SIDE);
        let most = (side.below(0.0).choose(F8::splat(s, most[0]), F8::splat(s, most[1])), most[0].max(most[1]));
        let mut sum = Sum { value: [F8::splat(s, 0.0); 4], weight: F8::splat(s, 0.0) };
        let own_surface = Own::new(s, self.guides, i);
        let mut done = 0.0;
        while done < most.1 {
            let k = F8::load(s, &STEP) + done;
            let on_line = !most.0.less(k);
            let along = side * k * stride as f32;
            let across = along * slope;
            let low = across.floor();
            let (fraction, g) = (across - low, exp_down(k * k * falls));
            let at = low + short.0 as f32;
            let index = self.offset(along, long.2, self.offset(low, short.2, s.splat_ids(i as u32)));
            let inside = on_line & !at.below(0.0) & at.below(short.1 as f32);
            self.add(&mut sum, &own_surface, index, inside, g * (fraction * -1.0 + 1.0));
            if slope != 0.0 {
                let (next, index) = (at + 1.0, s.add_ids(index, s.splat_ids(short.2 as u32)));
                let inside = on_line & !next.below(0.0) & next.below(short.1 as f32);
                self.add(&mut sum, &own_surface, index, inside, g * fraction);
            }
            done += 4.0;
        }
        let total = 1.0 + sum.weight.sum();
        let [r, g, b, w] = sum.value;
        [(own[0] + r.sum()) / total, (own[1] + g.sum()) / total, (own[2] + b.sum()) / total, (own[3] + w.sum()) / total]
    }

    /// `from` and so many pixels `by` apart.
    #[inline(always)]
    fn offset(&self, count: F8<S>, by: usize, from: S::I) -> S::I {
        let s = self.s;
        s.add_ids(s.mul_ids(count.ids(), s.splat_ids(by as u32)), from)
    }

    /// Adds eight pixels, those that count and are of one surface with the line's own.
    #[inline(always)]
    fn add(&self, sum: &mut Sum<S>, own: &Own<S>, index: S::I, counts: M8<S>, weight: F8<S>) {
        let s = self.s;
        let at = s.shift_up::<2>(index);
        let [nx, ny, nz, depth] = s.fours(self.guides.surface.as_flattened(), at);
        let normal = V3 { x: F8(s, nx), y: F8(s, ny), z: F8(s, nz) };
        let near = (own.depth - F8(s, depth)).abs().below(self.params.depth_threshold);
        let facing = own.normal.dot(normal).above(self.params.min_normal_cos);
        let same = M8(s, s.same_ids(own.material, s.ones(self.guides.material, index)));
        let weight = (counts & near & facing & same).choose(weight, F8::splat(s, 0.0));
        let [r, g, b, w] = s.fours(self.from, at);
        sum.weight = sum.weight + weight;
        sum.value[0] = sum.value[0] + F8(s, r) * weight;
        sum.value[1] = sum.value[1] + F8(s, g) * weight;
        sum.value[2] = sum.value[2] + F8(s, b) * weight;
        sum.value[3] = sum.value[3] + F8(s, w) * weight;
    }
}

/// What lanes have summed.
struct Sum<S: Simd> {
    value: [F8<S>; 4],
    weight: F8<S>,
}

/// The surface of the line's own pixel.
struct Own<S: Simd> {
    normal: V3<S>,
    depth: F8<S>,
    material: S::I,
}

impl<S: Simd> Own<S> {
    #[inline(always)]
    fn new(s: S, guides: &Guides, i: usize) -> Self {
        let [x, y, z, depth] = guides.surface[i];
        Self { normal: V3::splat(s, Vec3::new(x, y, z)), depth: F8::splat(s, depth), material: s.splat_ids(guides.material[i]) }
    }
}
