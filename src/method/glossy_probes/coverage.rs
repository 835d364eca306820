//! Antialiasing by coverage: pixels across which an edge runs are averaged over more rays, each of which takes its glossy radiance from the
//! sub-pixels at hand that show the same.
//!
//! *Ours*: over half of the method's squared error lies along the edges of reflectors and of what mirrors show, where a few rays a pixel
//! alias. More rays through all passes cure it, at a price that grows with their number; these are
//! asked only what they see, and only where it matters. Emission and the diffuse layer are the rays' own.

use crate::Result;
use crate::base::math::Rgb;
use crate::base::named::within;
use crate::base::ray::Ray;
use crate::lightmap::LightMap;
use crate::scene::Camera;
use crate::transport::World;
use crate::view::gbuffer::{GBuffer, Pixel, view_alpha};
use crate::view::mirror::{Reflected, facing_normal, mirror_hit};
use crate::view::mirror_light::mirror_light;
use glam::{Vec2, Vec3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

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
struct Shown {
    p: Vec3,
    normal: Vec3,
    depth: f32,
    alpha: Option<f32>,
    material: u32,
}

impl Shown {
    fn of(p: &Pixel) -> Self {
        let Pixel { surface, normal, depth, alpha, .. } = *p;
        Self { p: surface.p, normal, depth, alpha, material: surface.material }
    }

    fn is_sharp(&self) -> bool {
        self.alpha.is_some_and(|alpha| alpha <= SHARP_ALPHA)
    }

    fn same_surface(&self, other: &Self) -> bool {
        self.material == other.material
            && self.normal.dot(other.normal) > MIN_NORMAL_COS
            // Along a plane seen at a grazing angle depth changes quickly: its distance from the other's plane is what counts.
            && self.normal.dot(other.p - self.p).abs() < DEPTH_TOLERANCE * self.depth
    }

    /// Whether two mirror hits, `a` from here, are the same; of no account where the surface is rough.
    fn same_reflected(&self, a: &Reflected, b: &Reflected) -> bool {
        let reach = if a.is_sky() { 1.0 } else { a.point.distance(self.p) + self.depth };
        !self.is_sharp() || (a.material == b.material && a.point.distance(b.point) < REFLECTED_TOLERANCE * reach)
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
    let scene = Lit { world, lightmap, mirrors };
    let of = |i: usize| {
        let window = window(sub, [i % width, i / width]);
        if params.rays == 0 || !has_edge(sub, &window) {
            return None;
        }
        let corner = Vec2::new((i % width) as f32, (i / width) as f32);
        let rays = params.rays * params.rays;
        let mut sum = Covered::default();
        for k in 0..rays {
            let at = corner + lattice_point(k, rays);
            let seen = scene.along(&camera.ray(at, Vec2::splat(0.5)), sub, &window, at * sub.n as f32);
            sum.emission += seen.emission;
            sum.diffuse += seen.diffuse;
            sum.glossy += seen.glossy;
        }
        let scale = 1.0 / rays as f32;
        let glossy = (sum.glossy * scale).max(Rgb::ZERO);
        Some((i, Covered { emission: sum.emission * scale, diffuse: sum.diffuse * scale, glossy }))
    };
    (0..width * height).into_par_iter().with_min_len(width).filter_map(of).collect()
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
    /// What a ray through `at` (sub-pixels) shows.
    fn along(&self, ray: &Ray, sub: &SubPixels, window: &[usize], at: Vec2) -> Covered {
        let Self { world, lightmap, mirrors } = *self;
        let Some(surface) = world.seen(ray) else {
            return Covered { emission: world.backdrop(ray.d), ..Covered::default() };
        };
        let wo = -ray.d;
        let emission = world.lights.emitted(&world.scene, &surface, wo);
        let diffuse = lightmap.map_or(Rgb::ZERO, |map| map.diffuse_radiance(&world.scene, &surface, wo));
        let Some(alpha) = view_alpha(world, &surface, wo) else {
            return Covered { emission, diffuse, glossy: Rgb::ZERO };
        };
        let (p, normal) = (surface.p, facing_normal(&surface, wo));
        let seen = Shown { p, normal, depth: surface.t, alpha: Some(alpha), material: surface.material };
        let (mirrored, light) = match lightmap.filter(|_| mirrors && alpha == 0.0) {
            Some(map) => mirror_light(world, map, &surface, wo),
            None if seen.is_sharp() => (mirror_hit(world, &surface, wo), Rgb::ZERO),
            None => (Reflected::NONE, Rgb::ZERO),
        };
        Covered { emission, diffuse, glossy: light + glossy_of(sub, window, &seen, &mirrored, at) }
    }
}

/// The sub-pixels of a pixel and those around it.
fn window(sub: &SubPixels, [x, y]: [usize; 2]) -> Vec<usize> {
    let [width, height] = sub.view.size();
    let range = |p: usize, most: usize| (p * sub.n).saturating_sub(1)..((p + 1) * sub.n + 1).min(most);
    range(y, height).flat_map(|y| range(x, width).map(move |x| y * width + x)).collect()
}

fn has_edge(sub: &SubPixels, window: &[usize]) -> bool {
    let seen = |i: usize| sub.view.pixels[i].as_ref().map(Shown::of);
    let Some((&first, rest)) = window.split_first() else { return false };
    let (a, mirrored) = (seen(first), &sub.reflected[first]);
    rest.iter().any(|&i| match (&a, &seen(i)) {
        (None, None) => false,
        (Some(a), Some(b)) => !(a.same_surface(b) && a.same_reflected(mirrored, &sub.reflected[i])),
        _ => true,
    })
}

/// The glossy radiance of what a ray at `at` (sub-pixels) sees: that of the sub-pixels that show the same, the nearest most.
fn glossy_of(sub: &SubPixels, window: &[usize], seen: &Shown, mirrored: &Reflected, at: Vec2) -> Rgb {
    let width = sub.view.size()[0];
    // Same surface and reflection; same surface; whatever is nearest.
    let mut best = [(Rgb::ZERO, 0.0f32); 3];
    for &i in window {
        let Some(other) = sub.view.pixels[i].as_ref().filter(|p| p.alpha.is_some()) else { continue };
        let centre = Vec2::new((i % width) as f32, (i / width) as f32) + 0.5;
        let weight = 1.0 / (centre.distance_squared(at) + 0.1);
        let surface = seen.same_surface(&Shown::of(other));
        let reflection = surface && seen.same_reflected(mirrored, &sub.reflected[i]);
        for (k, counts) in [reflection, surface, true].into_iter().enumerate() {
            if counts {
                best[k].0 += sub.glossy[i] * weight;
                best[k].1 += weight;
            }
        }
    }
    best.iter().find(|(_, weight)| *weight > 0.0).map_or(Rgb::ZERO, |(sum, weight)| *sum / *weight)
}
