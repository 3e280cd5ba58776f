//! Runs one or several drivers in virtual time, connected by the same rings as live.
//!
//! Time advances in quanta of at most a millisecond, as the wake-ups of timers do. In each quantum every driver first
//! polls its rings and then runs the frames that are due; so the samples depend neither on the order of the drivers nor
//! on the block size. A quantum of a single driver is a whole block.

use super::async_resampler::{RingMeter, async_resampler, reserve_s};
use super::swap::PlanSwap;
use super::{Faults, Run};
use crate::plan::{MAX_BLOCK, Plan, Planner, RingSpec};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

const QUANTUM_S: f64 = 1e-3;
/// A quantum takes at most this part of a ring's reserve.
const PART_OF_RESERVE: f64 = 0.25;
const BILLION: u128 = 1_000_000_000;

/// Task of a driver in a quantum.
#[derive(Debug, Clone, Copy)]
pub(super) enum DriverTask {
    /// Polls its rings.
    Poll,
    /// Runs this many of its frames.
    Advance(usize),
}

/// The runs of all drivers of a graph.
pub struct Runner {
    runs: Vec<Run>,
    meters: Vec<Arc<RingMeter>>,
    /// Length of a quantum in units of the common time base.
    quantum: u128,
    /// Number of quanta run.
    quanta: u128,
    /// Deviation of each driver from its nominal rate, in parts per 10^9.
    drifts: Vec<i64>,
    /// Number of frames after which each driver ends.
    ends: Vec<u64>,
    /// Largest block in driver frames.
    longest: usize,
    /// Frames of each driver in the present quantum.
    due: Vec<usize>,
}

impl Runner {
    /// Makes connected runs of the plans of [`Plan::of`].
    pub fn new(plans: &[Arc<Plan>]) -> Self {
        let reserves = plans.iter().flat_map(|plan| &plan.ring_reads).map(|read| reserve_s(&read.ring));
        let quantum_s =
            reserves.fold(QUANTUM_S, |quantum_s, reserve_s| quantum_s.min(PART_OF_RESERVE * reserve_s));
        let quantum = match plans {
            [alone] => u128::from(alone.base.period(alone.driver)) * alone.block as u128,
            _ => {
                let units = plans.first().map_or(1.0, |plan| plan.base.units_per_second());
                ((quantum_s * units) as u128).max(1)
            }
        };
        let count = plans.len();
        let mut runs: Vec<Run> = plans.iter().map(|plan| Run::new(Arc::clone(plan))).collect();
        Self {
            meters: connect(&mut runs.iter_mut().collect::<Vec<_>>()),
            runs,
            quantum,
            quanta: 0,
            drifts: vec![0; count],
            ends: vec![u64::MAX; count],
            longest: MAX_BLOCK,
            due: vec![0; count],
        }
    }

    /// Makes each driver faster than nominal by `ppm` parts per million, to test drift.
    #[must_use]
    pub fn drifting(mut self, ppm: &[f64]) -> Self {
        for (drift, ppm) in self.drifts.iter_mut().zip(ppm) {
            *drift = (ppm * 1e3).round() as i64;
        }
        self
    }

    /// Ends each driver after `seconds` of its own time.
    #[must_use]
    pub fn ending_after(mut self, seconds: f64) -> Self {
        for (end, run) in self.ends.iter_mut().zip(&self.runs) {
            *end = (seconds * run.rate_hz()).round().max(0.0) as u64;
        }
        self
    }

    /// Ends each driver where the data of a source that stops the run end.
    #[must_use]
    pub fn ending_with_data(mut self) -> Self {
        for (end, run) in self.ends.iter_mut().zip(&self.runs) {
            *end = run.plan.data_frames.map_or(*end, |data| data.min(*end));
        }
        self
    }

    /// Runs a quantum and calls `each` after every block of every driver. Like [`Run::advance`] it does not allocate.
    ///
    /// # Errors
    /// The first error of `each`.
    pub fn run_quantum<E>(&mut self, mut each: impl FnMut(usize, &Run) -> Result<(), E>) -> Result<(), E> {
        self.run_quantum_by(|driver, run, task| match task {
            DriverTask::Poll => {
                run.poll_rings();
                Ok(())
            }
            DriverTask::Advance(frames) => {
                run.advance(frames);
                each(driver, run)
            }
        })
    }

    /// Runs a quantum in which `by` performs the tasks.
    pub(super) fn run_quantum_by<E>(
        &mut self,
        mut by: impl FnMut(usize, &mut Run, DriverTask) -> Result<(), E>,
    ) -> Result<(), E> {
        self.quanta += 1;
        for driver in 0..self.runs.len() {
            self.due[driver] = self.due(driver);
            by(driver, &mut self.runs[driver], DriverTask::Poll)?;
        }
        for (driver, (run, frames)) in self.runs.iter_mut().zip(&self.due).enumerate() {
            let mut left = *frames;
            while left > 0 {
                let block = left.min(run.plan.block).min(self.longest);
                by(driver, run, DriverTask::Advance(block))?;
                left -= block;
            }
        }
        Ok(())
    }

    /// Length of a quantum, s.
    pub fn quantum_s(&self) -> f64 {
        let units = self.runs.first().map(|run| run.plan.base.units_per_second());
        self.quantum as f64 / units.unwrap_or(1.0)
    }

    /// Frames of a driver that are due before the end of this quantum.
    fn due(&self, driver: usize) -> usize {
        let run = &self.runs[driver];
        let period = u128::from(run.plan.base.period(run.plan.driver));
        let speed = BILLION.saturating_add_signed(self.drifts[driver].into());
        let frames = (self.quanta * self.quantum * speed).div_ceil(period * BILLION);
        let frames = u64::try_from(frames).unwrap_or(u64::MAX).min(self.ends[driver]);
        frames.saturating_sub(run.driver_frames()) as usize
    }

    /// True if all drivers have ended.
    pub fn is_over(&self) -> bool {
        let mut both = self.runs.iter().zip(&self.ends);
        both.all(|(run, end)| run.driver_frames() >= *end)
    }

    /// Path of the first node upstream of the first faulted sink whose output is NaN or infinite; `None` when stopped.
    ///
    /// Repeats the run frame by frame, so that the result does not depend on the block size.
    pub(super) fn origin(
        planner: Planner<'_>,
        plans: &[Arc<Plan>],
        seconds: f64,
        stop: &AtomicBool,
    ) -> Option<Arc<str>> {
        let fresh = || Self::new(plans).ending_after(seconds);
        let faulted = fresh().until_a_fault(stop)?;
        let sink = faulted.runs.iter().find_map(Run::first_faulted_sink)?;
        let upstream_candidates = planner.leading_to(sink);
        let mut runner = fresh();
        runner.runs.iter_mut().for_each(|run| run.trace_fault(&upstream_candidates));
        let watched = runner.until_a_fault(stop)?;
        Faults::of(watched.runs.iter().map(Run::faults)).origin
    }

    /// Runs to the quantum in which an actuator first receives NaN or infinity; `None` when stopped.
    fn until_a_fault(mut self, stop: &AtomicBool) -> Option<Self> {
        self.longest = 1;
        while !self.is_over() && self.runs.iter().all(|run| run.faults().ticks == 0) {
            if stop.load(Ordering::Relaxed) {
                return None;
            }
            let Ok(()) = self.run_quantum(|_, _| Ok::<(), std::convert::Infallible>(()));
        }
        Some(self)
    }

    /// The runs, in the order of the graph's drivers.
    pub fn runs(&self) -> &[Run] {
        &self.runs
    }

    pub(super) fn runs_mut(&mut self) -> &mut [Run] {
        &mut self.runs
    }

    /// Meters of the rings between the drivers.
    pub fn rings(&self) -> &[Arc<RingMeter>] {
        &self.meters
    }
}

/// A ring between two runs; each end is the index of a run and the index of the end in that run.
struct RingEdge {
    ring: RingSpec,
    reader: (usize, usize),
    writer: (usize, usize),
}

/// The rings between the plans of a graph's drivers.
fn ring_edges(plans: &[Arc<Plan>]) -> Vec<RingEdge> {
    let mut ring_edges = Vec::new();
    for (reader, plan) in plans.iter().enumerate() {
        for (place, ring) in plan.ring_reads.iter().enumerate() {
            let far = |plan: &Arc<Plan>| plan.ring_writes.iter().position(|write| write.edge == ring.edge);
            let mut ends = plans.iter().enumerate();
            let Some(writer) = ends.find_map(|(writer, plan)| Some((writer, far(plan)?))) else {
                continue;
            };
            let (ring, reader) = (ring.ring.clone(), (reader, place));
            ring_edges.push(RingEdge { ring, reader, writer });
        }
    }
    ring_edges
}

impl RingEdge {
    /// Makes the ring and attaches both ends.
    fn connect(&self, runs: &mut [&mut Run]) -> Arc<RingMeter> {
        let (into, out) = async_resampler(&self.ring);
        let meter = Arc::clone(into.meter());
        runs[self.writer.0].state.ring_ends.writers[self.writer.1] = Some(into);
        runs[self.reader.0].state.ring_ends.readers[self.reader.1] = Some(out);
        meter
    }

    fn is_same_as(&self, other: &Self) -> bool {
        let runs = |ring: &Self| (ring.reader.0, ring.writer.0);
        runs(self) == runs(other) && self.ring == other.ring
    }
}

/// Connects the runs of a graph's drivers by rings.
pub(super) fn connect(runs: &mut [&mut Run]) -> Vec<Arc<RingMeter>> {
    let plans: Vec<Arc<Plan>> = runs.iter().map(|run| Arc::clone(&run.plan)).collect();
    ring_edges(&plans).iter().map(|ring| ring.connect(runs)).collect()
}

/// Connects new plans by rings. Rings that the old plans have continue; `known` are their meters.
///
/// Each driver changes over at its own time: until both have, the reader of a new ring is silent and its writer may
/// find it full.
pub(super) fn reconnect(
    before: &[Arc<Plan>],
    known: &[Arc<RingMeter>],
    next: &mut [&mut PlanSwap],
) -> Vec<Arc<RingMeter>> {
    let plans: Vec<Arc<Plan>> = next.iter().map(|next| Arc::clone(&next.run.plan)).collect();
    let before: Vec<(RingEdge, &Arc<RingMeter>)> = ring_edges(before).into_iter().zip(known).collect();
    let mut meters = Vec::new();
    for ring in ring_edges(&plans) {
        if let Some((was, meter)) = before.iter().find(|(was, _)| was.is_same_as(&ring)) {
            next[ring.reader.0].readers.push((was.reader.1, ring.reader.1));
            next[ring.writer.0].writers.push((was.writer.1, ring.writer.1));
            meters.push(Arc::clone(meter));
        } else {
            let mut runs: Vec<&mut Run> = next.iter_mut().map(|next| &mut next.run).collect();
            meters.push(ring.connect(&mut runs));
            next[ring.reader.0].add_new_rings();
            next[ring.writer.0].add_new_rings();
        }
    }
    meters
}
