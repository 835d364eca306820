//! What a person hears of a run on stderr: on a terminal a bar with the time left; elsewhere a line as each piece of work starts, and one
//! every half minute with what is done and what is left.

use indicatif::{HumanDuration, ProgressBar, ProgressDrawTarget, ProgressStyle};
use reprobe::base::progress::Progress;
use reprobe::plan::Listener;
use std::io::{IsTerminal as _, Write as _};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Time between two lines about one piece of work.
const PERIOD: Duration = Duration::from_secs(30);

/// Shows progress and says what a stage has to say.
pub struct Terminal {
    quiet: bool,
    verbose: bool,
    work: Mutex<Option<Work>>,
}

/// How the piece of work at hand is shown.
enum Work {
    Bar(ProgressBar),
    Lines(Lines),
}

/// A thread that prints a line now and then.
struct Lines {
    done: Arc<AtomicU64>,
    /// Dropped to end the thread.
    stop: Sender<()>,
    thread: JoinHandle<()>,
}

impl Lines {
    fn new(what: String, total: u64) -> Self {
        let done = Arc::<AtomicU64>::default();
        let (stop, stopped) = channel();
        let (count, start) = (done.clone(), Instant::now());
        let thread = std::thread::spawn(move || {
            while stopped.recv_timeout(PERIOD) == Err(RecvTimeoutError::Timeout) {
                put(&line(&what, count.load(Ordering::Relaxed), total, start.elapsed()));
            }
        });
        Self { done, stop, thread }
    }

    fn end(self) {
        drop(self.stop);
        let _ = self.thread.join();
    }
}

/// Prints a line to stderr, where anybody takes it.
pub fn put(line: &str) {
    let _ = writeln!(std::io::stderr(), "{line}");
}

/// What is done, and what is left at that pace.
fn line(what: &str, done: u64, total: u64, gone: Duration) -> String {
    let share = done as f64 / total.max(1) as f64;
    let left = match share {
        s if s > 0.0 => format!("some {} left", HumanDuration(gone.mul_f64((1.0 / s - 1.0).max(0.0)))),
        _ => "time left unknown".into(),
    };
    format!("{what}: {:.0} % done after {}, {left}", share * 100.0, HumanDuration(gone))
}

impl Terminal {
    /// `quiet`: warnings alone. `verbose`: more.
    pub fn new(quiet: bool, verbose: bool) -> Self {
        Self { quiet, verbose, work: Mutex::new(None) }
    }

    fn work(&self) -> MutexGuard<'_, Option<Work>> {
        self.work.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Prints a line above the bar.
    fn print(&self, line: &str) {
        match &*self.work() {
            Some(Work::Bar(bar)) => bar.suspend(|| put(line)),
            _ => put(line),
        }
    }
}

impl Progress for Terminal {
    fn start(&self, what: &str, total: u64) {
        if self.quiet || total == 0 {
            return;
        }
        let work = if std::io::stderr().is_terminal() {
            let style = ProgressStyle::with_template("{msg:24} {wide_bar} {percent:>3} %  {elapsed} gone, {eta} left")
                .unwrap_or_else(|_| ProgressStyle::default_bar());
            let bar = ProgressBar::with_draw_target(Some(total), ProgressDrawTarget::stderr());
            Work::Bar(bar.with_style(style).with_message(what.to_owned()))
        } else {
            put(&format!("{what} ..."));
            Work::Lines(Lines::new(what.to_owned(), total))
        };
        *self.work() = Some(work);
    }

    fn advance(&self, n: u64) {
        match &*self.work() {
            Some(Work::Bar(bar)) => bar.inc(n),
            Some(Work::Lines(lines)) => {
                lines.done.fetch_add(n, Ordering::Relaxed);
            }
            None => {}
        }
    }

    fn finish(&self) {
        match self.work().take() {
            Some(Work::Bar(bar)) => {
                // Drawn full before it goes, as it is drawn some times a second only.
                bar.finish();
                bar.finish_and_clear();
            }
            Some(Work::Lines(lines)) => lines.end(),
            None => {}
        }
    }
}

impl Listener for Terminal {
    fn warn(&self, message: &str) {
        self.print(&format!("reprobe: warning: {message}"));
    }

    fn say(&self, line: &str) {
        if !self.quiet {
            self.print(line);
        }
    }

    fn detail(&self, line: &str) {
        if self.verbose {
            self.print(line);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_tells_what_is_done_and_what_is_left() {
        let minute = Duration::from_secs(60);
        assert_eq!(line("probes", 1, 4, minute), "probes: 25 % done after 60 seconds, some 3 minutes left");
        assert_eq!(line("probes", 0, 4, minute), "probes: 0 % done after 60 seconds, time left unknown");
        assert_eq!(line("probes", 4, 4, minute), "probes: 100 % done after 60 seconds, some 0 seconds left");
        assert_eq!(line("nothing", 0, 0, minute), "nothing: 0 % done after 60 seconds, time left unknown");
    }
}
