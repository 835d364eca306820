//! How long things take.

use std::time::Instant;

/// Milliseconds of one pass after the other.
pub struct Clock {
    last: Instant,
    /// Passes in order, and their milliseconds.
    pub laps: Vec<(&'static str, f64)>,
}

impl Clock {
    /// Begins.
    pub fn start() -> Self {
        Self { last: Instant::now(), laps: Vec::new() }
    }

    /// Leaves out what happened since the last lap.
    pub fn restart(&mut self) {
        self.last = Instant::now();
    }

    /// Notes what has passed since the last lap, shared among passes that went by together in proportion to their `parts` of it.
    pub fn share(&mut self, passes: &[&'static str], parts: &[f64]) {
        let now = Instant::now();
        let scale = (now - self.last).as_secs_f64() * 1e3 / parts.iter().sum::<f64>().max(f64::MIN_POSITIVE);
        passes.iter().zip(parts).for_each(|(pass, part)| self.add(pass, part * scale));
        self.last = now;
    }

    /// Notes what has passed since the last lap, added to what `pass` took before.
    pub fn lap(&mut self, pass: &'static str) {
        let now = Instant::now();
        let ms = (now - self.last).as_secs_f64() * 1e3;
        self.add(pass, ms);
        self.last = now;
    }

    fn add(&mut self, pass: &'static str, ms: f64) {
        match self.laps.iter_mut().find(|(name, _)| *name == pass) {
            Some((_, sum)) => *sum += ms,
            None => self.laps.push((pass, ms)),
        }
    }
}

/// Seconds since this call, rounded to microseconds.
pub fn seconds() -> impl Fn() -> f64 {
    let start = Instant::now();
    move || (start.elapsed().as_secs_f64() * 1e6).round() / 1e6
}

/// The result of `work` and its milliseconds.
pub fn timed<T>(work: impl FnOnce() -> T) -> (T, f64) {
    let clock = seconds();
    let result = work();
    (result, clock() * 1e3)
}
