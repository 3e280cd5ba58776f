//! Lower bounds of the cost of reaching an end through each block of starts, in an order that yields only the blocks
//! that may matter.

use super::super::moments::Moments;
use super::super::objective::{Objective, put_lane};
use super::super::variance::{Estimator, LANES, Lanes, Scratch, end_size};
use super::{ByClass, CLASSES, MARK, by_class};
use std::cmp::Ordering;
use std::collections::BinaryHeap;

/// Blocks by their bounds. A bound holds at the latest mark; between marks all grow alike.
#[derive(Default)]
pub(super) struct Bounds {
    waiting: BinaryHeap<Waiting>,
    /// Blocks that were looked at since the latest mark.
    fresh: Vec<usize>,
    /// Blocks before this one are kept here.
    kept: usize,
    mark: usize,
    /// Least surprise from the signal's start to the latest mark, mark by mark.
    carried: f64,
}

/// A block, and its bound less what was carried when it was put here.
struct Waiting {
    excess: f64,
    block: usize,
}

impl Ord for Waiting {
    /// The greatest is the most promising.
    fn cmp(&self, other: &Self) -> Ordering {
        other.excess.total_cmp(&self.excess).then(other.block.cmp(&self.block))
    }
}

impl PartialOrd for Waiting {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Waiting {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Waiting {}

impl Bounds {
    /// Takes in the blocks before `block`, which were rated at every end so far.
    pub(super) fn take_in(&mut self, block: usize) {
        self.fresh.extend(self.kept..block);
        self.kept = block;
    }

    /// The blocks that were looked at since the latest mark, to be pushed before the next.
    pub(super) fn take_fresh(&mut self) -> Vec<usize> {
        std::mem::take(&mut self.fresh)
    }

    /// Moves on to the next mark.
    pub(super) fn pass_mark(&mut self, mark: usize, since_last: f64) {
        self.mark = mark;
        self.carried += since_last;
    }

    /// The latest mark.
    pub(super) fn mark(&self) -> usize {
        self.mark
    }

    pub(super) fn carried(&self) -> f64 {
        self.carried
    }

    /// Puts a block back, with its bound at the latest mark.
    pub(super) fn push(&mut self, block: usize, bound: f64) {
        let excess = bound - self.carried;
        self.waiting.push(Waiting { excess, block });
    }

    /// The block with the lowest bound at the latest mark, with that bound, if it is below `limit`.
    pub(super) fn pop_below(&mut self, limit: f64) -> Option<(usize, f64)> {
        let bound = self.waiting.peek()?.excess + self.carried;
        if bound >= limit {
            return None;
        }
        let Waiting { block, .. } = self.waiting.pop()?;
        Some((block, bound))
    }

    /// Notes that a block was looked at since the latest mark.
    pub(super) fn renew(&mut self, block: usize) {
        self.fresh.push(block);
    }

    /// The blocks that were looked at since the latest mark.
    pub(super) fn fresh(&self) -> &[usize] {
        &self.fresh
    }
}

/// Least surprise from any mark to the latest one, computed for [`LANES`] marks at once when first asked for.
pub(super) struct Marks {
    starts: Vec<Lanes>,
    /// Grid point and sample of each mark.
    samples: Vec<usize>,
    size: usize,
    /// The last known mark of each block of marks, and the bound there.
    known: Vec<(usize, [ByClass; LANES])>,
    end: Vec<Lanes>,
    end_at: usize,
}

impl Marks {
    pub(super) fn new<E: Estimator>(moments: &Moments, positions: &[usize]) -> Self {
        let size = end_size(moments.order);
        let samples: Vec<usize> = positions.iter().copied().step_by(MARK).collect();
        let blocks = samples.len().div_ceil(LANES);
        let mut starts = vec![Lanes::default(); if E::SUPERADDITIVE { blocks * size } else { 0 }];
        let mut described = vec![0.0; size];
        for (mark, &sample) in samples.iter().enumerate().filter(|_| E::SUPERADDITIVE) {
            E::describe_start(moments, sample, &mut described);
            let block = &mut starts[mark / LANES * size..][..size];
            put_lane(block, mark % LANES, &described);
        }
        Self {
            starts,
            samples,
            size,
            known: vec![(0, [[0.0; CLASSES]; LANES]); blocks],
            end: vec![Lanes::default(); size],
            end_at: 0,
        }
    }

    /// Least surprise between two marks, given as grid points, of which `to` is the later and the latest.
    #[inline(always)]
    pub(super) fn surprise<E: Estimator>(
        &mut self,
        from: usize,
        to: usize,
        objective: &Objective<'_, E>,
        scratch: &mut Scratch,
        variances: &mut [Lanes],
    ) -> ByClass {
        let (mark, end) = (from / MARK, self.samples[to / MARK]);
        let (block, lane) = (mark / LANES, mark % LANES);
        if self.known[block].0 != to {
            self.describe_end::<E>(to, end, objective.moments);
            let span = |lane: usize| {
                let start = self.samples.get(block * LANES + lane);
                start.map_or(1, |start| end.saturating_sub(*start)).max(1)
            };
            let spans = Lanes(std::array::from_fn(|lane| span(lane) as f64));
            let starts = &self.starts[block * self.size..][..self.size];
            E::estimate(starts, &self.end, spans, scratch, variances);
            let surprise = |lane| by_class(variances, |v| objective.surprise(v.0[lane], span(lane)));
            self.known[block] = (to, std::array::from_fn(surprise));
        }
        self.known[block].1[lane]
    }

    fn describe_end<E: Estimator>(&mut self, to: usize, end: usize, moments: &Moments) {
        if self.end_at == to {
            return;
        }
        let mut described = vec![0.0; self.size];
        E::describe_end(moments, end, &mut described);
        for (lanes, value) in self.end.iter_mut().zip(described) {
            *lanes = Lanes::splat(value);
        }
        self.end_at = to;
    }
}
