//! What estimates of scattered radiance were like, by place and direction: second moment, variance, cost.

use crate::base::math::{Rgb, floor, hash64};
use crate::base::octahedral;
use crate::material::Surface;
use crate::transport::places::{middle_of, side_of};
use glam::{DVec3, Vec3, Vec3Swizzles};
use std::collections::HashMap;
use std::hash::{BuildHasherDefault, Hasher};

/// Cells along the longest side of what the camera sees. Finer ones know less of each: with 64 the gain halves.
const ACROSS: f32 = 8.0;

/// Cells that a coordinate tells apart.
const COORDINATES: i64 = 1 << 8;

/// Bins of an outgoing direction along either axis of the octahedron.
const BINS: f32 = 4.0;

/// Estimates from which on a cell is believed.
const BELIEVED: f64 = 16.0;

/// Where estimates of one kind are put together: a cube of space, the side of it that the normal points to, a material, and a
/// bin of outgoing directions where it has other than diffuse lobes.
#[derive(Debug, Clone, Copy)]
struct Cell {
    at: [u64; 3],
    side: u64,
    direction: u64,
    material: u64,
}

impl Cell {
    /// The level of the finest key.
    const FINEST: u64 = 1;

    /// From the finest to what is known of the material all around.
    fn keys(self) -> impl Iterator<Item = u64> {
        (Self::FINEST..=3).map(move |level| self.key(level))
    }

    fn key(self, level: u64) -> u64 {
        let Self { at, side, direction, material } = self;
        let (at, side, direction) = match level {
            Self::FINEST => (at, side, direction),
            2 => (at, side, 0),
            _ => (at.map(|x| x >> 2), 0, 0),
        };
        at.iter().fold(level, |k, x| k << 8 | x) << 32 | side << 29 | direction << 24 | (material & 0xff_ffff)
    }
}

/// The grid of cells over the part of a scene that matters.
#[derive(Debug, Clone, Copy)]
pub(super) struct Grid {
    corner: Vec3,
    per_metre: f32,
}

impl Grid {
    /// A grid over [`middle_of`] points.
    fn over(points: Vec<Vec3>) -> Self {
        let [corner, end] = middle_of(points);
        let longest = (end - corner).max_element();
        Self { corner, per_metre: if longest > 0.0 { ACROSS / longest } else { 0.0 } }
    }

    fn cell(&self, s: &Surface, wo: Option<Vec3>) -> Cell {
        let p = (s.p - self.corner) * self.per_metre;
        let at = p.to_array().map(|x| (floor(x) + COORDINATES / 2).clamp(0, COORDINATES - 1) as u64);
        let side = side_of(s.frame.n).into();
        Cell { at, side, direction: wo.map_or(0, octahedral_bin), material: u64::from(s.material) }
    }
}

/// The bin, from 1 on, of a unit direction on the octahedral map about Z.
fn octahedral_bin(d: Vec3) -> u64 {
    let [x, y] = (octahedral::encode(d.xzy()) * BINS).to_array().map(|v| v.clamp(0.0, BINS - 1.0) as u64);
    1 + x * BINS as u64 + y
}

/// Radiance, and what it took to estimate it.
#[derive(Debug, Clone, Copy, Default)]
pub struct Estimate {
    /// Radiance.
    pub light: Rgb,
    /// In the unit of [`RAY_COST`].
    pub cost: f32,
}

impl Estimate {
    pub(super) fn add(&mut self, other: Self, weight: Rgb) {
        self.light += weight * other.light;
        self.cost += other.cost;
    }
}

/// Cost of a ray with the surface that it meets; of the camera's, too. Costs are in any unit that all share: profiles of five scenes
/// have these ratios.
pub const RAY_COST: f32 = 1.2;

/// Estimates of one kind in a cell, or their sums.
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    count: f64,
    cost: f64,
    light: DVec3,
    squares: DVec3,
}

impl Sums {
    fn of(estimate: &Estimate) -> Self {
        let light = estimate.light.as_dvec3();
        Self { count: 1.0, cost: f64::from(estimate.cost), light, squares: light * light }
    }

    fn add(&mut self, other: &Self) {
        self.count += other.count;
        self.cost += other.cost;
        self.light += other.light;
        self.squares += other.squares;
    }
}

/// Estimates as they come in, by their cells. Tallies of parts of an image are put together in the order of the parts, so that sums do not depend
/// on threads.
#[derive(Debug, Clone)]
pub struct Tally {
    grid: Grid,
    cells: HashMap<u64, (Cell, [Sums; 2]), BuildHasherDefault<Mixed>>,
}

impl Tally {
    /// One whose grid lies over `points`: what the camera sees.
    pub fn over(points: Vec<Vec3>) -> Self {
        Self { grid: Grid::over(points), cells: HashMap::default() }
    }

    /// One over the same grid, with nothing in it.
    pub fn empty(&self) -> Self {
        Self { grid: self.grid, cells: HashMap::default() }
    }

    /// Takes in an estimate, of a kind, of the light that `s` scatters, to `wo` where its material has other than diffuse lobes.
    pub fn record(&mut self, s: &Surface, wo: Option<Vec3>, kind: Kind, estimate: &Estimate) {
        let cell = self.grid.cell(s, wo);
        self.cells.entry(cell.key(Cell::FINEST)).or_insert((cell, [Sums::default(); 2])).1[kind as usize]
            .add(&Sums::of(estimate));
    }

    /// Takes in all of another one.
    pub fn absorb(&mut self, other: &Self) {
        for (&key, (cell, sums)) in &other.cells {
            let (_, mine) = self.cells.entry(key).or_insert((*cell, [Sums::default(); 2]));
            mine.iter_mut().zip(sums).for_each(|(mine, sums)| mine.add(sums));
        }
    }

    /// What is to be believed of it.
    pub fn moments(&self) -> Moments {
        let mut fine: Vec<_> = self.cells.iter().collect();
        fine.sort_by_key(|(key, _)| **key);
        let mut all: HashMap<u64, [Sums; 2], BuildHasherDefault<Mixed>> = HashMap::default();
        for (_, (cell, sums)) in fine {
            for key in cell.keys() {
                let whole = all.entry(key).or_default();
                whole.iter_mut().zip(sums).for_each(|(whole, sums)| whole.add(sums));
            }
        }
        all.retain(|_, [direct, onward]| direct.count.min(onward.count) >= BELIEVED);
        let empty = (0, [Moment::default(); 2]);
        let mut moments = Moments { grid: self.grid, slots: vec![empty; (2 * all.len()).max(2).next_power_of_two()] };
        for (key, sums) in &all {
            let slot = moments.slot(*key);
            moments.slots[slot] = (*key, sums.map(|s| Moment::of(&s)));
        }
        moments
    }
}

/// The two estimates at a vertex.
#[derive(Debug, Clone, Copy)]
pub enum Kind {
    /// Light straight from an emitter that was drawn.
    Direct,
    /// What a ray in a direction that was drawn from the scattering model brings.
    Onward,
}

/// What one estimate of a kind is like in a cell.
#[derive(Debug, Clone, Copy, Default)]
pub struct Moment {
    /// Mean square over mean cost.
    pub square: Rgb,
    /// Variance as a share of the mean square, all colours together.
    pub variance: f32,
}

impl Moment {
    fn of(sums: &Sums) -> Self {
        let (mean, square) = (sums.light / sums.count, sums.squares / sums.count);
        let total = square.element_sum();
        let variance = if total > 0.0 { (total - mean.length_squared()).max(0.0) / total } else { 0.0 };
        Self {
            square: (square / (sums.cost / sums.count).max(f64::from(f32::MIN_POSITIVE))).as_vec3(),
            variance: variance as f32,
        }
    }
}

/// Moments by cell, to be looked up.
#[derive(Debug)]
pub struct Moments {
    grid: Grid,
    /// Keys and what they stand for; zero where there is none. At least half are empty.
    slots: Vec<(u64, [Moment; 2])>,
}

impl Moments {
    /// What is known of estimates at `s` (to `wo` where that matters), of the finest kind of cell that has seen enough.
    pub fn at(&self, s: &Surface, wo: Option<Vec3>) -> Option<[Moment; 2]> {
        let found = |key| {
            let (has, moments) = &self.slots[self.slot(key)];
            (*has == key).then_some(*moments)
        };
        self.grid.cell(s, wo).keys().find_map(found)
    }

    /// Where a key lies, or would.
    fn slot(&self, key: u64) -> usize {
        let mask = self.slots.len() - 1;
        let mut slot = hash64(key) as usize & mask;
        while self.slots[slot].0 != key && self.slots[slot].0 != 0 {
            slot = (slot + 1) & mask;
        }
        slot
    }
}

/// A hash of keys that are single numbers.
#[derive(Default)]
struct Mixed(u64);

impl Hasher for Mixed {
    fn finish(&self) -> u64 {
        self.0
    }

    fn write(&mut self, bytes: &[u8]) {
        bytes.iter().for_each(|&b| self.write_u64(u64::from(b)));
    }

    fn write_u64(&mut self, x: u64) {
        self.0 = hash64(self.0 ^ x);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(p: Vec3, n: Vec3, material: u32) -> Surface {
        Surface { material, ..Surface::flat(p, n) }
    }

    /// A tally over a metre each way, with `count` estimates at `s` of either kind, whose light is 1, 3, 1, 3, ...
    fn filled(s: &Surface, wo: Option<Vec3>, count: u32) -> Tally {
        let mut tally = Tally::over((0..1000).map(|i| Vec3::splat(i as f32 / 999.0)).collect());
        for i in 0..count {
            let light = Rgb::new(1.0, 0.0, 0.0) * if i % 2 == 0 { 1.0 } else { 3.0 };
            tally.record(s, wo, Kind::Direct, &Estimate { light: light * 0.5, cost: 0.5 });
            tally.record(s, wo, Kind::Onward, &Estimate { light, cost: 4.0 });
        }
        tally
    }

    #[test]
    fn a_cell_has_the_moments_of_its_estimates() {
        let s = at(Vec3::splat(0.5), Vec3::Z, 3);
        let [direct, onward] = filled(&s, None, 20).moments().at(&s, None).unwrap();
        // Mean 2, mean square 5, variance 1.
        assert!((onward.square - Rgb::new(5.0 / 4.0, 0.0, 0.0)).length() < 1e-6 && (onward.variance - 0.2).abs() < 1e-6);
        assert!((direct.square.x - 5.0 / 4.0 / 0.5).abs() < 1e-6 && (direct.variance - 0.2).abs() < 1e-6);
    }

    #[test]
    fn places_that_have_seen_little_go_by_what_is_around_them() {
        let (s, up) = (at(Vec3::splat(0.52), Vec3::Z, 3), Some(Vec3::Z));
        let moments = filled(&s, up, 20).moments();
        let knows = |s: &Surface, wo| moments.at(s, wo).is_some();
        assert!(knows(&s, up) && knows(&s, None), "another direction, of this cell");
        assert!(knows(&at(Vec3::splat(0.6), Vec3::X, 3), None), "the material all around");
        assert!(!knows(&at(s.p, Vec3::Z, 4), None), "another material");
        assert!(!knows(&at(Vec3::splat(9.0), Vec3::Z, 3), None), "far away");
        assert!(filled(&s, up, 15).moments().at(&s, up).is_none(), "too few");
    }

    #[test]
    fn parts_add_up_to_the_whole() {
        let s = at(Vec3::splat(0.5), Vec3::NEG_Y, 0);
        let mut sum = filled(&s, None, 10);
        sum.absorb(&filled(&s, None, 20));
        let [a, b] = [sum, filled(&s, None, 30)].map(|t| t.moments().at(&s, None).unwrap());
        assert_eq!((a[1].square, a[1].variance, a[0].square), (b[1].square, b[1].variance, b[0].square));
    }

    #[test]
    fn every_direction_has_one_of_sixteen_bins() {
        let mut seen = [0; 17];
        for i in 0..4096 {
            seen[octahedral_bin(crate::base::math::spread_over_sphere(i, 4096)) as usize] += 1;
        }
        assert!(seen[0] == 0 && seen[1..].iter().all(|&n| (80..600).contains(&n)), "{seen:?}");
    }
}
