//! Where shapes have their light: in the map's own atlas, or on pages, textures for second coordinates that the scene came with.
//!
//! Coordinates are a light map's layout where all of a shape's triangles lie in [0, 1]², none is flattened, and no two overlap. Shapes that
//! overlap nothing of a page share it, as programs pack several objects into one square.

use crate::lightmap::LightMap;
use crate::scene::Geometry;
use glam::{DVec2, Vec2};
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Most pages: there are scenes of a million instances, each of which would want one.
const MOST_PAGES: usize = 1024;
/// Least and most texels along a page's edge.
const LEAST: usize = 64;
const MOST: usize = 4096;
/// A page that is covered less gets no more texels for it.
const LEAST_COVERED: f64 = 1.0 / 32.0;
/// How far beyond [0, 1] coordinates may lie.
const SLACK: f32 = 1e-3;
/// Cells along an edge of the grids in which overlaps are looked for.
const GRID: usize = 512;
/// The share of cells that may be taken twice, and of a surface that may be flattened.
const LEEWAY: f64 = 0.005;
/// The density of texels, relative to the mean, below which a triangle is flattened.
const FLATTENED: f64 = 1e-4;

/// Where a shape has its light.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Place {
    /// It has none: there is no map, or nothing of the shape in it.
    Nowhere,
    /// In the map's atlas.
    Atlas,
    /// On a page.
    Page(usize),
}

/// The places of all shapes.
#[derive(Default)]
pub struct Layout {
    /// One a shape.
    pub places: Vec<Place>,
    /// Textures of their own.
    pub pages: Vec<Page>,
}

/// A texture that shapes share.
pub struct Page {
    /// The shapes.
    pub objects: Vec<usize>,
    /// A bit a cell of the grid.
    taken: Vec<u64>,
    /// Of the shapes in the map's atlas.
    texels: f64,
    /// Of the page, at most 1.
    covered: f64,
}

impl Layout {
    /// Finds the shapes' places; `warnings` say which of their own coordinates cannot be used.
    pub fn of(geometry: &Geometry, map: Option<&LightMap>, warnings: &mut Vec<String>) -> Self {
        let shapes = 0..geometry.objects.len();
        let Some(map) = map else {
            return Self { places: shapes.map(|_| Place::Nowhere).collect(), pages: Vec::new() };
        };
        let is_lit = |object: usize| geometry.objects[object].triangles.clone().any(|t| map.places(t).is_some());
        let found: Vec<_> = shapes.into_par_iter().map(|object| is_lit(object).then(|| is_laid_out(geometry, object))).collect();
        let mut layout = Self::default();
        let mut odd: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
        for (object, found) in found.into_iter().enumerate() {
            let page = match found {
                None => {
                    layout.places.push(Place::Nowhere);
                    continue;
                }
                Some(Ok(false)) => Ok(None),
                Some(Ok(true)) => layout.page(geometry, map, object).map(Some),
                Some(Err(why)) => Err(why),
            };
            if let Err(why) = page {
                odd.entry(why).or_default().push(&geometry.objects[object].name);
            }
            layout.places.push(page.ok().flatten().map_or(Place::Atlas, Place::Page));
        }
        warnings.extend(odd.iter().map(|(why, names)| {
            let others = match names.len() {
                1 => String::new(),
                n => format!(" and {} more", n - 1),
            };
            format!(
                "the second texture coordinates of \"{}\"{others} {why}: no layout for a light map, whose own is taken",
                names[0]
            )
        }));
        layout
    }

    /// Puts a shape on the first page where it overlaps nothing.
    fn page(&mut self, geometry: &Geometry, map: &LightMap, object: usize) -> Result<usize, &'static str> {
        let mut mine = Vec::new();
        let (mut texels, mut covered) = (0.0, 0.0);
        let size = Vec2::new(map.size[0] as f32, map.size[1] as f32);
        for triangle in geometry.objects[object].triangles.clone() {
            let Some(corners) = geometry.light_corners(triangle) else { continue };
            covered += area(&corners);
            texels += map.places(triangle).map_or(0.0, |places| area(&places.map(|p| p * size)));
            let before = mine.len();
            let on_grid = corners.map(|p| p.as_dvec2() * GRID as f64);
            cells(on_grid, &mut |cell| mine.push(cell));
            if mine.len() == before {
                // Too small for a cell's middle: it takes the one that its own lies in.
                let [x, y] = (on_grid.iter().sum::<DVec2>() / 3.0).to_array().map(|x| (x.max(0.0) as usize).min(GRID - 1));
                mine.push(y * GRID + x);
            }
        }
        let most = (LEEWAY * mine.len() as f64) as usize;
        let fits = |page: &Page| mine.iter().filter(|&&cell| page.has(cell)).take(most + 1).count() <= most;
        let number = match self.pages.iter().position(fits) {
            Some(number) => number,
            None if self.pages.len() == MOST_PAGES => return Err("ask for more than 1024 textures"),
            None => {
                self.pages.push(Page { objects: Vec::new(), taken: vec![0; GRID * GRID / 64], texels: 0.0, covered: 0.0 });
                self.pages.len() - 1
            }
        };
        let page = &mut self.pages[number];
        mine.iter().for_each(|cell| page.taken[cell / 64] |= 1 << (cell % 64));
        page.objects.push(object);
        page.texels += texels;
        page.covered += covered;
        Ok(number)
    }
}

impl Page {
    fn has(&self, cell: usize) -> bool {
        self.taken[cell / 64] >> (cell % 64) & 1 == 1
    }

    /// Texels along its edge: on the whole as densely as in the map's atlas.
    pub fn size(&self) -> usize {
        ((self.texels / self.covered.max(LEAST_COVERED)).sqrt().ceil() as usize).clamp(LEAST, MOST)
    }
}

/// Whether a shape has second coordinates of its own; an error says why they are no layout.
fn is_laid_out(geometry: &Geometry, object: usize) -> Result<bool, &'static str> {
    let of = &geometry.objects[object];
    if !of.vertices.clone().any(|v| geometry.light_uvs.get(v as usize).is_some_and(|uv| uv.is_finite())) {
        return Ok(false);
    }
    let corners: Option<Vec<_>> = of.triangles.clone().map(|t| geometry.light_corners(t)).collect();
    let corners = corners.ok_or("are not all finite")?;
    let is_inside = |p: &Vec2| p.cmpge(Vec2::splat(-SLACK)).all() && p.cmple(Vec2::splat(1.0 + SLACK)).all();
    if !corners.iter().flatten().all(is_inside) {
        return Err("lie outside of [0, 1]");
    }
    let surfaces: Vec<f64> = of.triangles.clone().map(|t| 0.5 * f64::from(geometry.area_normal(t).length())).collect();
    let (surface, covered): (f64, f64) = (surfaces.iter().sum(), corners.iter().map(area).sum());
    // Texels a square metre, relative to those of all.
    let is_flat = |(corners, of): &(&[Vec2; 3], &f64)| area(corners) * surface < FLATTENED * covered * **of;
    let flat: f64 = corners.iter().zip(&surfaces).filter(is_flat).map(|(_, of)| of).sum();
    if covered == 0.0 || flat > LEEWAY * surface {
        return Err("have no area");
    }
    if overlap(&corners) { Err("overlap one another") } else { Ok(true) }
}

fn area([a, b, c]: &[Vec2; 3]) -> f64 {
    let [a, b, c] = [a, b, c].map(|p| p.as_dvec2());
    0.5 * (b - a).perp_dot(c - a).abs()
}

/// Whether more of what some triangles cover is covered twice than rounding comes to.
fn overlap(corners: &[[Vec2; 3]]) -> bool {
    let all = || corners.iter().flatten().map(|p| p.as_dvec2());
    let (low, high) = all().fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)));
    let to_grid = GRID as f64 / (high - low);
    let mut taken = vec![false; GRID * GRID];
    let (mut once, mut again) = (0, 0);
    for triangle in corners {
        cells(triangle.map(|p| (p.as_dvec2() - low) * to_grid), &mut |cell| match std::mem::replace(&mut taken[cell], true) {
            false => once += 1,
            true => again += 1,
        });
    }
    f64::from(again) > LEEWAY * f64::from(once)
}

/// Calls `hit` with each cell whose middle lies in a triangle; of a middle on an edge that two share, one of them has the cell.
fn cells([a, b, c]: [DVec2; 3], hit: &mut dyn FnMut(usize)) {
    // The first middle that lies at `x` or after it.
    let from = |x: f64| ((x - 0.5).ceil().max(0.0) as usize).min(GRID);
    for row in from(a.y.min(b.y).min(c.y))..from(a.y.max(b.y).max(c.y)) {
        let y = row as f64 + 0.5;
        let crossing = |(p, q): (DVec2, DVec2)| {
            // In the same order for both of the triangles that an edge has, so that rounding is the same, too.
            let (low, high) = if p.y <= q.y { (p, q) } else { (q, p) };
            (low.y <= y && y < high.y).then(|| low.x + (y - low.y) / (high.y - low.y) * (high.x - low.x))
        };
        let mut crossings = [(a, b), (b, c), (c, a)].into_iter().filter_map(crossing);
        if let (Some(x), Some(other)) = (crossings.next(), crossings.next()) {
            (from(x.min(other))..from(x.max(other))).for_each(|column| hit(row * GRID + column));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two triangles of a rectangle from `low` to `high`.
    fn rectangle(low: [f32; 2], high: [f32; 2]) -> [[Vec2; 3]; 2] {
        let [a, b, c, d] = [low, [high[0], low[1]], high, [low[0], high[1]]].map(Vec2::from);
        [[a, b, c], [a, c, d]]
    }

    #[test]
    fn cells_of_a_square_are_taken_once() {
        for (low, high) in [([0.0, 0.0], [1.0, 1.0]), ([0.1, 0.2], [0.7, 0.83]), ([0.25, 0.0], [0.25 + 1.0 / 512.0, 1.0])] {
            let mut count = vec![0; GRID * GRID];
            for triangle in rectangle(low, high) {
                cells(triangle.map(|p| p.as_dvec2() * GRID as f64), &mut |cell| count[cell] += 1);
            }
            for (cell, count) in count.into_iter().enumerate() {
                let middle = Vec2::new((cell % GRID) as f32 + 0.5, (cell / GRID) as f32 + 0.5) / GRID as f32;
                let is_in = middle.cmpge(low.into()).all() && middle.cmplt(high.into()).all();
                assert_eq!(count, i32::from(is_in), "{middle}");
            }
        }
    }

    #[test]
    fn what_is_small_or_touches_is_told_from_what_overlaps() {
        let of = |parts: &[[[Vec2; 3]; 2]]| overlap(&parts.concat());
        let left = rectangle([0.0, 0.0], [0.5, 1.0]);
        assert!(!of(&[left, rectangle([0.5, 0.0], [1.0, 1.0])]));
        assert!(of(&[left, rectangle([0.45, 0.0], [1.0, 1.0])]));
        // In a corner of the square, and turned the other way round.
        let small = rectangle([0.9, 0.9], [0.901, 0.901]);
        assert!(!of(&[small]) && of(&[small, small.map(|[a, b, c]| [a, c, b])]));
    }
}
