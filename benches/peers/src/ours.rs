//! haptograph's engine, in f64, on its shipped nodes.

use crate::work::{Contestant, Operation, RATE_HZ, SAMPLES, Source, Work, noise};
use haptograph_engine::document::{Builder, Document, Part};
use haptograph_engine::frame::Scalar;
use haptograph_engine::graph::{CheckOptions, Graph, check};
use haptograph_engine::node::{
    BuildContext, BuildError, Built, Io, NodeEntry, NodeKind, Port, Processor, Tick,
};
use haptograph_engine::plan::{Plan, PlanOptions};
use haptograph_engine::registry::Registry;
use haptograph_engine::run::Run;
use haptograph_engine::settings::NoSettings;
use haptograph_signal::quantity::Quantity;
use std::sync::Arc;

pub struct Ours {
    run: Run,
    block: usize,
    output: Vec<f64>,
}

impl Ours {
    pub fn new(work: &Work) -> Self {
        let graph = load(&text(work));
        Self { run: Run::new(Arc::new(plan(&graph, work))), block: work.block, output: vec![0.0; SAMPLES] }
    }
}

/// The work as the text of a graph file.
pub fn text(work: &Work) -> String {
    let mut graph = Builder::new("The work of a bench.")
        .driver("audio", RATE_HZ)
        .node("input", Part::new("Play").on("audio"));
    for (index, node) in work.nodes.iter().enumerate() {
        let name = |source: &Source| match source {
            Source::Input => "input.output".to_owned(),
            Source::Node(from) => format!("n{from}.output"),
        };
        let sources: Vec<String> = node.sources.iter().map(name).collect();
        let part = match node.operation {
            Operation::Gain(gain) if sources.len() == 1 => Part::new("Gain").set("gain", f64::from(gain)),
            Operation::Gain(gain) => Part::new("Mixer").set("gains", vec![f64::from(gain); sources.len()]),
            Operation::Offset(offset) => Part::new("Offset").set("offset", f64::from(offset)),
            Operation::Biquad { cutoff_hz, .. } => Part::new("LowPass").set("cutoff_hz", cutoff_hz),
        };
        let part = match &sources[..] {
            [one] => part.wire("input", one.as_str()),
            more => part.wires("inputs", more.iter().map(String::as_str)),
        };
        graph = graph.node(&format!("n{index}"), part);
    }
    graph.text()
}

/// Reads and checks the text of a graph file.
pub fn load(text: &str) -> Graph {
    let document = Document::parse("work.ron", text).expect("the builder writes graphs");
    check(&document, &registry(), &CheckOptions::default()).expect("the work is sound")
}

/// Lays out the graph, its last node tapped.
pub fn plan(graph: &Graph, work: &Work) -> Plan {
    let last = format!("n{}", work.nodes.len() - 1);
    let last = graph.nodes().find(&last);
    let taps = last.map(|index| (index, 0));
    Plan::of(graph, &PlanOptions::default().block(work.block).taps(taps)).remove(0)
}

fn registry() -> Registry {
    let mut registry = haptograph_nodes::registry();
    registry.add(NodeEntry::processor::<Play>());
    registry
}

impl Contestant for Ours {
    fn name(&self) -> &'static str {
        "haptograph"
    }

    fn run(&mut self) {
        for y in self.output.chunks_exact_mut(self.block) {
            self.run.advance(y.len());
            copy(self.run.tap(0), y);
        }
    }

    fn output(&self) -> Vec<f64> {
        self.output.clone()
    }
}

haptograph_engine::node! {
    /// Plays the input of the bench.
    struct Play(NoSettings) in "bench";
    example: r#""input": Play(clock: "audio")"#;
    out OUTPUT: Scalar = Port::of(Quantity::NUMBER, "The input.");
}

impl NodeKind for Play {
    fn build(_: NoSettings, _: &BuildContext) -> Result<Built<Self>, BuildError> {
        let samples = noise(SAMPLES).into_iter().map(f64::from).collect();
        Ok(Built::new(Player { samples, at: 0 }))
    }
}

#[derive(Clone)]
struct Player {
    samples: Box<[f64]>,
    at: usize,
}

impl Processor<Play> for Player {
    fn process(&mut self, tick: &Tick, io: &mut Io<'_, Play>) {
        copy(&self.samples[self.at..self.at + tick.frames], io.write(Play::OUTPUT));
        self.at = (self.at + tick.frames) % SAMPLES;
    }
}

/// A single sample without the call of `memcpy`.
fn copy(x: &[f64], y: &mut [f64]) {
    match (x, y) {
        ([x], [y]) => *y = *x,
        (x, y) => y.copy_from_slice(x),
    }
}
