//! Learns the surfaces of a folder of recordings, in parts that may run on several machines.

use super::by_file;
use crate::cli::evaluate::{TakeFiles, hash, recording_name, take_files};
use crate::cli::placing::{Force, Output};
use crate::cli::progress::Progress;
use crate::cli::result::{CommandResult, show};
use crate::cli::table::{significant, table};
use crate::cli::{Failure, eprint, make_folder, recording, run, surface};
use crate::learning::learn::{LearnSettings, learn};
use crate::learning::parts::{self, Outcome, Shard};
use crate::learning::recording::ImportSettings;
use crate::signal::parallel;
use crate::surfaces::{Surface, files as surface_files};
use clap::ValueEnum;
use serde::Serialize;
use std::collections::BTreeMap;
use std::convert::Infallible;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};

/// Setting of a learned surface that holds the hash of its inputs and settings.
const INPUTS: &str = "inputs sha256";

/// The flags of `learn` for a folder of recordings.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Folders of recordings")]
pub(super) struct Folder {
    /// Learn one of several parts of the surfaces of a folder
    #[arg(long, value_name = "K/N")]
    shard: Option<Shard>,
    /// The recordings that one surface is learned from
    #[arg(long, value_enum)]
    by: Option<By>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum By {
    /// One recording
    File,
    /// All recordings of a material, named <material>.<person>.<take>.<extension>
    Material,
}

/// A surface to learn.
struct Item {
    name: String,
    /// The recordings that it is learned from.
    recordings: Vec<PathBuf>,
    /// All files that it depends on: the recordings and the files beside them.
    files: Vec<PathBuf>,
}

/// Refuses the flags for folders if files are given.
pub(super) fn refuse_of_files(folder: &Folder) -> Result<(), Failure> {
    match folder.shard.is_some() || folder.by.is_some() {
        true => Err(Failure::Message(
            "--shard and --by apply to a folder of recordings; give one folder and no files".to_owned(),
        )),
        false => Ok(()),
    }
}

/// Learns one surface per recording or material of a folder, or of one part of them, into another folder. A
/// surface learned before from the same recordings and settings is kept. Failures are listed at the end,
/// after all other surfaces are learned.
pub(super) fn run_on(given: &super::Arguments, dir: &Path) -> Result<(), Failure> {
    let shown = dir.display();
    if given.has_single() {
        return Err(Failure::Message(format!(
            "{shown} is a folder: --circle, --tap, --press, --name, --report and --beside apply to one surface; leave them out, or name files"
        )));
    }
    let import = given.import()?;
    let items = items(dir, given.folder.by.unwrap_or(By::File))?;
    let shard = given.folder.shard;
    let own = items.iter().zip(0..).filter(|(_, number)| shard.is_none_or(|shard| shard.has(*number)));
    let items: Vec<&Item> = own.map(|(item, _)| item).collect();
    make_folder(&given.output)?;
    if given.output.canonicalize().ok() == dir.canonicalize().ok() {
        let why = format!("{shown} is the folder of the recordings; give another folder for the surfaces");
        return Err(Failure::Message(why));
    }
    let learned = LearnedFolder::of(&items, pass(given, &items, &import)?, &given.output);
    if !given.json {
        learned.warn_of_narrow();
    }
    // Without a surface the text is empty.
    show(&learned, given.json)?;
    if !given.json {
        learned.report();
    }
    let (missing, failed, all) = (learned.missing, learned.failed.len(), items.len());
    if missing > 0 {
        eprint(&format!(
            "stopped with {} of {all} surfaces missing; repeat the command to continue\n",
            missing + failed
        ));
        return Err(Failure::Interrupted);
    }
    match (failed, given.json) {
        (0, _) => Ok(()),
        (_, true) => Err(Failure::Reported),
        (failed, false) => Err(Failure::Message(format!(
            "{failed} of {all} surfaces were not learned; repeat the command to retry them, the others are kept"
        ))),
    }
}

/// The surface of an item, or why there is none.
type Learned<'a> = Result<LearnedSurface<'a>, String>;

/// Learns the surfaces that are not there yet, until ctrl-C.
fn pass<'a>(
    given: &super::Arguments,
    items: &[&'a Item],
    import: &ImportSettings,
) -> Result<Vec<Outcome<Learned<'a>>>, Failure> {
    let (stop, settings) = (run::stop_on_interrupt()?, given.learning());
    let progress = Progress::of("learning");
    let path = |item: &Item| given.output.join(format!("{}.ron", item.name));
    let find = |number: u64| {
        let item = items[number as usize];
        // An error of reading the files is one of learning, below.
        let inputs = inputs(item, import, &settings).ok();
        let there = inputs.and_then(|inputs| {
            let there = surface_files::load(&path(item)).ok()?;
            (there.provenance.settings.get(INPUTS) == Some(&inputs)).then_some(there)
        });
        Ok(there.map(|there| Ok(LearnedSurface::of(item, &there))))
    };
    let compute = |number: u64| {
        let item = items[number as usize];
        let learn = || learn_item(item, &path(item), given.force, (import, &settings));
        // A panic fails only its own item.
        Ok::<_, Infallible>(Some(match catch_unwind(AssertUnwindSafe(learn)) {
            Ok(learned) => learned.map_err(|failure| failure.to_string()),
            Err(_) => Err("haptograph panicked; the message is above".to_owned()),
        }))
    };
    let work = (parallel::cores(), items.len() as u64, None);
    let Ok(outcomes) = parts::resume(work, (&|part| progress.at(part), &stop), find, compute);
    Ok(outcomes)
}

/// The hash of all that a surface depends on.
fn inputs(item: &Item, import: &ImportSettings, settings: &LearnSettings) -> Result<String, Failure> {
    hash(item.files.iter(), &(settings, import))
}

/// Learns the surface of an item into a file.
fn learn_item<'a>(
    item: &'a Item,
    path: &Path,
    force: Force,
    (import, settings): (&ImportSettings, &LearnSettings),
) -> Result<LearnedSurface<'a>, Failure> {
    let inputs = inputs(item, import, settings)?;
    let output = Output::claim(path, force)?;
    let load = |path: &PathBuf| Ok(recording::load_with(path, import)?.recording);
    let recordings = item.recordings.iter().map(load).collect::<Result<Vec<_>, Failure>>()?;
    let named: Vec<_> = item.recordings.iter().map(|path| (path.as_path(), None)).collect();
    super::refuse_twins(&named, &recordings)?;
    let (mut surface, report) = learn(&item.name, &recordings, settings, &|_| ())
        .map_err(|error| Failure::Message(by_file(&error.to_string(), &error, &named, &recordings)))?;
    for missing in &report.missing {
        let said = by_file(&missing.to_string(), &missing.reason, &named, &recordings);
        eprint(&format!("warning: {}: {said}\n", item.name));
    }
    super::note_files(&mut surface, &named);
    surface.provenance = surface.provenance.with_setting(INPUTS, inputs);
    surface::save(&surface, &output)?;
    Ok(LearnedSurface::of(item, &surface))
}

/// What was learned from a folder.
#[derive(Serialize)]
struct LearnedFolder<'a> {
    failed: Vec<FailedSurface<'a>>,
    /// Number of surfaces that were there.
    kept: usize,
    surfaces: Vec<LearnedSurface<'a>>,
    /// Number of surfaces that a stop left out.
    #[serde(skip)]
    missing: usize,
    #[serde(skip)]
    folder: &'a Path,
}

#[derive(Serialize)]
struct LearnedSurface<'a> {
    highest_hz: Option<f64>,
    inputs_sha256: Option<String>,
    models: Option<usize>,
    mu: Option<f64>,
    n_per_mm: Option<f64>,
    origin: &'static str,
    recordings: &'a [PathBuf],
    surface: &'a str,
    taps: Option<usize>,
}

#[derive(Serialize)]
struct FailedSurface<'a> {
    error: String,
    recordings: &'a [PathBuf],
    surface: &'a str,
    /// The error as it was, with its place in the file.
    #[serde(skip)]
    whole: String,
}

impl<'a> LearnedSurface<'a> {
    fn of(item: &'a Item, surface: &Surface) -> Self {
        Self {
            highest_hz: surface.provenance.highest_hz(),
            inputs_sha256: surface.provenance.settings.get(INPUTS).cloned(),
            models: surface.texture.as_ref().map(|texture| texture.models().len()),
            mu: surface.friction.map(|friction| friction.mu()),
            n_per_mm: surface.stiffness.map(|stiffness| stiffness.n_per_mm()),
            origin: surface.provenance.origin.as_str(),
            recordings: &item.recordings,
            surface: &item.name,
            taps: surface.taps.as_ref().map(|taps| taps.taps().len()),
        }
    }

    /// Row of the table.
    fn row(&self) -> Vec<String> {
        let number = |value: Option<f64>| value.map_or_else(|| "–".to_owned(), |value| significant(value, 4));
        let count = |value: Option<usize>| value.map_or_else(|| "–".to_owned(), |value| value.to_string());
        let (surface, recordings) = (self.surface.to_owned(), self.recordings.len().to_string());
        let [models, taps] = [self.models, self.taps].map(count);
        let [mu, n_per_mm] = [self.mu, self.n_per_mm].map(number);
        vec![surface, recordings, self.origin.to_owned(), models, mu, taps, n_per_mm]
    }
}

impl<'a> LearnedFolder<'a> {
    fn of(items: &[&'a Item], outcomes: Vec<Outcome<Learned<'a>>>, folder: &'a Path) -> Self {
        let mut learned = Self { failed: vec![], kept: 0, surfaces: vec![], missing: 0, folder };
        for (item, outcome) in items.iter().zip(outcomes) {
            learned.kept += usize::from(matches!(outcome, Outcome::Kept(_)));
            match outcome {
                Outcome::Kept(Ok(surface)) | Outcome::Computed(Ok(surface), _) => {
                    learned.surfaces.push(surface);
                }
                Outcome::Kept(Err(whole)) | Outcome::Computed(Err(whole), _) => {
                    let error = whole.trim_start_matches("error: ").trim_end().to_owned();
                    let (recordings, surface) = (&item.recordings[..], &*item.name);
                    learned.failed.push(FailedSurface { error, recordings, surface, whole });
                }
                Outcome::Absent => learned.missing += 1,
            }
        }
        learned
    }

    /// Warns of the surfaces that lack frequencies.
    fn warn_of_narrow(&self) {
        let narrow = self.surfaces.iter().filter(|surface| surface.highest_hz.is_some()).count();
        if narrow > 0 {
            eprint(&format!(
                "warning: {narrow} of {} surfaces do not hold all frequencies that a hand feels; `haptograph surface show` says which\n",
                self.surfaces.len()
            ));
        }
    }

    /// Prints on standard error what was not learned, and the numbers.
    fn report(&self) {
        if !self.failed.is_empty() {
            // The whole error first, with its place in the file.
            self.failed.iter().for_each(|one| eprint(&format!("{}\n", one.whole.trim_end())));
            let row = |one: &FailedSurface<'_>| {
                vec![one.surface.to_owned(), one.error.lines().next().unwrap_or_default().to_owned()]
            };
            let rows: Vec<_> = self.failed.iter().map(row).collect();
            eprint(&format!("\n{}", table(&["not learned", "why"], &rows)));
        }
        let (kept, learned) = (self.kept, self.surfaces.len() - self.kept);
        let folder = self.folder.display();
        eprint(&format!("learned {learned} surfaces, kept {kept} existing ones: {folder}\n"));
    }
}

impl CommandResult for LearnedFolder<'_> {
    fn text(&self) -> String {
        if self.surfaces.is_empty() {
            return String::new();
        }
        let header = ["surface", "recordings", "origin", "models", "mu", "taps", "N/mm"];
        table(&header, &self.surfaces.iter().map(LearnedSurface::row).collect::<Vec<_>>())
    }
}

/// The surfaces to learn from a folder, by name. The files of one take count as one recording.
fn items(dir: &Path, by: By) -> Result<Vec<Item>, Failure> {
    let mut items: BTreeMap<String, Item> = BTreeMap::new();
    for TakeFiles { take, recording, files } in take_files(dir)? {
        let name = match by {
            By::File => take,
            By::Material => match recording_name(&take, &recording) {
                Some(name) => name.material,
                None => continue,
            },
        };
        let item =
            items.entry(name.clone()).or_insert_with(|| Item { name, recordings: vec![], files: vec![] });
        item.recordings.push(recording);
        item.files.extend(files);
    }
    if items.is_empty() {
        return Err(Failure::file("learn", dir, &"it contains no recording"));
    }
    Ok(items.into_values().collect())
}
