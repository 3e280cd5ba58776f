//! The rings between the drivers of a graph.

use super::Run;
use super::async_resampler::{RingMeter, async_resampler};
use super::swap::PlanSwap;
use crate::plan::{Plan, RingSpec};
use std::sync::Arc;

/// A ring between two runs; each end is the index of a run and the index of the end in that run.
struct RingEdge {
    ring: RingSpec,
    reader: (usize, usize),
    writer: (usize, usize),
}

/// The rings between the plans of a graph's drivers.
fn ring_edges(plans: &[Arc<Plan>]) -> Vec<RingEdge> {
    let mut ring_edges = Vec::new();
    for (reader, plan) in plans.iter().enumerate() {
        for (place, ring) in plan.ring_reads.iter().enumerate() {
            let far = |plan: &Arc<Plan>| plan.ring_writes.iter().position(|write| write.edge == ring.edge);
            let mut ends = plans.iter().enumerate();
            let Some(writer) = ends.find_map(|(writer, plan)| Some((writer, far(plan)?))) else {
                continue;
            };
            let (ring, reader) = (ring.ring.clone(), (reader, place));
            ring_edges.push(RingEdge { ring, reader, writer });
        }
    }
    ring_edges
}

impl RingEdge {
    /// Makes the ring and attaches both ends.
    fn connect(&self, runs: &mut [&mut Run]) -> Arc<RingMeter> {
        let (into, out) = async_resampler(&self.ring);
        let meter = Arc::clone(into.meter());
        runs[self.writer.0].state.ring_ends.writers[self.writer.1] = Some(into);
        runs[self.reader.0].state.ring_ends.readers[self.reader.1] = Some(out);
        meter
    }

    fn is_same_as(&self, other: &Self) -> bool {
        let runs = |ring: &Self| (ring.reader.0, ring.writer.0);
        runs(self) == runs(other) && self.ring == other.ring
    }
}

/// Connects the runs of a graph's drivers by rings.
pub(super) fn connect(runs: &mut [&mut Run]) -> Vec<Arc<RingMeter>> {
    let plans: Vec<Arc<Plan>> = runs.iter().map(|run| Arc::clone(&run.plan)).collect();
    ring_edges(&plans).iter().map(|ring| ring.connect(runs)).collect()
}

/// Connects new plans by rings. Rings that the old plans have continue; `known` are their meters.
///
/// Each driver changes over at its own time: until both have, the reader of a new ring is silent and its writer may
/// find it full.
pub(super) fn reconnect(
    before: &[Arc<Plan>],
    known: &[Arc<RingMeter>],
    next: &mut [&mut PlanSwap],
) -> Vec<Arc<RingMeter>> {
    let plans: Vec<Arc<Plan>> = next.iter().map(|next| Arc::clone(&next.run.plan)).collect();
    let before: Vec<(RingEdge, &Arc<RingMeter>)> = ring_edges(before).into_iter().zip(known).collect();
    let mut meters = Vec::new();
    for ring in ring_edges(&plans) {
        if let Some((was, meter)) = before.iter().find(|(was, _)| was.is_same_as(&ring)) {
            next[ring.reader.0].transfers.readers.push((was.reader.1, ring.reader.1));
            next[ring.writer.0].transfers.writers.push((was.writer.1, ring.writer.1));
            meters.push(Arc::clone(meter));
        } else {
            let mut runs: Vec<&mut Run> = next.iter_mut().map(|next| &mut next.run).collect();
            meters.push(ring.connect(&mut runs));
            next[ring.reader.0].add_new_rings();
            next[ring.writer.0].add_new_rings();
        }
    }
    meters
}
