//! The engine inside another program, with no file at all: `cargo run --example embed`.

use haptograph::engine::document::{Builder, Part, hold};
use haptograph::engine::graph::{CheckOptions, check};
use haptograph::engine::plan::{Plan, PlanOptions};
use haptograph::engine::run::Run;
use std::io::Write;
use std::sync::Arc;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let document = Builder::new("A tone that fades in.")
        .driver("audio", 48_000.0)
        .derived("control", "audio", 100.0)
        .node("fade", Part::new("Ramp").on("control").set("duration_s", 1.0))
        .node("tone", Part::new("Sine").on("audio").set("frequency_hz", 250.0))
        .node(
            "out",
            Part::new("Multiply")
                .wire("input", "tone")
                .wire("by", hold("fade")),
        )
        .build()?;
    let graph = check(
        &document,
        &haptograph::nodes::registry(),
        &CheckOptions::default(),
    )?;
    let nodes = graph.nodes();
    let out = nodes
        .node_indices()
        .find(|node| nodes[*node].path == "out")
        .ok_or("no node `out`")?;
    let plan = Plan::new(
        &graph,
        &PlanOptions {
            block: 480,
            taps: vec![(out, 0)],
        },
    );
    let mut run = Run::new(Arc::new(plan));
    let mut stdout = std::io::stdout();
    for tenth in 1..=10 {
        let mut peak = 0.0_f64;
        for _ in 0..10 {
            run.advance(480);
            peak = run.tap(0).iter().fold(peak, |most, x| most.max(x.abs()));
        }
        writeln!(
            stdout,
            "{:.1} s  {}",
            f64::from(tenth) / 10.0,
            "#".repeat((peak * 40.0).round() as usize)
        )?;
    }
    Ok(())
}
