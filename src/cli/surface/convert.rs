//! `haptograph surface convert`: converts between haptograph's and the toolkit's file formats.

use super::{Failure, Found, Only, claim, load, save, select};
use crate::cli::placing::Force;
use crate::cli::result::{Written, show};
use crate::cli::{make_folder, refuse_overwrite};
use crate::surfaces::files::merge;
use std::path::{Path, PathBuf};

/// Convert a surface between haptograph's .ron and the toolkit's (HaTT) .xml, or all surfaces of a folder
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    /// The file to read; its content determines the format. Several files with different parts of one
    /// material (the toolkit's models and taps) become one. Or a folder, which is searched with its subfolders
    #[arg(value_name = "IN", required = true, num_args = 1..)]
    input: Vec<PathBuf>,
    /// The file to write; its extension determines the format: .ron or .xml. For a folder, the folder to write, with a
    /// .ron file for each surface
    #[arg(value_name = "OUT")]
    output: PathBuf,
    #[command(flatten)]
    only: Only,
    #[command(flatten)]
    force: Force,
    /// Print what was written as JSON
    #[arg(long)]
    json: bool,
}

pub(super) fn run(arguments: &Arguments) -> Result<(), Failure> {
    if let [dir] = &arguments.input[..]
        && dir.is_dir()
    {
        return convert_folder(arguments, dir);
    }
    if arguments.only.only.is_some() {
        return Err(Failure::Message("--only chooses from a folder; give one folder".to_owned()));
    }
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

/// Writes the surfaces of a folder, each into one file.
fn convert_folder(arguments: &Arguments, dir: &Path) -> Result<(), Failure> {
    let (folder, mut written) = (&arguments.output, vec![]);
    let found = arguments.only.of(select::collect(dir)?)?;
    make_folder(folder)?;
    for Found { files, surface } in &found {
        let path = folder.join(surface.name.replace(['/', '\\'], "-") + ".ron");
        refuse_overwrite(files, &path)?;
        written.push(save(surface, &claim(&path, arguments.force)?)?);
    }
    let text = format!("wrote {} surfaces: {}\n", written.len(), folder.display());
    show(&Written::several(written, text), arguments.json)
}
