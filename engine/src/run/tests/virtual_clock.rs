//! Graphs with several drivers, in one virtual time.

use super::Heard;
use super::world::random_graph_with_drivers;
use crate::graph::{Bridge, Graph};
use crate::plan::{Plan, PlanOptions};
use crate::run::{FileSinks, Outcome, Probe, Session, SessionOptions, VirtualClock};
use std::sync::Arc;

/// A graph that has rings in it, of one to three drivers.
pub fn graphs() -> impl Iterator<Item = (u64, Graph)> {
    let ringed =
        |graph: &Graph| graph.nodes.edge_weights().any(|edge| matches!(edge.bridge, Bridge::Ring { .. }));
    (0..40_u64).map(|seed| (seed, random_graph_with_drivers(seed))).filter(move |(_, graph)| ringed(graph))
}

pub fn bits(heard: &[f64]) -> Vec<u64> {
    heard.iter().map(|x| x.to_bits()).collect()
}

/// All outputs of a graph, and where they are heard.
pub fn listening(graph: &Graph) -> (FileSinks<'_>, Vec<Heard>) {
    let mut file_sinks = FileSinks::new(graph);
    let mut heard = Vec::new();
    for node in graph.nodes().ids() {
        heard.push(Heard::default());
        let writer = Box::new(heard[node.index()].clone());
        let output = 0;
        file_sinks.probe(Probe { node, output, writer });
    }
    (file_sinks, heard)
}

pub fn all_bits(heard: &[Heard]) -> Vec<Vec<u64>> {
    heard.iter().map(|heard| bits(&heard.0.lock().unwrap())).collect()
}

/// All outputs over a second and a half.
fn play(graph: &Graph, block: usize) -> (Vec<Vec<u64>>, Outcome) {
    let (file_sinks, heard) = listening(graph);
    let outcome =
        Session::run_offline(file_sinks, &SessionOptions::default().block(block).seconds(1.5), &mut |_| {})
            .unwrap();
    (all_bits(&heard), outcome)
}

#[test]
fn any_block_gives_the_same_bits() {
    let mut rings = 0;
    for (seed, graph) in graphs() {
        let (definition, outcome) = play(&graph, 1);
        assert!(!outcome.stopped);
        rings += outcome.rings.len();
        for ring in &outcome.rings {
            let counts = ring.counts;
            assert_eq!((counts.underruns, counts.overruns), (0, 0), "seed {seed}: {ring:?}");
        }
        for (node, heard) in graph.nodes.node_weights().zip(&definition) {
            let rate_hz = graph.clocks[node.clock.unwrap()].rate.hz();
            let frames = (1.5 * rate_hz) as usize;
            assert!(
                heard.len().abs_diff(frames) <= 1 + (rate_hz / 500.0) as usize,
                "seed {seed}: {}",
                node.path
            );
        }
        for block in [7, 64, 1024] {
            assert!(play(&graph, block).0 == definition, "seed {seed}, block {block}");
        }
    }
    assert!(rings > 25, "{rings} rings were tried");
}

#[test]
fn drifting_clocks_give_the_same_bits_for_any_block_and_other_ones_than_true_clocks() {
    for (seed, graph) in graphs().take(12) {
        let play = |block: usize, ppm: &[f64]| {
            let taps = graph.nodes().ids().map(|node| (node, 0)).collect();
            let plans: Vec<Arc<Plan>> =
                Plan::of(&graph, &PlanOptions { block, taps }).into_iter().map(Arc::new).collect();
            let mut heard = vec![Vec::new(); graph.nodes.node_count()];
            let mut clock = VirtualClock::of(&plans).drifting(ppm);
            for _ in 0..1500 {
                clock.run_quantum(|driver, run| {
                    for (local, place) in plans[driver].tap_places.iter().enumerate() {
                        heard[*place].extend(bits(run.tap(local)));
                    }
                });
            }
            assert!(clock.rings().iter().all(|ring| ring.counts().underruns == 0), "seed {seed}");
            heard
        };
        let drifting = [300.0, -200.0, 0.0];
        let one = play(1, &drifting);
        assert!(play(64, &drifting) == one, "seed {seed}");
        assert!(play(64, &[0.0; 3]) != one, "seed {seed}");
    }
}

#[test]
fn a_plan_of_each_driver_has_its_own_nodes_and_the_ends_of_the_rings() {
    for (seed, graph) in graphs() {
        let plans = Plan::of(&graph, &PlanOptions::default());
        assert_eq!(plans.len(), graph.drivers().len(), "seed {seed}");
        let processors: usize = plans.iter().map(|plan| plan.processors.len() + plan.actuators.len()).sum();
        let sources =
            graph.nodes.node_weights().filter(|node| matches!(node.work, crate::graph::Work::Source { .. }));
        assert_eq!(processors + sources.count(), graph.nodes.node_count(), "seed {seed}");
        let ends = |of: fn(&Plan) -> usize| plans.iter().map(of).sum::<usize>();
        let rings =
            graph.nodes.edge_weights().filter(|edge| matches!(edge.bridge, Bridge::Ring { .. })).count();
        assert_eq!(ends(|plan| plan.ring_reads.len()), rings, "seed {seed}");
        assert_eq!(ends(|plan| plan.ring_writes.len()), rings, "seed {seed}");
        for plan in &plans {
            assert!(
                plan.steps.iter().all(|step| { graph.clocks[step.clock as usize].driver == plan.driver })
            );
        }
    }
}
