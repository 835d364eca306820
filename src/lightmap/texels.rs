//! What part of each texel the surface covers, triangle by triangle, and sample points spread over that part.
//!
//! *Ours*: rasterisation is conservative (exact clipping of every triangle against every texel that it touches),
//! so a texel is sampled where the surface is, never where its centre happens to be.

use super::Atlas;
use crate::scene::Geometry;
use glam::Vec2;
use rayon::prelude::*;

/// Smallest covered part of a texel that counts.
const MIN_AREA: f32 = 1e-5;

/// Part of a texel from which on it counts as covered by one triangle.
const WHOLE: f32 = 1.0 - 1e-5;

/// The covered texels of an atlas, chart by chart, each with the triangles that cover it.
#[derive(Debug, Clone, Default)]
pub struct Texels {
    /// Pixel of the atlas (row · width + column) of each texel.
    pub pixel: Vec<u32>,
    /// Chart of each texel.
    pub chart: Vec<u32>,
    /// First fragment of each texel, and the number of all.
    start: Vec<u32>,
    /// Triangle, and the part of the texel that it covers.
    fragments: Vec<(u32, f32)>,
}

/// A sample point: triangle, and barycentric weights of its second and third vertex.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Point {
    /// Triangle.
    pub triangle: u32,
    /// Weights of the second and third vertex.
    pub barycentric: Vec2,
}

impl Texels {
    /// Rasterises all charts.
    pub fn new(geometry: &Geometry, atlas: &Atlas) -> Self {
        let per_chart: Vec<Vec<(u32, u32, f32)>> = atlas
            .charts
            .par_iter()
            .map(|chart| {
                let mut list = Vec::new();
                for &t in &chart.triangles {
                    cover(geometry.corners(t).map(|p| chart.project(p)), atlas.size, &mut |pixel, area| {
                        list.push((pixel, t, area));
                    });
                }
                list.sort_by_key(|f| f.0);
                list
            })
            .collect();
        let mut texels = Self::default();
        for (chart, list) in per_chart.iter().enumerate() {
            for texel in list.chunk_by(|a, b| a.0 == b.0) {
                texels.pixel.push(texel[0].0);
                texels.chart.push(chart as u32);
                texels.start.push(texels.fragments.len() as u32);
                texels.fragments.extend(texel.iter().map(|f| (f.1, f.2)));
            }
        }
        texels.start.push(texels.fragments.len() as u32);
        texels
    }

    /// How many texels are covered.
    pub fn len(&self) -> usize {
        self.pixel.len()
    }

    /// Whether none is.
    pub fn is_empty(&self) -> bool {
        self.pixel.is_empty()
    }

    fn fragments_of(&self, texel: usize) -> &[(u32, f32)] {
        &self.fragments[self.start[texel] as usize..self.start[texel + 1] as usize]
    }

    /// The covered part of a texel, in (0, 1] (more where a chart folds below the texel's size).
    pub fn coverage(&self, texel: usize) -> f32 {
        self.fragments_of(texel).iter().map(|f| f.1).sum()
    }

    /// The point of texel `texel`'s covered part that `u` in [0, 1)² maps to, uniformly by area.
    pub fn point(&self, geometry: &Geometry, atlas: &Atlas, texel: usize, u: Vec2) -> Point {
        let fragments = self.fragments_of(texel);
        let mut x = u.x * self.coverage(texel);
        let mut chosen = fragments[fragments.len() - 1];
        for &f in fragments {
            if x < f.1 {
                chosen = f;
                break;
            }
            x -= f.1;
        }
        let (triangle, area) = chosen;
        let (corners, corner) = self.placed(geometry, atlas, texel, triangle);
        let polygon = Polygon::clip(corners.map(|c| c - corner));
        let p = polygon.point(Vec2::new((x / area).clamp(0.0, 1.0), u.y)) + corner;
        Point { triangle, barycentric: barycentric(&corners, p) }
    }

    /// A point of texel `texel`'s covered part, uniformly by area as [`Texels::point`], of which it is another map: most texels lie within one
    /// triangle, which this does not cut.
    pub fn random_point(&self, geometry: &Geometry, atlas: &Atlas, texel: usize, u: Vec2) -> Point {
        let &[(triangle, area)] = self.fragments_of(texel) else { return self.point(geometry, atlas, texel, u) };
        if area < WHOLE {
            return self.point(geometry, atlas, texel, u);
        }
        let (corners, corner) = self.placed(geometry, atlas, texel, triangle);
        Point { triangle, barycentric: barycentric(&corners, corner + u) }
    }

    /// A triangle's corners in the atlas, and that of a texel.
    fn placed(&self, geometry: &Geometry, atlas: &Atlas, texel: usize, triangle: u32) -> ([Vec2; 3], Vec2) {
        let (chart, pixel, width) = (&atlas.charts[self.chart[texel] as usize], self.pixel[texel], atlas.size[0]);
        let corner = Vec2::new((pixel % width) as f32, (pixel / width) as f32);
        (geometry.corners(triangle).map(|p| chart.project(p)), corner)
    }
}

/// Barycentric weights of the second and third corner at `p`, clamped to the triangle.
fn barycentric(corners: &[Vec2; 3], p: Vec2) -> Vec2 {
    let (b, c, d) = (corners[1] - corners[0], corners[2] - corners[0], p - corners[0]);
    let area = b.perp_dot(c);
    let weights = Vec2::new(d.perp_dot(c), b.perp_dot(d)) / area;
    if !weights.is_finite() {
        return Vec2::splat(1.0 / 3.0);
    }
    let w = weights.clamp(Vec2::ZERO, Vec2::ONE);
    w / (w.x + w.y).max(1.0)
}

/// Calls `emit` with every texel that a triangle touches and the part of it that is covered.
fn cover(corners: [Vec2; 3], size: [u32; 2], emit: &mut dyn FnMut(u32, f32)) {
    let lo = corners[0].min(corners[1]).min(corners[2]).floor().max(Vec2::ZERO);
    let hi = corners[0].max(corners[1]).max(corners[2]).ceil();
    for y in lo.y as u32..(hi.y as u32).max(lo.y as u32 + 1).min(size[1]) {
        for x in lo.x as u32..(hi.x as u32).max(lo.x as u32 + 1).min(size[0]) {
            let corner = Vec2::new(x as f32, y as f32);
            let area = Polygon::clip(corners.map(|c| c - corner)).area();
            if area > MIN_AREA {
                emit(y * size[0] + x, area);
            }
        }
    }
}

/// A triangle clipped to the unit square: at most 7 corners.
#[derive(Clone, Copy)]
struct Polygon {
    points: [Vec2; 8],
    count: usize,
}

impl Polygon {
    fn clip(triangle: [Vec2; 3]) -> Self {
        let mut polygon = Self { points: [Vec2::ZERO; 8], count: 3 };
        polygon.points[..3].copy_from_slice(&triangle);
        for axis in 0..2 {
            polygon = polygon.cut(|p| p[axis]);
            polygon = polygon.cut(|p| 1.0 - p[axis]);
        }
        polygon
    }

    /// The part where `inside` is not negative (Sutherland-Hodgman).
    fn cut(&self, inside: impl Fn(Vec2) -> f32) -> Self {
        let mut out = Self { points: [Vec2::ZERO; 8], count: 0 };
        let mut push = |p: Vec2| {
            if out.count < 8 {
                out.points[out.count] = p;
                out.count += 1;
            }
        };
        for i in 0..self.count {
            let (a, b) = (self.points[i], self.points[(i + 1) % self.count]);
            let (da, db) = (inside(a), inside(b));
            if da >= 0.0 {
                push(a);
            }
            if (da >= 0.0) != (db >= 0.0) {
                push(a + (b - a) * (da / (da - db)));
            }
        }
        out
    }

    fn fan_area(&self, i: usize) -> f32 {
        0.5 * (self.points[i + 1] - self.points[0]).perp_dot(self.points[i + 2] - self.points[0]).abs()
    }

    fn area(&self) -> f32 {
        (0..self.count.saturating_sub(2)).map(|i| self.fan_area(i)).sum()
    }

    /// Uniform by area; the fan's triangles in turn along `u.x`.
    fn point(&self, u: Vec2) -> Vec2 {
        let mut x = u.x * self.area();
        let last = self.count.saturating_sub(3);
        for i in 0..=last {
            let area = self.fan_area(i);
            if x < area || i == last {
                let r = if area > 0.0 { (x / area).clamp(0.0, 1.0).sqrt() } else { 0.0 };
                let (a, b, c) = (self.points[0], self.points[i + 1], self.points[i + 2]);
                return a * (1.0 - r) + (b * (1.0 - u.y) + c * u.y) * r;
            }
            x -= area;
        }
        self.points[0]
    }
}
