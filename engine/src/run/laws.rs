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

    /// Computes one frame of processors by their laws, up to one that has none; returns its number. What only the next one
    /// reads stays in a register.
    #[inline(never)]
    pub(super) fn apply_to_frame(&self, range: Range<usize>, memory: &mut [f64]) -> usize {
        let (mut latest, mut latest_at) = (0.0, u32::MAX);
        let mut number = range.start;
        while number < range.end {
            let mut step = &self.steps[number];
            let Some(law) = step.law else { break };
            let read = |place: u32| if place == latest_at { latest } else { memory[place as usize] };
            let x = read(step.from);
            let chain = self.starts[number];
            if chain.end > 0 && chain.end as usize <= range.end {
                latest = Affine::of_chain(&self.numbers[number..number + chain.count as usize], x);
                number = chain.end as usize;
                step = &self.steps[number - 1];
            } else {
                latest = law.of_read(x, || read(step.with));
                number += 1;
            }
            latest_at = step.to;
            if !step.is_inner {
                memory[step.to as usize] = latest;
            }
        }
        // Its reader may run by itself.
        if latest_at != u32::MAX {
            memory[latest_at as usize] = latest;
        }
        number
    }
}
