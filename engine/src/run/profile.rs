//! What each step of a running plan costs, by timing one block in many step by step.

use super::Run;
use crate::plan::Plan;
use haptograph_signal::statistics::median;
use petgraph::graph::NodeIndex;
use std::sync::Arc;
use std::time::Instant;

/// Somebody who is told when a step is done.
pub(super) trait Watch {
    /// Is every step run by itself, and told of?
    const APART: bool;

    /// Step `number` has run `ticks` of its clock.
    fn done(&mut self, number: usize, ticks: usize);
}

/// Nobody.
pub(super) struct Unwatched;

impl Watch for Unwatched {
    const APART: bool = false;

    fn done(&mut self, _: usize, _: usize) {}
}

/// The most samples kept of a step; beyond them each new one takes the place of an old one.
const KEPT: usize = 4096;
/// Blocks of each kind by which the price of timing is found.
const TRIAL_BLOCKS: usize = 256;
/// What timing may cost, as a part of the run.
const PRICE: f64 = 0.01;

/// A run that is measured.
pub struct Profile {
    run: Run,
    stopwatch: Stopwatch,
    samples: Vec<Samples>,
    /// One block in so many is timed.
    every: u64,
    blocks: u64,
    timed: u64,
}

/// What a step costs.
#[derive(Debug, Clone, PartialEq)]
pub struct StepCost {
    /// What the step does: the node's path, or for what stands between nodes words like `hold stylus.force`.
    pub label: String,
    /// The node it belongs to.
    pub node: NodeIndex,
    /// Its clock, as an index of the graph's.
    pub clock: usize,
    /// Median over the timed blocks, ns a tick of its clock.
    pub median_ns: f64,
    /// What 99 of 100 timed blocks stayed below, ns a tick.
    pub p99_ns: f64,
    /// The worst, interruptions by the system included, ns a tick.
    pub worst_ns: f64,
    /// Timed blocks in which it ran.
    pub samples: usize,
}

struct Stopwatch {
    latest: Instant,
    /// What looking at the clock itself takes, ns.
    look_ns: f64,
    /// Of each step in the present block: ns, ticks.
    block: Vec<(f64, usize)>,
}

#[derive(Clone, Default)]
struct Samples {
    ns_a_tick: Vec<f32>,
    seen: usize,
}

impl Watch for Stopwatch {
    const APART: bool = true;

    fn done(&mut self, number: usize, ticks: usize) {
        let now = Instant::now();
        if let Some((ns, all)) = self.block.get_mut(number) {
            *ns += now.duration_since(self.latest).as_nanos() as f64 - self.look_ns;
            *all += ticks;
        }
        self.latest = now;
    }
}

impl Profile {
    /// Runs some blocks to find how many of them can be timed at a hundredth of the whole cost, then starts anew.
    pub fn new(plan: &Arc<Plan>) -> Self {
        let mut this = Self::timing_every(plan, 1);
        let mut took = [Vec::new(), Vec::new()];
        for trial in 0..2 * TRIAL_BLOCKS {
            this.every = if trial % 2 == 0 { u64::MAX } else { 1 };
            let before = Instant::now();
            this.advance(plan.block());
            took[trial % 2].push(before.elapsed().as_nanos() as f64);
        }
        let [plain, timed] = took.map(|took| median(&took));
        let every = ((timed - plain).max(0.0) / (PRICE * plain.max(1.0))).ceil() as u64;
        Self::timing_every(plan, every.max(1))
    }

    /// A measured run that times one block in `every`.
    pub fn timing_every(plan: &Arc<Plan>, every: u64) -> Self {
        let steps = plan.step_count();
        Self {
            run: Run::new(Arc::clone(plan)),
            stopwatch: Stopwatch {
                latest: Instant::now(),
                look_ns: look_ns(),
                block: vec![(0.0, 0); steps],
            },
            samples: vec![Samples::default(); steps],
            every,
            blocks: 0,
            timed: 0,
        }
    }

    /// One block in so many is timed.
    pub fn every(&self) -> u64 {
        self.every
    }

    /// How many were.
    pub fn timed_blocks(&self) -> u64 {
        self.timed
    }

    /// Runs `frames` driver frames, at most the plan's block; the samples are those of [`Run::advance`].
    pub fn advance(&mut self, frames: usize) {
        let timed = self.blocks.is_multiple_of(self.every);
        self.blocks += 1;
        if !timed {
            self.run.advance(frames);
            return;
        }
        self.timed += 1;
        self.stopwatch.block.fill((0.0, 0));
        self.stopwatch.latest = Instant::now();
        self.run.advance_watched(frames, &mut self.stopwatch);
        for (samples, (ns, ticks)) in self.samples.iter_mut().zip(&self.stopwatch.block) {
            if *ticks > 0 {
                samples.push((ns / *ticks as f64).max(0.0) as f32);
            }
        }
    }

    /// The run itself.
    pub fn run(&self) -> &Run {
        &self.run
    }

    /// Of every step that ran, in the order of the plan.
    pub fn costs(&self) -> Vec<StepCost> {
        let plan = &self.run.plan;
        let cost = |(step, samples): (&crate::plan::Step, &Samples)| {
            let mut sorted = samples.ns_a_tick.clone();
            sorted.sort_by(f32::total_cmp);
            let at = |part: f64| sorted[((sorted.len() - 1) as f64 * part) as usize];
            (!sorted.is_empty()).then(|| StepCost {
                label: step.label.to_string(),
                node: step.node,
                clock: step.clock as usize,
                median_ns: f64::from(at(0.5)),
                p99_ns: f64::from(at(0.99)),
                worst_ns: f64::from(at(1.0)),
                samples: samples.seen,
            })
        };
        plan.steps.iter().zip(&self.samples).filter_map(cost).collect()
    }
}

impl Samples {
    fn push(&mut self, ns_a_tick: f32) {
        if self.ns_a_tick.len() < KEPT {
            self.ns_a_tick.push(ns_a_tick);
        } else {
            self.ns_a_tick[self.seen % KEPT] = ns_a_tick;
        }
        self.seen += 1;
    }
}

/// What lies between two looks at the clock, ns.
fn look_ns() -> f64 {
    let gaps: Vec<f64> = (0..1000)
        .map(|_| {
            let before = Instant::now();
            before.elapsed().as_nanos() as f64
        })
        .collect();
    median(&gaps)
}
