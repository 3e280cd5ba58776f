//! `haptograph check`: is the graph sound, and how would it run?

use super::{Failure, GraphArgs, load, say};
use haptograph_engine::plan::{Plan, PlanOptions};

#[derive(clap::Args)]
pub(crate) struct CheckArgs {
    #[command(flatten)]
    graph: GraphArgs,
    /// Findings as JSON, for editors
    #[arg(long)]
    pub json: bool,
    /// Also show the plan, one step a line
    #[arg(long)]
    plan: bool,
    /// Driver frames of a block
    #[arg(long, value_name = "N", default_value_t = 64)]
    block: usize,
}

pub(crate) fn check(args: &CheckArgs) -> Result<(), Failure> {
    let graph = load(&args.graph)?;
    if args.json {
        return say(&(haptograph_engine::diagnostic::to_json(&super::warnings(&graph)) + "\n"));
    }
    let plan = Plan::new(
        &graph,
        &PlanOptions {
            block: args.block,
            taps: Vec::new(),
        },
    );
    let (nodes, edges) = (graph.nodes().node_count(), graph.nodes().edge_count());
    say(&format!(
        "{} is sound: {nodes} nodes, {edges} connections, {} clocks, {} steps, {:.1} kB of buffers\n",
        args.graph.graph.display(),
        graph.clocks().len(),
        plan.step_count(),
        plan.buffer_bytes() as f64 / 1e3,
    ))?;
    for latency in graph.latencies() {
        say(&format!(
            "latency {} -> {}: {:.2} ms transport, {:.2} ms group delay\n",
            latency.source,
            latency.sink,
            latency.transport_s * 1e3,
            latency.group_delay_s * 1e3,
        ))?;
    }
    if args.plan { say(&plan.to_string()) } else { Ok(()) }
}
