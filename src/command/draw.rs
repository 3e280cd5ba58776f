//! `haptograph draw`: a graph as a picture.

use super::{Failure, GraphArguments, say, write_file};
use haptograph::report::drawing;
use std::path::PathBuf;

/// Draw a graph as SVG
#[derive(Debug, clap::Args)]
pub struct Arguments {
    #[command(flatten)]
    graph: GraphArguments,
    /// The SVG file to write; standard output where it is not given
    #[arg(short, long, value_name = "FILE.svg")]
    output: Option<PathBuf>,
}

pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    arguments.graph.refuse_repeated()?;
    let graph = arguments.graph.load_and_warn(None)?;
    if let Some(path) = &arguments.output {
        arguments.graph.spare_inputs(&graph, path)?;
    }
    let picture = drawing::standalone_svg(&graph, &arguments.graph.name());
    match &arguments.output {
        Some(path) => write_file(path, &picture),
        None => say(&picture),
    }
}
