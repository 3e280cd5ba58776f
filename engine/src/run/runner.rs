//! Several drivers in one virtual time, joined by the rings that join them live.
//!
//! Time goes in quanta of at most a millisecond, as the wake-ups of timers do. In each, every driver first looks at its
//! rings and then runs what is due; so neither their order nor the blocks they run in change a bit. A driver that is
//! alone waits for nobody: its quanta are whole blocks.

use super::async_resampler::{RingMeter, async_resampler, reserve_s};
use super::swap::PlanSwap;
use super::{Faults, Run};
use crate::graph::Graph;
use crate::plan::{MAX_BLOCK, Plan, RingSpec};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

const QUANTUM_S: f64 = 1e-3;
/// A round takes at most this part of a ring's reserve.
const PART_OF_RESERVE: f64 = 0.25;
const BILLION: u128 = 1_000_000_000;

/// What a driver does in a round.
#[derive(Debug, Clone, Copy)]
pub(super) enum DriverTask {
    /// Looks at its rings.
    Poll,
    /// Runs so many of its frames.
    Advance(usize),
}

/// The runs of all drivers of a graph.
pub struct Runner {
    runs: Vec<Run>,
    meters: Vec<Arc<RingMeter>>,
    /// Units of the common time base that a round takes, and quanta run.
    quantum: u128,
    quanta: u128,
    /// How much faster than nominal each driver is, as a part of 10^9.
    drifts: Vec<i64>,
    /// Driver frames after which each ends.
    ends: Vec<u64>,
    /// Driver frames of a block at most.
    longest: usize,
    /// Frames of each driver in the present round.
    due: Vec<usize>,
}

impl Runner {
    /// Runs of the plans of [`Plan::of`], joined.
    pub fn new(plans: &[Arc<Plan>]) -> Self {
        let reserves = plans
            .iter()
            .flat_map(|plan| &plan.ring_reads)
            .map(|read| reserve_s(&read.ring));
        let quantum_s = reserves.fold(QUANTUM_S, |quantum_s, reserve_s| {
            quantum_s.min(PART_OF_RESERVE * reserve_s)
        });
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

    /// Lets each driver run faster than nominal, by so many parts per million: what a test of drift needs.
    #[must_use]
    pub fn drifting(mut self, ppm: &[f64]) -> Self {
        for (drift, ppm) in self.drifts.iter_mut().zip(ppm) {
            *drift = (ppm * 1e3).round() as i64;
        }
        self
    }

    /// Lets each driver end after so many seconds of its own time.
    #[must_use]
    pub fn ending_after(mut self, seconds: f64) -> Self {
        for (end, run) in self.ends.iter_mut().zip(&self.runs) {
            *end = (seconds * run.rate_hz()).round().max(0.0) as u64;
        }
        self
    }

    /// Lets each driver end where the data of a source end that ends the run.
    #[must_use]
    pub fn ending_with_data_of(mut self, graph: &Graph) -> Self {
        for (end, run) in self.ends.iter_mut().zip(&self.runs) {
            *end = graph
                .frames_of_data(run.plan.driver_rate())
                .map_or(*end, |data| data.min(*end));
        }
        self
    }

    /// Runs a round; like [`Run::advance`] it does not allocate. `each` sees every block of every driver when it is done.
    ///
    /// # Errors
    /// The first of `each`.
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

    /// A round whose task is done by `by`.
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

    /// How long a round is, s.
    pub fn quantum_s(&self) -> f64 {
        let units = self.runs.first().map(|run| run.plan.base.units_per_second());
        self.quantum as f64 / units.unwrap_or(1.0)
    }

    /// Frames of a driver whose time comes before the end of this round.
    fn due(&self, driver: usize) -> usize {
        let run = &self.runs[driver];
        let period = u128::from(run.plan.base.period(run.plan.driver));
        let speed = BILLION.saturating_add_signed(self.drifts[driver].into());
        let frames = (self.quanta * self.quantum * speed).div_ceil(period * BILLION);
        let frames = u64::try_from(frames).unwrap_or(u64::MAX).min(self.ends[driver]);
        frames.saturating_sub(run.driver_frames()) as usize
    }

    /// Have all drivers come to their ends?
    pub fn is_over(&self) -> bool {
        let mut both = self.runs.iter().zip(&self.ends);
        both.all(|(run, end)| run.driver_frames() >= *end)
    }

    /// The first node with a way to the sink that was first given no number whose own output was none until then, or
    /// nothing when stopped. Found by runs of its own, frame by frame: the same whatever the block.
    pub(super) fn origin(
        graph: &Graph,
        plans: &[Arc<Plan>],
        seconds: f64,
        stop: &AtomicBool,
    ) -> Option<Arc<str>> {
        let fresh = || Self::new(plans).ending_after(seconds);
        let faulted = fresh().until_a_fault(stop)?;
        let sink = faulted.runs.iter().find_map(Run::first_faulted_sink)?;
        let upstream_candidates = graph.leading_to(sink);
        let mut runner = fresh();
        runner
            .runs
            .iter_mut()
            .for_each(|run| run.trace_fault(&upstream_candidates));
        let watched = runner.until_a_fault(stop)?;
        Faults::of(watched.runs.iter().map(Run::faults)).origin
    }

    /// Runs to the round in which an actuator is first given no number; nothing when stopped.
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

    /// What is known of the rings between them.
    pub fn rings(&self) -> &[Arc<RingMeter>] {
        &self.meters
    }
}

/// A ring between two runs, and where its ends are: which run's, and at which place there.
struct RingEdge {
    ring: RingSpec,
    reader: (usize, usize),
    writer: (usize, usize),
}

/// The rings between the plans of one graph's drivers.
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
    /// Puts a new ring there.
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

/// Puts rings between the runs of one graph's drivers.
pub(super) fn connect(runs: &mut [&mut Run]) -> Vec<Arc<RingMeter>> {
    let plans: Vec<Arc<Plan>> = runs.iter().map(|run| Arc::clone(&run.plan)).collect();
    ring_edges(&plans).iter().map(|ring| ring.connect(runs)).collect()
}

/// Puts rings between plans that are to take over: those that were there go on, the others are new. `known` are the
/// meters of those between the plans before. Each driver changes over at a moment of its own: until both have, a new ring
/// is silent at its reader's end, and full at its writer's at worst.
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
