//! `haptograph new`: a commented graph to start from.

use super::{Failure, say};
use std::io::Write;
use std::path::PathBuf;

#[derive(clap::Args)]
pub(crate) struct NewArgs {
    /// The file to write; it must not exist yet
    file: PathBuf,
}

const STARTER: &str = include_str!("starter.ron");

pub(crate) fn new(args: &NewArgs) -> Result<(), Failure> {
    let shown = args.file.display();
    let file = std::fs::File::create_new(&args.file);
    let written = file.and_then(|mut file| file.write_all(STARTER.as_bytes()));
    written.map_err(|error| match error.kind() {
        std::io::ErrorKind::AlreadyExists => Failure::new(format!(
            "{shown} exists already; choose another name or remove it"
        )),
        _ => Failure::new(format!("cannot write {shown}: {error}")),
    })?;
    say(&format!("wrote {shown}; now: haptograph run {shown}\n"))
}
