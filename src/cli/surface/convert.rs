//! `haptograph surface convert`: converts between haptograph's and the toolkit's file formats.

use super::{Failure, claim, load, save};
use crate::cli::placing::Force;
use crate::cli::refuse_overwrite;
use crate::cli::result::{Written, show};
use crate::surfaces::files::merge;
use std::path::PathBuf;

/// Convert a surface between haptograph's .ron and the toolkit's (HaTT) .xml
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    /// The file to read; its content determines the format. Several files with different parts of one
    /// material (the toolkit's models and taps) become one
    #[arg(value_name = "IN", required = true, num_args = 1..)]
    input: Vec<PathBuf>,
    /// The file to write; its extension determines the format: .ron or .xml
    #[arg(value_name = "OUT")]
    output: PathBuf,
    #[command(flatten)]
    force: Force,
    /// Print what was written as JSON
    #[arg(long)]
    json: bool,
}

pub(super) fn run(arguments: &Arguments) -> Result<(), Failure> {
    refuse_overwrite(&arguments.input, &arguments.output)?;
    let output = claim(&arguments.output, arguments.force)?;
    let mut surface = None;
    for path in &arguments.input {
        let next = load(path)?;
        surface = Some(match surface {
            None => next,
            Some(first) => merge(first, next).map_err(Failure::doing("add", path))?,
        });
    }
    // Clap requires at least one file.
    let Some(surface) = surface else { return Ok(()) };
    let output = save(&surface, &output)?;
    show(&Written::new(output, ""), arguments.json)
}
