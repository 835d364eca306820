//! The filter as one-dimensional passes.
//!
//! *Paper* (§6.3): passes 1 and 3 run along the first principal direction of each pixel's covariance, 2 and 4 along the second, with
//! halved covariances, so that a neighbour round the corner of an edge is still reached.
//! *Ours*: a pass steps along the axis nearest its direction and reads the two pixels nearest the line, each with its own range weight. Lanes
//! hold a step of the lines of eight pixels side by side: most lines are short.

use super::{FilterParams, Kernel, NOT_GLOSSY};
use crate::base::simd::functions::exp_down;
use crate::base::simd::lane::{F8, M8, V3};
use crate::base::simd::{self, Lanes, Simd};
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

/// What stays the same from pass to pass, a pixel an entry.
pub(super) struct Guides<'a> {
    /// A pixel's own kernel: [`super::planes::Planes`]'s.
    pub(super) axes: &'a [[f32; 4]],
    /// Normal and depth.
    pub(super) surface: &'a [[f32; 4]],
    /// [`NOT_GLOSSY`] for none.
    pub(super) material: &'a [u32],
}

impl Guides<'_> {
    /// Bit for bit what came in, where nothing is to be filtered.
    pub(super) fn is_filtered(&self, i: usize) -> bool {
        self.material[i] != NOT_GLOSSY && self.axes[i][2] >= MIN_SIGMA * 0.5
    }
}

/// One pass: each pixel's value becomes the mean over its line. Weighted colour and weight are carried alike.
/// `kernel` says whether the line is the major axis, and what multiplies its standard deviation.
pub(super) fn pass(
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
                let right = (left + TILE.1).min(width);
                for x in (left..right).step_by(8) {
                    let at = row * width + x;
                    image.line_mean([x, first / width + row], kernel, &mut out[at..at + (right - x).min(8)]);
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

const LANES: [f32; 8] = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0];

impl<S: Simd> Image<'_, S> {
    /// The means over the lines through at most eight pixels of a row, the first of which is (x, y).
    #[inline(always)]
    fn line_mean(&self, [x, y]: [usize; 2], kernel: (bool, f32), out: &mut [[f32; 4]]) {
        let (s, i) = (self.s, y * self.width + x);
        let own = s.add_ids(s.splat_ids(i as u32), F8::load(s, &LANES).ids());
        let lines = Lines::new(self, [x, y], own, kernel);
        let is_filtered = lines.is_filtered & F8::load(s, &LANES).below(out.len() as f32);
        out.copy_from_slice(&self.from.as_chunks().0[i..i + out.len()]);
        if is_filtered.bits() == 0 {
            return;
        }
        let zero = F8::splat(s, 0.0);
        let most = [is_filtered.choose(lines.most[0], zero), is_filtered.choose(lines.most[1], zero)];
        let own_surface = Own::new(s, self.guides, (i, own));
        let mut sum = Sum { value: [zero; 4], weight: zero };
        let mut step = 1.0;
        loop {
            let (before, after) = (!most[0].below(step), !most[1].below(step));
            if (before | after).bits() == 0 {
                break;
            }
            let weight = exp_down(lines.falls * (step * step));
            self.step(&mut sum, &lines, &own_surface, (lines.stride * -step, before, weight));
            self.step(&mut sum, &lines, &own_surface, (lines.stride * step, after, weight));
            step += 1.0;
        }
        let total = sum.weight + 1.0;
        let [r, g, b, w] = s.fours(self.from, s.shift_up::<2>(own));
        let [sum_r, sum_g, sum_b, sum_w] = sum.value;
        let (r, g) = (((F8(s, r) + sum_r) / total).array(), ((F8(s, g) + sum_g) / total).array());
        let (b, w) = (((F8(s, b) + sum_b) / total).array(), ((F8(s, w) + sum_w) / total).array());
        let bits = is_filtered.bits();
        for (lane, out) in out.iter_mut().enumerate() {
            if bits >> lane & 1 == 1 {
                *out = [r[lane], g[lane], b[lane], w[lane]];
            }
        }
    }

    /// Adds the two pixels nearest each line, so many pixels `along` its long axis.
    #[inline(always)]
    fn step(&self, sum: &mut Sum<S>, lines: &Lines<S>, own: &Own<S>, (along, counts, weight): (F8<S>, M8<S>, F8<S>)) {
        if counts.bits() == 0 {
            return;
        }
        let across = along * lines.slope;
        let low = across.floor();
        let fraction = across - low;
        let at = low + lines.short.0;
        let by = along * lines.long_by + low * lines.short_by;
        let inside = counts & !at.below(0.0) & at.less(lines.short.1);
        self.add(sum, own, by, inside, weight * (fraction * -1.0 + 1.0));
        let next = at + 1.0;
        let inside = counts & fraction.above(0.0) & !next.below(0.0) & next.less(lines.short.1);
        if inside.bits() != 0 {
            self.add(sum, own, by + lines.short_by, inside, weight * fraction);
        }
    }

    /// Adds eight pixels `by` so many indices from the lines' own, those that count and are of one surface.
    #[inline(always)]
    fn add(&self, sum: &mut Sum<S>, own: &Own<S>, by: F8<S>, counts: M8<S>, weight: F8<S>) {
        let s = self.s;
        let Read { surface: [nx, ny, nz, depth], material, value: [r, g, b, w] } = self.read(own, by);
        let normal = V3 { x: F8(s, nx), y: F8(s, ny), z: F8(s, nz) };
        let near = (own.depth - F8(s, depth)).abs().below(self.params.depth_threshold);
        let facing = own.normal.dot(normal).above(self.params.min_normal_cos);
        let same = M8(s, s.same_ids(own.material, material));
        let weight = (counts & near & facing & same).choose(weight, F8::splat(s, 0.0));
        sum.weight = sum.weight + weight;
        sum.value[0] = sum.value[0] + F8(s, r) * weight;
        sum.value[1] = sum.value[1] + F8(s, g) * weight;
        sum.value[2] = sum.value[2] + F8(s, b) * weight;
        sum.value[3] = sum.value[3] + F8(s, w) * weight;
    }

    /// Normals and depths, materials and values of eight pixels; sooner where they lie side by side, as they mostly do.
    #[inline(always)]
    fn read(&self, own: &Own<S>, by: F8<S>) -> Read<S> {
        let s = self.s;
        let ids = by.ids();
        let first = by.array()[0];
        let begin = own.first as isize + first as isize;
        let count = self.guides.material.len();
        let in_row = M8(s, s.same_ids(ids, F8::splat(s, first).ids()));
        if in_row.bits() == 0xff && begin >= 0 && begin as usize + 8 <= count {
            let at = begin as usize;
            let material = self.guides.material[at..].first_chunk().unwrap_or(&[NOT_GLOSSY; 8]);
            let surface = s.fours_in_row(self.guides.surface.as_flattened(), 4 * at);
            return Read { surface, material: s.load_ids(material), value: s.fours_in_row(self.from, 4 * at) };
        }
        let index = s.add_ids(own.index, ids);
        let at = s.shift_up::<2>(index);
        let surface = s.fours(self.guides.surface.as_flattened(), at);
        Read { surface, material: s.ones(self.guides.material, index), value: s.fours(self.from, at) }
    }
}

/// What is read of eight pixels.
struct Read<S: Simd> {
    /// Normals and depths.
    surface: [S::F; 4],
    material: S::I,
    value: [S::F; 4],
}

/// The lines of eight pixels.
struct Lines<S: Simd> {
    is_filtered: M8<S>,
    /// Pixels of one step along the long axis, the one nearest the line.
    stride: F8<S>,
    /// Steps to either side.
    most: [F8<S>; 2],
    /// Pixels along the short axis, the other one, for one along the long.
    slope: F8<S>,
    /// The pixel's place along the short axis, and how many there are.
    short: (F8<S>, F8<S>),
    /// Indices from a pixel to the next.
    long_by: F8<S>,
    short_by: F8<S>,
    /// The logarithm of the first step's weight.
    falls: F8<S>,
}

impl<S: Simd> Lines<S> {
    /// Of the pixels `own` from (x, y) on. `kernel` says whether the line is the major axis, and what multiplies its standard deviation.
    #[inline(always)]
    fn new(image: &Image<S>, [x, y]: [usize; 2], own: S::I, kernel: (bool, f32)) -> Self {
        let Image { s, width, height, params, guides, .. } = *image;
        let (one, by) = (F8::splat(s, 1.0), F8::splat(s, width as f32));
        let [major_x, major_y, sigma_a, sigma_b] = s.fours(guides.axes.as_flattened(), s.shift_up::<2>(own));
        let (major_x, major_y, sigma_a, sigma_b) = (F8(s, major_x), F8(s, major_y), F8(s, sigma_a), F8(s, sigma_b));
        let (dx, dy, sigma) = if kernel.0 { (major_x, major_y, sigma_a) } else { (-major_y, major_x, sigma_b) };
        let sigma = (sigma * kernel.1).min(F8::splat(s, params.max_radius / params.radius_sigmas));
        let none = M8(s, s.same_ids(s.ones(guides.material, own), s.splat_ids(NOT_GLOSSY)));
        let (column, row) = (F8::load(s, &LANES) + x as f32, F8::splat(s, y as f32));
        let (columns, rows) = (by, F8::splat(s, height as f32));
        let upright = dx.abs().less(dy.abs());
        let slope = upright.choose(dx, dy) / upright.choose(dy, dx);
        let stride = (sigma / STEPS).floor().max(one);
        let step = stride * (slope * slope + 1.0).sqrt();
        let reach = (sigma * params.radius_sigmas / step).floor();
        let (place, count) = (upright.choose(row, column), upright.choose(rows, columns));
        let most = [(place / stride).floor().min(reach), ((count - 1.0 - place) / stride).floor().min(reach)];
        let fall = step / sigma;
        Self {
            is_filtered: !none & !sigma.below(MIN_SIGMA),
            stride,
            most,
            slope,
            short: (upright.choose(column, row), upright.choose(columns, rows)),
            long_by: upright.choose(by, one),
            short_by: upright.choose(one, by),
            falls: fall * fall * -0.5,
        }
    }
}

/// What lanes have summed.
struct Sum<S: Simd> {
    value: [F8<S>; 4],
    weight: F8<S>,
}

/// The surfaces of the lines' own pixels.
struct Own<S: Simd> {
    /// Index of the first.
    first: usize,
    index: S::I,
    normal: V3<S>,
    depth: F8<S>,
    material: S::I,
}

impl<S: Simd> Own<S> {
    #[inline(always)]
    fn new(s: S, guides: &Guides, (first, index): (usize, S::I)) -> Self {
        let [x, y, z, depth] = s.fours(guides.surface.as_flattened(), s.shift_up::<2>(index));
        let normal = V3 { x: F8(s, x), y: F8(s, y), z: F8(s, z) };
        Self { first, index, normal, depth: F8(s, depth), material: s.ones(guides.material, index) }
    }
}
