//! How a live run keeps time: what each wake-up reports, and what is counted of it.

use crate::histogram::Histogram;
use std::fmt;

/// One wake-up of a driver, as the real-time thread reports it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Wake {
    /// How late it began, ns.
    pub late_ns: u64,
    /// How long its work took, ns.
    pub work_ns: u64,
    /// Driver frames it ran.
    pub frames: u32,
    /// Wake-ups that were lost before it because the machine stalled.
    pub lost: u32,
    /// Did its work take longer than its frames last?
    pub overrun: bool,
}

/// Everything that was counted of a live run.
#[derive(Debug, Clone, Default)]
pub struct Meters {
    /// How late wake-ups began.
    pub lateness: Histogram,
    /// How long their work took.
    pub work: Histogram,
    /// Wake-ups.
    pub wakes: u64,
    /// Driver frames.
    pub frames: u64,
    /// Wake-ups whose work took longer than their frames last.
    pub overruns: u64,
    /// Stalls of the machine, and the wake-ups lost in them.
    pub stalls: u64,
    /// Wake-ups lost in stalls.
    pub lost_wakes: u64,
    /// Reports that found no room on their way here.
    pub unreported: u64,
}

impl Meters {
    /// Counts a wake-up.
    pub fn record(&mut self, wake: &Wake) {
        self.lateness.record(wake.late_ns);
        self.work.record(wake.work_ns);
        self.wakes += 1;
        self.frames += u64::from(wake.frames);
        self.overruns += u64::from(wake.overrun);
        self.stalls += u64::from(wake.lost > 0);
        self.lost_wakes += u64::from(wake.lost);
    }
}

impl Meters {
    /// The part of the time between wake-ups that work took, exceeded by one in a hundred; 0 while nothing was counted.
    pub fn load(&self, rate_hz: f64) -> f64 {
        let between_ns = self.frames as f64 / rate_hz / self.wakes.max(1) as f64 * 1e9;
        if between_ns > 0.0 {
            self.work.quantile_ns(0.99) as f64 / between_ns
        } else {
            0.0
        }
    }

    /// Counts what another driver's have counted.
    pub fn add(&mut self, other: &Self) {
        self.lateness.add(&other.lateness);
        self.work.add(&other.work);
        self.wakes += other.wakes;
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
        write!(
            f,
            "{} wakes, {} overruns, {} stalls",
            self.wakes, self.overruns, self.stalls
        )
    }
}
