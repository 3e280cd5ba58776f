//! Counters of a ring.

use crate::plan::RingSpec;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

/// Counters of a running ring. Both ends write them; any thread may read them.
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

/// A snapshot of a ring's counters.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct RingCounts {
    /// Number of times that the ring ran dry.
    pub underruns: u64,
    /// Number of times that the ring was too full and frames were skipped.
    pub overruns: u64,
    /// Frames that were skipped or did not fit.
    pub lost_frames: u64,
    /// Last fill, s; `None` before the first start.
    pub fill_s: Option<f64>,
    /// Smallest and largest fill, s.
    pub range_s: Option<(f64, f64)>,
    /// Correction of the ratio, ppm; positive reads faster than nominal.
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

    /// A snapshot of the counters.
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

    /// True if the reader has polled while running.
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

    /// Records the fill and the correction. Only the reader calls it.
    pub(super) fn record(&self, fill_s: f64, correction_ppm: f64) {
        let float = |value: &AtomicU64| f64::from_bits(value.load(Relaxed));
        self.fill.store(fill_s.to_bits(), Relaxed);
        self.least.store(float(&self.least).min(fill_s).to_bits(), Relaxed);
        self.most.store(float(&self.most).max(fill_s).to_bits(), Relaxed);
        self.correction.store(correction_ppm.to_bits(), Relaxed);
    }
}
