//! Offline runs: as fast as the processor allows, signals written to files.

use super::arrivals::{Arrivals, ReplayBounds, ReplayError, check_graph, check_logs};
use super::file_sinks::{FileSinks, WriteError};
use super::files::Files;
use super::runner::Runner;
use super::{ActuatorReport, Faults, RingCounts, RingMeter, Run};
use crate::graph::Graph;
use crate::plan::{Life, Plan, PlanOptions, StepWork};
use std::ops::Range;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};

/// An offline run that is being set up.
pub struct Offline<'a> {
    sinks: FileSinks<'a>,
    block: usize,
    threads: usize,
}

/// Outcome of a run.
#[derive(Debug, Clone, PartialEq)]
pub struct Outcome {
    /// Frames of the first driver.
    pub driver_frames: u64,
    /// Duration by the first driver, s.
    pub seconds: f64,
    /// Whether it was stopped before its end.
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
pub struct RingReport {
    /// Output and input.
    pub name: String,
    /// The declared latency, s.
    pub latency_s: f64,
    /// Its counters.
    pub counts: RingCounts,
}

impl RingReport {
    /// Snapshot of a ring.
    pub fn of(meter: &RingMeter) -> Self {
        Self {
            name: meter.name.clone(),
            latency_s: meter.latency_s,
            counts: meter.counts(),
        }
    }
}

/// Why a run failed.
#[derive(Debug, thiserror::Error)]
pub enum OfflineError {
    /// A file could not be written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// The run cannot be replayed.
    #[error(transparent)]
    Replay(#[from] ReplayError),
    /// A worker thread ended early: a node panicked.
    #[error("a worker thread ended early: a node panicked")]
    Worker,
}

impl<'a> Offline<'a> {
    /// A run of a graph in blocks of `block` driver frames (0: the default), its files written.
    pub fn new(sinks: FileSinks<'a>, block: usize) -> Self {
        Self {
            sinks,
            block,
            threads: 1,
        }
    }

    /// Spreads the steps of the plan over this many threads; the samples stay the same. A graph with several drivers
    /// runs on one.
    #[must_use]
    pub fn threads(mut self, threads: usize) -> Self {
        self.threads = threads.max(1);
        self
    }

    /// Runs for `seconds`, until a source that stops the run has no more data, or until `stop` is set. Calls `progress`
    /// with the seconds done. Completes all files, also when stopped.
    ///
    /// # Errors
    /// [`OfflineError`] if a file cannot be written or a node panicked.
    pub fn run(
        self,
        seconds: f64,
        stop: &AtomicBool,
        progress: &mut dyn FnMut(f64),
    ) -> Result<Outcome, OfflineError> {
        let options = PlanOptions {
            block: self.block,
            taps: self.sinks.taps,
        };
        let mut plans = Plan::of(self.sinks.graph, &options);
        let mut files = Files::new(self.sinks.written, plans.iter());
        let request = Request {
            graph: self.sinks.graph,
            seconds,
            stop,
        };
        let outcome = match plans.len() {
            1 => run_single(plans.remove(0), self.threads, request, &mut files, progress),
            _ => run_several(plans, request, &mut files, progress),
        };
        // Also after a failure, such as a full disk: the files are complete up to there.
        let finished = files.finish();
        let outcome = outcome?;
        finished?;
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
        let options = PlanOptions {
            block: self.block,
            taps: self.sinks.taps,
        };
        let plans: Vec<Arc<Plan>> = Plan::of(self.sinks.graph, &options)
            .into_iter()
            .map(Arc::new)
            .collect();
        let rested = check_graph(self.sinks.graph, folder)?;
        let graph = self.sinks.graph;
        let goes_on = || !stop.load(Ordering::Relaxed);
        check_logs((graph, &plans), folder, bounds, &goes_on)?;
        let open = |(driver, plan): (usize, &Arc<Plan>)| Arrivals::open(plan, (folder, driver), bounds);
        let mut scripts = plans
            .iter()
            .enumerate()
            .map(open)
            .collect::<Result<Vec<_>, _>>()?;
        let mut files = Files::new(self.sinks.written, plans.iter().map(Arc::as_ref));
        let mut runner = Runner::new(&plans);
        runner.repeat_inputs((graph, &plans), folder, bounds)?;
        if !rested {
            runner
                .runs_mut()
                .iter_mut()
                .for_each(Run::assume_thermally_saturated);
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

/// A run of a graph for some time.
#[derive(Clone, Copy)]
struct Request<'a> {
    graph: &'a Graph,
    seconds: f64,
    stop: &'a AtomicBool,
}

/// Runs a graph with one driver.
fn run_single(
    plan: Plan,
    threads: usize,
    request: Request<'_>,
    files: &mut Files,
    progress: &mut dyn FnMut(f64),
) -> Result<Outcome, OfflineError> {
    let Request { graph, seconds, stop } = request;
    let plan = Arc::new(plan);
    let rate_hz = plan.driver_rate().hz();
    let data = graph.frames_of_data(plan.driver_rate());
    let total = ((seconds * rate_hz).round().max(0.0) as u64).min(data.unwrap_or(u64::MAX));
    let mut after_block = |run: &Run| -> Result<(), OfflineError> {
        files.write(0, run)?;
        progress(run.driver_frames() as f64 / rate_hz);
        Ok(())
    };
    let blocks = Blocks {
        total,
        block: plan.block as u64,
        stop,
    };
    let stages = cut(&plan, threads);
    let (driver_frames, mut faults, actuators) = match stages.len() {
        0 | 1 => {
            let mut run = Run::new(Arc::clone(&plan));
            while let Some(frames) = blocks.after(run.driver_frames()) {
                run.advance(frames);
                after_block(&run)?;
            }
            (run.driver_frames(), run.faults(), run.actuators().collect())
        }
        _ => pipeline(&plan, &stages, &blocks, &mut after_block)?,
    };
    if faults.ticks > 0 {
        faults.origin = Runner::origin(graph, &[plan], seconds, stop);
    }
    Ok(Outcome {
        driver_frames,
        seconds: driver_frames as f64 / rate_hz,
        stopped: driver_frames < total,
        faults,
        actuators,
        rings: Vec::new(),
    })
}

/// Runs a graph with several drivers.
fn run_several(
    plans: Vec<Plan>,
    request: Request<'_>,
    files: &mut Files,
    progress: &mut dyn FnMut(f64),
) -> Result<Outcome, OfflineError> {
    let Request { graph, seconds, stop } = request;
    let plans: Vec<Arc<Plan>> = plans.into_iter().map(Arc::new).collect();
    let mut runner = Runner::new(&plans)
        .ending_after(seconds)
        .ending_with_data_of(graph);
    while !runner.is_over() && !stop.load(Ordering::Relaxed) {
        runner.run_quantum(|driver, run| files.write(driver, run))?;
        progress(runner.runs()[0].driver_frames() as f64 / runner.runs()[0].rate_hz());
    }
    let mut outcome = outcome_of(&runner, !runner.is_over());
    if outcome.faults.ticks > 0 {
        outcome.faults.origin = Runner::origin(graph, &plans, seconds, stop);
    }
    Ok(outcome)
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

struct Blocks<'a> {
    total: u64,
    block: u64,
    stop: &'a AtomicBool,
}

impl Blocks<'_> {
    /// Length of the block that begins at `done`; `None` at the end or when stopped.
    fn after(&self, done: u64) -> Option<usize> {
        let left = self.total.saturating_sub(done);
        (left > 0 && !self.stop.load(Ordering::Relaxed)).then(|| left.min(self.block) as usize)
    }
}

/// Cuts the plan's steps into `threads` stages of equal length, never within an island.
fn cut(plan: &Plan, threads: usize) -> Vec<Range<usize>> {
    let mut starts = Vec::new();
    let mut number = 0;
    while number < plan.steps.len() {
        starts.push(number);
        number += match plan.steps[number].work {
            StepWork::Island { steps, .. } => steps as usize + 1,
            _ => 1,
        };
    }
    let wanted = threads.min(starts.len());
    let mut cuts: Vec<usize> = (0..wanted).map(|i| starts[i * starts.len() / wanted]).collect();
    cuts.push(plan.steps.len());
    cuts.windows(2).map(|pair| pair[0]..pair[1]).collect()
}

/// A block between two stages: its length, and the buffers that live across the cut.
struct StageBlock {
    frames: usize,
    buffers: Vec<Vec<f64>>,
}

/// Runs each stage on a thread of its own; blocks pass from one stage to the next.
fn pipeline(
    plan: &Arc<Plan>,
    stages: &[Range<usize>],
    blocks: &Blocks<'_>,
    after_block: &mut dyn FnMut(&Run) -> Result<(), OfflineError>,
) -> Result<(u64, Faults, Vec<ActuatorReport>), OfflineError> {
    std::thread::scope(|scope| {
        let (first, mut incoming) = sync_channel::<StageBlock>(2);
        let mut workers = Vec::new();
        let (last, earlier) = stages.split_last().ok_or(OfflineError::Worker)?;
        for stage in earlier {
            let (outgoing, next) = sync_channel(2);
            let received = std::mem::replace(&mut incoming, next);
            workers.push(scope.spawn(move || work(plan, stage, &received, &outgoing)));
        }
        scope.spawn(move || {
            let mut done = 0;
            while let Some(frames) = blocks.after(done) {
                if first
                    .send(StageBlock {
                        frames,
                        buffers: Vec::new(),
                    })
                    .is_err()
                {
                    break;
                }
                done += frames as u64;
            }
        });
        let mut run = Run::new(Arc::clone(plan));
        let mut result = Ok(());
        for block in incoming.iter() {
            stage_block(&mut run, last, &block);
            result = after_block(&run);
            if result.is_err() {
                break;
            }
        }
        drop(incoming);
        let mut runs = Vec::new();
        for worker in workers {
            runs.push(worker.join().map_err(|_| OfflineError::Worker)?);
        }
        runs.push(run);
        result?;
        Ok(merge(plan, stages, &runs))
    })
}

fn work(
    plan: &Arc<Plan>,
    stage: &Range<usize>,
    incoming: &Receiver<StageBlock>,
    outgoing: &SyncSender<StageBlock>,
) -> Run {
    let mut run = Run::new(Arc::clone(plan));
    for block in incoming {
        stage_block(&mut run, stage, &block);
        let buffers = crossing(plan, stage.end).map(|life| run.buffer(life.slot).to_vec());
        if outgoing
            .send(StageBlock {
                frames: block.frames,
                buffers: buffers.collect(),
            })
            .is_err()
        {
            break;
        }
    }
    run
}

fn stage_block(run: &mut Run, stage: &Range<usize>, block: &StageBlock) {
    let plan = Arc::clone(&run.plan);
    for (life, content) in crossing(&plan, stage.start).zip(&block.buffers) {
        run.buffer_mut(life.slot).copy_from_slice(content);
    }
    run.state.windows.next_block(block.frames);
    run.steps(stage.clone());
}

/// The buffers that are written before a cut and needed after it.
fn crossing(plan: &Plan, cut: usize) -> impl Iterator<Item = &Life> {
    plan.lives
        .iter()
        .filter(move |life| life.from < cut && life.to >= cut)
}

/// Merges the outcomes of the stages; each actuator's report comes from its own stage.
fn merge(plan: &Plan, stages: &[Range<usize>], runs: &[Run]) -> (u64, Faults, Vec<ActuatorReport>) {
    let mut faults = Faults::default();
    let mut actuators: Vec<ActuatorReport> = Vec::new();
    for (stage, run) in stages.iter().zip(runs) {
        faults.ticks += run.faults().ticks;
        for step in &plan.steps[stage.clone()] {
            if let StepWork::Actuator(index) = step.work {
                actuators.extend(run.actuators().nth(index as usize));
            }
        }
    }
    (runs.last().map_or(0, Run::driver_frames), faults, actuators)
}
