//! Points on surfaces that push one another apart until they lie evenly (Turk 1991).
//!
//! *Ours*: forces end at [`REACH`] spacings, act between points that face alike, and fall linearly; a point goes along its triangle, over an
//! edge into the next one of the same object where the surface is not folded back by more than a third of a turn, and else stops at the edge.

use super::place::Place;
use crate::lightmap::adjacency::{Adjacency, NONE, adjacency};
use crate::scene::Geometry;
use glam::{Quat, Vec2, Vec3};
use rayon::prelude::*;
use std::collections::{BTreeMap, HashMap};

/// How far points push one another, in spacings of a hexagonal lattice.
const REACH: f32 = 2.0;
/// How far a point goes at first for a force of 1, in spacings, and at most.
const STEP: f32 = 0.35;
const MOST: f32 = 0.5;
/// Least cosine between normals of points that push one another, and between triangles that a way leads on to.
const ALIKE: f32 = -0.5;
/// Most edges that a step leads over.
const MOST_EDGES: u32 = 16;

/// A point and the normal of its side.
#[derive(Clone, Copy)]
pub struct Point {
    /// Where it is.
    pub place: Place,
    /// Its position.
    pub p: Vec3,
    /// Unit normal of the triangle, on its side.
    pub n: Vec3,
}

/// Moves points in so many steps; `spacing` is what is between neighbours of a hexagonal lattice of as many on the same area.
pub fn spread(geometry: &Geometry, places: &[Place], spacing: f32, steps: u32) -> Vec<Place> {
    let objects: BTreeMap<u32, Adjacency> = {
        let mut used: Vec<u32> = places.iter().map(|p| geometry.triangle_object[p.triangle as usize]).collect();
        used.sort_unstable();
        used.dedup();
        used.into_par_iter().map(|o| (o, adjacency(geometry, o as usize))).collect()
    };
    let mut points: Vec<Point> = places.iter().map(|&place| point(geometry, place)).collect();
    for step in 0..steps {
        let cells = cells(&points, REACH * spacing);
        let cooled = STEP * (1.0 - step as f32 / steps as f32);
        let moved = |i: usize| {
            let at = points[i];
            let push = force(&points, &cells, i, REACH * spacing);
            let way = ((push - at.n * push.dot(at.n)) * (cooled * spacing)).clamp_length_max(MOST * spacing);
            let object = geometry.triangle_object[at.place.triangle as usize];
            walk(geometry, &objects[&object], &at, way)
        };
        points = (0..points.len()).into_par_iter().with_min_len(256).map(moved).collect();
    }
    points.into_iter().map(|point| point.place).collect()
}

/// The point at a place.
pub fn point(geometry: &Geometry, place: Place) -> Point {
    let [a, b, c] = geometry.corners(place.triangle);
    let Vec2 { x: u, y: v } = place.barycentric;
    let n = geometry.area_normal(place.triangle).normalize_or_zero();
    Point { place, p: a + (b - a) * u + (c - a) * v, n: if place.back { -n } else { n } }
}

type Cells = HashMap<[i32; 3], Vec<u32>>;

fn cell(p: Vec3, size: f32) -> [i32; 3] {
    (p / size).floor().as_ivec3().to_array()
}

fn cells(points: &[Point], size: f32) -> Cells {
    let mut cells = Cells::new();
    for (i, point) in points.iter().enumerate() {
        cells.entry(cell(point.p, size)).or_default().push(i as u32);
    }
    cells
}

/// The push of all points within `reach` of one; cells are asked in a fixed order.
fn force(points: &[Point], cells: &Cells, i: usize, reach: f32) -> Vec3 {
    let at = &points[i];
    let [x, y, z] = cell(at.p, reach);
    let around = (0..27).map(|k| [x + k % 3 - 1, y + k / 3 % 3 - 1, z + k / 9 - 1]);
    let mut sum = Vec3::ZERO;
    for &j in around.filter_map(|c| cells.get(&c)).flatten() {
        let other = &points[j as usize];
        let (away, distance) = (at.p - other.p, at.p.distance(other.p));
        if distance < reach && distance > 0.0 && at.n.dot(other.n) > ALIKE {
            sum += away / distance * (1.0 - distance / reach);
        }
    }
    sum
}

/// Goes along the surface by `way`.
fn walk(geometry: &Geometry, adjacency: &Adjacency, from: &Point, mut way: Vec3) -> Point {
    let mut place = from.place;
    for _ in 0..MOST_EDGES {
        let corners = geometry.corners(place.triangle);
        let [a, b, c] = corners;
        let (e, f, n) = (b - a, c - a, geometry.area_normal(place.triangle));
        let size = n.length_squared();
        if size <= 0.0 {
            break;
        }
        let start = [1.0 - place.barycentric.x - place.barycentric.y, place.barycentric.x, place.barycentric.y];
        let along = [way.cross(f).dot(n) / size, e.cross(way).dot(n) / size];
        let change = [-along[0] - along[1], along[0], along[1]];
        // The first weight that falls below zero: the way leads over the edge across from its corner.
        let leaves = |k: usize| if start[k] + change[k] < 0.0 { start[k].max(0.0) / -change[k] } else { 1.0 };
        let first = (0..3).min_by(|&k, &l| leaves(k).total_cmp(&leaves(l))).unwrap_or(0);
        let t = leaves(first).min(1.0);
        let at: [f32; 3] = std::array::from_fn(|k| (start[k] + change[k] * t).max(0.0));
        let sum: f32 = at.iter().sum();
        place.barycentric = Vec2::new(at[1], at[2]) / sum;
        if start[first] + change[first] >= 0.0 {
            break;
        }
        let local = (place.triangle - adjacency.first) as usize;
        let (next, _) = adjacency.across[local][(first + 1) % 3];
        if next == NONE {
            break;
        }
        let (mine, its) = (adjacency.normals[local], adjacency.normals[(next - adjacency.first) as usize]);
        if mine.dot(its) < ALIKE {
            break;
        }
        let p = a * at[0] / sum + b * at[1] / sum + c * at[2] / sum;
        way = Quat::from_rotation_arc(mine, its) * (way * (1.0 - t));
        place = Place { triangle: next, barycentric: weights(geometry, next, p), ..place };
    }
    point(geometry, place)
}

/// Barycentric weights of the point of a triangle's edge nearest to `p`, which lies on it but for rounding.
fn weights(geometry: &Geometry, triangle: u32, p: Vec3) -> Vec2 {
    let [a, b, c] = geometry.corners(triangle);
    let n = geometry.area_normal(triangle);
    let size = n.length_squared().max(f32::MIN_POSITIVE);
    let [u, v] = [(p - a).cross(c - a).dot(n) / size, (b - a).cross(p - a).dot(n) / size].map(|x| x.clamp(0.0, 1.0));
    Vec2::new(u, v) / (u + v).max(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::math::{hash_words, unit};
    use crate::lightmap::testing;

    fn random(geometry: &Geometry, count: u32) -> Vec<Place> {
        let n = geometry.triangles.len() as u32;
        let of = |i: u32| {
            let [u, v] = [0, 1].map(|k| unit(hash_words(&[i, k])));
            let barycentric = if u + v > 1.0 { Vec2::new(1.0 - u, 1.0 - v) } else { Vec2::new(u, v) };
            Place { triangle: hash_words(&[i, 7]) % n, barycentric, back: false }
        };
        (0..count).map(of).collect()
    }

    /// Distance to the nearest other point in spacings: mean and least.
    fn nearest(geometry: &Geometry, places: &[Place], spacing: f32) -> (f32, f32) {
        let points: Vec<Vec3> = places.iter().map(|&p| point(geometry, p).p).collect();
        let near =
            |i: usize| (0..points.len()).filter(|&j| j != i).map(|j| points[i].distance(points[j])).fold(f32::MAX, f32::min);
        let all: Vec<f32> = (0..points.len()).map(|i| near(i) / spacing).collect();
        (all.iter().sum::<f32>() / all.len() as f32, all.iter().copied().fold(f32::MAX, f32::min))
    }

    #[test]
    fn points_at_random_come_to_lie_evenly_on_flat_and_curved_surfaces() {
        let mut flat = Geometry::default();
        testing::quad(&mut flat, Vec3::ZERO, Vec3::X, Vec3::Z);
        let mut round = Geometry::default();
        testing::sphere(&mut round, Vec3::ZERO, 0.5, 24);
        for (geometry, name) in [(&flat, "flat"), (&round, "round")] {
            let total: f32 = (0..geometry.triangles.len() as u32).map(|t| 0.5 * geometry.area_normal(t).length()).sum();
            let start = random(geometry, 500);
            let area = total / 500.0;
            let spacing = (area * 2.0 / 3f32.sqrt()).sqrt();
            let after = spread(geometry, &start, spacing, 40);
            let (before, after) = (nearest(geometry, &start, spacing), nearest(geometry, &after, spacing));
            // At random the mean is 0.5 / sqrt(density): 0.47 spacings; a lattice has 1.
            assert!(before.0 < 0.55 && after.0 > 0.78 && after.1 > 2.0 * before.1, "{name}: {before:?}, then {after:?}");
        }
    }

    #[test]
    fn a_walk_goes_over_edges_and_ends_at_the_border() {
        let mut g = Geometry::default();
        testing::quad(&mut g, Vec3::ZERO, Vec3::X, Vec3::Z);
        let links = adjacency(&g, 0);
        let from = point(&g, Place { triangle: 0, barycentric: Vec2::splat(0.25), back: false });
        for (way, stays) in
            [(Vec3::new(0.1, 0.0, -0.2), true), (Vec3::new(-0.1, 0.0, 0.4), true), (Vec3::new(9.0, 0.0, 2.0), false)]
        {
            let to = walk(&g, &links, &from, way);
            assert!((to.p.distance(from.p + way) < 1e-5) == stays, "{way}: {} to {}", from.p, to.p);
        }
    }
}
