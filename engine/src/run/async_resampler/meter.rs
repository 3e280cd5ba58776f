//! What is counted of a ring while it runs.

use crate::plan::RingSpec;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

/// What is known of a ring while it runs; both ends write it, anybody may read it.
#[derive(Debug)]
pub struct RingMeter {
    /// Output and input: `force.output to drive.current`.
    pub name: String,
    /// The declared latency, s.
    pub latency_s: f64,
    underruns: AtomicU64,
    overruns: AtomicU64,
    lost: AtomicU64,
    fill: AtomicU64,
    least: AtomicU64,
    most: AtomicU64,
    correction: AtomicU64,
}

/// A ring's counts at a moment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RingCounts {
    /// How often it ran dry.
    pub underruns: u64,
    /// How often it had become too full and frames were skipped.
    pub overruns: u64,
    /// Frames that were skipped or found no room.
    pub lost_frames: u64,
    /// How full it was last, in seconds of its signal; none before it first ran.
    pub fill_s: Option<f64>,
    /// The least and the most.
    pub range_s: Option<(f64, f64)>,
    /// How much faster than nominal it is read, in parts per million.
    pub correction_ppm: f64,
}

impl RingMeter {
    pub(super) fn new(plan: &RingSpec) -> Self {
        let zero = || AtomicU64::new(0);
        Self {
            name: plan.name.clone(),
            latency_s: plan.latency_s,
            underruns: zero(),
            overruns: zero(),
            lost: zero(),
            fill: AtomicU64::new(f64::NAN.to_bits()),
            least: AtomicU64::new(f64::INFINITY.to_bits()),
            most: AtomicU64::new(f64::NEG_INFINITY.to_bits()),
            correction: zero(),
        }
    }

    /// What was counted so far.
    pub fn counts(&self) -> RingCounts {
        let float = |value: &AtomicU64| f64::from_bits(value.load(Relaxed));
        let fill_s = Some(float(&self.fill)).filter(|fill| !fill.is_nan());
        RingCounts {
            underruns: self.underruns.load(Relaxed),
            overruns: self.overruns.load(Relaxed),
            lost_frames: self.lost.load(Relaxed),
            range_s: fill_s.map(|_| (float(&self.least), float(&self.most))),
            fill_s,
            correction_ppm: float(&self.correction),
        }
    }

    /// Has the reader ever looked?
    pub(super) fn is_read(&self) -> bool {
        !f64::from_bits(self.fill.load(Relaxed)).is_nan()
    }

    pub(super) fn count_underrun(&self) {
        self.underruns.fetch_add(1, Relaxed);
    }

    pub(super) fn count_overrun(&self) {
        self.overruns.fetch_add(1, Relaxed);
    }

    pub(super) fn lose(&self, frames: u64) {
        self.lost.fetch_add(frames, Relaxed);
    }

    /// Only the reader calls this.
    pub(super) fn saw(&self, fill_s: f64, correction_ppm: f64) {
        let float = |value: &AtomicU64| f64::from_bits(value.load(Relaxed));
        self.fill.store(fill_s.to_bits(), Relaxed);
        self.least
            .store(float(&self.least).min(fill_s).to_bits(), Relaxed);
        self.most.store(float(&self.most).max(fill_s).to_bits(), Relaxed);
        self.correction.store(correction_ppm.to_bits(), Relaxed);
    }
}
