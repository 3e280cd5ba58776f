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

use super::beside::chosen_surfaces;
use super::placing::{Force, Output};
use super::{Failure, eprint, snippet};
use crate::engine::registry::Registry;
use crate::signal::spelling::closest;
pub(super) use crate::surfaces::files::check_extension;
use crate::surfaces::{Surface, TextureModel, files};
use clap::{Subcommand, ValueEnum};
use haptograph_study::thesis::is_same_name;
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

/// Several surfaces.
#[derive(Debug, clap::Args)]
struct Surfaces {
    /// Surface files, or folders, which are searched with their subfolders
    #[arg(required = true, value_name = "DIR|FILE")]
    paths: Vec<PathBuf>,
    #[command(flatten)]
    only: Only,
}

/// A surface, and the files with its parts.
struct Found {
    files: Vec<PathBuf>,
    surface: Surface,
}

impl Surfaces {
    fn find(&self) -> Result<Vec<Found>, Failure> {
        let of = |path: &PathBuf| match path.is_dir() {
            true => select::collect(path),
            false => Ok(vec![Found { surface: load(path)?, files: vec![path.clone()] }]),
        };
        let all = self.paths.iter().map(of).collect::<Result<Vec<_>, Failure>>()?;
        self.only.of(all.into_iter().flatten().collect())
    }

    /// One file for each surface, as graphs read them; files that are named are not read here.
    fn files(&self) -> Result<Vec<PathBuf>, Failure> {
        if self.only.only.is_none() && !self.paths.iter().any(|path| path.is_dir()) {
            return Ok(self.paths.clone());
        }
        let file = |Found { files, surface: Surface { name, .. } }: Found| match &files[..] {
            [file] => Ok(file.clone()),
            several => Err(Failure::Message(format!(
                "{name} has its parts in {} files, and a graph reads one: join them by `haptograph surface convert DIR OUT`",
                several.len()
            ))),
        };
        self.find()?.into_iter().map(file).collect()
    }

    fn load(&self) -> Result<Vec<Surface>, Failure> {
        Ok(self.find()?.into_iter().map(|found| found.surface).collect())
    }
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum NamedSet {
    /// The fifteen surfaces of the toolkit in the thesis's studies (4.4)
    #[value(name = "thesis-4.4")]
    Chosen,
}

/// The flag for a named set.
#[derive(Debug, Clone, Copy, clap::Args)]
struct Only {
    /// Take only the surfaces of this set, by their names
    #[arg(long, value_name = "SET")]
    only: Option<NamedSet>,
}

impl Only {
    /// The surfaces of the set, in its order.
    fn of(self, mut all: Vec<Found>) -> Result<Vec<Found>, Failure> {
        let Some(NamedSet::Chosen) = self.only else { return Ok(all) };
        let (mut found, mut missing) = (vec![], vec![]);
        for name in chosen_surfaces() {
            match all.iter().position(|of| is_same_name(&of.surface.name, name)) {
                Some(at) => found.push(all.remove(at)),
                None => missing.push(name),
            }
        }
        let near = |name: &&str| {
            let near = closest(name, all.iter().map(|of| &*of.surface.name));
            name.to_string() + &near.map_or_else(String::new, |near| format!(" (nearest: {near})"))
        };
        if missing.is_empty() {
            return Ok(found);
        }
        let (count, of) = (missing.len(), found.len() + missing.len());
        let names = missing.iter().map(near).collect::<Vec<_>>().join(", ");
        Err(Failure::Message(format!("{count} of the {of} surfaces of thesis-4.4 are missing: {names}")))
    }
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surfaces::{Origin, Provenance};

    #[test]
    fn a_named_set_is_taken_whole_or_what_is_missing_is_named() {
        let found = |name: &str| {
            let surface = Surface::new(name, Provenance::new(Origin::Simulated, "test"));
            Found { files: vec![PathBuf::from(format!("{name}.ron"))], surface }
        };
        let all = || {
            chosen_surfaces()
                .map(|name| found(&name.to_uppercase().replace(' ', "-")))
                .chain([found("slate")])
        };
        let set = Only { only: Some(NamedSet::Chosen) };
        let taken: Vec<String> =
            set.of(all().collect()).unwrap().into_iter().map(|of| of.surface.name).collect();
        assert!(taken.len() == 15 && taken[0] == "ABS-PLASTIC" && !taken.contains(&"slate".to_owned()));
        assert_eq!(Only { only: None }.of(all().collect()).unwrap().len(), 16);
        let some =
            all().filter(|of| !["CORK", "SILK-1"].contains(&&*of.surface.name)).chain([found("Silk 2")]);
        let Err(Failure::Message(why)) = set.of(some.collect()) else { panic!("it is not whole") };
        assert!(
            why.contains("2 of the 15") && why.contains("Cork") && why.contains("Silk 1 (nearest: Silk 2)"),
            "{why}"
        );
    }

    #[test]
    fn a_graph_reads_one_file_for_each_surface_of_a_folder() {
        let files = |paths: &[&str]| {
            let paths = paths.iter().map(PathBuf::from).collect();
            Surfaces { paths, only: Only { only: None } }.files()
        };
        assert_eq!(files(&["graphs/surfaces"]).unwrap().len(), 6);
        // Files are not read: the graph says what is wrong with them.
        assert_eq!(files(&["none.ron"]).unwrap(), [PathBuf::from("none.ron")]);
        let folder = tempfile::tempdir().unwrap();
        for name in ["a.ron", "b.ron"] {
            std::fs::copy("graphs/surfaces/t2-canvas.ron", folder.path().join(name)).unwrap();
        }
        let why = files(&[&folder.path().to_string_lossy()]).unwrap_err().to_string();
        assert!(why.contains("2 files") && why.contains("surface convert"), "{why}");
    }
}
