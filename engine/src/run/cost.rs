//! Cost of each node of a live run, measured by timing a few blocks step by step.

use super::Run;
use crate::node_id::NodeId;
use crate::plan::{Plan, StepTime};
use haptograph_signal::statistics::median;
use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::LazyLock;
use std::time::Instant;

/// Observer of finished steps.
pub(super) trait StepObserver {
    /// True if every step runs by itself, or in a list of laws, and is reported.
    const STEPWISE: bool;

    /// Called after steps have run `ticks` of their clock: one, or some that run together, in equal parts.
    fn steps_done(&mut self, numbers: Range<usize>, ticks: usize);
}

/// Observes nothing.
pub(super) struct NoObserver;

impl StepObserver for NoObserver {
    const STEPWISE: bool = false;

    fn steps_done(&mut self, _: Range<usize>, _: usize) {}
}

/// One block in this many is timed, on average.
const EVERY: u64 = 16;
/// 2^32 divided by the golden ratio: its multiples spread evenly and avoid aliasing with the graph's clocks.
const STRIDE: u32 = 0x9E37_79B9;

/// Cost of reading the clock, ns.
static CLOCK_NS: LazyLock<f64> = LazyLock::new(clock_ns);

/// Selection of the blocks that are timed.
#[derive(Debug, Default)]
pub(super) struct CostSampler {
    turn: u32,
    /// Number of blocks before the next timed one.
    left: u64,
}

impl CostSampler {
    /// Measures the cost of the clock, before the real-time thread needs it.
    pub(super) fn new() -> Self {
        LazyLock::force(&CLOCK_NS);
        Self::default()
    }

    /// True if the next block is timed.
    pub(super) fn is_due(&mut self) -> bool {
        if self.left > 0 {
            self.left -= 1;
            return false;
        }
        self.turn = self.turn.wrapping_add(STRIDE);
        self.left = (u64::from(self.turn) * (2 * EVERY - 1)) >> 32;
        true
    }
}

/// Adds the time of each step to the plan's sums.
struct Stopwatch<'p> {
    latest: Instant,
    times: &'p [StepTime],
}

impl StepObserver for Stopwatch<'_> {
    const STEPWISE: bool = true;

    fn steps_done(&mut self, numbers: Range<usize>, ticks: usize) {
        let now = Instant::now();
        // The clock was read once for all of them; its cost is taken off each later.
        let (ns, clock_ns) = (now.duration_since(self.latest).as_nanos() as f64, *CLOCK_NS);
        let ns = ((ns - clock_ns) / numbers.len() as f64 + clock_ns).max(0.0).round() as u64;
        let times = self.times.get(numbers).unwrap_or_default();
        times.iter().filter(|_| ticks > 0).for_each(|time| time.add(ns));
        self.latest = now;
    }
}

impl Run {
    /// Like [`advance`](Self::advance), but runs and times every step by itself.
    pub(super) fn advance_timed(&mut self, frames: usize) {
        let Self { plan, state } = self;
        state.windows.next_block(frames.min(plan.block));
        let mut stopwatch = Stopwatch { latest: Instant::now(), times: &plan.times };
        state.steps(plan, 0..plan.steps.len(), &mut stopwatch);
    }
}

/// Time of each node of a plan in the blocks that were timed, ns; empty if none was.
pub(super) fn of_nodes(plan: &Plan) -> Vec<(NodeId, f64)> {
    let mut nodes: BTreeMap<NodeId, f64> = BTreeMap::new();
    for (step, time) in plan.steps.iter().zip(&*plan.times) {
        let (ns, looks) = time.get();
        if looks > 0 {
            *nodes.entry(step.node).or_default() += (ns as f64 - looks as f64 * *CLOCK_NS).max(0.0);
        }
    }
    nodes.into_iter().collect()
}

/// Time between two readings of the clock, ns.
pub(super) fn clock_ns() -> f64 {
    let gaps: Vec<f64> = (0..1000)
        .map(|_| {
            let before = Instant::now();
            before.elapsed().as_nanos() as f64
        })
        .collect();
    median(&gaps)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_block_in_sixteen_is_timed_and_at_uneven_distances() {
        let mut sampler = CostSampler::default();
        let timed: Vec<usize> = (0..160_000).filter(|_| sampler.is_due()).collect();
        assert!((9_900..=10_100).contains(&timed.len()), "{}", timed.len());
        let gaps = timed.windows(2).map(|pair| pair[1] - pair[0]);
        let (least, most) = gaps.fold((usize::MAX, 0), |(least, most), gap| (least.min(gap), most.max(gap)));
        assert_eq!((least, most), (1, 31));
        // Whatever the rhythm of a clock, each of its phases is timed alike.
        for phase in 0..6 {
            let share = timed.iter().filter(|block| *block % 6 == phase).count() as f64 / timed.len() as f64;
            assert!((share - 1.0 / 6.0).abs() < 0.01, "{phase}: {share}");
        }
    }
}
