//! How much work a dispatch gets: so much that launching it costs nothing, so little that no driver takes the device for hung.

use std::time::Instant;

/// What a dispatch should take, seconds. Drivers' watchdogs wait for two seconds or more.
const AIM: f64 = 0.15;

/// Pieces of work a dispatch, learnt from those before.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Pace {
    pieces: f64,
}

impl Pace {
    /// Begins with so many pieces.
    pub fn new(pieces: usize) -> Self {
        Self { pieces: pieces as f64 }
    }

    /// Pieces that the next dispatch should have.
    pub fn pieces(&self) -> usize {
        self.pieces as usize
    }

    /// Runs a dispatch of so many pieces, and learns from the time that it takes.
    pub fn run<T>(&mut self, pieces: usize, dispatch: impl FnOnce() -> T) -> T {
        let began = Instant::now();
        let result = dispatch();
        self.learn(pieces, began.elapsed().as_secs_f64());
        result
    }

    /// A small dispatch says little of a large one's time, so the next is at most four times as large.
    fn learn(&mut self, pieces: usize, seconds: f64) {
        let fitting = pieces as f64 * AIM / seconds.max(1e-6);
        self.pieces = fitting.clamp(0.25 * self.pieces, 4.0 * self.pieces).clamp(64.0, f64::from(u32::MAX));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dispatches_come_to_last_as_long_as_they_should() {
        for pieces_a_second in [1e3, 1e6, 1e9] {
            let mut pace = Pace::new(4096);
            for _ in 0..12 {
                let pieces = pace.pieces();
                pace.learn(pieces, 1e-4 + pieces as f64 / pieces_a_second);
            }
            let seconds = pace.pieces() as f64 / pieces_a_second;
            assert!((seconds - AIM).abs() < 0.1 * AIM, "{seconds} s a dispatch at {pieces_a_second} pieces a second");
        }
    }
}
