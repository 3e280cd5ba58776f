//! The best breaks on a grid, exactly, by dynamic programming over all pairs of grid points.
//!
//! The best segmentation that ends at a point is the best over every start of (the best that ends at the start) plus one segment. The
//! `log⁺ m` term alone is no sum over segments, so a point keeps every prefix that may still win: one with fewer segments survives
//! while it is dearer by less than the logarithm can ever give back. That is one prefix almost always.
//!
//! Where the estimator allows it ([`Estimator::SUPERADDITIVE`]) starts are dropped for good as in Killick's PELT: once
//! (best at s) + (the least the samples s..t can cost) is no better than (best at t), no later end wants s.

use super::objective::{Objective, put_lane};
use super::variance::{Estimator, LANES, Lanes, Scratch, end_size};
use std::array::from_fn;
use std::f64::consts::TAU;

/// A prefix of the signal, segmented.
#[derive(Debug, Clone, Copy)]
struct Prefix {
    cost: f64,
    segments: usize,
    /// Grid point at which the last segment starts, and which of the prefixes there it extends.
    from: usize,
    from_prefix: usize,
}

/// How many grid points pass between two attempts to drop starts.
const PRUNING_INTERVAL: usize = 4;

/// The first samples of the second and later segments of the best segmentation whose breaks are multiples of the moments' step.
pub(super) fn best_on_grid<E: Estimator>(objective: &Objective<'_, E>) -> Vec<usize> {
    let mut search = Search::new(objective);
    let last = search.positions.len() - 1;
    for end in 1..=last {
        search.reach(end);
    }
    search.breaks_of_best(last)
}

struct Search<'a, E> {
    objective: &'a Objective<'a, E>,
    /// Grid points, and the signal's end as the last one.
    positions: Vec<usize>,
    /// Prefixes that end at each grid point, the cheapest first.
    prefixes: Vec<Vec<Prefix>>,
    blocks: Vec<Block>,
    /// What the estimator knows of the starts, block by block.
    starts: Vec<Lanes>,
    /// What it knows of the end at hand.
    ends: Vec<Lanes>,
    discounts: Discounts,
    scratch: Scratch,
    variances: Vec<Lanes>,
}

/// Starts handled side by side.
#[derive(Clone)]
struct Block {
    first_samples: Lanes,
    /// Cost of the cheapest prefix that ends at each start; infinite where there is none.
    before: Lanes,
    /// Cost of reaching the end at hand through each start.
    through: Lanes,
    /// Variance at the highest order between each start and the end at hand.
    least_variance: Lanes,
    /// Grid point of the end from which each start is not wanted any more.
    unwanted_from: [usize; LANES],
}

impl<'a, E: Estimator> Search<'a, E> {
    fn new(objective: &'a Objective<'a, E>) -> Self {
        let (moments, samples) = (objective.moments, objective.samples());
        let mut positions: Vec<usize> = (0..samples).step_by(moments.step).collect();
        positions.push(samples);
        let size = end_size(moments.order);
        let none = Lanes::splat(f64::INFINITY);
        let block = Block {
            first_samples: Lanes::splat(samples as f64),
            before: none,
            through: none,
            least_variance: none,
            unwanted_from: [usize::MAX; LANES],
        };
        let mut blocks = vec![block; positions.len().div_ceil(LANES)];
        let mut starts = vec![Lanes::default(); blocks.len() * size];
        let mut described = vec![0.0; size];
        for (point, &position) in positions.iter().enumerate() {
            E::describe_start(moments, position, &mut described);
            put_lane(&mut starts[point / LANES * size..][..size], point % LANES, &described);
            blocks[point / LANES].first_samples.0[point % LANES] = position as f64;
        }
        blocks[0].before.0[0] = 0.0;
        let mut prefixes = vec![Vec::new(); positions.len()];
        prefixes[0].push(Prefix { cost: 0.0, segments: 0, from: 0, from_prefix: 0 });
        Self {
            objective,
            prefixes,
            blocks,
            starts,
            ends: vec![Lanes::default(); size],
            discounts: Discounts::new(objective, &positions),
            scratch: Scratch::new(moments.order),
            variances: vec![Lanes::default(); moments.order + 1],
            positions,
        }
    }

    /// Finds the prefixes that end at grid point `end`, given those at all earlier ones.
    fn reach(&mut self, end: usize) {
        let position = self.positions[end];
        // Starts that leave the segment its minimum span.
        let early_enough = self.positions[..end].partition_point(|s| s + self.objective.min_span <= position);
        if early_enough == 0 {
            return;
        }
        let mut described = vec![0.0; self.ends.len()];
        E::describe_end(self.objective.moments, position, &mut described);
        for (lanes, value) in self.ends.iter_mut().zip(described) {
            *lanes = Lanes::splat(value);
        }
        let last_block = early_enough.div_ceil(LANES);
        pulp::Arch::new().dispatch(
            #[inline(always)]
            || {
                for block in 0..last_block {
                    self.rate_block(block, end);
                }
            },
        );
        self.keep_candidates(end, early_enough);
        if E::SUPERADDITIVE && end.is_multiple_of(PRUNING_INTERVAL) {
            self.drop_starts(end, early_enough);
        }
    }

    /// The cost of reaching `end` through each of a block's starts.
    #[inline(always)]
    fn rate_block(&mut self, index: usize, end: usize) {
        let block = &mut self.blocks[index];
        if block.unwanted_from.iter().all(|&from| from <= end) {
            block.through = Lanes::splat(f64::INFINITY);
            return;
        }
        let spans = Lanes::splat(self.positions[end] as f64) - block.first_samples;
        // Starts too late for this end get any positive span: their discounts are infinite.
        let positive = Lanes(from_fn(|l| if spans.0[l] > 1.0 { spans.0[l] } else { 1.0 }));
        let starts = &self.starts[index * self.ends.len()..][..self.ends.len()];
        E::estimate(starts, &self.ends, positive, &mut self.scratch, &mut self.variances);
        let floor = self.objective.floor;
        let mut best = Lanes::splat(f64::INFINITY);
        for (&variance, discount) in self.variances[1..].iter().zip(self.discounts.of(end, index * LANES)) {
            best = Lanes(from_fn(|l| {
                let candidate = (variance.0[l] + floor) * discount[l];
                if candidate < best.0[l] { candidate } else { best.0[l] }
            }));
        }
        for l in 0..LANES {
            block.through.0[l] = block.before.0[l] + positive.0[l] / 2.0 * (TAU * best.0[l]).ln();
        }
        block.least_variance = self.variances[self.variances.len() - 1];
    }

    fn through(&self, start: usize) -> f64 {
        self.blocks[start / LANES].through.0[start % LANES]
    }

    /// Keeps the cheapest prefix that ends at `end`, and those with fewer segments that may still overtake it.
    fn keep_candidates(&mut self, end: usize, starts: usize) {
        let mut cheapest = f64::INFINITY;
        let mut from = 0;
        for start in 0..starts {
            let cost = self.through(start);
            if cost < cheapest {
                (cheapest, from) = (cost, start);
            }
        }
        if cheapest == f64::INFINITY {
            return;
        }
        let most_segments = self.prefixes[from][0].segments + 1;
        let is_last = end + 1 == self.positions.len();
        let limit = cheapest + Self::greatest_refund(most_segments, 1, is_last);
        let mut candidates = vec![];
        for start in (0..starts).filter(|&start| start == from || self.through(start) < limit) {
            for (from_prefix, prefix) in self.prefixes[start].iter().enumerate() {
                let cost = self.through(start) + (prefix.cost - self.prefixes[start][0].cost);
                candidates.push(Prefix { cost, segments: prefix.segments + 1, from: start, from_prefix });
            }
        }
        candidates.sort_by(|a, b| a.cost.total_cmp(&b.cost).then(a.segments.cmp(&b.segments)));
        let kept = &mut self.prefixes[end];
        for candidate in candidates {
            let may_win = |winner: &Prefix| {
                candidate.segments < winner.segments
                    && candidate.cost
                        < winner.cost + Self::greatest_refund(winner.segments, candidate.segments, is_last)
            };
            if kept.iter().all(may_win) {
                kept.push(candidate);
            }
        }
        self.blocks[end / LANES].before.0[end % LANES] = cheapest;
    }

    /// The most that `fewer` instead of `more` segments up to a point can save in the break term of the whole signal.
    fn greatest_refund(more: usize, fewer: usize, is_last: bool) -> f64 {
        if is_last {
            Objective::<E>::break_penalty(more - 1) - Objective::<E>::break_penalty(fewer - 1)
        } else {
            // At least one segment follows, and the more follow the less it matters.
            (more as f64 / fewer as f64).ln()
        }
    }

    /// Marks the starts that no end far enough beyond `end` can want, since a break at `end` would do as well.
    fn drop_starts(&mut self, end: usize, starts: usize) {
        let Some(winner) = self.prefixes[end].first() else { return };
        let refund = (winner.segments as f64 + 1.0).ln();
        let bar = winner.cost + refund + 1e-9 * (1.0 + winner.cost.abs());
        // The segment after the break must be allowed whatever order the undivided one had.
        let clear = self.objective.min_span.max(2 * self.objective.moments.order);
        let from = self.positions.partition_point(|&p| p < self.positions[end] + clear);
        for start in 0..starts {
            let block = &mut self.blocks[start / LANES];
            let lane = start % LANES;
            if block.unwanted_from[lane] == usize::MAX && block.before.0[lane] < f64::INFINITY {
                let span = self.positions[end] - self.positions[start];
                let least = self.objective.surprise(block.least_variance.0[lane], span);
                if block.before.0[lane] + least >= bar {
                    block.unwanted_from[lane] = from;
                }
            } else if block.before.0[lane] == f64::INFINITY {
                // Nothing ends here within the minimum span of the signal's start, and nothing ever will.
                block.unwanted_from[lane] = 0;
            }
        }
    }

    fn breaks_of_best(&self, last: usize) -> Vec<usize> {
        let total = |p: &Prefix| p.cost + Objective::<E>::break_penalty(p.segments - 1);
        let Some(mut prefix) = self.prefixes[last].iter().min_by(|a, b| total(a).total_cmp(&total(b))) else {
            return vec![];
        };
        let mut breaks = vec![];
        while prefix.from > 0 {
            breaks.push(self.positions[prefix.from]);
            prefix = &self.prefixes[prefix.from][prefix.from_prefix];
        }
        breaks.reverse();
        breaks
    }
}

/// What the penalty of Eq. 2.3.3 amounts to as a factor on the variance: with it, the best order of a segment is the least product and the segment
/// takes one logarithm. Infinite where the order or the span is not allowed.
struct Discounts {
    /// By order (from 1), then by start for the last end, or by start less end plus the number of points for the others, whose spans
    /// are multiples of the step.
    last_end: Vec<f64>,
    other_ends: Vec<f64>,
    row: usize,
    points: usize,
}

impl Discounts {
    fn new<E: Estimator>(objective: &Objective<'_, E>, positions: &[usize]) -> Self {
        let points = positions.len();
        // A block of starts may reach past the last point.
        let row = points + LANES;
        let table = |span_of: &dyn Fn(usize) -> usize| {
            let entry = |order: usize, i: usize| {
                let span = span_of(i);
                if span >= objective.min_span && order <= objective.highest_order(span) {
                    (2.0 / span as f64 * objective.penalty(order, span)).exp()
                } else {
                    f64::INFINITY
                }
            };
            (1..=objective.moments.order).flat_map(|order| (0..row).map(move |i| (order, i))).map(|(order, i)| entry(order, i)).collect()
        };
        let samples = objective.samples();
        Self {
            last_end: table(&|start| positions.get(start).map_or(0, |position| samples - position)),
            other_ends: table(&|i| points.saturating_sub(i) * objective.moments.step),
            row,
            points,
        }
    }

    /// The factors of [`LANES`] starts from `start` on with grid point `end`, one item an order.
    #[inline(always)]
    fn of(&self, end: usize, start: usize) -> impl Iterator<Item = &[f64; LANES]> {
        let is_last = end + 1 == self.points;
        let table = if is_last { &self.last_end } else { &self.other_ends };
        let offset = if is_last { start } else { start + self.points - end };
        table.chunks_exact(self.row).filter_map(move |row| row.get(offset..)?.first_chunk())
    }
}
