//! `haptograph draw`: a graph as an SVG drawing.

use super::output::{Force, Output};
use super::{Failure, GraphArguments, print, print_json};
use crate::engine::registry::Registry;
use crate::report::drawing;
use serde_json::json;
use std::path::PathBuf;

/// Draw a graph as SVG
#[derive(Debug, clap::Args)]
pub struct Arguments {
    #[command(flatten)]
    graph: GraphArguments,
    /// The SVG file to write; default: standard output
    #[arg(short, long, value_name = "FILE.svg", value_parser = svg_file)]
    output: Option<PathBuf>,
    #[command(flatten)]
    force: Force,
    /// Print the written file as JSON; without a file, the JSON holds the drawing
    #[arg(long)]
    json: bool,
}

fn svg_file(text: &str) -> Result<PathBuf, String> {
    let path = PathBuf::from(text);
    if path
        .extension()
        .is_some_and(|end| end.eq_ignore_ascii_case("svg"))
    {
        return Ok(path);
    }
    let svg = path.with_extension("svg");
    let png = path.with_extension("png");
    Err(format!(
        "drawings are written as .svg; for a PNG, write {0} and then `rsvg-convert {0} -o {1}`",
        svg.display(),
        png.display()
    ))
}

pub fn run(arguments: &Arguments, registry: &Registry) -> Result<(), Failure> {
    arguments.graph.refuse_repeated()?;
    let graph = arguments.graph.load_and_warn(registry, None)?;
    let Some(path) = &arguments.output else {
        let picture = drawing::standalone_svg(&graph, &arguments.graph.name());
        return match arguments.json {
            true => print_json(&json!({ "svg": picture })),
            false => print(&picture),
        };
    };
    arguments.graph.refuse_inputs(&graph, path)?;
    let output = Output::claim(path, arguments.force)?;
    let picture = drawing::standalone_svg(&graph, &arguments.graph.name());
    let written = output.write(&picture)?;
    match arguments.json {
        true => print_json(&json!({ "written": [written] })),
        false => print(&format!("wrote {}\n", written.display())),
    }
}
