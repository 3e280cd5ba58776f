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
    /// Draw the nodes' names alone, so that the whole graph can be read on a screen
    #[arg(long)]
    overview: bool,
    #[command(flatten)]
    force: Force,
    /// Print the written file as JSON; without a file, the JSON holds the drawing
    #[arg(long)]
    json: bool,
}

/// A path, and what writes the text that its name ends in; none for SVG.
#[derive(Debug, Clone)]
struct DrawingFile {
    path: PathBuf,
    text: Option<fn(&Graph, &str) -> String>,
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
    let text: Option<fn(&Graph, &str) -> String> =
        match path.extension().unwrap_or_default().to_ascii_lowercase().to_str() {
            Some("svg") => None,
            Some("dot") => Some(drawing::dot),
            Some("mmd") => Some(drawing::mermaid),
            _ => return Err(no_such_drawing(&path)),
        };
    Ok(DrawingFile { path, text })
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
    let text = arguments.output.as_ref().and_then(|output| output.text);
    let draw = match (text, arguments.overview) {
        (Some(_), true) => return Err(Failure::Message("an overview is an .svg file".to_owned())),
        (Some(text), false) => text,
        (None, true) => drawing::overview_svg,
        (None, false) => drawing::standalone_svg,
    };
    if let (None, Some(why)) = (text, drawing::too_large(&graph)) {
        return Err(Failure::Message(format!("{why}: write a .dot file, which Graphviz's `sfdp` can draw")));
    }
    let Some(DrawingFile { path, .. }) = &arguments.output else {
        return show(&Drawing { svg: draw(&graph, &arguments.graph.name()) }, arguments.json);
    };
    arguments.graph.refuse_inputs(&graph, path)?;
    let output = Output::claim(path, arguments.force)?;
    let picture = draw(&graph, &arguments.graph.name());
    show(&Written::new(output.write(&picture)?, ""), arguments.json)
}
