//! The search of a probe's texels (§5.2): for a pixel, the texel of least energy (Eq. 1) around where the probe sees the same reflected point.
//!
//! Lanes hold eight pixels while it is found out where a probe sees what they reflect, and eight texels from there on ([`super::window`]).
//!
//! *Ours*: one pixel in so many each way, an anchor, is searched for in full; those between begin where it ended.

use super::candidates::WeightedProbe;
use super::gather::GatherParams;
use super::perturb::Perturbation;
use super::perturb_lanes::Paths;
use super::window::{Target, Texels, Window, windows};
use crate::base::simd::{Kernel, Lanes, Simd};
use crate::view::gbuffer::{GBuffer, Pixel};
use crate::view::mirror::{NOTHING, Reflected};
use glam::{Vec2, Vec3};

/// Most samples to each side of a search's centre.
pub const MAX_RADIUS: i32 = 15;

/// Side of a tile of pixels: what their searches read of a probe, some 100 KB, fits into a core's cache.
pub(crate) const TILE: usize = 16;

/// The glossy pixels of a view that reflect something, with their indices, square by square: neighbours search the same texels of a
/// probe, which then stay in the cache.
pub fn tiles<'a>(view: &'a GBuffer, reflected: &[Reflected]) -> Vec<Vec<(usize, &'a Pixel)>> {
    let [width, height] = view.size();
    let corners = (0..height).step_by(TILE).flat_map(|y| (0..width).step_by(TILE).map(move |x| [x, y]));
    corners.map(|corner| tile(view, reflected, corner)).collect()
}

/// The one of them whose upper left corner is given.
pub(crate) fn tile<'a>(view: &'a GBuffer, reflected: &[Reflected], [x, y]: [usize; 2]) -> Vec<(usize, &'a Pixel)> {
    let [width, height] = view.size();
    let glossy = |i: usize| {
        let pixel = view.pixels[i].as_ref().filter(|p| p.alpha.is_some() && reflected[i].material != NOTHING);
        pixel.map(|p| (i, p))
    };
    let rows = y..(y + TILE).min(height);
    rows.flat_map(|y| (x..(x + TILE).min(width)).map(move |x| y * width + x)).filter_map(glossy).collect()
}

/// What one probe offers a pixel.
#[derive(Debug, Clone, Copy)]
pub struct Sample {
    /// Its energy (Eq. 1).
    pub energy: f32,
    /// Its continuous texel coordinate.
    pub texel: Vec2,
}

/// What eight probes offer a pixel.
#[derive(Debug, Clone, Copy)]
pub struct Samples {
    /// Energies; infinite where a probe has nothing.
    pub energy: [f32; 8],
    /// Continuous texel coordinates, x and y.
    pub texel: [[f32; 8]; 2],
}

impl Samples {
    const NONE: Self = Self { energy: [f32::INFINITY; 8], texel: [[0.0; 8]; 2] };

    /// That of one probe.
    pub fn of(&self, k: usize) -> Option<Sample> {
        let energy = self.energy[k];
        energy.is_finite().then(|| Sample { energy, texel: Vec2::new(self.texel[0][k], self.texel[1][k]) })
    }

    fn set(&mut self, k: usize, sample: Sample) {
        self.energy[k] = sample.energy;
        (self.texel[0][k], self.texel[1][k]) = (sample.texel.x, sample.texel.y);
    }
}

/// How much worse than its anchor a pixel's sample may be before it is searched for in full: a factor, and an addend.
pub(crate) const ANCHOR_TOLERANCE: (f32, f32) = (3.0, 0.1);

/// The sample of least energy of each of `probes` (at most eight), for each pixel of one of [`tiles`], as `eye` sees it. `width`
/// is the view's.
pub fn best_samples(
    eye: Vec3,
    reflected: &[Reflected],
    (tile, width): (&[(usize, &Pixel)], usize),
    probes: &[WeightedProbe],
    params: &GatherParams,
) -> Vec<Samples> {
    Lanes::chosen().run(BestSamples { eye, reflected, tile, width, probes, params })
}

/// [`best_samples`] as a kernel.
pub(crate) struct BestSamples<'a> {
    pub(crate) eye: Vec3,
    pub(crate) reflected: &'a [Reflected],
    pub(crate) tile: &'a [(usize, &'a Pixel)],
    pub(crate) width: usize,
    pub(crate) probes: &'a [WeightedProbe<'a>],
    pub(crate) params: &'a GatherParams,
}

impl Kernel for BestSamples<'_> {
    type Output = Vec<Samples>;

    #[inline(always)]
    fn run<S: Simd>(self, s: S) -> Vec<Samples> {
        let Self { tile, params, .. } = self;
        let (targets, paths) = self.prepare();
        let windows = windows(&params.search);
        let step = params.anchors.max(1);
        let mut samples = vec![Samples::NONE; tile.len()];
        let mut begins = vec![Begin { x: [0.0; 8], y: [0.0; 8], valid: 0 }; paths.len()];
        for (k, w) in self.probes.iter().enumerate().take(8) {
            let texels = Texels::new(s, w, params);
            for (begin, paths) in begins.iter_mut().zip(&paths) {
                let (at, valid) = texels.towards(paths.reflection_points(s, w.probe.position));
                (begin.x, begin.y, begin.valid) = (at.x.array(), at.y.array(), valid);
            }
            // By place in the tile: where an anchor's search ended, from where it began.
            let mut ends = [Anchor::NONE; TILE * TILE];
            for is_anchor in [true, false] {
                for (at, target) in targets.iter().enumerate() {
                    let place = [target.place % TILE, target.place / TILE];
                    if (place[0].is_multiple_of(step) && place[1].is_multiple_of(step)) != is_anchor {
                        continue;
                    }
                    let Some(centre) = begins[at / 8].of(at % 8) else { continue };
                    let around = if is_anchor { Around::NONE } else { Around::of(&ends, place, step, target.material) };
                    let Some(found) = sample(&texels, &windows, target, centre, &around) else { continue };
                    samples[at].set(k, found);
                    if is_anchor {
                        let end = found.texel - centre;
                        ends[target.place] = Anchor { end, energy: found.energy, material: target.material };
                    }
                }
                if step == 1 {
                    break;
                }
            }
        }
        samples
    }
}

impl BestSamples<'_> {
    /// What is searched for, pixel by pixel, and the paths that lead there, eight at a time.
    fn prepare(&self) -> (Vec<Target>, Vec<Paths>) {
        let Self { eye, reflected, tile, width, params, .. } = *self;
        let of = |&(i, pixel): &(usize, &Pixel)| {
            let reflected = reflected[i];
            let (r, n) = (pixel.surface.p, pixel.normal);
            let path = Perturbation::new(eye, r, n, reflected.distance_from(r), &pixel.curvature, &params.perturb);
            let target = Target {
                normal: n,
                direction: reflected.direction_from(r),
                reflected,
                material: pixel.surface.material,
                alpha: pixel.alpha.unwrap_or(0.0),
                place: i / width % TILE * TILE + i % width % TILE,
            };
            (target, path)
        };
        let (targets, paths): (Vec<_>, Vec<_>) = tile.iter().map(of).unzip();
        let eight = |paths: &[Perturbation]| Paths::new(&std::array::from_fn(|i| paths[i.min(paths.len() - 1)]));
        (targets, paths.chunks(8).map(eight).collect())
    }
}

/// Where a probe sees what eight pixels reflect, texels.
#[derive(Clone)]
struct Begin {
    x: [f32; 8],
    y: [f32; 8],
    /// A bit for each that is anywhere.
    valid: u32,
}

impl Begin {
    #[inline(always)]
    fn of(&self, i: usize) -> Option<Vec2> {
        (self.valid >> i & 1 == 1).then(|| Vec2::new(self.x[i], self.y[i]))
    }
}

/// How an anchor's search ended.
#[derive(Clone, Copy)]
struct Anchor {
    /// From where it began, texels.
    end: Vec2,
    /// Infinite where nothing was found.
    energy: f32,
    /// Of the anchor's reflector.
    material: u32,
}

impl Anchor {
    const NONE: Self = Self { end: Vec2::ZERO, energy: f32::INFINITY, material: u32::MAX };
}

/// The ends of the anchors around a pixel that are of its material, the first one again in the lanes that are left over.
struct Around {
    x: [f32; 8],
    y: [f32; 8],
    /// The most that a sample may have.
    allowed: f32,
    count: usize,
}

impl Around {
    const NONE: Self = Self { x: [0.0; 8], y: [0.0; 8], allowed: 0.0, count: 0 };

    #[inline(always)]
    fn of(ends: &[Anchor; TILE * TILE], place: [usize; 2], step: usize, material: u32) -> Self {
        let [x, y] = [place[0] / step * step, place[1] / step * step];
        let mut around = Self::NONE;
        for (dx, dy) in [(0, 0), (step, 0), (0, step), (step, step)] {
            if x + dx >= TILE || y + dy >= TILE {
                continue;
            }
            let anchor = ends[(y + dy) * TILE + x + dx];
            if anchor.material != material {
                continue;
            }
            let at = around.count;
            if at == 0 {
                (around.x, around.y) = ([anchor.end.x; 8], [anchor.end.y; 8]);
            }
            (around.x[at], around.y[at], around.count) = (anchor.end.x, anchor.end.y, at + 1);
            around.allowed = around.allowed.max(anchor.energy * ANCHOR_TOLERANCE.0 + ANCHOR_TOLERANCE.1);
        }
        around
    }
}

/// A pixel's sample: the one that the anchors around it lead to, by the finest level alone; where that is much worse than theirs, or there
/// is none, the one that a search in full finds.
#[inline(always)]
fn sample<S: Simd>(texels: &Texels<S>, windows: &[Window], target: &Target, centre: Vec2, around: &Around) -> Option<Sample> {
    let mut start = if around.count > 0 { texels.best_of(&around.x, &around.y, centre, target) } else { None };
    loop {
        let (levels, allowed) = match start {
            Some(_) => (&windows[windows.len().saturating_sub(1)..], around.allowed),
            None => (windows, f32::INFINITY),
        };
        match texels.search(levels, start, centre, target) {
            Some(found) if found.energy <= allowed => return Some(found),
            _ if start.is_some() => start = None,
            _ => return None,
        }
    }
}
