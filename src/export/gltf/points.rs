//! A page's texels as points of the surface, at which a light map is looked up.

use crate::base::math::Rgb;
use crate::lightmap::LightMap;
use crate::lightmap::texels::Point;
use crate::scene::Geometry;
use glam::Vec2;

/// How far a texel's middle may lie from a triangle for it to be the triangle's, texels: the four of a bilinear lookup are nearer.
const REACH: f32 = 1.5;
/// Rings of texels beyond those, so that coarser levels of the texture have no black in them.
const RINGS: usize = 8;

/// The surface's point nearest to each texel, where one is near.
pub struct Points {
    /// Texels along an edge.
    pub size: usize,
    points: Vec<Option<Point>>,
}

impl Points {
    /// For the second texture coordinates of some shapes.
    pub fn new(geometry: &Geometry, objects: &[usize], size: usize) -> Self {
        let (mut points, mut nearest) = (vec![None; size * size], vec![REACH; size * size]);
        for triangle in objects.iter().flat_map(|&object| geometry.objects[object].triangles.clone()) {
            let Some(corners) = geometry.light_corners(triangle) else { continue };
            near(&corners.map(|p| p * size as f32), size, &mut |texel, distance, barycentric| {
                if distance < nearest[texel] {
                    nearest[texel] = distance;
                    points[texel] = Some(Point { triangle, barycentric });
                }
            });
        }
        drop(nearest);
        spread(&mut points, size);
        Self { size, points }
    }

    /// What a map says there, of fronts or of backs; black where no surface is near.
    pub fn light(&self, map: &LightMap, back: bool) -> Vec<Rgb> {
        let at = |point: &Option<Point>| point.map_or(Rgb::ZERO, |p| map.lookup(p.triangle, p.barycentric, back));
        self.points.iter().map(at).collect()
    }
}

/// Gives texels without a point that of a neighbour, ring by ring.
fn spread(points: &mut [Option<Point>], size: usize) {
    let mut edge: Vec<u32> = (0..points.len() as u32).filter(|&i| points[i as usize].is_some()).collect();
    for _ in 0..RINGS {
        let mut next = Vec::new();
        for texel in edge {
            let (x, y) = (texel as usize % size, texel as usize / size);
            for beside in [(x.wrapping_sub(1), y), (x + 1, y), (x, y.wrapping_sub(1)), (x, y + 1)] {
                let other = beside.1.wrapping_mul(size).wrapping_add(beside.0);
                if beside.0 < size && beside.1 < size && points[other].is_none() {
                    points[other] = points[texel as usize];
                    next.push(other as u32);
                }
            }
        }
        edge = next;
    }
}

/// Calls `emit` with the texels about a triangle, how far their middles are from it, and the barycentric weights of the nearest point.
fn near(corners: &[Vec2; 3], size: usize, emit: &mut dyn FnMut(usize, f32, Vec2)) {
    // The texels whose middles lie between two places.
    let between = |low: f32, high: f32| {
        let [first, end] = [(low - 0.5).ceil(), (high - 0.5).floor() + 1.0].map(|x| (x.max(0.0) as usize).min(size));
        first..end
    };
    let (low, high) = corners.iter().fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), p| (low.min(p.y), high.max(p.y)));
    for row in between(low - REACH, high + REACH) {
        let y = row as f32 + 0.5;
        let [left, right] = extent(corners, y - REACH, y + REACH);
        for column in between(left - REACH, right + REACH) {
            let (distance, barycentric) = closest(corners, Vec2::new(column as f32 + 0.5, y));
            emit(row * size + column, distance, barycentric);
        }
    }
}

/// From where to where the part of a triangle goes along x that lies between two heights.
fn extent(corners: &[Vec2; 3], low: f32, high: f32) -> [f32; 2] {
    let mut extent = [f32::INFINITY, f32::NEG_INFINITY];
    for k in 0..3 {
        let (a, b) = (corners[k], corners[(k + 1) % 3]);
        let (a, b) = if a.y <= b.y { (a, b) } else { (b, a) };
        if b.y < low || a.y > high {
            continue;
        }
        let at = |y: f32| a.x + ((y - a.y) / (b.y - a.y)).clamp(0.0, 1.0) * (b.x - a.x);
        let ends = if a.y < b.y { [at(low), at(high)] } else { [a.x, b.x] };
        extent = [ends[0].min(ends[1]).min(extent[0]), ends[0].max(ends[1]).max(extent[1])];
    }
    extent
}

/// How far a triangle is from `p`, and the weights of the second and third corner at the point of it that is nearest.
fn closest(corners: &[Vec2; 3], p: Vec2) -> (f32, Vec2) {
    let [a, b, c] = *corners;
    let (e, f, d) = (b - a, c - a, p - a);
    let weights = Vec2::new(d.perp_dot(f), e.perp_dot(d)) / e.perp_dot(f);
    if weights.x >= 0.0 && weights.y >= 0.0 && weights.x + weights.y <= 1.0 {
        return (0.0, weights);
    }
    let on_edge = |k: usize| {
        let (from, along) = (corners[k], corners[(k + 1) % 3] - corners[k]);
        let share = (p - from).dot(along) / along.length_squared();
        let share = if share.is_finite() { share.clamp(0.0, 1.0) } else { 0.0 };
        let mut weights = [0.0; 3];
        (weights[k], weights[(k + 1) % 3]) = (1.0 - share, share);
        (p.distance(from + along * share), Vec2::new(weights[1], weights[2]))
    };
    let [x, y, z] = [0, 1, 2].map(on_edge);
    let nearer = |a: (f32, Vec2), b: (f32, Vec2)| if b.0 < a.0 { b } else { a };
    nearer(nearer(x, y), z)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::math::hash_words;

    fn random(i: u32, k: u32) -> f32 {
        hash_words(&[i, k]) as f32 / u32::MAX as f32
    }

    /// Whatever a triangle's shape, the four texels that a bilinear lookup anywhere in it reads have a value, and those with their middles in it their own.
    #[test]
    fn every_texel_that_a_lookup_reads_is_the_triangle_s() {
        const SIZE: usize = 64;
        for i in 0..200 {
            // Slivers and dots among them.
            let scale = 64.0 * random(i, 9).powi(4);
            let middle = Vec2::new(random(i, 7), random(i, 8)) * 64.0;
            let corner = |k: u32| {
                let away = Vec2::new(random(i, 2 * k) - 0.5, (random(i, 2 * k + 1) - 0.5) * random(i, 10).powi(3));
                (middle + away * scale).clamp(Vec2::ZERO, Vec2::splat(64.0))
            };
            let corners = [corner(0), corner(1), corner(2)];
            let mut found = vec![None; SIZE * SIZE];
            near(&corners, SIZE, &mut |texel, distance, weights| found[texel] = Some((distance, weights)));
            let at = |w: Vec2| corners[0] + (corners[1] - corners[0]) * w.x + (corners[2] - corners[0]) * w.y;
            for j in 0..50 {
                let (u, v) = (random(j, 11), random(j, 12));
                let inside = at(if u + v > 1.0 { Vec2::new(1.0 - u, 1.0 - v) } else { Vec2::new(u, v) });
                let cell = (inside - 0.5).clamp(Vec2::ZERO, Vec2::splat(SIZE as f32 - 1.0));
                for (x, y) in [(cell.x.floor(), cell.y.floor()), (cell.x.ceil(), cell.y.ceil()), (cell.x.floor(), cell.y.ceil())]
                {
                    let (distance, weights) = found[y as usize * SIZE + x as usize].unwrap_or((f32::NAN, Vec2::NAN));
                    let texel = Vec2::new(x + 0.5, y + 0.5);
                    assert!(distance < REACH, "{corners:?} at {inside}: {distance} at {texel}");
                    assert!((at(weights).distance(texel) - distance).abs() < 1e-2, "{corners:?}: {weights} of {texel}");
                    assert!(distance <= texel.distance(inside) + 1e-3);
                }
            }
        }
    }

    #[test]
    fn texels_take_their_nearest_neighbour_s_point_eight_rings_far() {
        let mut points = vec![None; 32 * 32];
        points[16 * 32 + 16] = Some(Point { triangle: 5, barycentric: Vec2::ZERO });
        spread(&mut points, 32);
        for (i, point) in points.iter().enumerate() {
            let steps = (i % 32).abs_diff(16) + (i / 32).abs_diff(16);
            assert_eq!(point.is_some(), steps <= RINGS, "{i}");
        }
    }
}
