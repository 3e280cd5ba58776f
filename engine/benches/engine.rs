//! What the engine itself costs: a tick of a node, a hop through a ring, the real-time side of a swap, loading and
//! planning. `cargo bench -p haptograph-engine`; beside other engines: `benches/peers`.

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use haptograph_engine::document::{Builder, Document, Part, ring as from_ring};
use haptograph_engine::frame::{Linear, Scalar};
use haptograph_engine::graph::{CheckOptions, Graph, check};
use haptograph_engine::node::{
    BuildContext, BuildError, Built, Io, Law, Many, NodeEntry, NodeKind, Port, Processor, Tick,
};
use haptograph_engine::plan::{Plan, PlanOptions};
use haptograph_engine::registry::Registry;
use haptograph_engine::run::{Change, FileSinks, Run, Session, SessionOptions, player};
use haptograph_engine::settings::NoSettings;
use haptograph_signal::quantity::Quantity;
use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use rtrb::RingBuffer;
use std::hint::{black_box, spin_loop};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

const RATE_HZ: f64 = 48_000.0;
const NODES: usize = 1000;

criterion_group!(benches, tick, ring, drivers, swap, set_up);
criterion_main!(benches);

/// A node and a block, in a chain of 1000: what the engine adds to the work of the nodes.
fn tick(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("tick, per node");
    group.throughput(Throughput::Elements(NODES as u64));
    for (what, kind) in
        [("does nothing", "Nothing"), ("copies its input", "Copy"), ("multiplies by a law", "Product")]
    {
        for block in [1, 10, 64] {
            let mut run = Run::new(Arc::new(plan(&chain(kind, NODES), block)));
            group.bench_function(BenchmarkId::new(what, block), |bencher| {
                bencher.iter(|| run.advance(black_box(block)));
            });
        }
    }
    group.finish();
}

/// 64 samples through the ring that joins threads.
fn ring(criterion: &mut Criterion) {
    type Block = [f64; 64];
    let mut group = criterion.benchmark_group("ring hop, 64 samples");
    let (mut into, mut from) = RingBuffer::<Block>::new(16);
    let block = [0.5; 64];
    group.bench_function("same thread", |bencher| {
        bencher.iter(|| {
            let sent = into.push(black_box(block)).is_ok();
            (sent, black_box(from.pop().ok()))
        });
    });
    let (mut there, mut far) = RingBuffer::<Block>::new(16);
    let (mut echo, mut back) = RingBuffer::<Block>::new(16);
    let stop = Arc::new(AtomicBool::new(false));
    let stopped = Arc::clone(&stop);
    let other = std::thread::spawn(move || {
        while !stopped.load(Ordering::Relaxed) {
            match far.pop() {
                // There is room: only one block is on its way.
                Ok(block) => drop(echo.push(block)),
                Err(_) => spin_loop(),
            }
        }
    });
    // Half of the median way there and back; the mean would measure who else wants the processors.
    group.bench_function("across threads, median", |bencher| {
        bencher.iter_custom(|turns| {
            let mut times: Vec<Duration> = (0..turns.max(1001))
                .map(|_| {
                    let start = Instant::now();
                    let sent = there.push(block).is_ok();
                    while sent && back.pop().is_err() {
                        spin_loop();
                    }
                    start.elapsed()
                })
                .collect();
            let middle = times.len() / 2;
            let (_, median, _) = times.select_nth_unstable(middle);
            *median * u32::try_from(turns).unwrap_or(u32::MAX) / 2
        });
    });
    group.finish();
    stop.store(true, Ordering::Relaxed);
    drop(other.join());
}

/// 64 frames from one driver to another, through a ring and the resampler that follows both clocks: what the writer's
/// and the reader's callback take together.
fn drivers(criterion: &mut Criterion) {
    let graph = load(
        &source()
            .driver("other", RATE_HZ)
            .node("copy", Part::new("Copy").on("other").wire("input", from_ring("source.output", 5.0)))
            .text(),
    );
    let pair = || {
        let options = SessionOptions::default().block(64).rested();
        let opened = Session::open_all(FileSinks::new(&graph), &options, None);
        let (mut lives, session) = opened.expect("the system gives a thread");
        let reader = lives.pop().expect("the graph has two drivers");
        let writer = lives.pop().expect("the graph has two drivers");
        (writer, reader, session)
    };
    let mut group = criterion.benchmark_group("two drivers' callbacks and their ring, 64 frames");
    let (mut writer, mut reader, _session) = pair();
    group.bench_function("same thread", |bencher| {
        bencher.iter(|| {
            writer.process(64);
            reader.process(64);
        });
    });
    let (mut writer, mut reader, _session) = pair();
    let turn = Arc::new(AtomicU64::new(0));
    let asked = Arc::clone(&turn);
    // Even: the reader's turn; odd: the writer's; the highest: over.
    let other = std::thread::spawn(move || {
        loop {
            match asked.load(Ordering::Acquire) {
                u64::MAX => break,
                turn if turn % 2 == 1 => {
                    writer.process(64);
                    asked.store(turn + 1, Ordering::Release);
                }
                _ => spin_loop(),
            }
        }
    });
    group.bench_function("the writer on another thread, median", |bencher| {
        bencher.iter_custom(|turns| {
            let mut times: Vec<Duration> = (0..turns.max(1001))
                .map(|_| {
                    let start = Instant::now();
                    let now = turn.fetch_add(1, Ordering::AcqRel);
                    while turn.load(Ordering::Acquire) == now + 1 {
                        spin_loop();
                    }
                    reader.process(64);
                    start.elapsed()
                })
                .collect();
            let middle = times.len() / 2;
            let (_, median, _) = times.select_nth_unstable(middle);
            *median * u32::try_from(turns).unwrap_or(u32::MAX)
        });
    });
    group.finish();
    turn.store(u64::MAX, Ordering::Release);
    drop(other.join());
}

/// The callback in which a plan of 1000 nodes takes the place of another, with one frame of the new one; beside a
/// callback that only runs a frame.
fn swap(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("real-time side of a swap, 1000 nodes");
    // One node more, and the state of all others carried over.
    let plans = [NODES, NODES + 1].map(|nodes| Arc::new(plan(&chain("Copy", nodes), 64)));
    let (mut running, mut control) = player(Arc::clone(&plans[0]));
    group.bench_function("one frame alone", |bencher| {
        bencher.iter(|| running.process(1));
    });
    group.bench_function("the same graph", |bencher| {
        bencher.iter_custom(|turns| {
            let mut total = Duration::ZERO;
            for _ in 0..turns {
                let sent = control.swap(Arc::clone(&plans[0]));
                assert!(sent.is_ok(), "the callback takes every command");
                let start = Instant::now();
                running.process(1);
                total += start.elapsed();
                control.poll();
            }
            total
        });
    });
    let mut next = 1;
    // The state of all nodes is copied, and a frame of both plans is run.
    group.bench_function("another graph", |bencher| {
        bencher.iter_custom(|turns| {
            let mut total = Duration::ZERO;
            for _ in 0..turns {
                let sent = control.swap(Arc::clone(&plans[next]));
                assert_eq!(sent, Ok(Change::AtOnce));
                next = 1 - next;
                let freed = control.freed();
                let start = Instant::now();
                running.process(1);
                total += start.elapsed();
                control.poll();
                assert_eq!(control.freed(), freed + 1, "the change came in the callback that was timed");
            }
            total
        });
    });
    group.finish();
}

/// From text to a checked graph, and from that to a plan.
fn set_up(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("1000 nodes, 2000 edges");
    let text = random_text();
    group.bench_function("load and check", |bencher| bencher.iter(|| load(black_box(&text))));
    let graph = load(&text);
    group.bench_function("plan", |bencher| bencher.iter(|| plan(black_box(&graph), 64)));
    let made = Arc::new(plan(&graph, 64));
    group.bench_function("make ready to run", |bencher| {
        bencher.iter(|| Run::new(Arc::clone(black_box(&made))));
    });
    group.finish();
}

fn chain(kind: &str, nodes: usize) -> Graph {
    let mut builder = source();
    for node in 0..nodes {
        let from = match node {
            0 => "source.output".to_owned(),
            _ => format!("n{}.output", node - 1),
        };
        builder = builder.node(&format!("n{node}"), Part::new(kind).wire("input", from.as_str()));
    }
    load(&builder.text())
}

/// Every node reads two of those before it.
fn random_text() -> String {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(7);
    let mut builder = source();
    for node in 0..NODES {
        let mut from = || match random.random_range(0..=node) {
            0 => "source.output".to_owned(),
            before => format!("n{}.output", before - 1),
        };
        let pair = [from(), from()];
        let part = Part::new("Mix").wires("inputs", pair.iter().map(String::as_str));
        builder = builder.node(&format!("n{node}"), part);
    }
    builder.text()
}

fn source() -> Builder {
    Builder::new("The work of a bench.")
        .driver("audio", RATE_HZ)
        .node("source", Part::new("Source").on("audio"))
}

fn load(text: &str) -> Graph {
    let mut registry = Registry::default();
    registry.add(NodeEntry::processor::<Source>());
    registry.add(NodeEntry::processor::<Nothing>());
    registry.add(NodeEntry::processor::<Copy>());
    registry.add(NodeEntry::processor::<Product>());
    registry.add(NodeEntry::processor::<Mix>());
    let document = Document::parse("bench.ron", text).expect("the builder writes graphs");
    check(&document, &registry, &CheckOptions::default()).expect("the graphs of the bench are sound")
}

fn plan(graph: &Graph, block: usize) -> Plan {
    Plan::of(graph, &PlanOptions::default().block(block)).remove(0)
}

haptograph_engine::node! {
    /// Of the bench.
    struct Source(NoSettings) in "bench";
    example: "";
    out OUTPUT: Scalar = Port::of(Quantity::NUMBER, "Samples.");
}

impl NodeKind for Source {
    fn build(_: NoSettings, _: &BuildContext) -> Result<Built<Self>, BuildError> {
        Ok(Built::new(Source))
    }
}

haptograph_engine::node! {
    /// Of the bench.
    struct Nothing(NoSettings) in "bench";
    example: "";
    in INPUT: Scalar = Port::of(Quantity::NUMBER, "Samples.");
    out OUTPUT: Scalar = Port::of(Quantity::NUMBER, "Samples.");
}

impl NodeKind for Nothing {
    fn build(_: NoSettings, _: &BuildContext) -> Result<Built<Self>, BuildError> {
        Ok(Built::new(Nothing))
    }
}

haptograph_engine::node! {
    /// Of the bench.
    struct Copy(NoSettings) in "bench";
    example: "";
    in INPUT: Scalar = Port::of(Quantity::NUMBER, "Samples.");
    out OUTPUT: Scalar = Port::of(Quantity::NUMBER, "Samples.");
}

impl NodeKind for Copy {
    fn build(_: NoSettings, _: &BuildContext) -> Result<Built<Self>, BuildError> {
        Ok(Built::new(Copy))
    }
}

haptograph_engine::node! {
    /// Of the bench.
    struct Product(NoSettings) in "bench";
    example: "";
    in INPUT: Scalar = Port::of(Quantity::NUMBER, "Samples.");
    out OUTPUT: Scalar = Port::of(Quantity::NUMBER, "Samples.");
}

impl NodeKind for Product {
    fn build(_: NoSettings, _: &BuildContext) -> Result<Built<Self>, BuildError> {
        Ok(Built::law(Law::Scale(0.5), Self::INPUT, Self::OUTPUT))
    }
}

haptograph_engine::node! {
    /// Of the bench.
    struct Mix(NoSettings) in "bench";
    example: "";
    in INPUTS: Linear, Many = Port::any("Samples.");
    out OUTPUT: Scalar = Port::of(Quantity::NUMBER, "Samples.");
}

impl NodeKind for Mix {
    fn build(_: NoSettings, _: &BuildContext) -> Result<Built<Self>, BuildError> {
        Ok(Built::new(Mix))
    }
}

impl Processor<Source> for Source {
    fn process(&mut self, _: &Tick, io: &mut Io<'_, Source>) {
        io.write(Source::OUTPUT).fill(0.5);
    }
}

impl Processor<Nothing> for Nothing {
    fn process(&mut self, _: &Tick, _: &mut Io<'_, Nothing>) {}
}

impl Processor<Copy> for Copy {
    fn process(&mut self, _: &Tick, io: &mut Io<'_, Copy>) {
        let x = io.read(Copy::INPUT);
        io.write(Copy::OUTPUT).copy_from_slice(x);
    }
}

impl Processor<Mix> for Mix {
    fn process(&mut self, _: &Tick, io: &mut Io<'_, Mix>) {
        let terms = io.read(Mix::INPUTS);
        let (a, b) = (terms.nth_or_last(0), terms.nth_or_last(1));
        for ((y, a), b) in io.write(Mix::OUTPUT).iter_mut().zip(a).zip(b) {
            *y = 0.5 * (a + b);
        }
    }
}
