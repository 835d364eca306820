//! What the benches share.

use std::hint::black_box;
use std::time::Instant;

/// Best of `n` runs, printed.
pub fn time<T>(what: &str, n: u32, mut f: impl FnMut() -> T) -> T {
    let mut best = f64::INFINITY;
    let mut result = None;
    for _ in 0..n {
        let start = Instant::now();
        result = Some(black_box(f()));
        best = best.min(start.elapsed().as_secs_f64());
    }
    println!("{what:40} {:8.1} ms", best * 1e3);
    result.expect("at least one run")
}
