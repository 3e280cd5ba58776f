//! Timing of a live run: reports of wake-ups, and counters of them.

use crate::histogram::Histogram;
use std::fmt;

/// Report of the real-time thread about a wake-up.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Wake {
    /// Lateness of its start, ns.
    pub late_ns: u64,
    /// Duration of its work, ns.
    pub work_ns: u64,
    /// Driver frames that it ran.
    pub frames: u32,
    /// Wake-ups lost in a stall of the machine before it.
    pub lost: u32,
    /// True if its work took longer than its frames last.
    pub overrun: bool,
}

/// Stalls of which the moment is kept.
pub const MAX_STALLS: usize = 100;

/// Timing counters of a live run.
#[derive(Debug, Clone, Default)]
pub struct Meters {
    /// Lateness of wake-ups.
    pub lateness: Histogram,
    /// Duration of their work.
    pub work: Histogram,
    /// Number of wake-ups.
    pub wakes: u64,
    /// Duration of their work together, ns.
    pub work_ns: u64,
    /// Lateness of the last one, ns.
    pub late_ns: u64,
    /// Number of driver frames.
    pub frames: u64,
    /// Wake-ups whose work took longer than their frames last.
    pub overruns: u64,
    /// Stalls of the machine.
    pub stalls: u64,
    /// Wake-ups lost in stalls.
    pub lost_wakes: u64,
    /// Driver frames before each stall, of the first [`MAX_STALLS`]; none for several drivers together.
    pub stalled_at: Vec<u64>,
    /// Reports lost because the report ring was full.
    pub unreported: u64,
}

impl Meters {
    /// Counts a wake-up.
    pub fn record(&mut self, wake: &Wake) {
        self.lateness.record(wake.late_ns);
        self.work.record(wake.work_ns);
        if wake.lost > 0 && self.stalled_at.len() < MAX_STALLS {
            self.stalled_at.push(self.frames);
        }
        self.wakes += 1;
        self.work_ns += wake.work_ns;
        self.late_ns = wake.late_ns;
        self.frames += u64::from(wake.frames);
        self.overruns += u64::from(wake.overrun);
        self.stalls += u64::from(wake.lost > 0);
        self.lost_wakes += u64::from(wake.lost);
    }
}

impl Meters {
    /// Load: the 99 % quantile of the work as a fraction of the mean time between wake-ups; 0 before the first.
    pub fn load(&self, rate_hz: f64) -> f64 {
        let between_ns = self.frames as f64 / rate_hz / self.wakes.max(1) as f64 * 1e9;
        if between_ns > 0.0 { self.work.quantile_ns(0.99) as f64 / between_ns } else { 0.0 }
    }

    /// Adds the counters of another driver.
    pub fn add(&mut self, other: &Self) {
        self.lateness.add(&other.lateness);
        self.work.add(&other.work);
        self.wakes += other.wakes;
        self.work_ns += other.work_ns;
        self.late_ns = self.late_ns.max(other.late_ns);
        self.frames += other.frames;
        self.overruns += other.overruns;
        self.stalls += other.stalls;
        self.lost_wakes += other.lost_wakes;
        self.unreported += other.unreported;
    }
}

impl fmt::Display for Meters {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (name, histogram) in [("late", &self.lateness), ("work", &self.work)] {
            let us = |fraction| histogram.quantile_ns(fraction) as f64 / 1e3;
            write!(
                f,
                "{name} p50 {:.1} p99 {:.1} p99.9 {:.1} max {:.1} us; ",
                us(0.5),
                us(0.99),
                us(0.999),
                histogram.max_ns() as f64 / 1e3
            )?;
        }
        write!(f, "{} wakes, {} overruns, {} stalls", self.wakes, self.overruns, self.stalls)
    }
}
