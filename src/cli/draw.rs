//! `haptograph draw`: a graph as an SVG drawing, or as text for Graphviz or Mermaid.

use super::placing::{Force, Output};
use super::result::{CommandResult, Written, show};
use super::{Failure, GraphArguments};
use crate::engine::graph::Graph;
use crate::engine::registry::Registry;
use crate::report::drawing;
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Draw a graph as SVG, DOT or Mermaid
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    #[command(flatten)]
    graph: GraphArguments,
    /// The file to write: .svg, .dot (Graphviz) or .mmd (Mermaid); default: SVG to standard output
    #[arg(short, long, value_name = "FILE.svg", value_parser = drawing_file)]
    output: Option<DrawingFile>,
    #[command(flatten)]
    force: Force,
    /// Print the written file as JSON; without a file, the JSON holds the drawing
    #[arg(long)]
    json: bool,
}

/// A path and the function that draws what its name ends in.
#[derive(Debug, Clone)]
struct DrawingFile {
    path: PathBuf,
    draw: fn(&Graph, &str) -> String,
    is_svg: bool,
}

/// A drawing that is not written into a file.
#[derive(Serialize)]
struct Drawing {
    svg: String,
}

impl CommandResult for Drawing {
    fn text(&self) -> String {
        self.svg.clone()
    }
}

fn drawing_file(text: &str) -> Result<DrawingFile, String> {
    let path = PathBuf::from(text);
    let end = path.extension().unwrap_or_default().to_ascii_lowercase();
    let is_svg = end == "svg";
    let draw = match end.to_str() {
        Some("svg") => drawing::standalone_svg,
        Some("dot") => drawing::dot,
        Some("mmd") => drawing::mermaid,
        _ => return Err(no_such_drawing(&path)),
    };
    Ok(DrawingFile { path, draw, is_svg })
}

fn no_such_drawing(path: &Path) -> String {
    let svg = path.with_extension("svg");
    let png = path.with_extension("png");
    format!(
        "drawings are written as .svg, .dot or .mmd; for a PNG, write {0} and then `rsvg-convert {0} -o {1}`",
        svg.display(),
        png.display()
    )
}

pub(super) fn run(arguments: &Arguments, registry: &Registry) -> Result<(), Failure> {
    arguments.graph.refuse_repeated()?;
    let graph = arguments.graph.load_and_warn(registry, None)?;
    let is_text = arguments.output.as_ref().is_some_and(|output| !output.is_svg);
    if let (false, Some(why)) = (is_text, drawing::too_large(&graph)) {
        return Err(Failure::Message(format!("{why}: write a .dot file, which Graphviz's `sfdp` can draw")));
    }
    let Some(DrawingFile { path, draw, .. }) = &arguments.output else {
        return show(
            &Drawing { svg: drawing::standalone_svg(&graph, &arguments.graph.name()) },
            arguments.json,
        );
    };
    arguments.graph.refuse_inputs(&graph, path)?;
    let output = Output::claim(path, arguments.force)?;
    let picture = draw(&graph, &arguments.graph.name());
    show(&Written::new(output.write(&picture)?, ""), arguments.json)
}
