//! `haptograph surface`: commands for surface files.

mod constants;
mod convert;
pub(super) mod headroom;
mod image;
mod interpolate;
mod leave_one_out;
mod resample;
mod select;
mod show;

use super::placing::{Force, Output};
use super::{Failure, eprint, snippet};
use crate::engine::registry::Registry;
pub(super) use crate::surfaces::files::check_extension;
use crate::surfaces::{Surface, TextureModel, files};
use clap::Subcommand;
pub(super) use show::clips_of;
use std::path::{Path, PathBuf};

/// Show, convert, resample, select, interpolate and compare surface files; measure photographs of surfaces, and headroom
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Show(show::Arguments),
    Convert(convert::Arguments),
    Resample(resample::Arguments),
    Select(select::Arguments),
    Interpolate(interpolate::Arguments),
    LeaveOneOut(leave_one_out::Arguments),
    Image(image::Arguments),
    Headroom(headroom::Arguments),
    Constants(constants::Arguments),
}

pub(super) fn run(arguments: &Arguments, registry: &Registry) -> Result<(), Failure> {
    match &arguments.command {
        Command::Show(arguments) => show::run(arguments),
        Command::Convert(arguments) => convert::run(arguments),
        Command::Resample(arguments) => resample::run(arguments),
        Command::Select(arguments) => select::run(arguments),
        Command::Interpolate(arguments) => interpolate::run(arguments),
        Command::LeaveOneOut(arguments) => leave_one_out::run(arguments),
        Command::Image(arguments) => image::run(arguments),
        Command::Constants(arguments) => constants::run(arguments),
        Command::Headroom(arguments) => headroom::run(arguments, registry),
    }
}

/// Reads a surface; an error is shown at its place in the file.
pub(super) fn load(path: &Path) -> Result<Surface, Failure> {
    files::load(path).map_err(|error| match &error {
        files::FileError::Read { path, error: read } => {
            snippet::failure(path, read.place, &read.problem.to_string(), &error)
        }
        _ => Failure::Message(error.to_string()),
    })
}

/// Reads surface files, and those of folders.
fn load_all(paths: &[PathBuf]) -> Result<Vec<Surface>, Failure> {
    let mut surfaces = Vec::new();
    for path in paths {
        match path.is_dir() {
            true => surfaces.extend(select::collect(path)?),
            false => surfaces.push(load(path)?),
        }
    }
    Ok(surfaces)
}

/// Checks before the work that an output can be written.
pub(super) fn claim(path: &Path, force: Force) -> Result<Output, Failure> {
    files::check_extension(path).map_err(Failure::message)?;
    Output::claim(path, force)
}

/// Writes a surface and warns about what the format cannot hold; returns the path.
pub(super) fn save(surface: &Surface, output: &Output) -> Result<PathBuf, Failure> {
    let (path, left_out) = output.write_by(|path| files::save(surface, path))?;
    if !left_out.is_empty() {
        eprint(&format!("warning: the format of {} cannot hold: {}\n", path.display(), left_out.join(", ")));
    }
    Ok(path)
}

/// The texture of a surface, or an error if it has none.
fn texture<'s>(surface: &'s Surface, path: &Path) -> Result<&'s TextureModel, Failure> {
    let missing = || Failure::Message(format!("{} contains no texture", path.display()));
    surface.texture.as_ref().ok_or_else(missing)
}
