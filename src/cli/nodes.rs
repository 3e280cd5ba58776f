//! `haptograph nodes`: what can be written in a graph, from the same declarations that graphs are checked against.

use super::{Failure, say};
use crate::engine::registry::Registry;
use crate::engine::settings::closest;
use crate::report::reference;

/// List the kinds of nodes and devices, or tell all about one
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// A kind of node or device
    name: Option<String>,
    /// Print the whole reference as Markdown
    #[arg(long, conflicts_with = "name")]
    markdown: bool,
}

pub fn run(arguments: &Arguments, registry: &Registry) -> Result<(), Failure> {
    match &arguments.name {
        None if arguments.markdown => say(&reference::book(registry)),
        None => say(&reference::list(registry)),
        Some(name) => match reference::kind(registry, name) {
            Some(text) => say(&text),
            None => Err(unknown(registry, name)),
        },
    }
}

fn unknown(registry: &Registry, name: &str) -> Failure {
    let nodes = registry.nodes().iter().map(|entry| entry.spec.name);
    let devices = registry.devices().iter().map(|entry| entry.spec.name);
    let near = closest(name, nodes.chain(devices));
    let help = near.map_or_else(
        || "`haptograph nodes` lists them all".to_owned(),
        |near| format!("did you mean `{near}`?"),
    );
    Failure::Message(format!("there is no kind `{name}`; {help}"))
}
