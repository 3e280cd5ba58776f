//! What holds for every shipped graph: it loads, its ticks are fit for real time, and it can run for hours.
#![expect(clippy::unwrap_used, reason = "helpers of tests")]
#![expect(clippy::print_stdout, reason = "the figures of a long test are to be read")]
#![expect(unsafe_code, reason = "an allocator that counts can only be written so")]

mod realtime;

use haptograph_engine::document::{Document, LoadOptions};
use haptograph_engine::graph::{CheckOptions, Graph, check};
use haptograph_engine::plan::{Plan, PlanOptions};
use haptograph_engine::run::Run;
use petgraph::graph::NodeIndex;
use realtime::allocations;
use std::path::{Path, PathBuf};
use std::sync::Arc;

fn shipped() -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../graphs");
    let mut files: Vec<PathBuf> = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|extension| extension == "ron"))
        .collect();
    files.sort();
    assert!(!files.is_empty());
    files
}

fn graph(path: &Path) -> Graph {
    let document = Document::load(path, &LoadOptions::default()).unwrap_or_else(|wrong| panic!("{wrong}"));
    check(&document, &haptograph_nodes::registry(), &CheckOptions::default())
        .unwrap_or_else(|wrong| panic!("{wrong}"))
}

/// With every output tapped.
fn run(graph: &Graph, block: usize) -> (Run, usize) {
    let outputs = |node: NodeIndex| (0..graph.nodes()[node].outputs.len()).map(move |output| (node, output));
    let taps: Vec<_> = graph.nodes().node_indices().flat_map(outputs).collect();
    let count = taps.len();
    let plan = Arc::new(Plan::new(graph, &PlanOptions { block, taps }));
    (Run::new(plan), count)
}

#[test]
fn no_tick_of_a_shipped_graph_allocates() {
    for path in shipped() {
        let graph = graph(&path);
        for block in [1, 64, 1024] {
            let (mut run, _) = run(&graph, block);
            for _ in 0..(20_000 / block).max(20) {
                assert_eq!(allocations(|| run.advance(block)), 0, "{}", path.display());
            }
        }
    }
}

/// As every signal stays a number within what a body can do, and no tick allocates, nothing grows.
#[test]
#[ignore = "an hour of each graph's time: minutes"]
fn every_graph_runs_for_an_hour_without_a_fault() {
    for path in shipped() {
        let graph = graph(&path);
        let (mut run, taps) = run(&graph, 1024);
        let rate_hz = Plan::new(&graph, &PlanOptions::default()).driver_rate().hz();
        let frames = (3600.0 * rate_hz) as u64;
        let mut largest = vec![0.0_f64; taps];
        let mut first_minute = Vec::new();
        while run.driver_frames() < frames {
            run.advance(1024);
            for (tap, largest) in largest.iter_mut().enumerate() {
                for x in run.tap(tap) {
                    assert!(x.is_finite(), "{}: tap {tap}", path.display());
                    *largest = largest.max(x.abs());
                }
            }
            if first_minute.is_empty() && run.driver_frames() as f64 > 60.0 * rate_hz {
                first_minute.clone_from(&largest);
            }
        }
        assert_eq!(run.faults().ticks, 0, "{}", path.display());
        println!(
            "{}: largest values after a minute and after an hour:",
            path.display()
        );
        for (minute, hour) in first_minute.iter().zip(&largest) {
            println!("  {minute:12.6} {hour:12.6}");
        }
    }
}
