//! Discrete distributions, sampled by inversion.

use crate::base::prefetch::prefetch_at;

/// Running sums of a discrete distribution, with a table that tells where to begin to look.
#[derive(Debug, Clone)]
pub struct Steps {
    /// From 0 to 1; one entry more than there are outcomes.
    pub(crate) sums: Vec<f32>,
    /// For each of the equal parts of [0, 1], one for [`PER_PART`] outcomes: the first and the last step that may hold one of its numbers.
    guide: Vec<[u32; 2]>,
}

/// Outcomes for which the table has one entry: two lines of the cache of `sums`. With an entry for each outcome, the tables of an
/// environment's rows drive one another out of the cache.
const PER_PART: usize = 32;

/// Sums in a line of the cache, and lines that are fetched at the most.
const PER_LINE: usize = 16;
const MOST_LINES: usize = 4;

impl Steps {
    /// The distribution in proportion to `values` (not negative, at least one), and their sum. Even where that is zero.
    pub fn new(values: impl IntoIterator<Item = f64>) -> (Self, f64) {
        let mut running = vec![0.0];
        let mut total = 0.0;
        for v in values {
            total += v;
            running.push(total);
        }
        let last = running.len() - 1;
        let sums: Vec<f32> = running
            .iter()
            .enumerate()
            .map(|(i, s)| match i {
                i if i == last => 1.0,
                _ if total > 0.0 => (s / total) as f32,
                i => i as f32 / last as f32,
            })
            .collect();
        let parts = last.div_ceil(PER_PART);
        // A little early where parts begin and a little late where they end, against rounding.
        let step = |u: f32| (sums.partition_point(|&sum| sum <= u).max(1) - 1).min(last - 1) as u32;
        let edge = |part: usize| part as f32 / parts as f32;
        let guide = (0..parts)
            .map(|part| [edge(part) * (1.0 - 4.0 * f32::EPSILON), edge(part + 1) * (1.0 + 4.0 * f32::EPSILON)].map(step));
        let guide = guide.collect();
        (Self { sums, guide }, total)
    }

    /// The first and the last step that `u` may fall on.
    fn bounds(&self, u: f32) -> [usize; 2] {
        let parts = self.guide.len();
        self.guide[((u * parts as f32) as usize).min(parts - 1)].map(|step| step as usize)
    }

    /// Tells the caches what [`Steps::pick`] will read.
    pub fn prefetch(&self, u: f32) {
        let [first, last] = self.bounds(u);
        // Where outcomes are unlikely, many share a part.
        for step in (first..=last).step_by(PER_LINE).take(MOST_LINES) {
            prefetch_at(&self.sums, step);
        }
        prefetch_at(&self.sums, last);
    }

    /// The number that [`Steps::pick`] takes for an outcome and a place in its step.
    pub fn at(&self, step: usize, rest: f32) -> f32 {
        self.sums[step] + (self.sums[step + 1] - self.sums[step]) * rest
    }

    /// The outcome that `u` in [0, 1) falls on, and where in its step, in [0, 1).
    pub fn pick(&self, u: f32) -> (usize, f32) {
        let [first, last] = self.bounds(u);
        let step = first + self.sums[first + 1..=last].partition_point(|&sum| sum <= u);
        let height = self.sums[step + 1] - self.sums[step];
        let rest = if height > 0.0 { (u - self.sums[step]) / height } else { 0.0 };
        (step, rest.clamp(0.0, 1.0 - f32::EPSILON))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_guide_finds_what_a_search_finds() {
        let mut x = 1u32;
        for count in [1, 2, 7, 300] {
            let values: Vec<f64> = (0..count)
                .map(|i| {
                    x = crate::base::math::hash_words(&[x, i]);
                    if x.is_multiple_of(3) { 0.0 } else { f64::from(x >> 20).powi(3) }
                })
                .collect();
            let (steps, total) = Steps::new(values.iter().copied());
            assert_eq!(total, values.iter().sum::<f64>());
            for i in 0..20_000u32 {
                let u = crate::base::math::hash_words(&[i, 5]) as f32 / (1u64 << 32) as f32;
                let u = if i < 300 { steps.sums[i as usize % count as usize] } else { u.min(1.0 - f32::EPSILON) };
                let searched = steps.sums.partition_point(|&s| s <= u).clamp(1, count as usize) - 1;
                let (found, rest) = steps.pick(u);
                assert_eq!(found, searched, "u {u} of {count}");
                assert!((0.0..1.0).contains(&rest) && (values[found] > 0.0 || total == 0.0 || u >= 1.0 - 1e-6));
            }
        }
    }

    #[test]
    fn nothing_but_zeros_is_even() {
        let (steps, total) = Steps::new([0.0; 4]);
        assert_eq!(total, 0.0);
        assert_eq!(steps.pick(0.6), (2, 0.4000001));
    }
}
