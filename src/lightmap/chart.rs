//! Charts: patches of one object that a projection onto their mean plane shows without folds.
//!
//! *Ours*: a chart grows from the largest free triangle over smooth edges, the triangle that deviates least
//! from its mean normal first, as far as [`MAX_DEVIATION_COS`]. Creases end a chart, unless the facets beside
//! them are smaller than a texel, where the light map could not tell them apart anyway.
//! Triangles that the mean plane shows too obliquely, or on top of others, are left to later charts;
//! in the worst case a triangle is a chart of its own, which is always projectable.

use super::adjacency::{Adjacency, NONE};
use crate::scene::Geometry;
use glam::{Vec2, Vec3, Vec4};
use std::cmp::Reverse;
use std::collections::{BinaryHeap, VecDeque};

/// A triangle joins a chart if its normal deviates by at most 50 degrees from the mean.
const MAX_DEVIATION_COS: f32 = 0.64;

/// In the end no triangle may be seen more obliquely than this (75 degrees).
const MIN_FACING_COS: f32 = 0.26;

/// A chart whose normals deviate by more than 20 degrees from the mean ...
const CURVED_COS: f32 = 0.94;

/// ... has at least this many texels along each side, however small it is: the sides of a rod are lit differently.
const CURVED_TEXELS: u32 = 3;

/// Facets with edges up to this many texels may share a chart across a crease.
const SMALL_FACET_TEXELS: f32 = 1.0;

/// A patch with its own rectangle of texels.
#[derive(Debug, Clone, PartialEq)]
pub struct Chart {
    /// Its triangles.
    pub triangles: Vec<u32>,
    /// Column in texels of a point: `column · (p, 1)`.
    pub column: Vec4,
    /// Row in texels of a point: `row · (p, 1)`.
    pub row: Vec4,
    /// Width and height in texels, without gutter.
    pub size: [u32; 2],
    /// Column and row of its upper left texel in the atlas, without gutter.
    pub corner: [u32; 2],
}

impl Chart {
    /// Place of `p` in texels.
    pub fn project(&self, p: Vec3) -> Vec2 {
        Vec2::new(self.column.dot(p.extend(1.0)), self.row.dot(p.extend(1.0)))
    }
}

/// The charts of one object, with texels of about `texel` metres.
pub fn charts_of(geometry: &Geometry, adjacency: &Adjacency, texel: f32) -> Vec<Chart> {
    let count = adjacency.normals.len();
    let mut seeds: Vec<u32> = (0..count as u32).filter(|&t| adjacency.normals[t as usize] != Vec3::ZERO).collect();
    seeds.sort_by(|&a, &b| adjacency.areas[b as usize].total_cmp(&adjacency.areas[a as usize]).then(a.cmp(&b)));
    let mut queue = VecDeque::from(seeds);
    let mut taken = vec![false; count];
    let mut charts = Vec::new();
    while let Some(seed) = queue.pop_front() {
        if taken[seed as usize] {
            continue;
        }
        let grown = grow(geometry, adjacency, texel, seed, &mut taken);
        let (chart, rejected) = flatten(geometry, adjacency, texel, &grown);
        for t in rejected {
            taken[t as usize] = false;
            queue.push_back(t);
        }
        charts.push(chart);
    }
    charts
}

/// Local indices of the triangles that join the chart of `seed`, in the order in which they do.
fn grow(geometry: &Geometry, adjacency: &Adjacency, texel: f32, seed: u32, taken: &mut [bool]) -> Vec<u32> {
    let mut sum = adjacency.normals[seed as usize] * adjacency.areas[seed as usize];
    let mut heap = BinaryHeap::from([Reverse((0, seed))]);
    let mut grown = Vec::new();
    while let Some(Reverse((_, t))) = heap.pop() {
        let mean = sum.try_normalize().unwrap_or(adjacency.normals[seed as usize]);
        if taken[t as usize] || adjacency.normals[t as usize].dot(mean) < MAX_DEVIATION_COS {
            continue;
        }
        taken[t as usize] = true;
        grown.push(t);
        if t != seed {
            sum += adjacency.normals[t as usize] * adjacency.areas[t as usize];
        }
        for (e, &(next, _)) in adjacency.across[t as usize].iter().enumerate() {
            let local = next.wrapping_sub(adjacency.first);
            if next == NONE || taken[local as usize] {
                continue;
            }
            let open = adjacency.smooth[t as usize][e]
                || (longest_edge(geometry, next).max(longest_edge(geometry, adjacency.first + t)) < SMALL_FACET_TEXELS * texel);
            if open {
                let deviation = (1.0 - adjacency.normals[local as usize].dot(mean)).max(0.0);
                heap.push(Reverse((deviation.to_bits(), local)));
            }
        }
    }
    grown
}

fn longest_edge(geometry: &Geometry, t: u32) -> f32 {
    let [a, b, c] = geometry.corners(t);
    a.distance(b).max(b.distance(c)).max(c.distance(a))
}

/// Projects grown triangles and lays their rectangle out; also returns (local) triangles that do not fit the plane.
fn flatten(geometry: &Geometry, adjacency: &Adjacency, texel: f32, grown: &[u32]) -> (Chart, Vec<u32>) {
    let seed_normal = adjacency.normals[grown[0] as usize];
    let sum: Vec3 = grown.iter().map(|&t| adjacency.normals[t as usize] * adjacency.areas[t as usize]).sum();
    let mut normal = sum.try_normalize().unwrap_or(seed_normal);
    if normal.dot(seed_normal) < MIN_FACING_COS {
        normal = seed_normal;
    }
    let (fits, mut rejected): (Vec<u32>, Vec<u32>) =
        grown.iter().partition(|&&t| adjacency.normals[t as usize].dot(normal) >= MIN_FACING_COS);
    let first = adjacency.first;
    let origin = geometry.corners(first + fits[0])[0];
    let lay_out = |triangles: &[u32]| {
        let curved = triangles.iter().any(|&t| adjacency.normals[t as usize].dot(normal) < CURVED_COS);
        lay_out(geometry, first, triangles, &Plane { normal, origin, texel, least: if curved { CURVED_TEXELS } else { 1 } })
    };
    let chart = lay_out(&fits);
    let flat = without_folds(geometry, first, &chart, &fits);
    if flat.len() == fits.len() {
        return (chart, rejected);
    }
    rejected.extend(fits.iter().filter(|t| !flat.contains(t)));
    (lay_out(&flat.into_iter().collect::<Vec<_>>()), rejected)
}

/// What a chart is projected on, and how finely.
struct Plane {
    normal: Vec3,
    origin: Vec3,
    texel: f32,
    /// Fewest texels along a side.
    least: u32,
}

/// The smallest rectangle about the projected triangles, stretched to whole texels.
fn lay_out(geometry: &Geometry, first: u32, locals: &[u32], plane: &Plane) -> Chart {
    let &Plane { normal, origin, texel, least } = plane;
    let frame = crate::base::math::Basis::from_normal(normal);
    let points: Vec<Vec2> = locals
        .iter()
        .flat_map(|&t| geometry.corners(first + t))
        .map(|p| Vec2::new(frame.s.dot(p - origin), frame.t.dot(p - origin)))
        .collect();
    let axis = tightest_axis(&convex_hull(points.clone()));
    let extent = |axis: Vec2| {
        points.iter().fold((f32::INFINITY, f32::NEG_INFINITY), |(lo, hi), p| {
            let x = axis.dot(*p);
            (lo.min(x), hi.max(x))
        })
    };
    // Landscape charts pack better: the longer side goes along the rows.
    let (mut across, mut along) = (axis, axis.perp());
    if extent(across).1 - extent(across).0 < extent(along).1 - extent(along).0 {
        (across, along) = (along, -across);
    }
    let line = |axis: Vec2| {
        let (lo, hi) = extent(axis);
        let texels = ((hi - lo) / texel - 1e-3).ceil().max(least as f32);
        // A flat extent (a sliver) gets its one texel all the same; a stretch without bound would lose the place to rounding.
        let scale = if hi - lo > 1e-3 * texel { texels / (hi - lo) } else { 0.0 };
        let world = (frame.s * axis.x + frame.t * axis.y) * scale;
        (world.extend(-world.dot(origin) - lo * scale), texels as u32)
    };
    let ((column, width), (row, height)) = (line(across), line(along));
    Chart { triangles: locals.iter().map(|&t| first + t).collect(), column, row, size: [width, height], corner: [0, 0] }
}

/// Convex hull, counter-clockwise (monotone chain).
fn convex_hull(mut points: Vec<Vec2>) -> Vec<Vec2> {
    points.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    points.dedup();
    if points.len() < 3 {
        return points;
    }
    let half = |points: &mut dyn Iterator<Item = &Vec2>| {
        let mut chain: Vec<Vec2> = Vec::new();
        for &p in points {
            while let [.., a, b] = chain[..]
                && (b - a).perp_dot(p - a) <= 0.0
            {
                chain.pop();
            }
            chain.push(p);
        }
        chain.pop();
        chain
    };
    let mut hull = half(&mut points.iter());
    hull.extend(half(&mut points.iter().rev()));
    hull
}

/// Direction of the hull edge whose rectangle is smallest; the hull's edges thin out past 64.
fn tightest_axis(hull: &[Vec2]) -> Vec2 {
    let step = hull.len().div_ceil(64).max(1);
    let mut best = (f32::INFINITY, Vec2::X);
    for i in (0..hull.len()).step_by(step) {
        let Some(axis) = (hull[(i + 1) % hull.len()] - hull[i]).try_normalize() else { continue };
        let (lo, hi) = hull.iter().fold((Vec2::INFINITY, Vec2::NEG_INFINITY), |(lo, hi), p| {
            let q = Vec2::new(axis.dot(*p), axis.perp_dot(*p));
            (lo.min(q), hi.max(q))
        });
        let area = (hi - lo).element_product();
        if area < best.0 * 0.9999 {
            best = (area, axis);
        }
    }
    best.1
}

/// The triangles that stay when those that cover sample points already covered are left out (2 x 2 points a texel).
fn without_folds(geometry: &Geometry, first: u32, chart: &Chart, locals: &[u32]) -> std::collections::BTreeSet<u32> {
    const PER_TEXEL: f32 = 2.0;
    let (w, h) = (chart.size[0] as usize * PER_TEXEL as usize, chart.size[1] as usize * PER_TEXEL as usize);
    let mut covered = vec![false; w * h];
    let mut kept = std::collections::BTreeSet::new();
    let mut mine = Vec::new();
    for &t in locals {
        let corners = geometry.corners(first + t).map(|p| chart.project(p) * PER_TEXEL);
        mine.clear();
        let mut folds = false;
        let lo = corners[0].min(corners[1]).min(corners[2]).max(Vec2::ZERO);
        let hi = corners[0].max(corners[1]).max(corners[2]);
        let (a, b, c) = (corners[0], corners[1] - corners[0], corners[2] - corners[0]);
        let area = b.perp_dot(c);
        for j in (lo.y - 0.5).max(0.0) as usize..h.min((hi.y + 0.5).max(0.0) as usize) {
            for i in (lo.x - 0.5).max(0.0) as usize..w.min((hi.x + 0.5).max(0.0) as usize) {
                let d = Vec2::new(i as f32 + 0.5, j as f32 + 0.5) - a;
                let (u, v) = (d.perp_dot(c) / area, b.perp_dot(d) / area);
                // Strictly inside: a point on a shared edge is no fold.
                if u > 1e-3 && v > 1e-3 && u + v < 1.0 - 1e-3 {
                    folds |= covered[j * w + i];
                    mine.push(j * w + i);
                }
            }
        }
        if !folds || kept.is_empty() {
            mine.iter().for_each(|&i| covered[i] = true);
            kept.insert(t);
        }
    }
    kept
}
