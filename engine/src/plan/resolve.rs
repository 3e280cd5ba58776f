//! The last pass of planning: drafts of steps become steps whose inputs and outputs have places in memory.

use super::slots::Demand;
use super::{Plan, Step, StepWork, slots};
use crate::graph::NodeId;
use crate::io::{Extent, Form, Placing, ResolvedInput, Wires};
use crate::node::Law;
use haptograph_signal::laws::LawStep;
use std::ops::Range;
use std::sync::Arc;

/// A port before buffers are placed: its demand, and its place in it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Port {
    pub demand: usize,
    pub placing: Placing,
    pub clock: u32,
}

/// A step before buffers are placed.
pub(super) struct StepDraft {
    pub work: StepWork,
    pub clock: u32,
    /// The demand that it writes.
    pub out: Option<usize>,
    pub inputs: Vec<(Port, Form)>,
    pub outputs: Vec<Placing>,
    pub node: NodeId,
    pub label: Arc<str>,
}

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
            let extent = Extent { start: end, len: *len as u32 };
            end += extent.len;
            extent
        };
        Self { placed, slots: lens.iter().map(extent).collect() }
    }

    fn slot(&self, demand: usize) -> Extent {
        let slot = self.placed.get(demand);
        slot.and_then(|slot| self.slots.get(*slot as usize).copied()).unwrap_or_default()
    }

    /// Place of a port in memory.
    pub(super) fn port(&self, port: &Port) -> Placing {
        let Placing { start, width } = port.placing;
        Placing { start: self.slot(port.demand).start + start, width }
    }

    pub(super) fn step(&self, is_inner: bool, draft: StepDraft) -> Step {
        let out = draft.out.map(|demand| self.slot(demand)).unwrap_or_default();
        let inputs = draft.inputs.iter();
        Step {
            work: draft.work,
            clock: draft.clock,
            streak: 1,
            singles: 0,
            lawful: 0,
            cascades: 0,
            is_inner,
            wires: Wires {
                out,
                inputs: inputs.map(|(port, form)| ResolvedInput::new(self.port(port), *form, out)).collect(),
                outputs: draft.outputs.into(),
            },
            node: draft.node,
            label: draft.label,
        }
    }
}

/// Joins steps: the processors of scalars that need no ports, streaks of processors, and the works of each live setting.
pub(super) fn join(plan: &mut Plan) {
    for step in &mut plan.steps {
        if let StepWork::Process(index) = step.work {
            let found = without_ports(&step.wires, plan.processors[index as usize].law());
            step.singles = u32::from(found.is_some());
            step.lawful = u32::from(found.is_some_and(|found| found.law.is_some()));
            let cascade = plan.processors[index as usize].cascade();
            let has_input = !step.wires.inputs.is_empty() && step.wires.scalars(1).is_some();
            step.cascades = u32::from(cascade.is_some() && has_input);
            plan.laws.push(LawStep { is_inner: step.is_inner, ..found.unwrap_or(NONE) });
        }
    }
    join_streaks(&mut plan.steps, &plan.laws);
    plan.chains = chains(&plan.laws);
    let mut works: Vec<(NodeId, StepWork)> = Vec::new();
    if !plan.live.is_empty() {
        works.extend(plan.steps.iter().map(|step| (step.node, step.work)));
        works.sort_by_key(|(node, _)| *node);
    }
    let of = |node: NodeId| {
        let (begin, end) = (
            works.partition_point(|(known, _)| *known < node),
            works.partition_point(|(known, _)| *known <= node),
        );
        works[begin..end].iter().map(|(_, work)| *work).collect()
    };
    plan.live_works = plan.live.iter().map(|live| of(live.node)).collect();
}

/// Computes `streak`, `singles`, `lawful` and `cascades` of each step, from the last to the first.
fn join_streaks(steps: &mut [Step], laws: &[LawStep]) {
    for number in (1..steps.len()).rev() {
        let (earlier, later) = (&steps[number - 1], &steps[number]);
        if let (StepWork::Process(a), StepWork::Process(b)) = (earlier.work, later.work)
            && b == a + 1
            && earlier.clock == later.clock
        {
            let Step { streak, singles, lawful, cascades, .. } = *later;
            let is_read_there = earlier.is_inner && laws[b as usize].from == laws[a as usize].to;
            let earlier = &mut steps[number - 1];
            earlier.streak += streak;
            earlier.singles *= 1 + singles;
            earlier.lawful *= 1 + lawful;
            earlier.cascades *= 1 + if is_read_there { cascades } else { 0 };
        }
    }
}

/// How a processor computes a scalar from scalars without ports: by its law, or called with a frame of its only input.
pub(crate) fn without_ports(wires: &Wires, law: Option<Law>) -> Option<LawStep> {
    let law = law.filter(|_| !wires.inputs.is_empty());
    let by_law = law.and_then(|law| Some((Some(law), wires.scalars(law.inputs())?)));
    let (law, ([from, with], to)) = by_law.or_else(|| Some((None, wires.scalars(1)?)))?;
    Some(LawStep { law, from, with, to, ..NONE })
}

/// Maximum length of a chain: the real-time thread joins it anew when one of its numbers changes.
const MAX_CHAIN: usize = 16;

/// The processors that pass a frame on by factors and offsets, two or more in a row. A run uses a chain only where its list
/// of steps has all of them: other steps may lie between, or an island end.
fn chains(laws: &[LawStep]) -> Vec<Range<usize>> {
    let passes_on = |pair: &[LawStep]| {
        let [one, next] = pair else { return false };
        one.is_inner && one.is_affine() && next.is_affine() && next.from == one.to
    };
    let mut chains: Vec<Range<usize>> = Vec::new();
    for (number, _) in laws.windows(2).enumerate().filter(|(_, pair)| passes_on(pair)) {
        match chains.last_mut().filter(|chain| chain.end > number) {
            Some(chain) if chain.len() < MAX_CHAIN => chain.end += 1,
            // The first of both ends a chain.
            Some(_) => {}
            None => chains.push(number..number + 2),
        }
    }
    chains
}

/// Placeholder for a processor of other ports.
const NONE: LawStep = LawStep { law: None, from: 0, with: 0, to: 0, is_inner: false };
