//! The laws of processors of scalars with their present numbers, and the chains of factors and offsets among them: for
//! single frames products with a sum, one behind the other.

use crate::plan::Plan;
use haptograph_signal::laws::{Affine, Law, LawStep};
use std::ops::Range;

/// The laws of a plan with their present numbers.
pub(super) struct Laws {
    /// One for each processor, valid where the plan's step says so.
    pub steps: Vec<LawStep>,
    /// For each processor the chain that begins with it, or an empty one.
    starts: Vec<Chain>,
    /// For each processor the first one of its chain; itself if it belongs to none.
    first: Vec<u32>,
    /// The joined numbers of each chain, from the place of its first processor on.
    numbers: Vec<Affine>,
}

/// A chain: the number behind its last processor, and how many joined numbers it has.
#[derive(Clone, Copy, Default)]
struct Chain {
    end: u32,
    count: u32,
}

impl Laws {
    pub(super) fn new(plan: &Plan) -> Self {
        let processors = plan.laws.len();
        let mut laws = Self {
            steps: plan.laws.clone(),
            starts: vec![Chain::default(); processors],
            first: (0..processors as u32).collect(),
            numbers: vec![Affine::NONE; processors],
        };
        for Range { start, end } in plan.chains.iter().cloned() {
            laws.starts[start].end = end as u32;
            laws.first[start..end].fill(start as u32);
            laws.join(start);
        }
        laws
    }

    /// Takes over the present law of a processor, if the plan uses it.
    pub(super) fn update(&mut self, processor: usize, present: Option<Law>) {
        if let (Some(law), Some(present)) = (&mut self.steps[processor].law, present) {
            *law = present;
            self.join(self.first[processor] as usize);
        }
    }

    fn join(&mut self, first: usize) {
        let Chain { end, count } = &mut self.starts[first];
        if *end > 0 {
            let steps = first..*end as usize;
            *count = Affine::join(&self.steps[steps.clone()], &mut self.numbers[steps]) as u32;
        }
    }

    /// The numbers of the chain that begins with a processor and ends by `end`, and its last processor.
    #[inline]
    pub(super) fn chain(&self, processor: usize, end: usize) -> Option<(&[Affine], usize)> {
        let chain = self.starts[processor];
        let is_whole = chain.end > 0 && chain.end as usize <= end;
        is_whole.then(|| (&self.numbers[processor..processor + chain.count as usize], chain.end as usize - 1))
    }
}
