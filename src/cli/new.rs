//! `haptograph new`: a first graph of one's own.

use super::{Failure, say, say_json};
use crate::engine::registry::Registry;
use serde_json::json;
use std::io::Write;
use std::path::PathBuf;

/// Write a commented graph to start from
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// The file to make; it must not exist yet
    file: PathBuf,
    /// Print what was written as JSON
    #[arg(long)]
    json: bool,
}

/// Runs as it is and uses no file but itself.
const STARTER: &str = include_str!("new/starter.ron");

pub fn run(arguments: &Arguments, _: &Registry) -> Result<(), Failure> {
    let path = &arguments.file;
    let mut file = std::fs::File::create_new(path).map_err(|error| match error.kind() {
        std::io::ErrorKind::AlreadyExists => {
            Failure::Message(format!("{} exists already; give another name", path.display()))
        }
        _ => Failure::file("write", path, &error),
    })?;
    file.write_all(STARTER.as_bytes())
        .map_err(|error| Failure::file("write", path, &error))?;
    if arguments.json {
        return say_json(&json!({ "written": [path] }));
    }
    let shown = path.display();
    say(&format!(
        "wrote {shown}\n\nrun it:   haptograph run {shown}\ndraw it:  haptograph draw {shown} -o graph.svg\n"
    ))
}
