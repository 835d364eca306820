//! How long things take.

use std::time::Instant;

/// Milliseconds of one pass after the other.
pub(crate) struct Clock {
    last: Instant,
    pub(crate) laps: Vec<(&'static str, f64)>,
}

impl Clock {
    pub(crate) fn start() -> Self {
        Self { last: Instant::now(), laps: Vec::new() }
    }

    /// Leaves out what happened since the last lap.
    pub(crate) fn restart(&mut self) {
        self.last = Instant::now();
    }

    /// Notes what has passed since the last lap, added to what `pass` took before.
    pub(crate) fn lap(&mut self, pass: &'static str) {
        let now = Instant::now();
        let ms = (now - self.last).as_secs_f64() * 1e3;
        match self.laps.iter_mut().find(|(name, _)| *name == pass) {
            Some((_, sum)) => *sum += ms,
            None => self.laps.push((pass, ms)),
        }
        self.last = now;
    }
}
