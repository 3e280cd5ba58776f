//! `haptograph check`: checks a graph.

use super::failure::findings_json;
use super::run::{message, refuse_own_files};
use super::terminal::is_coloured;
use super::{Failure, GraphArguments, print, print_json, warnings};
use crate::engine::diagnostic::render;
use crate::engine::plan::{Plan, PlanOptions};
use crate::engine::registry::Registry;
use crate::live;
use serde_json::json;

/// Check a graph and report every problem
#[derive(Debug, clap::Args)]
pub struct Arguments {
    #[command(flatten)]
    graph: GraphArguments,
    /// Print the findings as JSON
    #[arg(long)]
    json: bool,
    /// Also print the plan, one step per line
    #[arg(long, conflicts_with = "json")]
    plan: bool,
}

pub fn run(arguments: &Arguments, registry: &Registry) -> Result<(), Failure> {
    arguments.graph.refuse_repeated()?;
    let (findings, sound) = match arguments.graph.load(registry, None) {
        Ok(graph) => (warnings(&graph), Some(graph)),
        Err(diagnostics) => (diagnostics, None),
    };
    let Some(graph) = sound else {
        return Err(Failure::Graph(findings));
    };
    refuse_own_files(&graph, false).map_err(message)?;
    live::refuse_conflicts(&graph).map_err(message)?;
    if arguments.json {
        return print_json(&json!({ "findings": findings_json(&findings) }));
    }
    let colour = is_coloured(&std::io::stdout());
    let (nodes, wires) = (graph.nodes().len(), graph.nodes().connections().count());
    let clocks: Vec<String> =
        graph.clocks().iter().map(|clock| format!("{} {}", clock.name, clock.rate)).collect();
    let file = arguments.graph.graph.display();
    print(&format!(
        "{}{file} is sound: {nodes} nodes, {wires} wires, clocks {}\n",
        render(&findings, colour),
        clocks.join(", ")
    ))?;
    for latency in graph.latencies() {
        print(&format!(
            "latency {} -> {}: {:.2} ms transport, {:.2} ms group delay\n",
            latency.source,
            latency.sink,
            latency.transport_s * 1e3,
            latency.group_delay_s * 1e3
        ))?;
    }
    if arguments.plan {
        for plan in Plan::of(&graph, &PlanOptions::default()) {
            print(&plan.to_string())?;
        }
    }
    Ok(())
}
