//! The best breaks on a grid, exactly, by dynamic programming over all pairs of grid points.
//!
//! The best segmentation that ends at a point is the best over every start of (the best that ends at the start) plus one segment. The
//! `log⁺ m` term alone is no sum over segments, so a point keeps every prefix that may still win: one with fewer segments survives
//! while it is dearer by less than the logarithm can ever give back. That is one prefix almost always.
//!
//! Most pairs need no rating where the estimator allows it ([`Estimator::SUPERADDITIVE`]). At any order a segment `s..t` is at least as
//! surprising as its parts `s..u` and `u..t`, and its penalty at least that of `s..u`; so
//!
//! ```text
//! cost(s..t) >= cost(s..u) + (what u..t costs at the highest order, without penalty)
//! ```
//!
//! and a start whose bound exceeds what is known to reach t need not be looked at. Where a low order is best, the surprise at the
//! highest one is too little by what it fits to chance; so the orders are bounded in [classes](CLASSES), each with the surprise at its
//! own highest. The idea is that of PELT (Killick, Fearnhead and Eckley 2012), but works as well where nothing ever changes. The
//! bounds of all starts grow by at least the same surprise from one [`mark`](MARK) to the next, so a heap ordered by what they exceed
//! it by yields those that may matter, and the others cost nothing: the search takes time in proportion to the signal's length where
//! its character changes, and little more where it does not.

use super::objective::{Objective, put_lane};
use super::variance::{Estimator, LANES, Lanes, Scratch, end_size};
use bounds::{Bounds, Marks};
use std::array::from_fn;
use std::f64::consts::TAU;

mod bounds;

/// A prefix of the signal, segmented.
#[derive(Debug, Clone, Copy)]
struct Prefix {
    cost: f64,
    segments: usize,
    /// Grid point at which the last segment starts, and which of the prefixes there it extends.
    from: usize,
    from_prefix: usize,
}

/// Starts at most this many grid points before an end are always rated: their least surprise carries the bounds of all others forward
/// from mark to mark, which lie as far apart.
const MARK: usize = 8;

/// The orders are bounded in so many classes: up to an eighth of the highest, up to a quarter, a half, and the rest.
const CLASSES: usize = 4;

/// A cost for each class.
type ByClass = [f64; CLASSES];

/// The highest order of each class.
fn class_ends(order: usize) -> [usize; CLASSES] {
    from_fn(|class| (order >> (CLASSES - 1 - class)).max(1))
}

/// The least over the classes of what is known up to some point, continued by what follows.
#[inline(always)]
fn least(known: &ByClass, following: &ByClass) -> f64 {
    known.iter().zip(following).fold(f64::INFINITY, |least, (k, f)| least.min(k + f))
}

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
    /// Data of the estimator about the starts, block by block.
    starts: Vec<Lanes>,
    /// Data of the estimator about the present end.
    ends: Vec<Lanes>,
    discounts: Discounts,
    /// Surprise from each of the last [`MARK`] grid points, the latest first, to the end at hand.
    surprise_since: [ByClass; MARK + 1],
    bounds: Bounds,
    marks: Marks,
    /// The cheapest way known to reach the end at hand: cost and number of segments.
    incumbent: (f64, usize),
    /// Starts through which the end at hand was rated, and the cost of reaching it.
    reached: Vec<(usize, f64)>,
    scratch: Scratch,
    variances: Vec<Lanes>,
}

/// Starts handled side by side.
#[derive(Clone)]
struct Block {
    first_samples: Lanes,
    /// Cost of the cheapest prefix that ends at each start; infinite where there is none.
    before: Lanes,
    /// At most the cost of reaching grid point `bounded_at` through any of the starts.
    bound: ByClass,
    bounded_at: usize,
    /// Fewest segments of any prefix that ends at one of the starts.
    fewest: usize,
}

/// Rates all starts that may matter for one end, with the widest vectors the processor has.
struct RateStarts<'s, 'a, E> {
    end: usize,
    search: &'s mut Search<'a, E>,
}

impl<E: Estimator> pulp::WithSimd for RateStarts<'_, '_, E> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { end, search } = self;
        let recent = if E::SUPERADDITIVE { end.saturating_sub(MARK) / LANES } else { 0 };
        for block in (recent..end.div_ceil(LANES)).rev() {
            search.rate(block, end);
        }
        if !E::SUPERADDITIVE {
            return;
        }
        search.bounds.take_in(recent);
        if end.is_multiple_of(MARK) {
            search.pass_mark(end);
        }
        for index in 0..search.bounds.fresh().len() {
            search.rate_if_needed(search.bounds.fresh()[index], end);
        }
        // The most promising first, because the incumbent is what all are measured by.
        while let Some(block) = search.next_waiting(end) {
            search.rate_if_needed(block, end);
            search.bounds.renew(block);
        }
    }
}

impl<'a, E: Estimator> Search<'a, E> {
    fn new(objective: &'a Objective<'a, E>) -> Self {
        let (moments, samples) = (objective.moments, objective.samples());
        let mut positions: Vec<usize> = (0..samples).step_by(moments.step).collect();
        positions.push(samples);
        let size = end_size(moments.order);
        let block = Block {
            first_samples: Lanes::splat(samples as f64),
            before: Lanes::splat(f64::INFINITY),
            bound: [f64::NEG_INFINITY; CLASSES],
            bounded_at: 0,
            fewest: usize::MAX,
        };
        let mut blocks = vec![block; positions.len().div_ceil(LANES)];
        let mut starts = vec![Lanes::default(); blocks.len() * size];
        let mut described = vec![0.0; size];
        for (point, &position) in positions.iter().enumerate() {
            E::describe_start(moments, position, &mut described);
            put_lane(&mut starts[point / LANES * size..][..size], point % LANES, &described);
            blocks[point / LANES].first_samples.0[point % LANES] = position as f64;
        }
        (blocks[0].before.0[0], blocks[0].fewest) = (0.0, 0);
        let mut prefixes = vec![Vec::new(); positions.len()];
        prefixes[0].push(Prefix { cost: 0.0, segments: 0, from: 0, from_prefix: 0 });
        Self {
            objective,
            prefixes,
            blocks,
            starts,
            ends: vec![Lanes::default(); size],
            discounts: Discounts::new(objective, &positions),
            surprise_since: [[0.0; CLASSES]; MARK + 1],
            bounds: Bounds::default(),
            marks: Marks::new::<E>(moments, &positions),
            incumbent: (f64::INFINITY, 1),
            reached: vec![],
            scratch: Scratch::new(moments.order),
            variances: vec![Lanes::default(); moments.order + 1],
            positions,
        }
    }

    /// Finds the prefixes that end at grid point `end`, given those at all earlier ones.
    fn reach(&mut self, end: usize) {
        let position = self.positions[end];
        let mut described = vec![0.0; self.ends.len()];
        E::describe_end(self.objective.moments, position, &mut described);
        for (lanes, value) in self.ends.iter_mut().zip(described) {
            *lanes = Lanes::splat(value);
        }
        self.incumbent = (f64::INFINITY, 1);
        self.reached.clear();
        haptograph_signal::instructions::arch().dispatch(RateStarts { end, search: self });
        self.keep_candidates(end);
    }

    /// Carries all bounds forward to the mark `end`.
    fn pass_mark(&mut self, end: usize) {
        let since_last = self.surprise_since[MARK.min(end)];
        for block in self.bounds.take_fresh() {
            let bound = self.bound_now(block, end);
            let Block { bound: rated, bounded_at, .. } = &mut self.blocks[block];
            if *bounded_at > self.bounds.mark() {
                let since = self.surprise_since[end - *bounded_at];
                *rated = from_fn(|class| rated[class] + since[class]);
                *bounded_at = end;
            }
            self.bounds.push(block, bound - since_last[CLASSES - 1]);
        }
        self.bounds.pass_mark(end, since_last[CLASSES - 1]);
    }

    /// At most the cost of reaching `end` through any start of a block.
    #[inline(always)]
    fn bound_now(&mut self, block: usize, end: usize) -> f64 {
        let (known, at) = self.bound_since_mark(block);
        least(&known, &self.surprise_since[end - at])
    }

    /// The bound of a block at the latest mark, or where it was rated since.
    #[inline(always)]
    fn bound_since_mark(&mut self, block: usize) -> (ByClass, usize) {
        let mark = self.bounds.mark();
        let Block { bound, bounded_at, .. } = self.blocks[block];
        if bounded_at >= mark {
            return (bound, bounded_at);
        }
        let (scratch, variances) = (&mut self.scratch, &mut self.variances);
        let since = self.marks.surprise(bounded_at, mark, self.objective, scratch, variances);
        (from_fn(|class| bound[class] + since[class]), mark)
    }

    /// Rates a block for `end` if it may matter.
    #[inline(always)]
    fn rate_if_needed(&mut self, block: usize, end: usize) {
        if self.bound_now(block, end) < self.limit(self.blocks[block].fewest) {
            self.rate(block, end);
        }
    }

    /// Upper limit of the cost of a prefix that extends one of at least this many segments: the cost of the incumbent,
    /// plus the largest saving of the break term for the segments that the incumbent has more.
    #[inline(always)]
    fn limit(&self, extended: usize) -> f64 {
        let (cost, segments) = self.incumbent;
        let refund = if extended < segments - 1 {
            // Which of the two is greater depends on whether a prefix of one segment is extended.
            let of = |is_last| Self::greatest_refund(segments, extended + 1, is_last);
            of(true).max(of(false))
        } else {
            0.0
        };
        // The last term covers the rounding of the sums that make a bound.
        cost + refund + 1e-9 * (1.0 + cost.abs() + self.bounds.carried().abs())
    }

    /// The most promising of the blocks that were not looked at since the latest mark, if it may matter before the next.
    #[inline(always)]
    fn next_waiting(&mut self, end: usize) -> Option<usize> {
        let limit = self.limit(0) - self.surprise_since[end - self.bounds.mark()][CLASSES - 1];
        while let Some((block, bound)) = self.bounds.pop_below(limit) {
            let (known, _) = self.bound_since_mark(block);
            let tightened = least(&known, &[0.0; CLASSES]).max(bound);
            if tightened < limit {
                return Some(block);
            }
            self.bounds.push(block, tightened);
        }
        None
    }

    /// The cost of reaching `end` through each of a block's starts.
    #[inline(always)]
    fn rate(&mut self, index: usize, end: usize) {
        let spans = Lanes::splat(self.positions[end] as f64) - self.blocks[index].first_samples;
        // Starts too late for this end get any positive span: their discounts are infinite.
        let spans = Lanes(from_fn(|l| if spans.0[l] > 1.0 { spans.0[l] } else { 1.0 }));
        let starts = &self.starts[index * self.ends.len()..][..self.ends.len()];
        E::estimate(starts, &self.ends, spans, &mut self.scratch, &mut self.variances);
        let costs = self.costs(index, end, spans);
        // Only where every order was allowed does the cost bound what a longer segment costs.
        let clear = self.objective.min_span.max(2 * self.objective.moments.order) as f64;
        let block = &mut self.blocks[index];
        block.bounded_at = end;
        block.bound = [f64::INFINITY; CLASSES];
        for l in 0..LANES {
            let start = index * LANES + l;
            let cost = costs[..].iter().fold(f64::INFINITY, |least, cost| least.min(cost.0[l]));
            for (bound, cost) in block.bound.iter_mut().zip(&costs) {
                *bound = bound.min(if spans.0[l] >= clear { cost.0[l] } else { f64::NEG_INFINITY });
            }
            if cost < f64::INFINITY {
                self.reached.push((start, cost));
                if cost < self.incumbent.0 {
                    self.incumbent = (cost, self.prefixes[start][0].segments + 1);
                }
            }
            if E::SUPERADDITIVE && start < end && end - start <= MARK {
                let span = self.positions[end] - self.positions[start];
                self.surprise_since[end - start] =
                    by_class(&self.variances, |v| self.objective.surprise(v.0[l], span));
            }
        }
    }

    /// The least cost in each class of orders of reaching `end` through a block's starts, given the variances.
    #[inline(always)]
    fn costs(&self, index: usize, end: usize, spans: Lanes) -> [Lanes; CLASSES] {
        let floor = self.objective.floor;
        let before = self.blocks[index].before;
        let mut orders = self.variances[1..].iter().zip(self.discounts.of(end, index * LANES));
        let mut done = 0;
        class_ends(self.objective.moments.order).map(|class_end| {
            let mut best = Lanes::splat(f64::INFINITY);
            for (&variance, discount) in orders.by_ref().take(class_end - done) {
                best = Lanes(from_fn(|l| {
                    let candidate = (variance.0[l] + floor) * discount[l];
                    if candidate < best.0[l] { candidate } else { best.0[l] }
                }));
            }
            done = class_end;
            Lanes(from_fn(|l| before.0[l] + spans.0[l] / 2.0 * (TAU * best.0[l]).ln()))
        })
    }

    /// Keeps the cheapest prefix that ends at `end`, and those with fewer segments that may still overtake it.
    fn keep_candidates(&mut self, end: usize) {
        let (cheapest, segments) = self.incumbent;
        let is_last = end + 1 == self.positions.len();
        let limit = cheapest + (segments as f64).ln();
        let mut candidates = vec![];
        for &(start, reached) in self.reached.iter().filter(|(_, cost)| *cost <= limit) {
            for (from_prefix, prefix) in self.prefixes[start].iter().enumerate() {
                let cost = reached + (prefix.cost - self.prefixes[start][0].cost);
                candidates.push(Prefix { cost, segments: prefix.segments + 1, from: start, from_prefix });
            }
        }
        candidates.sort_by(|a, b| {
            a.cost.total_cmp(&b.cost).then(a.segments.cmp(&b.segments)).then(a.from.cmp(&b.from))
        });
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
        let block = &mut self.blocks[end / LANES];
        block.before.0[end % LANES] = cheapest;
        for prefix in &self.prefixes[end] {
            block.fewest = block.fewest.min(prefix.segments);
        }
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

/// The values at the highest order of each class.
#[inline(always)]
fn by_class<T>(orders: &[T], known: impl Fn(&T) -> f64) -> ByClass {
    class_ends(orders.len() - 1).map(|order| known(&orders[order]))
}

/// The penalty of Eq. 2.3.3 as a factor on the variance: the best order of a segment then has the least product, and a
/// segment takes one logarithm. Infinite if the order or the span is not allowed.
struct Discounts {
    /// Discounts by order (from 1), then by start for the last end, or by start less end plus the number of points for the others, whose spans
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
            (1..=objective.moments.order)
                .flat_map(|order| (0..row).map(move |i| (order, i)))
                .map(|(order, i)| entry(order, i))
                .collect()
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
