//! `learn` and `evaluate` over many recordings, split into parts that may run on several machines. The merged
//! parts equal the result of one run.

use super::learn::{self, by_file};
use super::placing::{LEDGER, Output};
use super::progress::Progress;
use super::table::{significant, table};
use super::{Failure, eprint, evaluate, folder_of, print, print_json, read_file, recording, run, surface};
use crate::engine::registry::Registry;
use crate::learning::evaluate::{RecordingName, Study, StudyHead, StudyPart};
use crate::learning::learn::{self as library, LearnSettings};
use crate::learning::parts::{Shard, until_stopped};
use crate::learning::recording::ImportSettings;
use crate::signal::{files, parallel};
use crate::surfaces::{Surface, files as surface_files};
use clap::{Subcommand, ValueEnum};
use serde_json::{Value, json};
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use std::ffi::OsStr;
use std::fmt::Debug;
use std::fs;
use std::io;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;

/// Setting of a learned surface that holds the hash of its inputs and settings.
const INPUTS: &str = "inputs sha256";

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
pub struct Evaluate {
    #[command(subcommand)]
    merge: Option<Merge>,
    #[command(flatten)]
    given: evaluate::Arguments,
    /// Learn and compare one of several parts of the textures; `merge` prints the tables
    #[arg(long, value_name = "K/N", requires = "output", conflicts_with_all = ["report", "holdout"])]
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
        /// Print tables and map as JSON
        #[arg(long)]
        json: bool,
    },
}

/// The flags of `learn` for a folder of recordings.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Folders of recordings")]
pub struct Folder {
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

pub fn evaluate(arguments: &Evaluate, registry: &Registry) -> Result<(), Failure> {
    match arguments {
        Evaluate { merge: Some(Merge::Merge { parts, json }), .. } => merge(parts, *json),
        Evaluate { given, shard: Some(shard), output: Some(output), .. } => {
            evaluate_part(given, *shard, output)
        }
        Evaluate { given, .. } => evaluate::run(given, registry),
    }
}

/// Learns and compares one part of the textures and writes it to a file. An existing part is kept.
fn evaluate_part(given: &evaluate::Arguments, shard: Shard, path: &Path) -> Result<(), Failure> {
    let folder = folder_of(path)?;
    if folder.canonicalize().ok() == given.dir().canonicalize().ok() {
        let (path, dir) = (path.display(), given.dir().display());
        return Err(Failure::Message(format!(
            "{path} is in {dir}, the folder of the recordings; give a file in another folder"
        )));
    }
    let import = given.settings.import(&given.import)?;
    let settings = evaluate::study_settings(given);
    let study = hash(listed(given.dir())?.iter(), &(&settings, &import))?;
    if let Some(there) = read_part(path).ok().filter(|there| there.head.study == study) {
        let wanted = (0..there.head.of).filter(|number| shard.has(*number as u64));
        if there.numbers().eq(wanted) {
            return part_facts(given.json, path, &there, true);
        }
    }
    let output = Output::claim(path, given.force)?;
    let takes = evaluate::list_takes(given.dir(), &import)?;
    let progress = Progress::of("evaluating");
    let failed = |error: &dyn std::fmt::Display| Failure::file("evaluate", given.dir(), error);
    let whole = Study::of(&takes).map_err(|error| failed(&error))?;
    let found = whole.compare(Some(shard), &settings, &|part| progress.at(part));
    let found = found.map_err(|error| failed(&error))?;
    drop(progress);
    let compared: Vec<_> = found.into_iter().map(|(_, compared)| compared).collect();
    let head = StudyHead::of(study, &settings, &whole, &takes);
    let part = StudyPart::new(head, &compared);
    let text = part.to_text().map_err(|error| Failure::file("write", path, &error))?;
    part_facts(given.json, &output.write(&text)?, &part, false)
}

fn part_facts(json: bool, path: &Path, part: &StudyPart, kept: bool) -> Result<(), Failure> {
    let textures = part.numbers().count();
    if json {
        return print_json(&json!({ "part": path, "textures": textures, "of": part.head.of, "kept": kept }));
    }
    let (path, of) = (path.display(), part.head.of);
    let there = if kept { "; kept the existing part" } else { "" };
    print(&format!("{textures} of {of} textures: {path}{there}\n"))
}

fn read_part(path: &Path) -> Result<StudyPart, Failure> {
    let text = files::read_text(path, files::MAX_PART_BYTES);
    let text = text.map_err(|error| Failure::file("read", path, &error))?;
    StudyPart::parse(path, &text).map_err(|error| Failure::Message(error.to_string()))
}

/// Prints the tables of all parts.
fn merge(paths: &[PathBuf], json: bool) -> Result<(), Failure> {
    let read = |path: &PathBuf| Ok((path.clone(), read_part(path)?));
    let parts = paths.iter().map(read).collect::<Result<Vec<_>, Failure>>()?;
    let Some(StudyPart { head, .. }) = parts.first().map(|(_, part)| part) else {
        return Err(Failure::Message("no part given; name the files of all parts".to_owned()));
    };
    let settings = evaluate::seeded(head.pooling, head.seed);
    let progress = Progress::of("evaluating");
    let found = StudyPart::merged(&parts, &settings, &|part| progress.at(part));
    let found = found.map_err(|error| Failure::Message(error.to_string()))?;
    drop(progress);
    if json {
        return print_json(&evaluate::to_json(&found, head.simulated > 0));
    }
    print(&evaluate::describe(&found))?;
    evaluate::print_simulated(head.simulated, head.recordings)
}

/// A surface to learn.
struct Item {
    name: String,
    /// The recordings that it is learned from.
    recordings: Vec<PathBuf>,
    /// All files that it depends on: the recordings and the files beside them.
    files: Vec<PathBuf>,
}

/// The result for one item.
enum Outcome {
    /// The surface, and true if it existed already.
    Learned(Box<Surface>, bool),
    Failed(String),
}

/// Refuses the flags for folders if files are given.
pub fn refuse_of_files(folder: &Folder) -> Result<(), Failure> {
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
pub fn learn(given: &learn::Arguments, dir: &Path) -> Result<(), Failure> {
    if given.has_single() {
        return Err(Failure::Message(format!(
            "{} is a folder: --circle, --tap, --press, --name and --report apply to one surface; leave them out, or name files",
            dir.display()
        )));
    }
    let import = given.import()?;
    let settings = given.learning();
    let items = items(dir, given.folder.by.unwrap_or(By::File))?;
    let shard = given.folder.shard;
    let numbered = items.iter().zip(0_u64..);
    let items: Vec<&Item> = numbered
        .filter(|(_, number)| shard.is_none_or(|shard| shard.has(*number)))
        .map(|(item, _)| item)
        .collect();
    fs::create_dir_all(&given.output)
        .map_err(|error| Failure::file("make the folder", &given.output, &error))?;
    if given.output.canonicalize().ok() == dir.canonicalize().ok() {
        return Err(Failure::Message(format!(
            "{} is the folder of the recordings; give another folder for the surfaces",
            dir.display()
        )));
    }
    let stop = run::stop_on_interrupt()?;
    let progress = Progress::of("learning");
    let one = |item: &&Item| {
        if stop.load(Ordering::Relaxed) {
            return None;
        }
        // A panic fails only its own item.
        Some(match catch_unwind(AssertUnwindSafe(|| learn_item(given, item, &import, &settings))) {
            Ok(Ok((surface, kept))) => Outcome::Learned(Box::new(surface), kept),
            Ok(Err(failure)) => Outcome::Failed(failure.to_string()),
            Err(_) => Outcome::Failed("haptograph panicked; the message is above".to_owned()),
        })
    };
    let outcomes =
        parallel::map(parallel::cores(), &items, &until_stopped(&stop, |part| progress.at(part)), one);
    drop(progress);
    let stopped = outcomes.iter().any(Option::is_none);
    let counted = report(given, &items, outcomes)?;
    if stopped {
        let missing = items.len() - counted.0;
        eprint(&format!(
            "stopped with {missing} of {} surfaces missing; repeat the command to continue\n",
            items.len()
        ));
        return Err(Failure::Interrupted);
    }
    match (counted.1, given.json) {
        (0, _) => Ok(()),
        (_, true) => Err(Failure::Reported),
        (failed, false) => Err(Failure::Message(format!(
            "{failed} of {} surfaces were not learned; repeat the command to retry them, the others are kept",
            items.len()
        ))),
    }
}

/// The surface of an item, and true if it existed already.
fn learn_item(
    given: &learn::Arguments,
    item: &Item,
    import: &ImportSettings,
    settings: &LearnSettings,
) -> Result<(Surface, bool), Failure> {
    let path = given.output.join(format!("{}.ron", item.name));
    let inputs = hash(item.files.iter(), &(settings, import))?;
    if let Ok(there) = surface_files::load(&path)
        && there.provenance.settings.get(INPUTS) == Some(&inputs)
    {
        return Ok((there, true));
    }
    let output = Output::claim(&path, given.force)?;
    let load = |path: &PathBuf| Ok(recording::load_with(path, import)?.recording);
    let recordings = item.recordings.iter().map(load).collect::<Result<Vec<_>, Failure>>()?;
    let named: Vec<_> = item.recordings.iter().map(|path| (path.as_path(), None)).collect();
    learn::refuse_twins(&named, &recordings)?;
    let (mut surface, report) = library::learn(&item.name, &recordings, settings, &|_| ())
        .map_err(|error| Failure::Message(by_file(&error.to_string(), &error, &named, &recordings)))?;
    for missing in &report.missing {
        let said = by_file(&missing.to_string(), &missing.reason, &named, &recordings);
        eprint(&format!("warning: {}: {said}\n", item.name));
    }
    for (index, (path, _)) in named.iter().enumerate() {
        let file = path.file_name().unwrap_or_default().to_string_lossy();
        let name = format!("recording {} file", index + 1);
        surface.provenance = surface.provenance.with_setting(name, file);
    }
    surface.provenance = surface.provenance.with_setting(INPUTS, inputs);
    surface::save(&surface, &output)?;
    Ok((surface, false))
}

/// Prints what was learned and what failed. Returns the number of surfaces and of failures.
fn report(
    given: &learn::Arguments,
    items: &[&Item],
    outcomes: Vec<Option<Outcome>>,
) -> Result<(usize, usize), Failure> {
    let (mut surfaces, mut kept, mut failed) = (vec![], 0, vec![]);
    for (&item, outcome) in items.iter().zip(outcomes) {
        match outcome {
            None => {}
            Some(Outcome::Learned(surface, was_there)) => {
                kept += usize::from(was_there);
                surfaces.push((item, surface));
            }
            Some(Outcome::Failed(why)) => failed.push((item, why)),
        }
    }
    let counts = (surfaces.len(), failed.len());
    if given.json {
        let failed = failed.iter().map(|(item, why)| {
            let why = why.trim_start_matches("error: ").trim_end();
            json!({ "surface": item.name, "recordings": item.recordings, "error": why })
        });
        let facts = json!({
            "surfaces": surfaces.iter().map(|(item, surface)| surface_json(item, surface)).collect::<Vec<_>>(),
            "kept": kept,
            "failed": failed.collect::<Vec<_>>(),
        });
        return print_json(&facts).map(|()| counts);
    }
    let narrow = surfaces.iter().filter(|(_, surface)| surface.provenance.highest_hz().is_some()).count();
    if narrow > 0 {
        eprint(&format!(
            "warning: {narrow} of {} surfaces do not hold all frequencies that a hand feels; `haptograph surface show` says which\n",
            surfaces.len()
        ));
    }
    if !surfaces.is_empty() {
        let header = ["surface", "recordings", "origin", "models", "mu", "taps", "N/mm"];
        let rows: Vec<_> = surfaces.iter().map(|(item, surface)| row(item, surface)).collect();
        print(&table(&header, &rows))?;
    }
    if !failed.is_empty() {
        // The whole error first, with its place in the file.
        failed.iter().for_each(|(_, why)| eprint(&format!("{}\n", why.trim_end())));
        let row = |(item, why): &(&Item, String)| {
            let line = why.lines().next().unwrap_or_default();
            vec![item.name.clone(), line.trim_start_matches("error: ").to_owned()]
        };
        let rows: Vec<_> = failed.iter().map(row).collect();
        eprint(&format!("\n{}", table(&["not learned", "why"], &rows)));
    }
    let (learned, folder) = (counts.0 - kept, given.output.display());
    eprint(&format!("learned {learned} surfaces, kept {kept} existing ones: {folder}\n"));
    Ok(counts)
}

/// Table row of a surface, the same for a new and a kept one.
fn row(item: &Item, surface: &Surface) -> Vec<String> {
    let models = surface.texture.as_ref().map(|texture| texture.models().len());
    let taps = surface.taps.as_ref().map(|taps| taps.taps().len());
    let number = |value: Option<f64>| value.map_or_else(|| "–".to_owned(), |value| significant(value, 4));
    let count = |value: Option<usize>| value.map_or_else(|| "–".to_owned(), |value| value.to_string());
    vec![
        item.name.clone(),
        item.recordings.len().to_string(),
        surface.provenance.origin.as_str().to_owned(),
        count(models),
        number(surface.friction.map(|friction| friction.mu())),
        count(taps),
        number(surface.stiffness.map(|stiffness| stiffness.n_per_mm())),
    ]
}

fn surface_json(item: &Item, surface: &Surface) -> Value {
    json!({
        "surface": item.name,
        "recordings": item.recordings,
        "origin": surface.provenance.origin.as_str(),
        "models": surface.texture.as_ref().map(|texture| texture.models().len()),
        "mu": surface.friction.map(|friction| friction.mu()),
        "taps": surface.taps.as_ref().map(|taps| taps.taps().len()),
        "highest_hz": surface.provenance.highest_hz(),
        "n_per_mm": surface.stiffness.map(|stiffness| stiffness.n_per_mm()),
        "inputs_sha256": surface.provenance.settings.get(INPUTS),
    })
}

/// The surfaces to learn from a folder, by name. The files of one take count as one recording: of the
/// toolkit's triples the first file stands for all three, and a WAV file stands for the table beside it. RON
/// files beside recordings are notes and are skipped.
fn items(dir: &Path, by: By) -> Result<Vec<Item>, Failure> {
    let mut takes: BTreeMap<String, Vec<PathBuf>> = BTreeMap::new();
    for path in listed(dir)? {
        let file = path.file_name().unwrap_or_default().to_string_lossy();
        let note = file.strip_suffix(".ron");
        let file = note.unwrap_or(&file);
        let parts = ["Accel_", "Position_", "Force_"];
        let file = parts.iter().find_map(|part| file.strip_prefix(part)).unwrap_or(file);
        let take = file.rsplit_once('.').map_or(file, |(take, _)| take).to_owned();
        takes.entry(take).or_default().push(path);
    }
    let mut items: BTreeMap<String, Item> = BTreeMap::new();
    for (take, files) in takes {
        let of = |extension: &str| {
            let is =
                |path: &&PathBuf| path.extension().is_some_and(|own| own.eq_ignore_ascii_case(extension));
            files.iter().find(is)
        };
        let is_note = |path: &&PathBuf| path.extension() == Some(OsStr::new("ron"));
        let Some(recording) = of("wav").or_else(|| files.iter().find(|path| !is_note(path))).cloned() else {
            continue;
        };
        let name = match (by, RecordingName::parse(&format!("{take}."))) {
            (By::File, _) => take,
            (By::Material, Some(name)) => name.material,
            (By::Material, None) => {
                let path = recording.display();
                eprint(&format!(
                    "warning: skipped {path}: its name is not <material>.<person>.<take>.<extension>\n"
                ));
                continue;
            }
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

/// The files of a folder by name, without hidden ones.
fn listed(dir: &Path) -> Result<Vec<PathBuf>, Failure> {
    let entries: io::Result<Vec<_>> = files::entries(dir).and_then(Iterator::collect);
    let entries = entries.map_err(|error| Failure::file("read", dir, &error))?;
    let mut paths: Vec<PathBuf> = entries
        .into_iter()
        .filter(|entry| !entry.file_name().to_string_lossy().starts_with('.'))
        .map(|entry| entry.path())
        .filter(|path| path.is_file() && !path.ends_with(LEDGER))
        .collect();
    paths.sort();
    Ok(paths)
}

/// A hash over the names and contents of files, the settings and the version.
fn hash<'a>(files: impl Iterator<Item = &'a PathBuf>, settings: &dyn Debug) -> Result<String, Failure> {
    let mut hash = Sha256::new();
    hash.update(format!("haptograph {}\n{settings:?}\n", env!("CARGO_PKG_VERSION")));
    for path in files {
        let bytes = read_file(path)?;
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        hash.update(format!("{name} {}\n", bytes.len()));
        hash.update(bytes);
    }
    Ok(hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect())
}
