//! Thins a crowd of points out to an even set ([Silvennoinen and Lehtinen 2017] §4.1).
//!
//! *Paper*: "iteratively remove candidates from the densest regions", by a kernel density estimate with the weights of Eq. 10. *Ours*: one point
//! at a time, the densest of those that are left. Densities are whole numbers, so that what was added comes off again to the last bit, in any
//! order and on any number of threads.

use super::support::weight;
use glam::Vec3;
use rayon::prelude::*;
use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap};

/// What a weight of 1 is as a whole number.
const ONE: f32 = (1 << 24) as f32;

/// Points by the cubes of the kernel's size that they lie in.
struct Crowd<'a> {
    points: &'a [Vec3],
    lower: Vec3,
    spacing: f32,
    cells: BTreeMap<[i32; 3], Vec<u32>>,
}

impl Crowd<'_> {
    fn cell(&self, p: Vec3) -> [i32; 3] {
        ((p - self.lower) / self.spacing).floor().as_ivec3().to_array()
    }

    /// The points of the crowd whose kernels reach a point, and their weights there, itself among them.
    fn near(&self, i: usize) -> impl Iterator<Item = (usize, u64)> {
        let p = self.points[i];
        let [x, y, z] = self.cell(p);
        let around = (0..27).map(move |k| [x + k % 3 - 1, y + k / 3 % 3 - 1, z + k / 9 - 1]);
        let weight = move |j: usize| (weight(p.distance(self.points[j]) / self.spacing) * ONE).round() as u64;
        around.filter_map(|cell| self.cells.get(&cell)).flatten().map(move |&j| (j as usize, weight(j as usize)))
    }

    fn remove(&mut self, i: usize) {
        let cell = self.cell(self.points[i]);
        if let Some(list) = self.cells.get_mut(&cell)
            && let Some(at) = list.iter().position(|&j| j as usize == i)
        {
            list.swap_remove(at);
        }
    }
}

/// Removes the point where the kernels of all points that are left, of radius `spacing` in metres, add up to most, the first of equal ones,
/// until `count` are left. Their indices, ascending. `wanted`: how dense points shall be at each of them, relative to the others (above 0); none
/// for the same everywhere.
pub fn thin(points: &[Vec3], spacing: f32, count: usize, wanted: Option<&[f32]>) -> Vec<usize> {
    let lower = points.iter().fold(Vec3::INFINITY, |lower, p| lower.min(*p));
    let mut crowd = Crowd { points, lower, spacing, cells: BTreeMap::new() };
    for (i, p) in (0..).zip(points) {
        let cell = crowd.cell(*p);
        crowd.cells.entry(cell).or_default().push(i);
    }
    let density = |i: usize| crowd.near(i).map(|(_, weight)| weight).sum();
    let mut density: Vec<u64> = (0..points.len()).into_par_iter().map(density).collect();
    let crowding = |density: u64, i: usize| match wanted {
        Some(wanted) => (density as f64 / f64::from(wanted[i])) as u64,
        None => density,
    };
    // Densities as they were last known: what they are now is no more.
    let known = density.iter().enumerate().map(|(i, &density)| (crowding(density, i), Reverse(i)));
    let mut heap: BinaryHeap<_> = known.collect();
    let mut is_left = vec![true; points.len()];
    let mut left = points.len();
    while left > count
        && let Some((known, Reverse(i))) = heap.pop()
    {
        let now = crowding(density[i], i);
        if known > now {
            heap.push((now, Reverse(i)));
            continue;
        }
        crowd.near(i).for_each(|(j, weight)| density[j] -= weight);
        crowd.remove(i);
        is_left[i] = false;
        left -= 1;
    }
    (0..points.len()).filter(|&i| is_left[i]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::math::{hash_words, unit};

    /// All densities anew for every removal.
    fn by_force(points: &[Vec3], spacing: f32, count: usize) -> Vec<usize> {
        let mut left: Vec<usize> = (0..points.len()).collect();
        while left.len() > count {
            let one = |i: usize, j: usize| f64::from(weight(points[i].distance(points[j]) / spacing));
            let density = |i: usize| left.iter().map(|&j| (one(i, j) * f64::from(ONE)).round()).sum::<f64>();
            let densest = (0..left.len()).rev().max_by(|&a, &b| density(left[a]).total_cmp(&density(left[b]))).unwrap();
            left.remove(densest);
        }
        left
    }

    #[test]
    fn the_densest_goes_first_as_by_brute_force() {
        // Denser towards one side, and a lattice full of ties.
        let random = |i: u32, k: u32| unit(hash_words(&[i, k]));
        let scattered: Vec<Vec3> =
            (0..150).map(|i| Vec3::new(4.0 * random(i, 0).powi(2), 2.0 * random(i, 1), 3.0 * random(i, 2) - 1.0)).collect();
        let lattice: Vec<Vec3> = (0..125).map(|i| Vec3::new((i % 5) as f32, (i / 5 % 5) as f32, (i / 25) as f32)).collect();
        for points in [scattered, lattice] {
            for (spacing, count) in [(0.3, 100), (1.2, 20), (2.5, 5), (100.0, 2)] {
                assert_eq!(thin(&points, spacing, count, None), by_force(&points, spacing, count), "{spacing}");
            }
        }
    }

    #[test]
    fn more_are_left_where_more_are_wanted() {
        let points: Vec<Vec3> = (0..400).map(|i| Vec3::new((i % 20) as f32, (i / 20) as f32, 0.0)).collect();
        let wanted: Vec<f32> = points.iter().map(|p| if p.x < 10.0 { 3.0 } else { 1.0 }).collect();
        let left = thin(&points, 4.0, 100, Some(&wanted));
        let wanted_more = left.iter().filter(|&&i| points[i].x < 10.0).count();
        assert!((68..=82).contains(&wanted_more), "{wanted_more}");
    }

    #[test]
    fn nothing_goes_where_there_are_few_enough() {
        let points = [Vec3::ZERO, Vec3::X, Vec3::ZERO];
        assert_eq!(thin(&points, 1.0, 3, None), [0, 1, 2]);
        assert_eq!(thin(&points, 1.0, 9, None), [0, 1, 2]);
        assert_eq!(thin(&points, 1.0, 2, None), [1, 2], "of two points in one place one is left");
        assert_eq!(thin(&[], 1.0, 2, None), [0; 0]);
    }

    #[test]
    fn a_crowd_comes_down_to_an_even_set() {
        // A square, ten times as crowded in one quarter of it.
        let random = |i: u32, k: u32| unit(hash_words(&[i, k]));
        let corner = |i: u32| if i % 10 < 7 { 0.5 } else { 1.0 };
        let points: Vec<Vec3> = (0..6000).map(|i| Vec3::new(random(i, 0), random(i, 1), 0.0) * corner(i)).collect();
        let left = thin(&points, 0.1, 100, None);
        let crowded = left.iter().filter(|&&i| points[i].max_element() < 0.5).count();
        assert!((20..=32).contains(&crowded), "{crowded} of 100 in a quarter");
        let gap = |&i: &usize| left.iter().filter(|&&j| j != i).map(|&j| points[i].distance(points[j])).fold(9.0, f32::min);
        assert!(left.iter().map(gap).fold(9.0, f32::min) > 0.06);
    }
}
