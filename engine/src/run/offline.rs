//! Offline runs: as fast as the processor allows, signals written to files.

use super::arrivals::{Arrivals, ReplayBounds, ReplayError, check_graph, check_logs};
use super::file_sinks::{FileSinks, WriteError};
use super::files::Files;
use super::runner::Runner;
use super::{ActuatorReport, Faults, RingCounts, RingMeter, Run};
use crate::plan::{Plan, PlanOptions};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// An offline run that is being set up.
pub struct Offline<'a> {
    sinks: FileSinks<'a>,
    block: usize,
}

/// Outcome of a run.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Outcome {
    /// Frames of the first driver.
    pub driver_frames: u64,
    /// Duration by the first driver, s.
    pub seconds: f64,
    /// True if the run was stopped before its end.
    pub stopped: bool,
    /// NaN and infinity at actuators.
    pub faults: Faults,
    /// Limiter counts of each actuator sink.
    pub actuators: Vec<ActuatorReport>,
    /// Counters of the rings between its drivers.
    pub rings: Vec<RingReport>,
}

/// Report of a ring between two drivers.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct RingReport {
    /// Output and input.
    pub name: String,
    /// The declared latency, s.
    pub latency_s: f64,
    /// The counters.
    pub counts: RingCounts,
}

impl RingReport {
    /// Snapshot of a ring.
    pub fn of(meter: &RingMeter) -> Self {
        Self { name: meter.name.clone(), latency_s: meter.latency_s, counts: meter.counts() }
    }
}

/// Reason why a run failed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum OfflineError {
    /// A file could not be written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// The run cannot be replayed.
    #[error(transparent)]
    Replay(#[from] ReplayError),
}

impl<'a> Offline<'a> {
    /// A run of a graph in blocks of `block` driver frames (0: the default), its files written.
    pub fn new(sinks: FileSinks<'a>, block: usize) -> Self {
        Self { sinks, block }
    }

    fn plans(&self) -> Vec<Arc<Plan>> {
        let options = PlanOptions { block: self.block, taps: self.sinks.taps.clone() };
        let plans = self.sinks.planner.plans(&options).into_iter();
        plans.map(Arc::new).collect()
    }

    /// Runs for `seconds`, until a source that stops the run has no more data, or until `stop` is set. Calls `progress`
    /// with the seconds done. Completes all files, also when stopped.
    ///
    /// # Errors
    /// [`OfflineError`] if a file cannot be written.
    pub fn run(
        self,
        seconds: f64,
        stop: &AtomicBool,
        progress: &mut dyn FnMut(f64),
    ) -> Result<Outcome, OfflineError> {
        let (planner, plans) = (self.sinks.planner, self.plans());
        let mut files = Files::new(self.sinks.written, plans.iter().map(Arc::as_ref));
        let mut runner = Runner::new(&plans).ending_after(seconds).ending_with_data();
        let mut written = Ok(());
        while written.is_ok() && !runner.is_over() && !stop.load(Ordering::Relaxed) {
            written = runner.run_quantum(|driver, run| files.write(driver, run));
            let first = &runner.runs()[0];
            progress(first.driver_frames() as f64 / first.rate_hz());
        }
        // Also after a failure, such as a full disk: the files are complete up to there.
        let finished = files.finish();
        written?;
        finished?;
        let mut outcome = outcome_of(&runner, !runner.is_over());
        if outcome.faults.ticks > 0 {
            outcome.faults.origin = Runner::origin(planner, &plans, seconds, stop);
        }
        Ok(outcome)
    }

    /// Replays a live run from the log in `folder`, bit for bit, up to its end or a change of graph. Checks the log
    /// against `bounds` first.
    ///
    /// # Errors
    /// [`OfflineError`] if a file cannot be written, or the log is not of a run of this graph within the bounds.
    pub fn replay(
        self,
        (folder, bounds): (&Path, &ReplayBounds),
        stop: &AtomicBool,
        progress: &mut dyn FnMut(f64),
    ) -> Result<Outcome, OfflineError> {
        let plans = self.plans();
        let rested = check_graph(self.sinks.planner, folder)?;
        let goes_on = || !stop.load(Ordering::Relaxed);
        check_logs(&plans, folder, bounds, &goes_on)?;
        let open = |(driver, plan): (usize, &Arc<Plan>)| Arrivals::open(plan, (folder, driver), bounds);
        let mut scripts = plans.iter().enumerate().map(open).collect::<Result<Vec<_>, _>>()?;
        let mut files = Files::new(self.sinks.written, plans.iter().map(Arc::as_ref));
        let mut runner = Runner::new(&plans);
        runner.repeat_inputs(&plans, folder, bounds)?;
        if !rested {
            runner.runs_mut().iter_mut().for_each(Run::assume_thermally_saturated);
        }
        let played = runner.replay(&mut scripts, goes_on, |driver, run| -> Result<(), OfflineError> {
            files.write(driver, run)?;
            if driver == 0 {
                progress(run.driver_frames() as f64 / run.rate_hz());
            }
            Ok(())
        });
        let finished = files.finish();
        played?;
        finished?;
        let stopped = stop.load(Ordering::Relaxed) && !scripts.iter().all(Arrivals::is_over);
        Ok(outcome_of(&runner, stopped))
    }
}

fn outcome_of(runner: &Runner, stopped: bool) -> Outcome {
    let first = &runner.runs()[0];
    Outcome {
        driver_frames: first.driver_frames(),
        seconds: first.driver_frames() as f64 / first.rate_hz(),
        stopped,
        faults: Faults::of(runner.runs().iter().map(Run::faults)),
        actuators: runner.runs().iter().flat_map(Run::actuators).collect(),
        rings: runner.rings().iter().map(|meter| RingReport::of(meter)).collect(),
    }
}
