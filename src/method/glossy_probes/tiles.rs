//! The passes before the filter, some pixels after the other: what later passes need of a pixel is a quarter of what these know of it. The
//! rest stays in a core's cache from pass to pass, and the system need not clear memory for it, which takes as long as the rays.

use super::candidates::WeightedProbe;
use super::filter::planes::{self, Entry};
use super::filter::{FilterParams, NOT_GLOSSY};
use super::footprint::Footprint;
use super::gather::{GatherParams, Gathered, gather_tile};
use super::gather_params::TILE;
use super::previous::Previous;
use super::search::{BestSamples, tile_of};
use super::shown::Shown;
use crate::base::math::Rgb;
use crate::base::simd::Lanes;
use crate::lightmap::LightMap;
use crate::scene::Camera;
use crate::surface::CurvatureMap;
use crate::transport::World;
use crate::view::gbuffer::{BLOCK as BEAM_SIDE, Pixel, block, seen};
use crate::view::mirror::Reflected;
use crate::view::mirror_light::mirrored;
use bytemuck::{Zeroable, zeroed_vec};
use rayon::prelude::*;
use std::time::Instant;

/// Columns that the passes go over together: what is known of them, some 300 KB, fits into a core's own cache. (A single tile or all
/// of a row took the same time.)
const COLUMNS: usize = 4 * TILE;

/// What the passes read.
pub struct Tiles<'a> {
    /// The scene.
    pub world: &'a World,
    /// Curvatures of its vertices.
    pub curvature: &'a CurvatureMap,
    /// Its diffuse light; without it, the diffuse layer is black.
    pub lightmap: Option<&'a LightMap>,
    /// Where perfect mirrors are lit by it.
    pub mirrors: Option<&'a LightMap>,
    /// Those around the camera.
    pub probes: &'a [WeightedProbe<'a>],
    /// What the probes were baked at.
    pub roughness_scale: f32,
    /// §5.2.
    pub gather: &'a GatherParams,
    /// §6.1.
    pub footprint: Option<&'a Footprint>,
    /// §6.2, §6.3.
    pub filter: &'a FilterParams,
    /// The frame before.
    pub previous: Option<&'a Previous>,
}

/// What they leave of a view, a pixel an entry, rows from the top.
#[derive(Default)]
pub struct Planes {
    /// What decides whether two pixels show the same.
    pub shown: Vec<Shown>,
    /// Gathered.
    pub glossy: Vec<Rgb>,
    /// What perfect mirrors show.
    pub mirrored: Vec<Rgb>,
    /// LE.
    pub emission: Vec<Rgb>,
    /// L(S|D)*DE.
    pub diffuse: Vec<Rgb>,
}

/// Memory that frames take again, empty at first: the system would have to clear new pages.
#[derive(Default)]
pub struct Room {
    pub(crate) shown: Vec<Shown>,
    pub(crate) glossy: Vec<Rgb>,
    /// What the filter is told.
    pub(crate) filter: planes::Planes,
}

impl Room {
    /// Takes what a frame has no more use for.
    pub fn take(&mut self, Planes { shown, glossy, .. }: Planes) {
        (self.shown, self.glossy) = (shown, glossy);
    }

    /// Filters the colours of rows of so many pixels, of which [`Tiles::run`] has told the filter.
    pub fn filter(&mut self, width: usize, glossy: &mut [Rgb], params: &FilterParams) {
        self.filter.filter((Lanes::chosen(), width), glossy, params);
    }
}

/// Some rows of them, and of the filter's.
struct Rows<'a> {
    width: usize,
    shown: &'a mut [Shown],
    glossy: &'a mut [Rgb],
    mirrored: &'a mut [Rgb],
    emission: &'a mut [Rgb],
    diffuse: &'a mut [Rgb],
    filter: planes::Rows<'a>,
}

/// What went by meanwhile.
#[derive(Clone, Copy, Default)]
pub struct Tally {
    /// Pixels that no probe and no earlier frame served.
    pub unserved: usize,
    /// Seconds of each of [`PASSES`].
    pub seconds: [f64; PASSES.len()],
}

/// The passes' names.
pub const PASSES: [&str; 5] = ["gbuffer", "mirror", "gather", "footprint", "composite"];

impl Tally {
    /// Notes what has passed since `last`.
    fn lap(&mut self, pass: usize, last: &mut Instant) {
        let now = Instant::now();
        self.seconds[pass] += (now - *last).as_secs_f64();
        *last = now;
    }

    fn add(mut self, other: Self) -> Self {
        self.unserved += other.unserved;
        self.seconds.iter_mut().zip(other.seconds).for_each(|(a, b)| *a += b);
        self
    }
}

impl Tiles<'_> {
    /// All pixels of `camera`. What the filter is told of them stays in the room.
    pub fn run(&self, camera: &Camera, room: &mut Room) -> (Planes, Tally) {
        let [width, height] = camera.size.map(|s| s as usize);
        let count = width * height;
        let mut planes = Planes {
            shown: again(&mut room.shown, count),
            glossy: again(&mut room.glossy, count),
            mirrored: zeroed_vec(count),
            emission: zeroed_vec(count),
            diffuse: zeroed_vec(count),
        };
        room.filter.resize(count);
        let Planes { shown, glossy, mirrored, emission, diffuse } = &mut planes;
        let strip = width.max(1) * TILE;
        let all = (
            shown.par_chunks_mut(strip),
            glossy.par_chunks_mut(strip),
            mirrored.par_chunks_mut(strip),
            emission.par_chunks_mut(strip),
            diffuse.par_chunks_mut(strip),
            room.filter.chunks(strip),
        );
        let strips = all.into_par_iter().map(|(shown, glossy, mirrored, emission, diffuse, filter)| Rows {
            width,
            shown,
            glossy,
            mirrored,
            emission,
            diffuse,
            filter,
        });
        let strips = strips.enumerate();
        let tallies = strips.map_init(Block::default, |block, (i, rows)| self.strip(block, camera, i * TILE, rows));
        let tally = tallies.reduce(Tally::default, Tally::add);
        (planes, tally)
    }

    /// Some rows, of which `top` is the first.
    fn strip(&self, block: &mut Block, camera: &Camera, top: usize, mut rows: Rows) -> Tally {
        let (mut tally, mut clock) = (Tally::default(), Instant::now());
        for left in (0..rows.width).step_by(COLUMNS) {
            block.begin([left, top], [COLUMNS.min(rows.width - left), rows.shown.len() / rows.width]);
            block.see(self, camera);
            tally.lap(0, &mut clock);
            block.mirror(self);
            tally.lap(1, &mut clock);
            block.gather(self, camera);
            tally.unserved += block.take_previous(self.previous);
            tally.lap(2, &mut clock);
            block.footprint(self, camera);
            tally.lap(3, &mut clock);
            block.leave(self, &mut rows);
            tally.lap(4, &mut clock);
        }
        tally
    }
}

/// So many entries, where there is room for as many.
fn again<T: Zeroable>(room: &mut Vec<T>, count: usize) -> Vec<T> {
    let room = std::mem::take(room);
    if room.len() == count { room } else { zeroed_vec(count) }
}

/// Pixels that the passes go over together: [`TILE`] rows of [`COLUMNS`] or, at the edges, fewer.
#[derive(Default)]
struct Block {
    /// The upper left one.
    corner: [usize; 2],
    width: usize,
    pixels: Vec<Option<Pixel>>,
    /// The environment behind them.
    behind: Vec<Rgb>,
    reflected: Vec<Reflected>,
    mirrored: Vec<Rgb>,
    gathered: Vec<Gathered>,
    covariance: Vec<[f32; 3]>,
}

impl Block {
    /// Another one, which [`Self::see`] is to overwrite: pixels stay what they were until then.
    fn begin(&mut self, corner: [usize; 2], [width, height]: [usize; 2]) {
        let count = width * height;
        (self.corner, self.width) = (corner, width);
        self.pixels.resize(count, None);
        self.behind.resize(count, Rgb::ZERO);
        self.reflected.clear();
        self.mirrored.clear();
        self.gathered.clear();
        self.gathered.resize(count, Gathered::NONE);
        self.covariance.resize(count, [0.0; 3]);
    }

    fn see(&mut self, t: &Tiles, camera: &Camera) {
        let ([left, top], width) = (self.corner, self.width);
        for y in (0..self.pixels.len() / width).step_by(BEAM_SIDE) {
            for x in (0..width).step_by(BEAM_SIDE) {
                for ([x, y], ray, hit) in block(t.world, camera, [left + x, top + y]) {
                    let i = (y - top) * width + x - left;
                    (self.pixels[i], self.behind[i]) = seen(t.world, t.curvature, &ray, hit);
                }
            }
        }
    }

    fn mirror(&mut self, t: &Tiles) {
        for (reflected, light) in self.pixels.iter().map(|pixel| mirrored(t.world, t.mirrors, pixel)) {
            self.reflected.push(reflected);
            self.mirrored.push(light);
        }
    }

    fn gather(&mut self, t: &Tiles, camera: &Camera) {
        let (lanes, eye, width) = (Lanes::chosen(), camera.position(), self.width);
        for left in (0..width).step_by(TILE) {
            let tile = tile_of(&self.pixels, &self.reflected, width, [left, 0]);
            if tile.is_empty() {
                continue;
            }
            let search = BestSamples { eye, reflected: &self.reflected, tile: &tile, width, probes: t.probes, params: t.gather };
            let found = gather_tile(lanes, t.world, search, t.roughness_scale);
            tile.iter().zip(found).for_each(|((i, _), g)| self.gathered[*i] = g);
        }
    }

    /// Fills in what no probe served; how many stay without. Their energy stays infinite: they give nothing to the filter.
    fn take_previous(&mut self, previous: Option<&Previous>) -> usize {
        let pixels = self.pixels.iter().zip(&mut self.gathered).filter(|(_, g)| g.energy.is_infinite());
        pixels.map(|(pixel, gathered)| usize::from(!gathered.or_previous(pixel, previous))).sum()
    }

    fn footprint(&mut self, t: &Tiles, camera: &Camera) {
        let Some(footprint) = t.footprint else { return };
        for ((out, pixel), reflected) in self.covariance.iter_mut().zip(&self.pixels).zip(&self.reflected) {
            *out = footprint.of_pixel(camera, pixel, reflected);
        }
    }

    /// Writes down what is needed later.
    fn leave(&self, t: &Tiles, rows: &mut Rows) {
        for (from, (pixel, gathered)) in self.pixels.iter().zip(&self.gathered).enumerate() {
            let to = from / self.width * rows.width + self.corner[0] + from % self.width;
            rows.shown[to] = Shown::of(pixel, &self.reflected[from]);
            rows.glossy[to] = gathered.color;
            let diffuse = |(p, map): (&Pixel, &LightMap)| map.diffuse_radiance(&t.world.scene, &p.surface, p.wo);
            // These are black already, and few are anything else: pages that nothing is written to cost nothing.
            set(&mut rows.mirrored[to], self.mirrored[from]);
            set(&mut rows.emission[to], pixel.as_ref().map_or(self.behind[from], |p| p.emission));
            set(&mut rows.diffuse[to], pixel.as_ref().zip(t.lightmap).map_or(Rgb::ZERO, diffuse));
            let entry = |p: &Pixel| Entry {
                color: gathered.color,
                normal: p.normal,
                depth: p.depth,
                material: if p.alpha.is_some() { p.surface.material } else { NOT_GLOSSY },
                covariance: self.covariance[from],
                energy: gathered.energy,
            };
            rows.filter.set(to, pixel.as_ref().map(entry).as_ref(), t.filter);
        }
    }
}

/// Writes a colour over black.
fn set(black: &mut Rgb, color: Rgb) {
    if color != Rgb::ZERO {
        *black = color;
    }
}
