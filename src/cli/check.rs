//! `haptograph check`: checks a graph.

use super::failure::findings_json;
use super::result::{CommandResult, show};
use super::run::refuse_own_files;
use super::terminal::is_coloured;
use super::{Failure, GraphArguments, warnings};
use crate::engine::diagnostic::{Diagnostics, render};
use crate::engine::graph::Graph;
use crate::engine::plan::{Plan, PlanOptions};
use crate::engine::registry::Registry;
use crate::live;
use serde::Serialize;
use serde_json::Value;

/// Check a graph and report every problem
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    #[command(flatten)]
    graph: GraphArguments,
    /// Print the findings as JSON
    #[arg(long)]
    json: bool,
    /// Also print the plan, one step per line
    #[arg(long, conflicts_with = "json")]
    plan: bool,
}

pub(super) fn run(arguments: &Arguments, registry: &Registry) -> Result<(), Failure> {
    arguments.graph.refuse_repeated()?;
    let (findings, sound) = match arguments.graph.load(registry, None) {
        Ok(graph) => (warnings(&graph), Some(graph)),
        Err(diagnostics) => (diagnostics, None),
    };
    let Some(graph) = sound else {
        return Err(Failure::Graph(findings));
    };
    refuse_own_files(&graph, false).map_err(Failure::message)?;
    live::refuse_conflicts(&graph).map_err(Failure::message)?;
    let checked = Checked { findings: findings_json(&findings), warnings: findings, graph, arguments };
    show(&checked, arguments.json)
}

/// A sound graph.
#[derive(Serialize)]
struct Checked<'a> {
    findings: Value,
    #[serde(skip)]
    warnings: Diagnostics,
    #[serde(skip)]
    graph: Graph,
    #[serde(skip)]
    arguments: &'a Arguments,
}

impl CommandResult for Checked<'_> {
    fn text(&self) -> String {
        let graph = &self.graph;
        let (nodes, wires) = (graph.nodes().len(), graph.nodes().connections().count());
        let clocks: Vec<String> =
            graph.clocks().iter().map(|clock| format!("{} {}", clock.name, clock.rate)).collect();
        let mut text = format!(
            "{}{} is valid: {nodes} nodes, {wires} wires, clocks {}\n",
            render(&self.warnings, is_coloured(&std::io::stdout())),
            self.arguments.graph.graph.display(),
            clocks.join(", ")
        );
        for latency in graph.latencies() {
            text += &format!(
                "latency {} -> {}: {:.2} ms transport, {:.2} ms group delay\n",
                latency.source,
                latency.sink,
                latency.transport_s * 1e3,
                latency.group_delay_s * 1e3
            );
        }
        if self.arguments.plan {
            let plans = Plan::of(graph, &PlanOptions::default());
            plans.iter().for_each(|plan| text += &plan.to_string());
        }
        text
    }
}
