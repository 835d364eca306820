//! Equal time (§7.3: "same frame rate for each method"): the sample count with which a method takes as long a frame as it may.

use crate::common::Common;
use crate::render_path::Args;
use crate::timings::{Timings, frame_ms};
use anyhow::{Context, bail};
use reprobe::io::atomic;
use std::collections::BTreeMap;
use std::path::Path;

/// Milliseconds a frame that `--budget-ms` gives, or the other method that `--match-time` names took; `None` without either.
pub fn budget_ms(args: &Args, common: &Common) -> anyhow::Result<Option<f64>> {
    let budget = match &args.match_time {
        Some(folder) => Some(read(folder, common)?),
        None => args.budget_ms,
    };
    match budget {
        Some(ms) if !(ms.is_finite() && ms > 0.0) => bail!("a budget of {ms} ms a frame: expected a positive number"),
        _ => Ok(budget),
    }
}

/// The mean time of another run's frames.
fn read(folder: &Path, common: &Common) -> anyhow::Result<f64> {
    #[derive(serde::Deserialize)]
    struct Other {
        threads: usize,
        mean_ms: BTreeMap<String, f64>,
    }
    let path = folder.join("timings.json");
    let text =
        std::fs::read_to_string(&path).with_context(|| format!("{}: --match-time needs a folder of frames", path.display()))?;
    let other: Other = serde_json::from_str(&text).with_context(|| path.display().to_string())?;
    let threads = rayon::current_num_threads();
    if other.threads != threads && !common.quiet {
        eprintln!("reprobe: warning: {}: timed with {} threads; this run has {threads}", path.display(), other.threads);
    }
    let ms = frame_ms(&other.mean_ms);
    if ms <= 0.0 {
        bail!("{}: that run kept all its frames and timed none; render them again", path.display());
    }
    Ok(ms)
}

/// The count from 1 to `most` whose frame time comes nearest `budget` milliseconds, given the time that a count takes, about a
/// constant and a share a sample. Measures at three counts at the most.
pub fn choose(budget: f64, most: u32, time: &mut dyn FnMut(u32) -> anyhow::Result<f64>) -> anyhow::Result<u32> {
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

/// Writes down what was chosen before the frames are rendered with it, so that a run that is stopped can be repeated.
pub fn record(timings: &Timings, output: &Path) -> anyhow::Result<()> {
    Ok(atomic::write_json(&output.join("timings.json"), timings)?)
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
