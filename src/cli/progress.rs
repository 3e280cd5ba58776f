//! Progress bars on terminals, for work that takes longer than a second.

use super::terminal::is_animated;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Work shorter than this gets no bar.
const PATIENCE: Duration = Duration::from_secs(1);
const STEPS: f64 = 1000.0;

/// The progress of one task. Dropping it removes the bar.
#[derive(Debug)]
pub(super) struct Progress {
    bar: ProgressBar,
    begun: Instant,
    shown: AtomicBool,
}

impl Progress {
    /// Starts the progress of a task of known length.
    pub(super) fn of(doing: &'static str) -> Self {
        let style = ProgressStyle::with_template("{msg} {bar:40} {percent:>3} %  {eta} left");
        let bar = ProgressBar::with_draw_target(Some(STEPS as u64), ProgressDrawTarget::hidden())
            .with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
            .with_message(doing);
        Self { bar, begun: Instant::now(), shown: AtomicBool::new(false) }
    }

    /// Does work that tells the fraction done.
    pub(super) fn during<T>(doing: &'static str, work: impl FnOnce(&(dyn Fn(f64) + Sync)) -> T) -> T {
        let progress = Self::of(doing);
        work(&|part| progress.at(part))
    }

    /// Sets the fraction that is done, 0 to 1.
    pub(super) fn at(&self, part: f64) {
        if is_animated() && self.begun.elapsed() > PATIENCE && !self.shown.swap(true, Ordering::Relaxed) {
            self.bar.set_draw_target(ProgressDrawTarget::stderr_with_hz(10));
        }
        self.bar.set_position((part * STEPS) as u64);
    }

    /// Starts the progress of a task of unknown length, shown as a spinner.
    pub(super) fn unknown(doing: &'static str) -> Self {
        let bar = match is_animated() {
            true => ProgressBar::new_spinner().with_message(doing),
            false => ProgressBar::hidden(),
        };
        bar.enable_steady_tick(Duration::from_millis(120));
        Self { bar, begun: Instant::now(), shown: AtomicBool::new(true) }
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}
