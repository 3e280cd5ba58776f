//! What each step of running plans costs, by timing one round of theirs in many step by step.

use super::fleet::{Fleet, Work};
use crate::graph::NodeId;
use crate::plan::{Plan, Step};
use haptograph_signal::statistics::median;
use std::convert::Infallible;
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
/// Stretches of rounds, with one that is timed and with none, by which the price of timing is found: what comes after a
/// timed round is dearer too.
const TRIALS: usize = 256;
const TRIAL_ROUNDS: u64 = 7;
/// What timing may cost, as a part of the run.
const PRICE: f64 = 0.01;
/// The part of a stretch by which the timed round lies further along than in the stretch before: so it falls in with
/// no rhythm of the graph's clocks.
const STRIDE: f64 = 0.618_033_988_749_894_8;

/// The runs of all drivers of a graph, measured.
pub struct Profile {
    fleet: Fleet,
    /// Of each driver.
    books: Vec<Book>,
    /// What looking at the clock itself takes, ns.
    look_ns: f64,
    /// One round in so many is timed.
    every: u64,
    rounds: u64,
    timed: u64,
}

/// What was seen of a driver.
struct Book {
    stopwatch: Stopwatch,
    samples: Vec<Samples>,
}

/// What a step costs.
#[derive(Debug, Clone, PartialEq)]
pub struct StepCost {
    /// What the step does: the node's path, or for what stands between nodes words like `hold stylus.force`.
    pub label: String,
    /// The node it belongs to.
    pub node: NodeId,
    /// Its clock, as an index of the graph's.
    pub clock: usize,
    /// Median over the timed rounds, ns a tick of its clock.
    pub median_ns: f64,
    /// What 99 of 100 timed rounds stayed below, ns a tick.
    pub p99_ns: f64,
    /// The worst, interruptions by the system included, ns a tick.
    pub worst_ns: f64,
    /// Timed rounds in which it ran.
    pub samples: usize,
}

struct Stopwatch {
    latest: Instant,
    /// What looking at the clock itself takes, ns.
    look_ns: f64,
    /// Of each step in the present round: ns, ticks.
    steps: Vec<(f64, usize)>,
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
        if let Some((ns, all)) = self.steps.get_mut(number) {
            *ns += now.duration_since(self.latest).as_nanos() as f64 - self.look_ns;
            *all += ticks;
        }
        self.latest = now;
    }
}

impl Profile {
    /// Of the plans of [`Plan::of`]: runs some rounds to find how many of them can be timed at a hundredth of the whole
    /// cost, then starts anew.
    pub fn new(plans: &[Arc<Plan>]) -> Self {
        let mut this = Self::timing_every(plans, u64::MAX);
        // The first one is timed.
        this.round();
        let mut took = [Vec::new(), Vec::new()];
        for trial in 0..2 * TRIALS {
            let before = Instant::now();
            for round in 0..TRIAL_ROUNDS {
                if trial % 2 == 1 && round == 0 {
                    this.timed_round();
                } else {
                    this.round();
                }
            }
            took[trial % 2].push(before.elapsed().as_nanos() as f64);
        }
        let [plain, timed] = took.map(|took| median(&took));
        let a_round = (plain / TRIAL_ROUNDS as f64).max(1.0);
        let every = ((timed - plain).max(0.0) / (PRICE * a_round)).ceil() as u64;
        Self::timing_every(plans, every.max(1))
    }

    /// Measured runs of which one round in `every` is timed.
    pub fn timing_every(plans: &[Arc<Plan>], every: u64) -> Self {
        let look_ns = look_ns();
        let book = |plan: &Arc<Plan>| Book {
            stopwatch: Stopwatch {
                latest: Instant::now(),
                look_ns,
                steps: vec![(0.0, 0); plan.step_count()],
            },
            samples: vec![Samples::default(); plan.step_count()],
        };
        Self {
            fleet: Fleet::new(plans),
            books: plans.iter().map(book).collect(),
            look_ns,
            every,
            rounds: 0,
            timed: 0,
        }
    }

    /// One round in so many is timed.
    pub fn every(&self) -> u64 {
        self.every
    }

    /// How many were.
    pub fn timed_rounds(&self) -> u64 {
        self.timed
    }

    /// Runs a round; the samples are those of [`Fleet::round`].
    pub fn round(&mut self) {
        let (stretch, at) = (self.rounds / self.every, self.rounds % self.every);
        let turn = (STRIDE * stretch as f64).fract() * self.every as f64;
        self.rounds += 1;
        if at != turn as u64 {
            let Ok(()) = self.fleet.round(|_, _| Ok::<(), Infallible>(()));
        } else {
            self.timed_round();
        }
    }

    fn timed_round(&mut self) {
        self.timed += 1;
        let books = &mut self.books;
        let Ok(()) = self.fleet.round_by(|driver, run, work| {
            let stopwatch = &mut books[driver].stopwatch;
            match work {
                Work::Look => {
                    run.look();
                    stopwatch.steps.fill((0.0, 0));
                }
                Work::Advance(frames) => {
                    stopwatch.latest = Instant::now();
                    run.advance_watched(frames, stopwatch);
                }
            }
            Ok::<(), Infallible>(())
        });
        for Book { stopwatch, samples } in books {
            for (samples, (ns, ticks)) in samples.iter_mut().zip(&stopwatch.steps) {
                if *ticks > 0 {
                    samples.push((ns / *ticks as f64).max(0.0) as f32);
                }
            }
        }
    }

    /// Runs a round and adds to `took_ns` what each driver took for it, as a whole.
    pub fn round_by_driver(&mut self, took_ns: &mut [f64]) {
        let look_ns = self.look_ns;
        let Ok(()) = self.fleet.round_by(|driver, run, work| {
            let begun = Instant::now();
            match work {
                Work::Look => run.look(),
                Work::Advance(frames) => run.advance(frames),
            }
            took_ns[driver] += begun.elapsed().as_nanos() as f64 - look_ns;
            Ok::<(), Infallible>(())
        });
    }

    /// The runs themselves.
    pub fn fleet(&self) -> &Fleet {
        &self.fleet
    }

    /// Of every step of a driver that ran, in the order of its plan.
    pub fn costs(&self, driver: usize) -> Vec<StepCost> {
        let steps = self.fleet.runs()[driver].plan.steps.iter();
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
        steps.zip(&self.books[driver].samples).filter_map(cost).collect()
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
pub(super) fn look_ns() -> f64 {
    let gaps: Vec<f64> = (0..1000)
        .map(|_| {
            let before = Instant::now();
            before.elapsed().as_nanos() as f64
        })
        .collect();
    median(&gaps)
}
