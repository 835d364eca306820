//! Equal time (§7.3: "same frame rate for each method"): the sample count with which a method takes as long a frame as it may.

use super::Context;
use super::timings::frame_ms;
use crate::{Error, Result};
use std::collections::BTreeMap;
use std::path::Path;

/// Largest sample count that a budget may choose.
const MOST_SAMPLES: u32 = 1 << 16;

/// How long a frame may take.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Budget {
    /// Milliseconds.
    pub ms: f64,
}

/// An error for a number of milliseconds that is none.
pub fn check(ms: Option<f64>) -> Result<()> {
    match ms {
        Some(ms) if !(ms.is_finite() && ms > 0.0) => {
            Err(Error::Request(format!("a budget of {ms} ms a frame: expected a positive number")))
        }
        _ => Ok(()),
    }
}

impl Budget {
    /// `ms`, or what the frames of another run took; `None` without either.
    pub fn read(ms: Option<f64>, match_time: Option<&Path>, cx: &Context) -> Result<Option<Self>> {
        check(ms)?;
        let matched = match_time.map(|folder| mean_ms(folder, cx)).transpose()?;
        Ok(ms.or(matched).map(|ms| Self { ms }))
    }

    /// The sample count whose frames take about so long, given the time that a count takes.
    pub fn choose(&self, time: &mut dyn FnMut(u32) -> Result<f64>) -> Result<u32> {
        choose(self.ms, MOST_SAMPLES, time)
    }
}

/// The mean time of another run's frames.
fn mean_ms(folder: &Path, cx: &Context) -> Result<f64> {
    #[derive(serde::Deserialize)]
    struct Other {
        threads: usize,
        mean_ms: BTreeMap<String, f64>,
    }
    let path = folder.join("timings.json");
    let text =
        std::fs::read_to_string(&path).map_err(|e| Error::input(&path, format!("{e}: --match-time needs a folder of frames")))?;
    let other: Other = crate::io::json::parse(&path, &text)?;
    let threads = rayon::current_num_threads();
    if other.threads != threads {
        cx.listener.warn(&format!("{}: timed with {} threads; this run has {threads}", path.display(), other.threads));
    }
    let ms = frame_ms(&other.mean_ms);
    if ms <= 0.0 {
        return Err(Error::input(&path, "that run kept all its frames and timed none; render them again"));
    }
    Ok(ms)
}

/// The count from 1 to `most` whose frame time comes nearest `budget` milliseconds, given the time that a count takes, about a
/// constant and a share a sample. Measures at three counts at the most.
fn choose(budget: f64, most: u32, time: &mut dyn FnMut(u32) -> Result<f64>) -> Result<u32> {
    let clamp = |n: f64| n.round().clamp(1.0, f64::from(most)) as u32;
    // The first run also warms the caches.
    time(1)?;
    let one = time(1)?;
    if one >= budget {
        return Ok(1);
    }
    // At least a few: one sample more may be less than the noise.
    let mut count = clamp((budget / one).max(4.0));
    for _ in 0..2 {
        let taken = time(count)?;
        let slope = (taken - one) / f64::from(count.max(2) - 1);
        // Noise may hide a share so small; the count is then limited by nothing else.
        let better = if slope > 0.0 { clamp(1.0 + (budget - one) / slope) } else { most };
        let settled = better.abs_diff(count) * 10 <= count;
        count = better;
        if settled {
            break;
        }
    }
    Ok(count)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_count_is_the_one_that_a_linear_method_needs() {
        for (constant, share, budget, expected) in [
            (0.0, 10.0, 100.0, 10),
            (80.0, 5.0, 100.0, 4),
            (80.0, 0.1, 100.0, 200),
            (300.0, 10.0, 100.0, 1),
            (0.0, 1.0, 1e9, 4096),
        ] {
            let mut calls = 0;
            let mut time = |n: u32| {
                calls += 1;
                Ok(constant + share * f64::from(n))
            };
            let found = choose(budget, 4096, &mut time).unwrap();
            assert_eq!(found, expected, "{constant} {share} {budget}");
            assert!(calls <= 4);
        }
    }

    #[test]
    fn noise_in_the_timings_moves_the_count_by_about_as_much() {
        let mut k = 0;
        let mut time = |n: u32| {
            k += 1;
            Ok((40.0 + 7.0 * f64::from(n)) * (1.0 + 0.03 * f64::from(k % 3 - 1)))
        };
        let found = choose(400.0, 1 << 20, &mut time).unwrap();
        // (400 - 40) / 7 = 51.
        assert!((47..56).contains(&found), "{found}");
    }
}
