//! Evaluations in parts that may run on several machines. The merged parts equal the result of one run.

use super::tables::beside as beside_of;
use super::takes::{hash, list_takes, listed};
use super::{Arguments, Tables, seeded, study_settings};
use crate::cli::beside::{Beside, show_with};
use crate::cli::placing::Output;
use crate::cli::progress::Progress;
use crate::cli::result::{CommandResult, show};
use crate::cli::{Failure, folder_of};
use crate::engine::registry::Registry;
use crate::learning::evaluate::{Study, StudyError, StudyHead, StudyPart};
use crate::learning::parts::Shard;
use crate::signal::files;
use clap::Subcommand;
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Measure how well learned textures match recordings
///
/// Reads all recordings in a folder whose names have the form `<material>.<person>.<take>.<extension>`. For
/// every material and person it learns a texture from the first take. The person with the most takes is the
/// expert; the expert's other takes are the test recordings. Prints Table 2.1 of the thesis (textures against
/// materials, with each texture's own material marked) and, with several people, Table 2.2. `--shard 2/5 -o
/// PART` learns and compares the second of five parts on any machine; `haptograph evaluate merge` prints the
/// tables of all parts.
#[derive(Debug, clap::Args)]
#[command(args_conflicts_with_subcommands = true, subcommand_negates_reqs = true)]
pub(crate) struct Evaluate {
    #[command(subcommand)]
    merge: Option<Merge>,
    #[command(flatten)]
    given: Arguments,
    /// Learn and compare one of several parts of the textures; `merge` prints the tables
    #[arg(long, value_name = "K/N", requires = "output", conflicts_with_all = ["report", "holdout", "beside"])]
    shard: Option<Shard>,
    /// The part to write
    #[arg(short, long, value_name = "PART.ron", requires = "shard")]
    output: Option<PathBuf>,
}

#[derive(Debug, Subcommand)]
enum Merge {
    /// Merge the parts of an evaluation and print its tables, identical to those of one run
    Merge {
        /// The files of all parts
        #[arg(required = true, value_name = "PART.ron")]
        parts: Vec<PathBuf>,
        #[command(flatten)]
        beside: Beside,
        /// Print tables and map as JSON
        #[arg(long)]
        json: bool,
    },
}

pub(crate) fn run(arguments: &Evaluate, registry: &Registry) -> Result<(), Failure> {
    match arguments {
        Evaluate { merge: Some(Merge::Merge { parts, beside, json }), .. } => merge(parts, *beside, *json),
        Evaluate { given, shard: Some(shard), output: Some(output), .. } => {
            evaluate_part(given, *shard, output)
        }
        Evaluate { given, .. } => super::run(given, registry),
    }
}

/// Learns and compares one part of the textures and writes it to a file. An existing part is kept.
fn evaluate_part(given: &Arguments, shard: Shard, path: &Path) -> Result<(), Failure> {
    let folder = folder_of(path)?;
    if folder.canonicalize().ok() == given.dir().canonicalize().ok() {
        let (path, dir) = (path.display(), given.dir().display());
        return Err(Failure::Message(format!(
            "{path} is in {dir}, the folder of the recordings; give a file in another folder"
        )));
    }
    let import = given.settings.import(&given.import)?;
    let settings = study_settings(given);
    let study = hash(listed(given.dir())?.iter(), &(&settings, &import))?;
    if let Some(there) = read_part(path).ok().filter(|there| there.head.study == study) {
        let wanted = (0..there.head.of).filter(|number| shard.has(*number as u64));
        if there.numbers().eq(wanted) {
            return show(&PartFacts::of(path, &there, true), given.json);
        }
    }
    let output = Output::claim(path, given.force)?;
    let takes = list_takes(given.dir(), &import)?;
    let failed = |error: StudyError| Failure::file("evaluate", given.dir(), &error);
    let whole = Study::of(&takes).map_err(failed)?;
    let found = Progress::during("evaluating", |at| whole.compare(Some(shard), &settings, at));
    let found = found.map_err(failed)?;
    let compared: Vec<_> = found.into_iter().map(|(_, compared)| compared).collect();
    let head = StudyHead::of(study, &settings, &whole, &takes);
    let part = StudyPart::new(head, &compared);
    let text = part.to_text().map_err(Failure::doing("write", path))?;
    show(&PartFacts::of(&output.write(text)?, &part, false), given.json)
}

/// A part of an evaluation.
#[derive(Serialize)]
struct PartFacts {
    kept: bool,
    of: usize,
    part: PathBuf,
    textures: usize,
}

impl PartFacts {
    fn of(path: &Path, part: &StudyPart, kept: bool) -> Self {
        Self { kept, of: part.head.of, part: path.to_owned(), textures: part.numbers().count() }
    }
}

impl CommandResult for PartFacts {
    fn text(&self) -> String {
        let Self { kept, of, part, textures } = self;
        let there = if *kept { "; kept the existing part" } else { "" };
        format!("{textures} of {of} textures: {}{there}\n", part.display())
    }
}

fn read_part(path: &Path) -> Result<StudyPart, Failure> {
    let text = files::read_text(path, files::MAX_PART_BYTES);
    let text = text.map_err(Failure::doing("read", path))?;
    StudyPart::parse(path, &text).map_err(Failure::message)
}

/// Prints the tables of all parts.
fn merge(paths: &[PathBuf], beside: Beside, json: bool) -> Result<(), Failure> {
    let read = |path: &PathBuf| Ok((path.clone(), read_part(path)?));
    let parts = paths.iter().map(read).collect::<Result<Vec<_>, Failure>>()?;
    let Some(StudyPart { head, .. }) = parts.first().map(|(_, part)| part) else {
        return Err(Failure::Message("no part given; name the files of all parts".to_owned()));
    };
    let settings = seeded(head.pooling, head.seed);
    let found = Progress::during("evaluating", |at| StudyPart::merged(&parts, &settings, at));
    let found = found.map_err(Failure::message)?;
    let StudyHead { simulated, recordings, .. } = *head;
    let beside = beside.rows(|| Ok(beside_of(&found).0))?;
    show_with(&Tables { found, simulated, recordings, page: None }, &beside, json)
}
