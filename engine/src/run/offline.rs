//! Sessions in virtual time: as fast as the processor allows, their files written by the caller's thread.

use super::arrivals::{Arrivals, ReplayBounds, ReplayError, check_graph, check_logs, repeat_inputs, replay};
use super::file_sinks::{FileSinks, WriteError};
use super::rings::Writer;
use super::session::{Session, SessionOptions};
use super::virtual_clock::VirtualClock;
use super::{ActuatorReport, Faults, RingCounts, RingMeter};
use crate::plan::Plan;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

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
    /// The session cannot be opened.
    #[error(transparent)]
    System(#[from] std::io::Error),
    /// A node panicked.
    #[error("a node panicked: this is a defect of the node, and the files end there")]
    Panicked,
}

impl Session {
    /// Runs a graph in virtual time for the options' seconds, until a source that stops the run has no more data, or until
    /// it is stopped, which is at once and without a fade. Calls `progress` with the seconds done. Completes all files,
    /// also when stopped. The actuators start rested.
    ///
    /// # Errors
    /// [`OfflineError`] if a file cannot be written or a node panics.
    pub fn run_offline(
        sinks: FileSinks<'_>,
        options: &SessionOptions,
        progress: &mut dyn FnMut(f64),
    ) -> Result<Outcome, OfflineError> {
        let planner = sinks.planner;
        let (mut clock, mut session) = Self::in_virtual_time(sinks, options, true)?;
        let is_stopped = || options.stop.load(Ordering::Relaxed);
        while session.writes() && !clock.is_over() && !clock.has_panicked() && !is_stopped() {
            clock.run_quantum(|_, _| session.write_block());
            progress(seconds_of(&clock));
        }
        let plans = session.plans();
        let stopped = !clock.is_over();
        let mut outcome = session.finish_offline(clock, stopped)?;
        if outcome.faults.ticks > 0 {
            let seconds = options.seconds.unwrap_or(f64::INFINITY);
            outcome.faults.origin = VirtualClock::origin(planner, &plans, seconds, &options.stop);
        }
        Ok(outcome)
    }

    /// Replays a live run from the log in `folder`, bit for bit, up to its end or a change of graph. Checks the log
    /// against `bounds` first. The options' duration has no effect.
    ///
    /// # Errors
    /// [`OfflineError`] if a file cannot be written, or the log is not of a run of this graph within the bounds.
    pub fn replay(
        sinks: FileSinks<'_>,
        (folder, bounds): (&Path, &ReplayBounds),
        options: &SessionOptions,
        progress: &mut dyn FnMut(f64),
    ) -> Result<Outcome, OfflineError> {
        let rested = check_graph(sinks.planner, folder)?;
        let options = SessionOptions { seconds: None, ..options.clone() };
        let (mut clock, mut session) = Self::in_virtual_time(sinks, &options, rested)?;
        let plans = session.plans();
        let goes_on = || !options.stop.load(Ordering::Relaxed);
        check_logs(&plans, folder, bounds, &goes_on)?;
        let open = |(driver, plan): (usize, &Arc<Plan>)| Arrivals::open(plan, (folder, driver), bounds);
        let mut scripts = plans.iter().enumerate().map(open).collect::<Result<Vec<_>, _>>()?;
        repeat_inputs(clock.players_mut(), folder, bounds)?;
        let played = replay(clock.players_mut(), &mut scripts, goes_on, |driver, run| {
            session.write_block();
            if driver == 0 {
                progress(run.driver_frames() as f64 / run.rate_hz());
            }
            session.writes()
        });
        let stopped = !goes_on() && !scripts.iter().all(Arrivals::is_over);
        // Also after a failure, such as a full disk: the files are complete up to there.
        let outcome = session.finish_offline(clock, stopped);
        played?;
        outcome
    }

    /// Opens a session whose clock is virtual and whose files the caller writes.
    fn in_virtual_time(
        sinks: FileSinks<'_>,
        options: &SessionOptions,
        rested: bool,
    ) -> std::io::Result<(VirtualClock, Self)> {
        // The clock reads the flag: a stop needs no fade.
        let stop = Arc::<AtomicBool>::default();
        let options = SessionOptions { offline: true, rested, stop, ..options.clone() };
        let (players, session) = Self::open_with(sinks, &options, Writer::of_the_caller())?;
        Ok((VirtualClock::running(players, &session), session))
    }

    fn finish_offline(self, clock: VirtualClock, stopped: bool) -> Result<Outcome, OfflineError> {
        let has_panicked = clock.has_panicked();
        let ended = self.finish_all(clock.into_players());
        match ended.failed.into_iter().next() {
            Some(failed) => Err(failed.into()),
            None if has_panicked => Err(OfflineError::Panicked),
            None => Ok(Outcome { stopped, ..ended.outcome }),
        }
    }
}

/// Seconds run by the first driver.
fn seconds_of(clock: &VirtualClock) -> f64 {
    clock.runs().next().map_or(0.0, |run| run.driver_frames() as f64 / run.rate_hz())
}
