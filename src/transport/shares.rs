//! A density that two uniform numbers are drawn by: shares of the parts of a square.

use crate::base::prefetch::prefetch;
use bytemuck::{Pod, Zeroable};
use glam::Vec2;

/// Parts along either side of the square of numbers.
pub(crate) const SIDE: usize = 16;
pub(crate) const PARTS: usize = SIDE * SIDE;

/// The part that two numbers lie in.
pub(super) fn part(v: Vec2) -> usize {
    let [x, y] = [v.x, v.y].map(|u| ((u * SIDE as f32) as usize).min(SIDE - 1));
    y * SIDE + x
}

/// Shares of the parts: of the rows, and along each row.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub(crate) struct Shares {
    rows: Edges,
    columns: [Edges; SIDE],
}

/// Words that the GPU has of one.
#[cfg(test)]
pub(crate) const SHARE_WORDS: usize = size_of::<Shares>() / size_of::<u32>();

impl Shares {
    /// In proportion to `weights`, but for the share `even` of all, which goes to all parts alike, as it all does where weights are zero or
    /// not numbers.
    pub(super) fn new(weights: &[f32; PARTS], even: f32) -> Self {
        let total: f32 = weights.iter().sum();
        let least = 1.0 / PARTS as f32;
        let share =
            |weight: f32| if total > 0.0 && total.is_finite() { even * least + (1.0 - even) * weight / total } else { least };
        let shares = weights.map(share);
        let row = |y: usize| &shares[y * SIDE..(y + 1) * SIDE];
        let rows = Edges::new(std::array::from_fn(|y| row(y).iter().sum()));
        Self { rows, columns: std::array::from_fn(|y| Edges::new(std::array::from_fn(|x| row(y)[x]))) }
    }

    /// Tells the caches that it will be read.
    #[inline]
    pub(super) fn prefetch(&self) {
        prefetch(&self.rows);
        for row in (1..SIDE).step_by(2) {
            prefetch(&self.columns[row]);
        }
    }

    /// What becomes of two uniform numbers, and their density.
    pub(super) fn draw(&self, v: Vec2) -> (Vec2, f32) {
        let (row, y, height) = self.rows.pick(v.y);
        let (column, x, width) = self.columns[row].pick(v.x);
        ((Vec2::new(column as f32, row as f32) + Vec2::new(x, y)) / SIDE as f32, height * width * PARTS as f32)
    }

    /// Density of two numbers that [`Shares::draw`] returns.
    pub(super) fn density(&self, v: Vec2) -> f32 {
        let (row, column) = (part(v) / SIDE, part(v) % SIDE);
        self.rows.share(row) * self.columns[row].share(column) * PARTS as f32
    }
}

/// Where steps of a distribution begin, as shares of 2^16.
#[repr(transparent)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct Edges([u16; SIDE]);

pub(crate) const WHOLE: f32 = 65536.0;

impl Edges {
    /// Steps in proportion to `shares`, none of which is below a 2000th of all.
    fn new(shares: [f32; SIDE]) -> Self {
        let total: f32 = shares.iter().sum();
        let mut sum = 0.0;
        Self(shares.map(|share| {
            let edge = (sum / total * WHOLE) as u16;
            sum += share;
            edge
        }))
    }

    fn ends(&self, step: usize) -> [f32; 2] {
        [f32::from(self.0[step]), self.0.get(step + 1).map_or(WHOLE, |&edge| f32::from(edge))]
    }

    fn share(&self, step: usize) -> f32 {
        let [begin, end] = self.ends(step);
        (end - begin) / WHOLE
    }

    /// The step that `u` falls on, where in it, and its share.
    fn pick(&self, u: f32) -> (usize, f32, f32) {
        let at = (u * WHOLE) as u16;
        // The first begins at zero. Counted in numbers as wide as the edges are, which is what lanes can do.
        let begun: u16 = self.0.iter().map(|&edge| u16::from(edge <= at)).sum();
        let step = usize::from(begun) - 1;
        let [begin, end] = self.ends(step);
        (step, ((u * WHOLE - begin) / (end - begin)).clamp(0.0, 1.0 - f32::EPSILON), (end - begin) / WHOLE)
    }
}

/// What parts at the edges of a part count for beside it.
const BESIDE: f32 = 0.25;

/// Each part's mean with those beside it, those at its corners by the square of [`BESIDE`]: for what each has been drawn for a few times only.
pub(super) fn smoothed(values: &[f32; PARTS]) -> [f32; PARTS] {
    let mut along = *values;
    for step in [1, SIDE] {
        let of = along;
        let mean = |i: usize| {
            let at = i / step % SIDE;
            let (before, after) = (if at > 0 { BESIDE } else { 0.0 }, if at + 1 < SIDE { BESIDE } else { 0.0 });
            let sum = of[i] + before * of[i.wrapping_sub(step) % PARTS] + after * of[(i + step) % PARTS];
            sum / (1.0 + before + after)
        };
        along = std::array::from_fn(mean);
    }
    along
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transport::Sampler;

    #[test]
    fn shares_are_a_density_and_what_is_drawn_has_it() {
        let even = 0.1;
        for power in 0..4 {
            let weights = std::array::from_fn(|i| ((i * 37 % PARTS) as f32 / PARTS as f32).powi(power));
            let shares = Shares::new(&smoothed(&weights), even);
            let of = |i: usize| shares.density(Vec2::new((i % SIDE) as f32, (i / SIDE) as f32) / SIDE as f32);
            let total: f32 = (0..PARTS).map(of).sum();
            assert!((total / PARTS as f32 - 1.0).abs() < 1e-4, "{total}");
            let mut found = [0u32; PARTS];
            for k in 0..4096 {
                let (v, density) = shares.draw(Sampler::new(3, k).next_2d());
                found[part(v)] += 1;
                assert!(density == shares.density(v) && density >= 0.9 * even, "{v}: {density}");
            }
            // Stratified by rows and columns, so that parts are off by a few numbers at the most.
            for (i, &n) in found.iter().enumerate() {
                let expected = 16.0 * of(i);
                assert!((n as f32 - expected).abs() < 4.0 * expected.sqrt() + 4.0, "part {i}: {n}, not {expected}");
            }
        }
    }

    #[test]
    fn parts_share_with_those_beside_them() {
        let one = |at: usize| smoothed(&std::array::from_fn(|i| f32::from(i == at)));
        let middle = 5 * SIDE + 7;
        let [inside, corner] = [one(middle), one(0)];
        let w = 1.0 / 1.5;
        for (offset, weight) in [(0, 1.0), (1, 0.25), (SIDE, 0.25), (SIDE + 1, 0.0625), (2, 0.0)] {
            assert!(
                (inside[middle + offset] - weight * w * w).abs() < 1e-6 && inside[middle - offset] == inside[middle + offset]
            );
        }
        // What is at the border has fewer beside it.
        assert!((corner[0] - 0.64).abs() < 1e-6 && (corner[1] - 0.2 * w).abs() < 1e-6 && corner[SIDE - 1] == 0.0);
        assert!(smoothed(&[3.0; PARTS]).iter().all(|x| (x - 3.0).abs() < 1e-6));
    }

    #[test]
    fn weights_that_say_nothing_leave_numbers_as_they_are() {
        for weights in [[0.0; PARTS], [f32::INFINITY; PARTS], [f32::NAN; PARTS]] {
            let v = Vec2::new(0.3, 0.7);
            let (same, density) = Shares::new(&weights, 0.1).draw(v);
            assert!(same.distance(v) < 1e-5 && density == 1.0, "{same}, {density}");
        }
    }
}
