//! The last pass of planning: drafts of steps become steps whose inputs and outputs have places in memory.

use super::build::{Port, StepDraft};
use super::slots::Demand;
use super::{Plan, SingleStep, Step, StepWork, slots};
use crate::graph::NodeId;
use crate::io::{Extent, Form, Placing, ResolvedInput};
use crate::node::Single;
use std::collections::HashMap;

/// The places of all buffers.
pub(super) struct Places {
    /// Slot of each demand.
    placed: Vec<u32>,
    pub slots: Vec<Extent>,
}

impl Places {
    pub(super) fn of(demands: &[Demand]) -> Self {
        let (placed, lens) = slots::assign(demands);
        let mut end = 0;
        let extent = |len: &usize| {
            let extent = Extent {
                start: end,
                len: *len as u32,
            };
            end += extent.len;
            extent
        };
        Self {
            placed,
            slots: lens.iter().map(extent).collect(),
        }
    }

    fn slot(&self, demand: usize) -> Extent {
        let slot = self.placed.get(demand);
        slot.and_then(|slot| self.slots.get(*slot as usize).copied())
            .unwrap_or_default()
    }

    /// Place of a port in memory.
    pub(super) fn port(&self, port: &Port) -> Placing {
        let Placing { start, width } = port.placing;
        Placing {
            start: self.slot(port.demand).start + start,
            width,
        }
    }

    pub(super) fn step(&self, draft: StepDraft) -> Step {
        let out = draft.out.map(|demand| self.slot(demand)).unwrap_or_default();
        let inputs = draft.inputs.iter();
        Step {
            work: draft.work,
            clock: draft.clock,
            streak: 1,
            singles: 0,
            out,
            inputs: inputs
                .map(|(port, form)| ResolvedInput::new(self.port(port), *form, out))
                .collect(),
            outputs: draft.outputs.into(),
            node: draft.node,
            label: draft.label,
        }
    }
}

/// Joins steps: processors with a single-frame form, streaks of processors, and the works of each live setting.
pub(super) fn join(plan: &mut Plan) {
    let mut works: HashMap<NodeId, Vec<StepWork>> = HashMap::new();
    for step in &mut plan.steps {
        works.entry(step.node).or_default().push(step.work);
        let mut found = None;
        if let StepWork::Process(index) = step.work {
            found = scalar_places(step).and_then(|(from, to)| {
                let single = plan.processors[index as usize].single()?;
                Some(SingleStep { single, from, to })
            });
            plan.singles.push(found.unwrap_or(SingleStep::NONE));
        }
        step.singles = u32::from(found.is_some());
    }
    join_streaks(&mut plan.steps);
    let of = |node| {
        works
            .get(node)
            .map_or_else(Box::default, |works| works.as_slice().into())
    };
    plan.live_works = plan.live.iter().map(|live| of(&live.node)).collect();
}

/// Places of a processor's only input and output if both are scalars.
fn scalar_places(step: &Step) -> Option<(u32, u32)> {
    let [output] = *step.outputs else { return None };
    let to = step.out.start + output.start;
    let (from, is_scalar) = match &*step.inputs {
        // A source ignores its input.
        [] => (to, true),
        [input, others @ ..] if others.iter().all(|other| other.form == Form::Absent) => {
            let is_scalar = input.form == Form::Sampled && input.width == 1;
            (input.place(step.out), is_scalar)
        }
        _ => return None,
    };
    (is_scalar && output.width == 1).then_some((from, to))
}

/// Computes `streak` and `singles` of each step, from the last to the first.
fn join_streaks(steps: &mut [Step]) {
    for number in (1..steps.len()).rev() {
        let (earlier, later) = (&steps[number - 1], &steps[number]);
        if let (StepWork::Process(a), StepWork::Process(b)) = (earlier.work, later.work)
            && b == a + 1
            && earlier.clock == later.clock
        {
            let (streak, singles) = (later.streak, later.singles);
            let earlier = &mut steps[number - 1];
            earlier.streak += streak;
            earlier.singles *= 1 + singles;
        }
    }
}

impl SingleStep {
    /// Placeholder for a processor without single-frame form.
    const NONE: Self = Self {
        single: Single::Call,
        from: 0,
        to: 0,
    };
}
