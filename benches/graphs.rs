//! What the shipped graphs cost: loading, planning and one block, for every graph in `graphs/`, and the callback of a
//! soundcard that asks for 64 frames. `cargo bench --bench graphs`.

use criterion::{Criterion, Throughput};
use haptograph::engine::document::{Document, LoadOptions};
use haptograph::engine::graph::{CheckOptions, Graph, check};
use haptograph::engine::plan::{Plan, PlanOptions};
use haptograph::engine::run::{Run, player};
use std::hint::black_box;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Driver frames of a block and of a callback.
const FRAMES: usize = 64;

fn main() {
    let mut criterion = Criterion::default().configure_from_args();
    for path in shipped() {
        graph(&mut criterion, &path);
    }
    criterion.final_summary();
}

/// The graph files in `graphs/`, by name.
fn shipped() -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("graphs");
    let entries = folder.read_dir().expect("the repository has graphs");
    let paths = entries.filter_map(|entry| Some(entry.ok()?.path()));
    let mut graphs: Vec<PathBuf> =
        paths.filter(|path| path.extension().is_some_and(|end| end == "ron")).collect();
    graphs.sort();
    graphs
}

fn graph(criterion: &mut Criterion, path: &Path) {
    let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let mut group = criterion.benchmark_group(name);
    group.bench_function("load and check", |bencher| bencher.iter(|| load(black_box(path))));
    let graph = load(path);
    group.bench_function("plan", |bencher| bencher.iter(|| plan(black_box(&graph))));
    let plan = Arc::new(plan(&graph));
    group.throughput(Throughput::Elements(FRAMES as u64));
    let mut run = Run::new(Arc::clone(&plan));
    group.bench_function("block of 64 frames", |bencher| {
        bencher.iter(|| run.advance(black_box(FRAMES)));
    });
    let (mut running, mut control) = player(plan);
    group.bench_function("callback of 64 frames", |bencher| {
        bencher.iter(|| running.process(black_box(FRAMES)));
    });
    control.poll();
    group.finish();
}

fn load(path: &Path) -> Graph {
    let document = Document::load(path, &LoadOptions::default()).expect("shipped graphs can be read");
    check(&document, &haptograph::nodes::registry(), &CheckOptions::default())
        .expect("shipped graphs are sound")
}

/// Of a graph with several drivers what hangs from the first.
fn plan(graph: &Graph) -> Plan {
    Plan::of(graph, &PlanOptions::default().block(FRAMES)).remove(0)
}
