//! What probes see of a scene: its visibility atlas ([Wang et al. 2019] §3.2, Figures 4 and 5).
//!
//! *Paper*: each probe's octahedral map marks the texels of the scene's texture atlas that it sees; the union over all probes should be the
//! whole atlas. *Ours*: the atlas is a coarse light map's, and a ray from every texel to the probe says the same without gaps between a
//! map's directions. A texel has two sides, as in the light map: the upper one of a thin table is seen by other probes than the lower one.
//! It counts by the area that its surface covers, as far as it lies in the box of what cameras see ([`super::clip`]). Sides that nothing in the free space sees (backs of walls, insides of objects) do not count.

use super::clip::{barycentric, clip};
use super::skeleton::space::Space;
use crate::Result;
use crate::base::math::{Basis, hash_words, unit};
use crate::base::ray::{Hit, Ray};
use crate::lightmap::chart::Chart;
use crate::lightmap::texels::Texels;
use crate::lightmap::{Atlas, AtlasParams};
use crate::material::Surface;
use crate::scene::Geometry;
use crate::transport::World;
use glam::{Vec2, Vec3};
use rayon::prelude::*;
use std::f32::consts::TAU;

/// Free voxels that a side is tried against first.
const TARGETS: usize = 24;
/// Directions from a side that are tried next.
const DIRECTIONS: u32 = 48;
/// Cameras of a path that say which sides are seen.
const CAMERAS: usize = 16;
/// What a side that no camera sees counts: only reflections of what they do see show it.
const UNSEEN_WEIGHT: f32 = 0.1;
/// How much of its length a ray leaves out before the probe.
const GAP: f32 = 1e-4;

/// What no probe sees, in pictures: a colour that [`heat`](crate::io::picture::heat) comes nowhere near.
pub const UNSEEN: [u8; 3] = [230, 0, 200];

/// One side of a texel of the atlas.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Side {
    /// A point of its surface, metres.
    pub p: Vec3,
    /// Unit geometric normal on this side.
    pub n: Vec3,
    /// Area, m².
    pub area: f32,
    /// What it counts where probes are chosen by how well they see it, m²: its area, or less where no camera sees it.
    pub weight: f32,
    /// Which of [`Sides::surface`] it is a side of.
    pub texel: u32,
    /// How far along `n` rays start, metres.
    offset: f32,
    /// A point of the free space that sees it.
    pub witness: Vec3,
}

/// The sides that the free space sees, in the atlas's order.
#[derive(Debug, Clone, Default)]
pub struct Sides {
    /// The sides.
    pub list: Vec<Side>,
    /// Points on all surfaces and their normals, seen or not.
    pub surface: Vec<(Vec3, Vec3)>,
    /// Pixel of the atlas (row · width + column) of each of these.
    pub pixel: Vec<u32>,
    /// Width and height of the atlas, pixels.
    pub atlas: [u32; 2],
    /// Area of all sides together, m².
    pub area: f64,
}

/// Which sides a probe sees, a bit each.
pub type Row = Vec<u64>;

impl Side {
    /// Cosine between the side's normal and the way to a probe at `probe`, and its length in metres, where nothing is between them.
    pub fn seen_from(&self, world: &World, probe: Vec3) -> Option<(f32, f32)> {
        let way = probe - self.p;
        if way.dot(self.n) <= 0.0 {
            return None;
        }
        let o = self.p + self.n * self.offset;
        let d = (probe - o).try_normalize()?;
        let ray = Ray { t_max: (probe - o).length() * (1.0 - GAP), ..Ray::new(o, d) };
        (d.dot(self.n) > 0.0 && !world.occluded(&ray)).then(|| (d.dot(self.n), way.length()))
    }
}

impl Sides {
    /// About `texels` texels of the opaque surfaces in the box `within` (lower and upper corner), and those of their sides that the free
    /// space sees.
    pub fn new(world: &World, space: &Space, within: (Vec3, Vec3), texels: u32) -> Result<Self> {
        let (points, atlas) = surface_points(world, within, texels)?;
        let free: Vec<usize> = (0..space.free.len()).filter(|&i| space.is_open(space.field.voxels.centre(i))).collect();
        let targets: Vec<Vec3> = (0..TARGETS.min(free.len()))
            .map(|k| space.field.voxels.centre(free[(2 * k + 1) * free.len() / (2 * TARGETS)]))
            .collect();
        let sides_of = |(i, SurfacePoint { surface, area, .. }): (usize, &SurfacePoint)| {
            let side = |n| Side {
                p: surface.p,
                n,
                area: *area,
                weight: *area,
                texel: i as u32,
                offset: surface.offset,
                witness: Vec3::ZERO,
            };
            let seen = |side: Side| Some(Side { witness: witness(world, space, &side, &targets)?, ..side });
            [surface.ng, -surface.ng].map(|n| seen(side(n)))
        };
        let list: Vec<Side> =
            points.par_iter().enumerate().map(sides_of).collect::<Vec<_>>().into_iter().flatten().flatten().collect();
        let area = list.iter().map(|s| f64::from(s.area)).sum();
        let surface = points.iter().map(|p| (p.surface.p, p.surface.ng)).collect();
        Ok(Self { list, surface, pixel: points.iter().map(|p| p.pixel).collect(), atlas, area })
    }

    /// What a probe at `probe` sees.
    pub fn row(&self, world: &World, probe: Vec3) -> Row {
        let mut row = self.no_row();
        for (i, side) in self.list.iter().enumerate() {
            if side.seen_from(world, probe).is_some() {
                row[i / 64] |= 1 << (i % 64);
            }
        }
        row
    }

    /// What each of several probes sees.
    pub fn rows(&self, world: &World, probes: &[Vec3]) -> Vec<Row> {
        probes.par_iter().map(|&p| self.row(world, p)).collect()
    }

    /// Lets sides that none of `cameras` sees count less.
    pub fn weigh(&mut self, world: &World, cameras: &[Vec3]) {
        let step = cameras.len().div_ceil(CAMERAS).max(1);
        self.list.par_iter_mut().for_each(|side| {
            let is_seen = cameras.iter().step_by(step).any(|&camera| side.seen_from(world, camera).is_some());
            side.weight = if is_seen { side.area } else { UNSEEN_WEIGHT * side.area };
        });
    }

    /// Nothing seen.
    pub fn no_row(&self) -> Row {
        vec![0; self.list.len().div_ceil(64)]
    }

    /// Share of the sides' area that is in a row.
    pub fn share(&self, row: &[u64]) -> f64 {
        self.area_of(row.iter().copied()) / self.area.max(f64::MIN_POSITIVE)
    }

    /// Area of the sides whose bits are set, m², summed in their order.
    pub fn area_of(&self, words: impl Iterator<Item = u64>) -> f64 {
        bits(words).map(|i| f64::from(self.list[i].area)).sum()
    }

    /// How many of the probes see each side.
    pub fn times_seen(&self, rows: &[Row]) -> Vec<u32> {
        let mut times = vec![0; self.list.len()];
        rows.iter().flat_map(|row| bits(row.iter().copied())).for_each(|i| times[i] += 1);
        times
    }
}

/// Positions of the bits that are set, ascending.
pub fn bits(words: impl Iterator<Item = u64>) -> impl Iterator<Item = usize> {
    words.enumerate().flat_map(|(k, mut word)| {
        std::iter::from_fn(move || {
            let bit = (word != 0).then(|| word.trailing_zeros() as usize)?;
            word &= word - 1;
            Some(64 * k + bit)
        })
    })
}

/// Which triangles the probe stages see: those of opaque materials.
pub fn is_opaque(world: &World, triangle: u32) -> bool {
    let material = world.scene.geometry.object(triangle).material as usize;
    world.scene.materials.get(material).is_none_or(|m| !m.bsdf.is_transmissive())
}

/// How many of the probes, up to `most`, see a surface on the side of its unit normal `n`.
pub fn seen_by(world: &World, surface: &Surface, n: Vec3, probes: &[Vec3], most: usize) -> usize {
    let sees = |probe: &&Vec3| n.dot(**probe - surface.p) > 0.0 && !world.occluded(&surface.spawn_to(**probe));
    probes.iter().filter(sees).take(most).count()
}

/// A point of a texel of the atlas.
struct SurfacePoint {
    surface: Surface,
    /// Area that the texel covers, m².
    area: f32,
    pixel: u32,
}

/// A point of each texel of a coarse light map of what lies in a box, and the map's size. Where the scene has many more charts than texels
/// are asked for, points are drawn evenly over their areas.
fn surface_points(world: &World, (lower, upper): (Vec3, Vec3), texels: u32) -> Result<(Vec<SurfacePoint>, [u32; 2])> {
    let clipped = clip(&world.scene.geometry, &|t| is_opaque(world, t), lower, upper);
    let geometry = &clipped.geometry;
    let keep = |object: usize| !geometry.objects[object].triangles.is_empty();
    let atlas = Atlas::build(geometry, &keep, &AtlasParams { texel: None, budget: texels })?;
    let all = Texels::new(geometry, &atlas);
    let areas = areas(geometry, &atlas, &all);
    let surface = |(i, area): (usize, f32)| {
        // Anywhere in the texel: what is regular falls on edges where surfaces meet.
        let u = Vec2::new(unit(hash_words(&[all.pixel[i], 0])), unit(hash_words(&[all.pixel[i], 1])));
        let point = all.point(geometry, &atlas, i, u);
        let ([a, b, c], [u, v]) = (geometry.corners(point.triangle), point.barycentric.to_array());
        let triangle = clipped.source[point.triangle as usize];
        let b = barycentric(&world.scene.geometry.corners(triangle), a * (1.0 - u - v) + b * u + c * v);
        SurfacePoint { surface: world.surface(&Hit { t: 0.0, triangle, u: b.x, v: b.y }), area, pixel: all.pixel[i] }
    };
    let chosen: Vec<(usize, f32)> =
        if all.len() > 2 * texels as usize { drawn(&areas, texels) } else { areas.into_iter().enumerate().collect() };
    let points = chosen.into_par_iter().map(surface).collect::<Vec<_>>();
    let is_sound = |p: &SurfacePoint| p.surface.p.is_finite() && p.surface.ng.is_normalized();
    Ok((points.into_iter().filter(is_sound).collect(), atlas.size))
}

/// What of its chart's area is each texel's, m²: charts are stretched to whole texels, so that these differ in size.
fn areas(geometry: &Geometry, atlas: &Atlas, all: &Texels) -> Vec<f32> {
    let of_chart = |c: &Chart| c.triangles.iter().map(|&t| 0.5 * f64::from(geometry.area_normal(t).length())).sum::<f64>();
    let mut scale: Vec<f64> = atlas.charts.iter().map(of_chart).collect();
    let mut covered = vec![0.0; scale.len()];
    (0..all.len()).for_each(|i| covered[all.chart[i] as usize] += f64::from(all.coverage(i)));
    scale.iter_mut().zip(covered).for_each(|(area, covered)| *area /= covered.max(f64::MIN_POSITIVE));
    (0..all.len()).map(|i| (f64::from(all.coverage(i)) * scale[all.chart[i] as usize]) as f32).collect()
}

/// `count` indices, each after an equal part of the sum of all areas, with that part.
fn drawn(areas: &[f32], count: u32) -> Vec<(usize, f32)> {
    let part = areas.iter().map(|&a| f64::from(a)).sum::<f64>() / f64::from(count.max(1));
    let (mut sum, mut next) = (0.0, 0.5 * part);
    let mut found: Vec<(usize, f32)> = Vec::new();
    for (i, &area) in areas.iter().enumerate() {
        sum += f64::from(area);
        let mut times = 0.0;
        while next < sum && part > 0.0 {
            (times, next) = (times + part, next + part);
        }
        if times > 0.0 {
            found.push((i, times as f32));
        }
    }
    found
}

/// A point of the free space that sees a side, as far from surfaces as one finds there.
fn witness(world: &World, space: &Space, side: &Side, targets: &[Vec3]) -> Option<Vec3> {
    let towards = |d: Vec3| {
        let o = side.p + side.n * side.offset;
        let end = world.closest(&Ray::new(o, d)).map_or(f32::INFINITY, |hit| hit.t);
        along(space, o, d, end)
    };
    if let Some(found) = towards(side.n) {
        return Some(found);
    }
    if let Some(&seen) = targets.iter().find(|&&t| side.seen_from(world, t).is_some()) {
        return Some(seen);
    }
    let frame = Basis::from_normal(side.n);
    let turn = unit(hash_words(&[side.p.x.to_bits(), side.p.y.to_bits(), side.p.z.to_bits()]));
    (0..DIRECTIONS).find_map(|i| {
        let z = 1.0 - (i as f32 + 0.5) / DIRECTIONS as f32;
        let (sin, cos) = ((i as f32 * 0.618_034 + turn) * TAU).sin_cos();
        let r = (1.0 - z * z).max(0.0).sqrt();
        towards(frame.to_world(Vec3::new(r * cos, r * sin, z)))
    })
}

/// The point of a free stretch of a ray, not beyond `end`, that is farthest from surfaces.
fn along(space: &Space, o: Vec3, d: Vec3, end: f32) -> Option<Vec3> {
    let voxels = &space.field.voxels;
    let (a, b) = ((voxels.lower - o) / d, (voxels.upper() - o) / d);
    let pick = |v: Vec3, none: f32| Vec3::select(v.is_nan_mask(), Vec3::splat(none), v);
    let start = pick(a.min(b), f32::NEG_INFINITY).max_element().max(0.0);
    let end = pick(a.max(b), f32::INFINITY).min_element().min(end);
    let step = 0.5 * voxels.edge;
    let mut best: Option<(f32, Vec3)> = None;
    let count = ((end - start) / step).clamp(0.0, 4096.0) as u32;
    for k in 0..count {
        let p = o + d * (start + (k as f32 + 0.5) * step);
        if space.is_open(p) {
            let distance = space.field.at(p);
            if best.is_none_or(|(most, _)| distance > most) {
                best = Some((distance, p));
            }
        }
    }
    best.map(|(_, p)| p)
}
