//! Antialiasing by coverage: pixels across which an edge runs are averaged over more rays, each of which takes its glossy radiance from the
//! sub-pixels at hand that show the same.
//!
//! *Ours*: over half of the method's squared error lies along the edges of reflectors and of what mirrors show, where a few rays a pixel
//! alias. More rays through all passes cure it, at a price that grows with their number; these are
//! asked only what they see, and only where it matters. Emission and the diffuse layer are the rays' own.

use crate::Result;
use crate::base::math::Rgb;
use crate::base::named::within;
use crate::base::ray::{Hit, Ray};
use crate::lightmap::LightMap;
use crate::scene::Camera;
use crate::transport::World;
use crate::transport::bvh::BEAM;
use crate::view::gbuffer::{GBuffer, Pixel, view_alpha};
use crate::view::mirror::{Reflected, mirror_hit};
use crate::view::mirror_light::mirror_light;
use glam::{Vec2, Vec3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::ops::Range;

/// Parameters of the antialiasing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CoverageParams {
    /// N x N rays a pixel where there is an edge; 0: none.
    pub rays: u32,
}

impl Default for CoverageParams {
    fn default() -> Self {
        Self { rays: 4 }
    }
}

impl CoverageParams {
    /// An error where a parameter is out of its range.
    pub fn validate(&self) -> Result<()> {
        within("coverage.rays", self.rays, 0..=64)
    }
}

// No measurement told values about these apart.
/// Least cosine between the normals of one surface.
pub(crate) const MIN_NORMAL_COS: f32 = 0.9;
/// How far from the other's plane a point of one surface may lie, as a fraction of its depth.
pub(crate) const DEPTH_TOLERANCE: f32 = 0.02;
/// Alpha up to which what a surface mirrors counts as an edge. (Twice the rays at 0.15, for nothing.)
pub(crate) const SHARP_ALPHA: f32 = 0.05;
/// Most that two reflected points of one surface differ, as a fraction of their distance.
pub(crate) const REFLECTED_TOLERANCE: f32 = 0.05;

/// What the passes have found at a view's sub-pixels.
pub struct SubPixels<'a> {
    /// The view.
    pub view: &'a GBuffer,
    /// Mirror hits.
    pub reflected: &'a [Reflected],
    /// Filtered glossy radiance.
    pub glossy: &'a [Rgb],
    /// Sub-pixels along a pixel's side.
    pub n: usize,
}

/// What a pixel along an edge shows.
#[derive(Debug, Clone, Copy, Default)]
pub struct Covered {
    /// LE.
    pub emission: Rgb,
    /// L(S|D)*DE.
    pub diffuse: Rgb,
    /// L(S|D)*S+E.
    pub glossy: Rgb,
}

/// What decides whether two rays see the same.
#[derive(Clone, Copy)]
struct Shown {
    p: Vec3,
    depth: f32,
    normal: Vec3,
    /// [`NOTHING_SEEN`] for the environment.
    material: u32,
    /// Negative where the surface has no glossy lobe.
    alpha: f32,
    reflected: Reflected,
}

/// [`Shown::material`] of what shows no surface.
const NOTHING_SEEN: u32 = u32::MAX;

impl Shown {
    fn of(pixel: &Option<Pixel>, reflected: &Reflected) -> Self {
        match pixel {
            Some(p) => Self {
                p: p.surface.p,
                depth: p.depth,
                normal: p.normal,
                material: p.surface.material,
                alpha: p.alpha.unwrap_or(-1.0),
                reflected: *reflected,
            },
            None => Self {
                p: Vec3::ZERO,
                depth: 0.0,
                normal: Vec3::ZERO,
                material: NOTHING_SEEN,
                alpha: -1.0,
                reflected: Reflected::NONE,
            },
        }
    }

    fn is_glossy(&self) -> bool {
        self.alpha >= 0.0
    }

    fn is_sharp(&self) -> bool {
        self.is_glossy() && self.alpha <= SHARP_ALPHA
    }

    /// Whether the two are on either side of an edge.
    fn differs(&self, other: &Self) -> bool {
        if self.material == NOTHING_SEEN || other.material == NOTHING_SEEN {
            return self.material != other.material;
        }
        !(self.same_surface(other) && self.same_reflected(&other.reflected))
    }

    fn same_surface(&self, other: &Self) -> bool {
        self.material == other.material
            && self.normal.dot(other.normal) > MIN_NORMAL_COS
            // Along a plane seen at a grazing angle depth changes quickly: its distance from the other's plane is what counts.
            && self.normal.dot(other.p - self.p).abs() < DEPTH_TOLERANCE * self.depth
    }

    /// Whether another mirror hit is the same as that from here; of no account where the surface is rough.
    fn same_reflected(&self, b: &Reflected) -> bool {
        if !self.is_sharp() {
            return true;
        }
        let a = &self.reflected;
        let reach = if a.is_sky() { 1.0 } else { a.point.distance(self.p) + self.depth };
        a.material == b.material && a.point.distance(b.point) < REFLECTED_TOLERANCE * reach
    }
}

/// Pixels across which an edge runs, by index, with their layers. `camera` is the view's at the frame's size; `mirrors` says that the
/// sub-pixels' glossy radiance lacks [`crate::view::mirror_light`]'s.
pub fn covered_pixels(
    world: &World,
    lightmap: Option<&LightMap>,
    mirrors: bool,
    camera: &Camera,
    sub: &SubPixels,
    params: &CoverageParams,
) -> Vec<(usize, Covered)> {
    let [width, height] = camera.size.map(|s| s as usize);
    if params.rays == 0 {
        return Vec::new();
    }
    let scene = Lit { world, lightmap, mirrors };
    let strip = |first: usize| {
        let rows = first..(first + ROWS).min(height);
        let shown = Strip::new(sub, rows.clone());
        let mut covered = Vec::new();
        for (x, y) in rows.flat_map(|y| (0..width).map(move |x| (x, y))) {
            let window = shown.window([x, y]);
            if has_edge(&shown, &window) {
                covered.push((y * width + x, scene.pixel(camera, params.rays * params.rays, [x, y], &shown, &window)));
            }
        }
        covered
    };
    (0..height.div_ceil(ROWS)).into_par_iter().flat_map_iter(|k| strip(k * ROWS)).collect()
}

/// Rows of a task.
const ROWS: usize = 8;

/// What the sub-pixels of some rows show, and of those next to them.
struct Strip<'a> {
    sub: &'a SubPixels<'a>,
    /// Sub-pixels in a row.
    width: usize,
    /// The first row of sub-pixels that is here.
    first: usize,
    shown: Vec<Shown>,
}

/// Columns and rows of sub-pixels.
type Window = [Range<usize>; 2];

impl<'a> Strip<'a> {
    fn new(sub: &'a SubPixels, rows: Range<usize>) -> Self {
        let [width, height] = sub.view.size();
        let around = (rows.start * sub.n).saturating_sub(1)..(rows.end * sub.n + 1).min(height);
        let all = around.start * width..around.end * width;
        let shown = sub.view.pixels[all.clone()].iter().zip(&sub.reflected[all]).map(|(p, r)| Shown::of(p, r)).collect();
        Self { sub, width, first: around.start, shown }
    }

    /// The sub-pixels of a pixel and those around it.
    fn window(&self, [x, y]: [usize; 2]) -> Window {
        let (n, [width, height]) = (self.sub.n, self.sub.view.size());
        let range = |p: usize, most: usize| (p * n).saturating_sub(1)..((p + 1) * n + 1).min(most);
        [range(x, width), range(y, height)]
    }

    /// A row of sub-pixels.
    fn row(&self, y: usize) -> &[Shown] {
        let start = (y - self.first) * self.width;
        &self.shown[start..start + self.width]
    }
}

pub(crate) const GOLDEN_RATIO: f32 = 0.618_034;

/// Point `k` of `n` in the unit square: a lattice of the golden ratio, whose points lie in as many columns and rows as there are points.
/// (Along a bar that is nearly upright, a grid of 4 x 4 has but four columns to tell its width by.)
fn lattice_point(k: u32, n: u32) -> Vec2 {
    Vec2::new((k as f32 + 0.5) / n as f32, (k as f32 * GOLDEN_RATIO + 0.5).fract())
}

/// A scene and its light.
struct Lit<'a> {
    world: &'a World,
    lightmap: Option<&'a LightMap>,
    mirrors: bool,
}

impl Lit<'_> {
    /// What a pixel shows along so many rays.
    fn pixel(&self, camera: &Camera, rays: u32, [x, y]: [usize; 2], shown: &Strip, window: &Window) -> Covered {
        let corner = Vec2::new(x as f32, y as f32);
        let mut sum = Covered::default();
        let place = |k: u32| corner + lattice_point(k, rays);
        for first in (0..rays).step_by(BEAM) {
            let count = (rays - first).min(BEAM as u32) as usize;
            let beam: [Ray; BEAM] = std::array::from_fn(|i| {
                let k = first + i.min(count - 1) as u32;
                camera.ray(place(k), Vec2::splat(0.5))
            });
            let hits = self.world.closest_of(&beam[..count]);
            for (i, (ray, hit)) in beam[..count].iter().zip(hits).enumerate() {
                let at = place(first + i as u32) * shown.sub.n as f32;
                let seen = self.along((ray, hit), shown, window, at);
                sum.emission += seen.emission;
                sum.diffuse += seen.diffuse;
                sum.glossy += seen.glossy;
            }
        }
        let scale = 1.0 / rays as f32;
        let glossy = (sum.glossy * scale).max(Rgb::ZERO);
        Covered { emission: sum.emission * scale, diffuse: sum.diffuse * scale, glossy }
    }

    /// What a ray through `at` (sub-pixels), whose first hit is known, shows.
    fn along(&self, (ray, hit): (&Ray, Option<Hit>), shown: &Strip, window: &Window, at: Vec2) -> Covered {
        let Self { world, lightmap, mirrors } = *self;
        let Some(surface) = world.seen_from(ray, hit) else {
            return Covered { emission: world.backdrop(ray.d), ..Covered::default() };
        };
        let wo = -ray.d;
        let emission = world.lights.emitted(&world.scene, &surface, wo);
        let diffuse = lightmap.map_or(Rgb::ZERO, |map| map.diffuse_radiance(&world.scene, &surface, wo));
        let Some(alpha) = view_alpha(world, &surface, wo) else {
            return Covered { emission, diffuse, glossy: Rgb::ZERO };
        };
        let (p, normal) = (surface.p, surface.facing_normal(wo));
        let (reflected, light) = match lightmap.filter(|_| mirrors && alpha == 0.0) {
            Some(map) => mirror_light(world, map, &surface, wo),
            None if alpha <= SHARP_ALPHA => (mirror_hit(world, &surface, wo), Rgb::ZERO),
            None => (Reflected::NONE, Rgb::ZERO),
        };
        let seen = Shown { p, normal, depth: surface.t, alpha, material: surface.material, reflected };
        Covered { emission, diffuse, glossy: light + glossy_of(shown, window, &seen, at) }
    }
}

/// Whether what lies in a window is not all the same.
fn has_edge(strip: &Strip, [columns, rows]: &Window) -> bool {
    let first = &strip.row(rows.start)[columns.start];
    rows.clone().any(|y| strip.row(y)[columns.clone()].iter().any(|other| first.differs(other)))
}

/// The glossy radiance of what a ray at `at` (sub-pixels) sees: that of the sub-pixels that show the same, the nearest most.
fn glossy_of(strip: &Strip, [columns, rows]: &Window, seen: &Shown, at: Vec2) -> Rgb {
    // Same surface and reflection; same surface; whatever is nearest.
    let mut best = [(Rgb::ZERO, 0.0f32); 3];
    for (x, y) in rows.clone().flat_map(|y| columns.clone().map(move |x| (x, y))) {
        let other = &strip.row(y)[x];
        if !other.is_glossy() {
            continue;
        }
        let glossy = strip.sub.glossy[y * strip.width + x];
        let weight = 1.0 / ((Vec2::new(x as f32, y as f32) + 0.5).distance_squared(at) + 0.1);
        let surface = seen.same_surface(other);
        let reflection = surface && seen.same_reflected(&other.reflected);
        for (k, counts) in [reflection, surface, true].into_iter().enumerate() {
            if counts {
                best[k].0 += glossy * weight;
                best[k].1 += weight;
            }
        }
    }
    best.iter().find(|(_, weight)| *weight > 0.0).map_or(Rgb::ZERO, |(sum, weight)| *sum / *weight)
}
