//! The sub-commands, and what they share: how a graph is loaded and how errors are told.

mod check;
mod new;
mod nodes;
mod run;
mod writers;

use clap::{Args, Parser, Subcommand};
use haptograph_engine::diagnostic::{Diagnostics, Severity, render, to_json};
use haptograph_engine::document::{Document, LoadOptions};
use haptograph_engine::graph::{CheckOptions, Graph, check as check_graph};
use std::io::{IsTerminal, Write};
use std::path::PathBuf;
use std::process::ExitCode;

#[derive(Parser)]
#[command(
    name = "haptograph",
    version,
    about = "Renders the feel of real surfaces from graphs in RON files",
    disable_help_subcommand = true
)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Run a graph and leave its sound, plots and facts in a folder
    Run(run::RunArgs),
    /// Say whether a graph is sound, and what its plan looks like
    Check(check::CheckArgs),
    /// List the node and device kinds, or tell all about one
    Nodes(nodes::NodesArgs),
    /// Write a commented graph to start from
    New(new::NewArgs),
}

/// A graph file and what is set in it.
#[derive(Args)]
struct GraphArgs {
    /// The graph file
    graph: PathBuf,
    /// Give a parameter of the graph another value; may be repeated
    #[arg(long = "set", value_name = "NAME=VALUE", value_parser = name_and_value)]
    set: Vec<(String, String)>,
    /// Seed of all random streams, in place of the graph's own
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
    /// Which devices the graph is bound to
    #[arg(long, value_name = "SET", default_value = "simulated")]
    endpoints: String,
}

fn name_and_value(text: &str) -> Result<(String, String), String> {
    let (name, value) = text
        .split_once('=')
        .ok_or_else(|| "write NAME=VALUE".to_owned())?;
    Ok((name.trim().to_owned(), value.to_owned()))
}

/// Why a sub-command failed.
#[derive(Debug, thiserror::Error)]
pub(crate) enum Failure {
    /// The graph has errors; they are shown in full.
    #[error("the graph has errors")]
    Graph(Box<Diagnostics>),
    /// Anything else, in one sentence that says what to do.
    #[error("{0}")]
    Message(String),
    /// Nobody reads our output any more.
    #[error("output closed")]
    Closed,
}

impl Failure {
    pub(crate) fn new(message: impl Into<String>) -> Self {
        Self::Message(message.into())
    }
}

impl From<Diagnostics> for Failure {
    fn from(diagnostics: Diagnostics) -> Self {
        Self::Graph(Box::new(diagnostics))
    }
}

impl From<haptograph_engine::run::OfflineError> for Failure {
    fn from(error: haptograph_engine::run::OfflineError) -> Self {
        Self::Message(error.to_string())
    }
}

/// Parses the command line, does what it says, and returns 0, 1 for a failure or 2 for a command line that is wrong.
pub(crate) fn main() -> ExitCode {
    let cli = Cli::parse();
    let json = matches!(&cli.command, Command::Check(args) if args.json);
    let done = match cli.command {
        Command::Run(args) => run::run(&args),
        Command::Check(args) => check::check(&args),
        Command::Nodes(args) => nodes::nodes(&args),
        Command::New(args) => new::new(&args),
    };
    match done {
        Ok(()) | Err(Failure::Closed) => ExitCode::SUCCESS,
        Err(Failure::Graph(diagnostics)) => {
            if json {
                let _ = say(&to_json(&diagnostics));
            } else {
                tell(&render(&diagnostics, std::io::stderr().is_terminal()));
            }
            ExitCode::FAILURE
        }
        Err(failure) => {
            tell(&format!("error: {failure}\n"));
            ExitCode::FAILURE
        }
    }
}

/// Writes to standard output; a closed pipe is no failure.
pub(crate) fn say(text: &str) -> Result<(), Failure> {
    let mut out = std::io::stdout().lock();
    let written = out.write_all(text.as_bytes()).and_then(|()| out.flush());
    written.map_err(|_| Failure::Closed)
}

/// Writes to standard error, as well as that goes.
pub(crate) fn tell(text: &str) {
    let _ = std::io::stderr().lock().write_all(text.as_bytes());
}

/// Reads and proves a graph; its warnings are told.
fn load(args: &GraphArgs) -> Result<Graph, Failure> {
    let document = Document::load(&args.graph, &LoadOptions::default())?;
    let options = CheckOptions {
        set: args.set.clone(),
        endpoints: args.endpoints.clone(),
        seed: args.seed,
    };
    let graph = check_graph(&document, &haptograph_nodes::registry(), &options)?;
    if !graph.warnings().is_empty() {
        tell(&render(&warnings(&graph), std::io::stderr().is_terminal()));
    }
    Ok(graph)
}

/// The warnings of a sound graph, in the form in which they are shown.
fn warnings(graph: &Graph) -> Diagnostics {
    let list = graph
        .warnings()
        .iter()
        .filter(|warning| warning.severity == Severity::Warning)
        .cloned();
    Diagnostics {
        sources: graph.sources().clone(),
        list: list.collect(),
    }
}
