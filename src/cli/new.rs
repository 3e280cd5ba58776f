//! `haptograph new`: writes a first graph.

use super::Failure;
use super::result::{Written, show};
use crate::engine::registry::Registry;
use crate::signal::files;
use std::path::PathBuf;

/// Write a commented graph to start from
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    /// The file to create; it must not exist
    file: PathBuf,
    /// Print the written file as JSON
    #[arg(long)]
    json: bool,
}

/// Runs without changes and reads no other file.
const STARTER: &str = include_str!("new/starter.ron");

pub(super) fn run(arguments: &Arguments, _: &Registry) -> Result<(), Failure> {
    let path = &arguments.file;
    if path.symlink_metadata().is_ok() {
        let message = format!("{} exists already; give another name", path.display());
        return Err(Failure::Message(message));
    }
    files::write_atomically(path, STARTER.as_bytes()).map_err(Failure::doing("write", path))?;
    let shown = path.display();
    let advice =
        format!("\nrun it:   haptograph run {shown}\ndraw it:  haptograph draw {shown} -o graph.svg\n");
    show(&Written::new(path.clone(), &advice), arguments.json)
}
