//! The search of a probe's texels (§5.2): for a pixel, the texel of least energy (Eq. 1) around where the probe sees the same reflected point.
//!
//! Lanes hold eight pixels while it is found out where a probe sees what they reflect, and eight texels from there on ([`super::window`]).
//!
//! *Ours*: one pixel in so many each way, an anchor, is searched for in full; those between begin where it ended.

use super::between::{Anchors, Begin, Block};
use super::candidates::WeightedProbe;
use super::gather_params::{GatherParams, TILE};
use super::perturb::Perturbation;
use super::perturb_lanes::Paths;
use super::samples::Samples;
use super::window::{Target, Texels, windows};
use crate::base::simd::{Kernel, Lanes, Simd};
use crate::view::gbuffer::{GBuffer, Pixel};
use crate::view::mirror::{NOTHING, Reflected};
use glam::Vec3;

/// The glossy pixels of a view that reflect something, with their indices, square by square: neighbours search the same texels of a
/// probe, which then stay in the cache.
pub fn tiles<'a>(view: &'a GBuffer, reflected: &[Reflected]) -> Vec<Vec<(usize, &'a Pixel)>> {
    let [width, height] = view.size();
    let corners = (0..height).step_by(TILE).flat_map(|y| (0..width).step_by(TILE).map(move |x| [x, y]));
    corners.map(|corner| tile(view, reflected, corner)).collect()
}

/// The one of them whose upper left corner is given.
pub(crate) fn tile<'a>(view: &'a GBuffer, reflected: &[Reflected], corner: [usize; 2]) -> Vec<(usize, &'a Pixel)> {
    tile_of(&view.pixels, reflected, view.size()[0], corner)
}

/// The same of rows of so many pixels.
pub(crate) fn tile_of<'a>(
    pixels: &'a [Option<Pixel>],
    reflected: &[Reflected],
    width: usize,
    [x, y]: [usize; 2],
) -> Vec<(usize, &'a Pixel)> {
    let glossy = |i: usize| {
        let pixel = pixels[i].as_ref().filter(|p| p.alpha.is_some() && reflected[i].material != NOTHING);
        pixel.map(|p| (i, p))
    };
    let rows = y..(y + TILE).min(pixels.len() / width.max(1));
    rows.flat_map(|y| (x..(x + TILE).min(width)).map(move |x| y * width + x)).filter_map(glossy).collect()
}

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
        let step = params.anchors.max(1);
        let (targets, paths) = self.prepare();
        let blocks: Vec<Block> = targets.chunks(8).map(|targets| Block::new(targets, step)).collect();
        let windows = windows(&params.search);
        let mut samples = vec![Samples::NONE; tile.len()];
        let mut begins = vec![Begin::NOWHERE; paths.len()];
        for (k, w) in self.probes.iter().enumerate().take(8) {
            let texels = Texels::new(s, w, params);
            for (begin, paths) in begins.iter_mut().zip(&paths) {
                *begin = Begin::new(texels.towards(paths.reflection_points(s, w.probe.position)));
            }
            let mut anchors = Anchors::NONE;
            // A bit for each pixel of a block that is searched for in full: the anchors, and then those that they do not lead to.
            let mut left: Vec<u32> = blocks.iter().zip(&begins).map(|(block, begin)| block.anchors & begin.valid).collect();
            for are_anchors in [true, false] {
                for at in 0..blocks.len() * 8 {
                    if left[at / 8] >> (at % 8) & 1 == 0 {
                        continue;
                    }
                    let (centre, target) = (begins[at / 8].of(at % 8), &targets[at]);
                    let Some(found) = texels.search(&windows, centre, target) else { continue };
                    samples[at].set(k, found);
                    if are_anchors {
                        anchors.set(target, found, centre);
                    }
                }
                if !are_anchors || step == 1 {
                    break;
                }
                for (at, (block, begin)) in blocks.iter().zip(&begins).enumerate() {
                    let some = at * 8..tile.len().min(at * 8 + 8);
                    left[at] = block.between(&texels, &anchors, begin, windows.last(), (k, &mut samples[some]));
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
