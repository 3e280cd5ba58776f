//! A node kind of one's own, used from a graph file like any other: `cargo run --example custom_node`.

use haptograph::engine::document::Document;
use haptograph::engine::frame::Kind;
use haptograph::engine::graph::{CheckOptions, check};
use haptograph::engine::node::{
    BuildContext, BuildError, Io, NodeEntry, NodeKind, NodeSpec, Processor, Tick, input, output,
};
use haptograph::engine::plan::{Plan, PlanOptions};
use haptograph::engine::run::Run;
use haptograph::signal::quantity::Quantity;
use std::io::Write;
use std::sync::Arc;

haptograph::engine::settings! {
    /// Settings of [`SoftClip`].
    pub struct SoftClipSettings {
        /// What the output never reaches, N.
        limit_n: f64 = 1.0, in 1e-6..=1e6;
    }
}

/// Rounds off what is too strong.
pub struct SoftClip;

impl NodeKind for SoftClip {
    type Settings = SoftClipSettings;
    const SPEC: NodeSpec = NodeSpec {
        name: "SoftClip",
        group: "mine",
        doc: "Rounds off a force that is too strong, by a hyperbolic tangent.",
        source: "",
        inputs: &[input("input", Kind::Scalar, Quantity::FORCE, "The force, N.")],
        outputs: &[output(
            "output",
            Kind::Scalar,
            Quantity::FORCE,
            "The rounded force, N.",
        )],
        example: r#""soft": SoftClip(input: "push", limit_n: 0.5)"#,
    };

    fn build(settings: SoftClipSettings, _: &BuildContext) -> Result<Box<dyn Processor>, BuildError> {
        Ok(Box::new(Clipper {
            limit_n: settings.limit_n,
        }))
    }
}

#[derive(Clone)]
struct Clipper {
    limit_n: f64,
}

impl Processor for Clipper {
    fn process(&mut self, _: &Tick, io: &mut Io<'_>) {
        let strong = io.lanes(0);
        for (soft, force) in io.out(0).iter_mut().zip(strong) {
            *soft = self.limit_n * (force / self.limit_n).tanh();
        }
    }
}

const GRAPH: &str = r#"
Graph(
    format: 1,
    clocks: { "servo": Driver(rate_hz: 1000) },
    nodes: {
        "push": Sine(clock: "servo", frequency_hz: 2, amplitude: 3, quantity: "force"),
        "soft": SoftClip(input: "push", limit_n: 0.5),
        "file": CsvSink(inputs: ["push", "soft"], file: "forces.csv"),
    },
)"#;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut registry = haptograph::nodes::registry();
    registry.add(NodeEntry::processor::<SoftClip>());
    let document = Document::parse("custom_node.ron", GRAPH)?;
    let graph = check(&document, &registry, &CheckOptions::default())?;
    let nodes = graph.nodes();
    let soft = nodes
        .node_indices()
        .find(|node| nodes[*node].path == "soft")
        .ok_or("no node `soft`")?;
    let options = PlanOptions {
        block: 100,
        taps: vec![(soft, 0)],
    };
    let mut run = Run::new(Arc::new(Plan::new(&graph, &options)));
    let mut strongest = 0.0_f64;
    for _ in 0..10 {
        run.advance(100);
        strongest = run
            .tap(0)
            .iter()
            .fold(strongest, |most, force| most.max(force.abs()));
    }
    writeln!(
        std::io::stdout(),
        "pushed with 3 N, felt at most {strongest:.4} N"
    )?;
    Ok(())
}
