//! The plan as the real-time loop walks it: every input and output at its place in the memory.

use crate::io::{Binding, Extent, Form, Placing, Wire};
use crate::plan::{Plan, Step, StepWork};
use petgraph::graph::NodeIndex;
use std::ops::Range;

/// A plan with everything looked up that can be looked up before it runs.
pub(super) struct Program {
    /// One a step of the plan.
    pub lines: Vec<Line>,
    /// Where each slot of the plan lies.
    pub extents: Vec<Extent>,
    /// f64s of all slots.
    pub len: usize,
    /// Seconds a frame, by clock.
    pub periods_s: Vec<f64>,
}

/// What the loop has to know of a step; its label and the like stay in the plan.
pub(super) struct Line {
    pub work: StepWork,
    pub clock: u32,
    /// Processors of the same clock that follow one another from here on: one look at the window serves them all.
    pub streak: u32,
    pub out: Extent,
    pub inputs: Box<[Wire]>,
    pub outputs: Box<[Placing]>,
    pub node: NodeIndex,
    /// Where the one scalar input and the one scalar output lie, if the processor takes single frames.
    pub frame: Option<(u32, u32)>,
}

impl Program {
    pub(super) fn new(plan: &Plan) -> Self {
        let mut len = 0;
        let extent = |slot: &usize| {
            let start = len;
            len += slot;
            Extent {
                start: start as u32,
                len: *slot as u32,
            }
        };
        let extents: Vec<Extent> = plan.slots.iter().map(extent).collect();
        let mut lines: Vec<Line> = plan.steps.iter().map(|step| line(plan, step, &extents)).collect();
        for number in (1..lines.len()).rev() {
            let (earlier, later) = (&lines[number - 1], &lines[number]);
            if let (StepWork::Process(a), StepWork::Process(b)) = (earlier.work, later.work)
                && b == a + 1
                && earlier.clock == later.clock
            {
                lines[number - 1].streak = later.streak + 1;
            }
        }
        Self {
            lines,
            extents,
            len,
            periods_s: plan.rates.iter().map(|rate| rate.period_s()).collect(),
        }
    }

    /// Where a slot lies.
    pub(super) fn range(&self, slot: u32) -> Range<usize> {
        let Extent { start, len } = self.extents.get(slot as usize).copied().unwrap_or_default();
        start as usize..(start + len) as usize
    }
}

fn line(plan: &Plan, step: &Step, extents: &[Extent]) -> Line {
    let out = extents.get(step.out as usize).copied().unwrap_or_default();
    let wire = |binding: &Binding| wire(binding, extents, out);
    let inputs = &plan.bindings[step.inputs.start as usize..step.inputs.end as usize];
    let outputs = &plan.placings[step.outputs.start as usize..step.outputs.end as usize];
    Line {
        frame: frame(plan, step, extents, inputs, outputs),
        work: step.work,
        clock: step.clock,
        streak: 1,
        out,
        inputs: inputs.iter().map(wire).collect(),
        outputs: outputs.into(),
        node: step.node,
    }
}

fn frame(
    plan: &Plan,
    step: &Step,
    extents: &[Extent],
    inputs: &[Binding],
    outputs: &[Placing],
) -> Option<(u32, u32)> {
    let (StepWork::Process(index), [output]) = (step.work, outputs) else {
        return None;
    };
    let to = extents.get(step.out as usize)?.start + output.start;
    let (from, scalar) = match inputs {
        // A source does not look at what it is given.
        [] => (to, output.width == 1),
        [input] => (
            extents.get(input.slot as usize)?.start + input.start,
            input.form == Form::Sampled && input.width == 1 && output.width == 1,
        ),
        _ => return None,
    };
    (scalar && plan.processors[index as usize].has_frame()).then_some((from, to))
}

/// No two slots overlap and none is both read and written by a step, so that an input lies wholly before the step's
/// own buffer or wholly behind it.
fn wire(binding: &Binding, extents: &[Extent], out: Extent) -> Wire {
    let Binding { width, form, .. } = *binding;
    let from = extents.get(binding.slot as usize).copied().unwrap_or_default();
    let behind = form != Form::Absent && from.start >= out.start + out.len;
    let origin = if behind { out.start + out.len } else { 0 };
    let at = match form {
        Form::Absent => 0,
        _ => from.start + binding.start - origin,
    };
    Wire {
        at,
        width,
        behind,
        form,
    }
}
