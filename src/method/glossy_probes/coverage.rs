//! Antialiasing by coverage: pixels across which an edge runs are averaged over more rays, each of which takes its glossy radiance from the
//! sub-pixels at hand that show the same.
//!
//! *Ours*: over half of the method's squared error lies along the edges of reflectors and of what mirrors show, where a few rays a pixel
//! alias. More rays through all passes cure it, at a price that grows with their number; these are
//! asked only what they see, and only where it matters. Emission and the diffuse layer are the rays' own.

use super::shown::Shown;
use crate::Result;
use crate::base::math::Rgb;
use crate::base::named::within;
use crate::base::ray::{Hit, Ray};
use crate::lightmap::LightMap;
use crate::scene::Camera;
use crate::transport::World;
use crate::transport::bvh::BEAM;
use crate::view::gbuffer::view_alpha;
use crate::view::mirror::{Reflected, mirror_hit};
use crate::view::mirror_light::mirror_light;
use glam::Vec2;
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

/// What the passes have found at a view's sub-pixels.
pub struct SubPixels<'a> {
    /// What they show, rows from the top.
    pub shown: &'a [Shown],
    /// Filtered glossy radiance.
    pub glossy: &'a [Rgb],
    /// Sub-pixels in a row, and rows.
    pub size: [usize; 2],
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
        let (mut covered, mut around) = (Vec::new(), Vec::new());
        for (x, y) in rows.flat_map(|y| (0..width).map(move |x| (x, y))) {
            let window = sub.window([x, y]);
            if has_edge(sub, &window) {
                around.clear();
                around.extend(sub.glossy_of(&window));
                let place = |k: u32, rays: u32| Vec2::new(x as f32, y as f32) + lattice_point(k, rays);
                covered.push((y * width + x, scene.pixel(camera, params.rays * params.rays, place, (&around, sub.n))));
            }
        }
        covered
    };
    (0..height.div_ceil(ROWS)).into_par_iter().flat_map_iter(|k| strip(k * ROWS)).collect()
}

/// Rows of a task.
const ROWS: usize = 8;

/// Columns and rows of sub-pixels.
type Window = [Range<usize>; 2];

impl SubPixels<'_> {
    /// The sub-pixels of a pixel and those around it.
    fn window(&self, [x, y]: [usize; 2]) -> Window {
        let (n, [width, height]) = (self.n, self.size);
        let range = |p: usize, most: usize| (p * n).saturating_sub(1)..((p + 1) * n + 1).min(most);
        [range(x, width), range(y, height)]
    }

    /// Those of a window that are glossy.
    fn glossy_of(&self, [columns, rows]: &Window) -> impl Iterator<Item = Near> {
        let all = rows.clone().flat_map(|y| columns.clone().map(move |x| [x, y])).map(|[x, y]| (x, y, self.row(y)[x]));
        all.filter(|(.., shown)| shown.is_glossy()).map(|(x, y, shown)| Near {
            shown,
            glossy: self.glossy[y * self.size[0] + x],
            centre: Vec2::new(x as f32, y as f32) + 0.5,
        })
    }

    /// A row of sub-pixels.
    fn row(&self, y: usize) -> &[Shown] {
        &self.shown[y * self.size[0]..(y + 1) * self.size[0]]
    }
}

pub(crate) const GOLDEN_RATIO: f32 = 0.618_034;

/// Point `k` of `n` in the unit square: a lattice of the golden ratio, whose points lie in as many columns and rows as there are points.
/// (Along a bar that is nearly upright, a grid of 4 x 4 has but four columns to tell its width by.)
fn lattice_point(k: u32, n: u32) -> Vec2 {
    Vec2::new((k as f32 + 0.5) / n as f32, (k as f32 * GOLDEN_RATIO + 0.5).fract())
}

/// A glossy sub-pixel at hand.
struct Near {
    shown: Shown,
    /// Its filtered glossy radiance.
    glossy: Rgb,
    /// Sub-pixels.
    centre: Vec2,
}

/// A scene and its light.
struct Lit<'a> {
    world: &'a World,
    lightmap: Option<&'a LightMap>,
    mirrors: bool,
}

impl Lit<'_> {
    /// What a pixel shows along so many rays, whose places in the frame are told. Its sub-pixels, n along a side, and those around it that are
    /// glossy are given.
    fn pixel(&self, camera: &Camera, rays: u32, place: impl Fn(u32, u32) -> Vec2, (around, n): (&[Near], usize)) -> Covered {
        let (mut sum, focal_px) = (Covered::default(), camera.focal_px());
        for first in (0..rays).step_by(BEAM) {
            let count = (rays - first).min(BEAM as u32) as usize;
            let beam: [Ray; BEAM] = std::array::from_fn(|i| {
                let k = first + i.min(count - 1) as u32;
                camera.ray_of(focal_px, place(k, rays), Vec2::splat(0.5))
            });
            let hits = self.world.closest_of(&beam[..count]);
            for (i, (ray, hit)) in beam[..count].iter().zip(hits).enumerate() {
                let at = place(first + i as u32, rays) * n as f32;
                let seen = self.along((ray, hit), around, at);
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
    fn along(&self, (ray, hit): (&Ray, Option<Hit>), around: &[Near], at: Vec2) -> Covered {
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
            Some(map) => {
                let (reflected, light) = mirror_light(world, map, &surface, wo);
                (Some(reflected), light)
            }
            None => (None, Rgb::ZERO),
        };
        let seen = Shown { p, normal, depth: surface.t, alpha, material: surface.material, reflected: Reflected::NONE };
        let mirror = || reflected.unwrap_or_else(|| mirror_hit(world, &surface, wo));
        Covered { emission, diffuse, glossy: light + glossy_of(around, seen, mirror, at) }
    }
}

/// Whether what lies in a window is not all the same.
fn has_edge(sub: &SubPixels, [columns, rows]: &Window) -> bool {
    let first = &sub.row(rows.start)[columns.start];
    rows.clone().any(|y| sub.row(y)[columns.clone()].iter().any(|other| first.differs(other)))
}

/// The glossy radiance of what a ray at `at` (sub-pixels) sees: that of the sub-pixels that show the same, the nearest most. What it mirrors is
/// asked for where that counts.
fn glossy_of(around: &[Near], mut seen: Shown, mirror: impl Fn() -> Reflected, at: Vec2) -> Rgb {
    // Same surface and reflection; same surface; whatever is nearest.
    let mut best = [(Rgb::ZERO, 0.0f32); 3];
    let mut is_known = !seen.is_sharp();
    for Near { shown: other, glossy, centre } in around {
        let weight = 1.0 / (centre.distance_squared(at) + 0.1);
        let surface = seen.same_surface(other);
        if surface && !is_known {
            (seen.reflected, is_known) = (mirror(), true);
        }
        let reflection = surface && seen.same_reflected(&other.reflected);
        for (k, counts) in [reflection, surface, true].into_iter().enumerate() {
            if counts {
                best[k].0 += *glossy * weight;
                best[k].1 += weight;
            }
        }
    }
    best.iter().find(|(_, weight)| *weight > 0.0).map_or(Rgb::ZERO, |(sum, weight)| *sum / *weight)
}
