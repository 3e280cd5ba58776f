//! State that a stream's callbacks share with the rest of the program, without waiting.

use super::CardCounts;
use haptograph_engine::run::SharedHistogram;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::Relaxed};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Counts and flags of a stream.
#[derive(Debug, Default)]
pub(super) struct Shared {
    pub callbacks: AtomicU64,
    pub clipped: AtomicU64,
    pub xruns: AtomicU64,
    xrun_delay_max_ns: AtomicU64,
    xrun_last_ns: AtomicU64,
    /// The next callback is the first after an xrun.
    pub after_xrun: AtomicBool,
    /// Times between callback and converter, as the system states them.
    pub latency: SharedHistogram,
    /// The run has ended and all outputs have faded out.
    pub at_rest: AtomicBool,
}

impl Shared {
    /// The counts of a stream whose card has vanished `vanished` times.
    pub(super) fn counts(&self, vanished: u64) -> CardCounts {
        CardCounts {
            xruns: self.xruns.load(Relaxed),
            xrun_delay_max_ns: self.xrun_delay_max_ns.load(Relaxed),
            xrun_last_ns: self.xrun_last_ns.load(Relaxed),
            clipped: self.clipped.load(Relaxed),
            vanished,
            latency: self.latency.read(),
        }
    }
}

/// Divisor of a callback's earliness by which later callbacks are expected earlier.
const FOLLOWS: u32 = 64;

/// Expected times of a stream's callbacks.
pub(super) struct Due {
    rate_hz: f64,
    start: Instant,
    next: Option<Instant>,
}

impl Due {
    pub(super) fn new(rate_hz: u32, start: Instant) -> Self {
        Self { rate_hz: f64::from(rate_hz), start, next: None }
    }

    /// Records a callback; returns its delay and the duration of its frames.
    pub(crate) fn record(&mut self, began: Instant, frames: usize, shared: &Shared) -> (Duration, Duration) {
        let lasts = Duration::from_secs_f64(frames as f64 / self.rate_hz);
        let due = self.next.unwrap_or(began);
        let late = began.saturating_duration_since(due);
        // After an early callback the next is due one buffer after the expected time, or slightly earlier: otherwise a card
        // faster than the computer's clock would seem ever earlier and hide delays.
        let early = due.saturating_duration_since(began);
        self.next = Some(due.max(began) - early / FOLLOWS + lasts);
        if shared.after_xrun.swap(false, Relaxed) {
            let late_ns = late.as_nanos() as u64;
            shared.xrun_delay_max_ns.fetch_max(late_ns, Relaxed);
            let since_start = began.saturating_duration_since(self.start);
            shared.xrun_last_ns.store(since_start.as_nanos() as u64, Relaxed);
        }
        shared.callbacks.fetch_add(1, Relaxed);
        (late, lasts)
    }
}

/// Holds the state of a callback while no stream is open.
#[derive(Debug)]
pub(super) struct Detached<T>(Arc<Mutex<Option<Box<T>>>>);

impl<T> Clone for Detached<T> {
    fn clone(&self) -> Self {
        Self(Arc::clone(&self.0))
    }
}

impl<T> Detached<T> {
    pub(super) fn of(it: T) -> Self {
        Self(Arc::new(Mutex::new(Some(Box::new(it)))))
    }

    pub(crate) fn lock(&self) -> MutexGuard<'_, Option<Box<T>>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Moves the state to a stream, if no other stream has it.
    pub(crate) fn attach(&self) -> Active<T> {
        Active { it: self.lock().take(), slot: self.clone() }
    }
}

/// The state of a running stream's callback. It returns to [`Detached`] when the stream ends.
pub(super) struct Active<T> {
    it: Option<Box<T>>,
    slot: Detached<T>,
}

impl<T> Active<T> {
    pub(super) fn get(&mut self) -> Option<&mut T> {
        self.it.as_deref_mut()
    }
}

impl<T> Drop for Active<T> {
    fn drop(&mut self) {
        if let Some(it) = self.it.take() {
            *self.slot.lock() = Some(it);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lateness_is_seen_though_the_card_is_faster_than_the_clock() {
        let (start, shared) = (Instant::now(), Shared::default());
        let mut due = Due::new(48_000, start);
        // 200 s by a card that is 100 parts per million fast.
        let callback =
            |number: u32| start + Duration::from_secs_f64(f64::from(number) * 64.0 / 48_000.0 * (1.0 - 1e-4));
        for number in 0..150_000 {
            let (late, _) = due.record(callback(number), 64, &shared);
            assert!(late < Duration::from_micros(1), "{late:?}");
        }
        let (late, _) = due.record(callback(150_000) + Duration::from_millis(5), 64, &shared);
        assert!((late.as_secs_f64() - 5e-3).abs() < 2e-5, "{late:?}");
    }
}
