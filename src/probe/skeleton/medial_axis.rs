//! Candidates from the medial axis by shrinking balls ([Wang et al. 2019] §3.1 after [Ma et al. 2012]).
//!
//! A ball touches each surface point from the free side; while another point lies in it, it shrinks to the ball that touches both. Its
//! centre is then equally far from both: a point of the medial axis. *Paper*: surface points are the vertices of a fine tessellation; the
//! density of probes is controlled by pre-clustering them by position and orientation (Figure 3). *Ours*: surface points are the light map's
//! texels, spread evenly whatever the triangles; all of them stop balls, and one a cluster starts a ball. A ball that two points touch at a
//! small angle, seen from its centre, sits on a bump of the sampled surface: it is left as large as it was before.

use super::nearest::Nearest;
use super::space::Space;
use crate::probe::coverage::Sides;
use crate::transport::World;
use glam::{IVec3, Vec3};
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Least angle between the points that touch a ball, seen from its centre, degrees.
const SEPARATION: f32 = 25.0;
/// Steps after which a ball is left as it is.
const STEPS: u32 = 64;
/// Where a ball stops shrinking: this much of its radius.
const SLACK: f32 = 1e-4;
/// Size of the first clusters of surface points, voxels.
const CLUSTER: f32 = 2.0;
/// How much larger clusters get where there are too many.
const LARGER: f32 = 1.2;

/// A ball between surfaces.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ball {
    /// Its middle, metres.
    pub centre: Vec3,
    /// Its radius, metres.
    pub radius: f32,
}

/// Shrinks the ball that touches `p` on the side of the unit normal `n`, from radius `most` on, until none of `points` is inside.
pub fn shrink(points: &[Vec3], tree: &Nearest, p: Vec3, n: Vec3, most: f32) -> Ball {
    let mut ball = Ball { centre: p + n * most, radius: most };
    let cos_least = SEPARATION.to_radians().cos();
    for _ in 0..STEPS {
        let Some((i, square)) = tree.find(ball.centre, &|i| points[i as usize] != p) else { break };
        let q = points[i as usize];
        if square.sqrt() >= ball.radius * (1.0 - SLACK) {
            break;
        }
        // The centre p + r n is as far from q as from p: |q - p|² = 2 r n·(q - p).
        let way = q - p;
        let height = way.dot(n);
        let radius = way.length_squared() / (2.0 * height);
        if !(height > 0.0 && radius < ball.radius) {
            break;
        }
        let centre = p + n * radius;
        if (p - centre).normalize_or_zero().dot((q - centre).normalize_or_zero()) > cos_least {
            break;
        }
        ball = Ball { centre, radius };
    }
    ball
}

/// Centres in the free space, at least `cull` metres from all surfaces: one a cluster of reachable surface points, at most `most`, those
/// that nearly coincide taken together; the widest first.
pub fn candidates(world: &World, space: &Space, sides: &Sides, cull: f32, most: usize) -> Vec<Vec3> {
    let voxels = &space.field.voxels;
    let points: Vec<Vec3> = sides.surface.iter().map(|(p, _)| *p).collect();
    let tree = Nearest::new(points.iter().copied());
    let largest = 0.5 * (voxels.upper() - voxels.lower).length();
    let mut size = CLUSTER * voxels.edge;
    loop {
        let starts = clusters(sides, size);
        let balls: Vec<Ball> = starts
            .into_par_iter()
            .map(|i| shrink(&points, &tree, sides.list[i].p, sides.list[i].n, largest))
            .filter(|ball| voxels.contains(ball.centre) && space.field.at(ball.centre) >= cull && space.has(world, ball.centre))
            .collect();
        let found = apart(balls, 0.5 * size);
        if found.len() <= most.max(1) {
            return found;
        }
        size *= LARGER;
    }
}

/// Sides that start balls: of those in one cube of edge `size` whose normals lie about the same axis, the one nearest to their mean.
fn clusters(sides: &Sides, size: f32) -> Vec<usize> {
    let mut cells: BTreeMap<([i32; 3], usize, bool), Vec<usize>> = BTreeMap::new();
    for (i, side) in sides.list.iter().enumerate() {
        let axis = side.n.abs().max_position();
        cells.entry((cell(side.p, size), axis, side.n[axis] > 0.0)).or_default().push(i);
    }
    let middle = |list: Vec<usize>| {
        let mean = list.iter().map(|&i| sides.list[i].p).sum::<Vec3>() / list.len() as f32;
        let square = |i: usize| sides.list[i].p.distance_squared(mean);
        list.into_iter().min_by(|&a, &b| square(a).total_cmp(&square(b)).then(a.cmp(&b)))
    };
    cells.into_values().filter_map(middle).collect()
}

/// Centres of the balls in order of their size, without those that lie in the same cube of edge `size` as a larger one.
fn apart(mut balls: Vec<Ball>, size: f32) -> Vec<Vec3> {
    let coordinates = |b: &Ball| b.centre.to_array();
    // A total order: no two balls differ in nothing but their place in the list.
    balls.sort_by(|a, b| {
        b.radius
            .total_cmp(&a.radius)
            .then_with(|| coordinates(a).partial_cmp(&coordinates(b)).unwrap_or(std::cmp::Ordering::Equal))
    });
    let mut taken = std::collections::BTreeSet::new();
    balls.into_iter().filter(|b| taken.insert(cell(b.centre, size))).map(|b| b.centre).collect()
}

fn cell(p: Vec3, size: f32) -> [i32; 3] {
    IVec3::to_array(&(p / size).floor().as_ivec3())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::math::direction_from_lat_long;
    use glam::Vec2;

    fn balls(surface: &[(Vec3, Vec3)], most: f32) -> Vec<Ball> {
        let points: Vec<Vec3> = surface.iter().map(|s| s.0).collect();
        let tree = Nearest::new(points.iter().copied());
        surface.iter().map(|&(p, n)| shrink(&points, &tree, p, n, most)).collect()
    }

    #[test]
    fn balls_in_a_sphere_end_at_its_middle() {
        let direction = |i: u32| {
            direction_from_lat_long(Vec2::new(
                (i as f32 * 0.618_034).fract(),
                (1.0 - (2 * i + 1) as f32 / 2000.0).acos() / std::f32::consts::PI,
            ))
        };
        let surface: Vec<_> = (0..2000).map(|i| (direction(i) * 2.0, -direction(i))).collect();
        for ball in balls(&surface, 30.0) {
            assert!(ball.centre.length() < 0.02 && (ball.radius - 2.0).abs() < 0.02, "{ball:?}");
        }
    }

    #[test]
    fn balls_in_a_cylinder_end_on_its_axis() {
        let at = |i: u32, k: u32| {
            let (sin, cos) = ((i as f32 + 0.5 * (k % 2) as f32) / 96.0 * std::f32::consts::TAU).sin_cos();
            (Vec3::new(cos, (k as f32 - 80.0) * 0.05, sin), Vec3::new(-cos, 0.0, -sin))
        };
        let surface: Vec<_> = (0..160).flat_map(|k| (0..96).map(move |i| at(i, k))).collect();
        for (ball, _) in balls(&surface, 20.0).iter().zip(&surface).filter(|(_, (p, _))| p.y.abs() < 2.0) {
            assert!(ball.centre.with_y(0.0).length() < 0.03, "{ball:?}");
        }
    }

    /// In a box of 4 x 2 x 3 each ball touches the wall it started from, and a second one.
    #[test]
    fn balls_in_a_box_are_as_large_as_the_next_wall_lets_them() {
        let half = Vec3::new(2.0, 1.0, 1.5);
        let mut surface = Vec::new();
        for axis in 0..3 {
            let (s, t) = ((axis + 1) % 3, (axis + 2) % 3);
            for (i, j) in (0..60).flat_map(|i| (0..60).map(move |j| (i, j))) {
                for sign in [-1.0, 1.0] {
                    let mut p = Vec3::ZERO;
                    p[axis] = sign * half[axis];
                    p[s] = half[s] * ((i as f32 + 0.5) / 30.0 - 1.0);
                    p[t] = half[t] * ((j as f32 + 0.5) / 30.0 - 1.0);
                    surface.push((p, Vec3::AXES[axis] * -sign));
                }
            }
        }
        let mut near = 0;
        let balls = balls(&surface, 10.0);
        for ball in &balls {
            let walls = half - ball.centre.abs();
            assert!(walls.min_element() > ball.radius - 0.08, "{ball:?} is cut by a wall");
            let touched = (0..3).filter(|&axis| (walls[axis] - ball.radius).abs() < 0.08).count();
            near += usize::from(touched >= 2 || ball.centre.y.abs() < 0.05);
        }
        assert!(near as f32 > 0.99 * balls.len() as f32, "{near} of {}", balls.len());
    }

    #[test]
    fn a_lone_plane_has_balls_of_the_largest_size() {
        let surface: Vec<_> = (0..400).map(|i| (Vec3::new((i % 20) as f32, 0.0, (i / 20) as f32), Vec3::Y)).collect();
        assert!(balls(&surface, 7.0).iter().all(|b| b.radius == 7.0));
    }
}
