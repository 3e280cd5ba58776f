//! Cost of each step of running plans, measured by timing a fraction of the quanta step by step.

use super::cost::{StepObserver, clock_ns};
use super::virtual_clock::VirtualClock;
use crate::node_id::NodeId;
use crate::plan::{Plan, Step};
use haptograph_signal::statistics::median;
use std::ops::Range;
use std::sync::Arc;
use std::time::Instant;

/// Largest number of samples kept for a step; further samples replace the oldest.
const MAX_SAMPLES: usize = 4096;
/// Number of trials, with and without a timed quantum, that measure the cost of timing.
const TRIALS: usize = 256;
/// Quanta of a trial: those after a timed one cost more too.
const TRIAL_QUANTA: u64 = 7;
/// Largest cost of timing, as a fraction of the run.
const MAX_COST: f64 = 0.01;
/// Shift of the timed quantum from period to period, as a fraction of the period: it avoids aliasing with the clocks.
const STRIDE: f64 = 0.618_033_988_749_894_8;

/// Virtual time that measures the players that it runs.
pub struct Profile {
    clock: VirtualClock,
    /// One for each driver.
    drivers: Vec<DriverProfile>,
    /// Cost of reading the clock, ns.
    clock_ns: f64,
    /// One quantum of this many is timed.
    every: u64,
    quanta: u64,
    timed: u64,
}

/// Samples of a driver.
struct DriverProfile {
    stopwatch: Stopwatch,
    samples: Vec<Samples>,
}

/// Cost of a step.
#[derive(Debug, Clone, PartialEq)]
pub struct StepCost {
    /// Label of the step: the node's path, or a description such as `hold stylus.force`.
    pub label: String,
    /// The node it belongs to.
    pub node: NodeId,
    /// Index of its clock in the graph.
    pub clock: usize,
    /// Median over the timed quanta, ns per tick of its clock.
    pub median_ns: f64,
    /// 99 % quantile, ns per tick.
    pub p99_ns: f64,
    /// Maximum, interruptions by the system included, ns per tick.
    pub worst_ns: f64,
    /// Number of timed quanta in which it ran.
    pub samples: usize,
}

struct Stopwatch {
    latest: Instant,
    /// Cost of reading the clock, ns.
    clock_ns: f64,
    /// (ns, ticks) of each step in the present quantum.
    steps: Vec<(f64, usize)>,
}

#[derive(Clone, Default)]
struct Samples {
    ns_a_tick: Vec<f32>,
    seen: usize,
}

impl StepObserver for Stopwatch {
    const STEPWISE: bool = true;

    fn steps_done(&mut self, numbers: Range<usize>, ticks: usize) {
        let now = Instant::now();
        let took_ns = now.duration_since(self.latest).as_nanos() as f64 - self.clock_ns;
        let each_ns = took_ns / numbers.len() as f64;
        for (ns, all) in self.steps.get_mut(numbers).unwrap_or_default() {
            *ns += each_ns;
            *all += ticks;
        }
        self.latest = now;
    }
}

impl Profile {
    /// Profiles the plans of [`Plan::of`]. First measures the fraction of quanta that can be timed at 1 % of the cost.
    pub fn new(plans: &[Arc<Plan>]) -> Self {
        let mut this = Self::timing_every(plans, u64::MAX);
        // The first quantum is timed.
        this.run_quantum();
        let mut took = [Vec::new(), Vec::new()];
        for trial in 0..2 * TRIALS {
            let before = Instant::now();
            for quantum in 0..TRIAL_QUANTA {
                if trial % 2 == 1 && quantum == 0 {
                    this.timed_quantum();
                } else {
                    this.run_quantum();
                }
            }
            took[trial % 2].push(before.elapsed().as_nanos() as f64);
        }
        let [plain, timed] = took.map(|took| median(&took));
        let quantum_ns = (plain / TRIAL_QUANTA as f64).max(1.0);
        let every = ((timed - plain).max(0.0) / (MAX_COST * quantum_ns)).ceil() as u64;
        Self::timing_every(plans, every.max(1))
    }

    /// Profiles the plans by timing one quantum of `every`.
    pub fn timing_every(plans: &[Arc<Plan>], every: u64) -> Self {
        let clock_ns = clock_ns();
        let driver = |plan: &Arc<Plan>| DriverProfile {
            stopwatch: Stopwatch {
                latest: Instant::now(),
                clock_ns,
                steps: vec![(0.0, 0); plan.step_count()],
            },
            samples: vec![Samples::default(); plan.step_count()],
        };
        Self {
            clock: VirtualClock::of(plans),
            drivers: plans.iter().map(driver).collect(),
            clock_ns,
            every,
            quanta: 0,
            timed: 0,
        }
    }

    /// One quantum of this many is timed.
    pub fn every(&self) -> u64 {
        self.every
    }

    /// Number of timed quanta.
    pub fn timed_quanta(&self) -> u64 {
        self.timed
    }

    /// Runs a quantum; gives the same samples as [`VirtualClock::run_quantum`].
    pub fn run_quantum(&mut self) {
        let (stretch, at) = (self.quanta / self.every, self.quanta % self.every);
        let turn = (STRIDE * stretch as f64).fract() * self.every as f64;
        self.quanta += 1;
        if at != turn as u64 {
            self.clock.run_quantum(|_, _| {});
        } else {
            self.timed_quantum();
        }
    }

    fn timed_quantum(&mut self) {
        self.timed += 1;
        let drivers = &mut self.drivers;
        drivers.iter_mut().for_each(|driver| driver.stopwatch.steps.fill((0.0, 0)));
        self.clock.run_quantum_by(|driver, player, mut left| {
            let (run, stopwatch) = (player.run_mut(), &mut drivers[driver].stopwatch);
            while left > 0 {
                let block = left.min(run.plan.block);
                stopwatch.latest = Instant::now();
                run.advance_observed(block, stopwatch);
                left -= block;
            }
        });
        for DriverProfile { stopwatch, samples } in drivers {
            for (samples, (ns, ticks)) in samples.iter_mut().zip(&stopwatch.steps) {
                if *ticks > 0 {
                    samples.push((ns / *ticks as f64).max(0.0) as f32);
                }
            }
        }
    }

    /// Runs a quantum and adds the time of each driver to `took_ns`.
    pub fn run_quantum_by_driver(&mut self, took_ns: &mut [f64]) {
        let clock_ns = self.clock_ns;
        self.clock.run_quantum_by(|driver, player, frames| {
            let begun = Instant::now();
            player.run_due(frames, &mut |_, _| {});
            took_ns[driver] += begun.elapsed().as_nanos() as f64 - clock_ns;
        });
    }

    /// The clock.
    pub fn clock(&self) -> &VirtualClock {
        &self.clock
    }

    /// Cost of every step of a driver that ran, in the order of its plan.
    pub fn costs(&self, driver: usize) -> Vec<StepCost> {
        let Some(run) = self.clock.runs().nth(driver) else {
            return Vec::new();
        };
        let steps = run.plan.steps.iter();
        let cost = |(step, samples): (&Step, &Samples)| {
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
        steps.zip(&self.drivers[driver].samples).filter_map(cost).collect()
    }
}

impl Samples {
    fn push(&mut self, ns_a_tick: f32) {
        if self.ns_a_tick.len() < MAX_SAMPLES {
            self.ns_a_tick.push(ns_a_tick);
        } else {
            self.ns_a_tick[self.seen % MAX_SAMPLES] = ns_a_tick;
        }
        self.seen += 1;
    }
}
