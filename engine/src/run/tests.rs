//! The engine against its definition: random graphs, evaluated tick by tick from whole histories.

mod arm;
mod arrivals;
mod change;
mod edits;
mod heat;
mod naive;
mod player;
mod swap;
mod virtual_clock;
mod world;

use super::{FileSinks, Profile, Run, Session, SessionOptions, StepCost, VirtualClock};
use crate::graph::Graph;
use crate::graph::NodeId;
use crate::node::FrameWriter;
use crate::plan::{Plan, PlanOptions};
use std::sync::{Arc, Mutex};
use world::random_graph;

/// All outputs of a graph over `frames` driver frames, run in blocks whose sizes repeat.
fn play(graph: &Graph, frames: usize, blocks: &[usize]) -> Vec<Vec<f64>> {
    let taps: Vec<(NodeId, usize)> = graph.nodes().ids().map(|node| (node, 0)).collect();
    let block = blocks.iter().copied().max().unwrap_or(1);
    let mut run = Run::new(Arc::new(Plan::of(graph, &PlanOptions { block, taps: taps.clone() }).remove(0)));
    let mut heard = vec![Vec::new(); taps.len()];
    let mut sizes = blocks.iter().cycle();
    while run.driver_frames() < frames as u64 {
        let left = frames - run.driver_frames() as usize;
        run.advance(left.min(*sizes.next().unwrap()));
        for (tap, heard) in heard.iter_mut().enumerate() {
            heard.extend_from_slice(run.tap(tap));
        }
    }
    heard
}

fn assert_same_bits(a: &[Vec<f64>], b: &[Vec<f64>], graph: &Graph, what: &str) {
    for (node, (a, b)) in graph.nodes.node_weights().zip(a.iter().zip(b)) {
        assert_eq!(a.len(), b.len(), "{what}: frames of {}", node.path);
        for (tick, (a, b)) in a.iter().zip(b).enumerate() {
            assert_eq!(a.to_bits(), b.to_bits(), "{what}: {} at tick {tick}: {a} against {b}", node.path);
        }
    }
}

#[test]
fn random_graphs_give_what_the_definition_says_whatever_the_block() {
    for seed in 0..150 {
        let graph = random_graph(seed, seed);
        let definition = naive::evaluate(&graph, 2100);
        for blocks in [&[1][..], &[64], &[1024], &[7, 1, 333, 64, 2]] {
            assert_same_bits(
                &play(&graph, 2100, blocks),
                &definition,
                &graph,
                &format!(
                    "seed {seed}, blocks {blocks:?}\n{}",
                    Plan::of(&graph, &PlanOptions::default()).remove(0)
                ),
            );
        }
    }
}

#[test]
fn the_order_in_the_file_changes_no_bit() {
    for seed in 0..40 {
        let (graph, shuffled) = (random_graph(seed, seed), random_graph(seed, seed + 1000));
        let (a, b) = (play(&graph, 900, &[64]), play(&shuffled, 900, &[64]));
        for (node, heard) in graph.nodes.node_weights().zip(&a) {
            let same = shuffled.nodes.node_indices().find(|i| shuffled.nodes[*i].path == node.path).unwrap();
            assert_eq!(heard, &b[same.index()], "seed {seed}, {}", node.path);
        }
    }
}

/// Collects frames in memory.
#[derive(Clone, Default)]
struct Heard(Arc<Mutex<Vec<f64>>>);

impl FrameWriter for Heard {
    fn write(&mut self, _: usize, frames: &[f64]) -> std::io::Result<()> {
        self.0.lock().unwrap().extend_from_slice(frames);
        Ok(())
    }
    fn finish(self: Box<Self>) -> std::io::Result<()> {
        Ok(())
    }
}

#[test]
fn a_stop_ends_the_run_with_complete_blocks() {
    let graph = random_graph(3, 3);
    let options = SessionOptions::default().block(10).seconds(1e6);
    let mut calls = 0;
    let outcome = Session::run_offline(FileSinks::new(&graph), &options, &mut |_| {
        calls += 1;
        options.stop.store(calls == 5, std::sync::atomic::Ordering::Relaxed);
    });
    let outcome = outcome.unwrap();
    assert_eq!((outcome.driver_frames, outcome.stopped), (50, true));
}

#[test]
fn a_measured_run_gives_the_same_bits_and_sees_every_step() {
    let alone = (0..30).map(|seed| (seed, random_graph(seed, seed)));
    for (seed, graph) in alone.chain(virtual_clock::graphs().take(12)) {
        let taps: Vec<(NodeId, usize)> = graph.nodes().ids().map(|node| (node, 0)).collect();
        let plans = Plan::of(&graph, &PlanOptions { block: 50, taps });
        let plans: Vec<Arc<Plan>> = plans.into_iter().map(Arc::new).collect();
        let (mut plain, mut measured) = (VirtualClock::of(&plans), Profile::timing_every(&plans, 3));
        let mut took_ns = vec![0.0; plans.len()];
        let rounds = 30 * plans.len() as u64;
        for round in 0..rounds * 2 {
            plain.run_quantum(|_, _| {});
            if round < rounds {
                measured.run_quantum();
            } else {
                measured.run_quantum_by_driver(&mut took_ns);
            }
            for (plain, measured) in plain.runs().zip(measured.clock().runs()) {
                assert_eq!(plain.driver_frames(), measured.driver_frames());
                for tap in 0..plain.plan.tap_streams().count() {
                    let bits = |frames: &[f64]| frames.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
                    assert_eq!(bits(plain.tap(tap)), bits(measured.tap(tap)), "seed {seed}");
                }
            }
        }
        assert_eq!(measured.timed_quanta(), rounds / 3);
        assert!(took_ns.iter().all(|ns| *ns > 0.0), "seed {seed}: {took_ns:?}");
        let costs: Vec<StepCost> = (0..plans.len()).flat_map(|driver| measured.costs(driver)).collect();
        assert!(costs.iter().all(|cost| cost.median_ns <= cost.p99_ns && cost.p99_ns <= cost.worst_ns));
        let processors = graph.nodes().ids().filter(|node| {
            // A clock of a graph may be too slow to tick in 1500 frames.
            costs.iter().any(|cost| cost.node == *node)
        });
        assert!(processors.count() * 2 > graph.nodes.node_count(), "seed {seed}");
    }
}
