//! The executable form of a plan: every input and output resolved to its place in memory.

use crate::graph::NodeId;
use crate::io::{Binding, Extent, Form, Placing, ResolvedInput};
use crate::node::Single;
use crate::plan::{Plan, Step, StepWork, Tap};
use std::collections::HashMap;
use std::ops::Range;
use std::sync::Arc;

/// A plan with all lookups resolved.
pub(super) struct Program {
    /// One for each step of the plan.
    pub lines: Vec<Line>,
    /// One for each processor, valid if its line has `singles`. A run updates its own copy when settings change.
    pub singles: Vec<SingleStep>,
    pub taps: Vec<TapAt>,
    /// Place of each slot in memory.
    pub extents: Vec<Extent>,
    /// Length of all slots in f64.
    pub len: usize,
    /// Period of each clock, s.
    pub periods_s: Vec<f64>,
    /// Works of the node of each live setting.
    pub of_live: Vec<Box<[StepWork]>>,
}

/// The executable form of a step.
pub(super) struct Line {
    pub work: StepWork,
    pub clock: u32,
    /// Number of successive processors of this clock from here on; they share one lookup of the window.
    pub streak: u32,
    /// Number of them, from this one on, that have a single-frame form.
    pub singles: u32,
    pub out: Extent,
    pub inputs: Box<[ResolvedInput]>,
    pub outputs: Box<[Placing]>,
    pub node: NodeId,
    /// Path of a processor's node.
    pub path: Arc<str>,
}

/// The single-frame form of a processor, and the places of its scalar input and output.
#[derive(Debug, Clone, Copy)]
pub(super) struct SingleStep {
    pub single: Single,
    pub from: u32,
    pub to: u32,
}

/// Place of a tapped output in memory.
#[derive(Debug, Clone, Copy)]
pub(super) struct TapAt {
    pub start: u32,
    pub width: u32,
    pub clock: u32,
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
        let mut singles = vec![SingleStep::NONE; plan.processors.len()];
        for (step, line) in plan.steps.iter().zip(&mut lines) {
            if let StepWork::Process(index) = step.work
                && let Some(single) = single_step(plan, step, index as usize, &extents)
            {
                singles[index as usize] = single;
                line.singles = 1;
            }
        }
        join_streaks(&mut lines);
        let tap = |tap: &Tap| TapAt {
            start: extents[tap.slot as usize].start + tap.placing.start,
            width: tap.placing.width,
            clock: tap.clock,
        };
        Self {
            lines,
            singles,
            taps: plan.taps.iter().map(tap).collect(),
            extents,
            len,
            of_live: of_live(plan),
            periods_s: plan.rates.iter().map(|rate| rate.period_s()).collect(),
        }
    }

    /// Place of a slot in memory.
    pub(super) fn range(&self, slot: u32) -> Range<usize> {
        let Extent { start, len } = self.extents.get(slot as usize).copied().unwrap_or_default();
        start as usize..(start + len) as usize
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

/// Computes `streak` and `singles` of each line, from the last to the first.
fn join_streaks(lines: &mut [Line]) {
    for number in (1..lines.len()).rev() {
        let (earlier, later) = (&lines[number - 1], &lines[number]);
        if let (StepWork::Process(a), StepWork::Process(b)) = (earlier.work, later.work)
            && b == a + 1
            && earlier.clock == later.clock
        {
            let (streak, singles) = (later.streak, later.singles);
            let earlier = &mut lines[number - 1];
            earlier.streak += streak;
            earlier.singles *= 1 + singles;
        }
    }
}

fn of_live(plan: &Plan) -> Vec<Box<[StepWork]>> {
    let mut works: HashMap<NodeId, Vec<StepWork>> = HashMap::new();
    for step in &plan.steps {
        works.entry(step.node).or_default().push(step.work);
    }
    let of = |node| {
        works
            .get(node)
            .map_or_else(Box::default, |works| works.as_slice().into())
    };
    plan.live.iter().map(|live| of(&live.node)).collect()
}

fn line(plan: &Plan, step: &Step, extents: &[Extent]) -> Line {
    let out = extents.get(step.out as usize).copied().unwrap_or_default();
    let wire = |binding: &Binding| wire(binding, extents, out);
    Line {
        work: step.work,
        clock: step.clock,
        streak: 1,
        singles: 0,
        out,
        inputs: plan.inputs(step).iter().map(wire).collect(),
        outputs: plan.outputs(step).into(),
        node: step.node,
        path: Arc::clone(&step.label),
    }
}

fn single_step(plan: &Plan, step: &Step, processor: usize, extents: &[Extent]) -> Option<SingleStep> {
    let [output] = plan.outputs(step) else { return None };
    let to = extents.get(step.out as usize)?.start + output.start;
    let (from, scalar) = match plan.inputs(step) {
        // A source ignores its input.
        [] => (to, output.width == 1),
        [input, others @ ..] if others.iter().all(|other| other.form == Form::Absent) => (
            extents.get(input.slot as usize)?.start + input.start,
            input.form == Form::Sampled && input.width == 1 && output.width == 1,
        ),
        _ => return None,
    };
    let single = plan.processors[processor].single().filter(|_| scalar)?;
    Some(SingleStep { single, from, to })
}

/// Resolves an input. Slots do not overlap and no step reads the slot that it writes, so an input lies wholly before or
/// wholly behind the step's own buffer.
fn wire(binding: &Binding, extents: &[Extent], out: Extent) -> ResolvedInput {
    let Binding { width, form, .. } = *binding;
    let from = extents.get(binding.slot as usize).copied().unwrap_or_default();
    let behind = form != Form::Absent && from.start >= out.start + out.len;
    let origin = if behind { out.start + out.len } else { 0 };
    let at = match form {
        Form::Absent => 0,
        _ => from.start + binding.start - origin,
    };
    ResolvedInput {
        at,
        width,
        behind,
        form,
    }
}
