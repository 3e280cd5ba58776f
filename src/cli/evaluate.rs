//! `haptograph evaluate`: the error of virtual surfaces against recordings of the real ones (thesis 2.5).

mod holdout;
pub(super) mod shards;
mod tables;
mod takes;

pub(super) use tables::Centre;
pub(super) use takes::{TakeFiles, hash, recording_name, take_files};

use super::beside::{Beside, show_with};
use super::import::{Choices, Import, choice};
use super::placing::{Force, Output};
use super::progress::Progress;
use super::result::show;
use super::{Failure, eprint, learn as learning};
use crate::engine::registry::Registry;
use crate::learning::evaluate::{Evaluation, HoldoutSettings, Study, StudyError, StudySettings, TakeSource};
use crate::learning::learn::{LearnSettings, learn};
use crate::learning::metrics::Pooling;
use crate::learning::recording::{AnyRecording, Gesture, ImportSettings};
use crate::surfaces::Origin;
use std::borrow::Cow;
use std::path::{Path, PathBuf};
use tables::Tables;
use takes::{list_takes, read_takes};

/// What to evaluate, and how
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    /// The folder of recordings
    #[arg(required = true)]
    dir: Option<PathBuf>,
    /// Also write a page with figures into this folder
    #[arg(long, value_name = "DIR")]
    report: Option<PathBuf>,
    #[command(flatten)]
    force: Force,
    /// The windows whose deviations scale the spectral difference. Textures and materials are shown by both, the chosen
    /// one first
    #[arg(long, value_parser = choice(POOLINGS), default_value = "all")]
    pooling: Pooling,
    /// Instead of the tables: learn from parts of every drag (halves, interleaved quarters, whole takes),
    /// test on the rest, and show all measures, of the powers averaged over seeds and of single seeds, beside a
    /// floor, the thesis's method and five plain baselines; also taps, friction and stiffness by speed and
    /// force. Takes about 4 s for each material with four takes of 6 s on two cores; a terminal shows a
    /// progress bar
    #[arg(long, conflicts_with_all = ["pooling", "beside"])]
    holdout: bool,
    /// Seed of the synthesised vibrations and of the map's trajectory
    #[arg(long, default_value_t = 1, value_parser = super::seed)]
    seed: u64,
    /// Print tables and map as JSON
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    beside: Beside,
    #[command(flatten)]
    settings: learning::Settings,
    #[command(flatten)]
    import: Import,
}

const POOLINGS: Choices<Pooling> = &[
    ("pair", Pooling::Pair, "The windows of the compared pair"),
    ("all", Pooling::All, "The windows of all pairs"),
];

impl Arguments {
    /// The folder of recordings. Clap requires it if there is no subcommand.
    fn dir(&self) -> &Path {
        self.dir.as_deref().unwrap_or(Path::new("."))
    }
}

pub(super) fn run(arguments: &Arguments, _: &Registry) -> Result<(), Failure> {
    let page = Output::claim_page(arguments.report.as_deref(), arguments.force)?;
    let import = arguments.settings.import(&arguments.import)?;
    if arguments.holdout {
        return run_holdout(arguments, page.as_ref(), &import);
    }
    let takes = list_takes(arguments.dir(), &import)?;
    let settings = study_settings(arguments);
    let evaluate = |study: Study| Progress::during("evaluating", |at| study.evaluate(&settings, at));
    let found = Study::of(&takes).and_then(evaluate).map_err(|error| {
        // Hold-out needs only one take per material, since it tests on parts of it.
        let is_for_holdout = matches!(error, StudyError::NoTest { .. });
        let more = if is_for_holdout { "; or --holdout, which tests on parts of each take" } else { "" };
        Failure::file("evaluate", arguments.dir(), &format!("{error}{more}"))
    })?;
    let page = match &page {
        Some(page) => Some(write_report(page, arguments, &takes, &found)?),
        None => None,
    };
    let simulated = takes.iter().filter(|take| is_simulated(*take)).count();
    let beside = arguments.beside.rows(|| Ok(tables::beside(&found).0))?;
    show_with(&Tables { found, simulated, recordings: takes.len(), page }, &beside, arguments.json)
}

fn run_holdout(arguments: &Arguments, page: Option<&Output>, import: &ImportSettings) -> Result<(), Failure> {
    let takes = &read_takes(arguments.dir(), import)?[..];
    let settings = HoldoutSettings {
        processing: arguments.settings.processing(),
        texture: arguments.settings.texture(),
        seed: arguments.seed,
        ..HoldoutSettings::default()
    };
    let found = holdout::found(arguments.dir(), takes, &settings)?;
    let contact = holdout::contacts(takes, &settings.processing);
    let simulated = takes.iter().filter(|take| is_simulated(*take)).count();
    let title = title(arguments.dir());
    let html =
        |output: &Output| output.write(crate::report::holdout::page(&title, &found, &contact, simulated > 0));
    let (page, recordings) = (page.map(html).transpose()?, takes.len());
    show(&holdout::HeldOut { found, contact, simulated, recordings, page }, arguments.json)
}

/// The last lines: how many recordings are simulated, if any, and the page.
fn conclusion(simulated: usize, recordings: usize, page: Option<&PathBuf>) -> String {
    let simulated = match simulated {
        0 => String::new(),
        _ => format!("\n{simulated} of {recordings} recordings are simulated\n"),
    };
    let page = page.map_or_else(String::new, |page| format!("\nlook at {}\n", page.display()));
    simulated + &page
}

fn title(dir: &Path) -> String {
    dir.file_name().map_or_else(|| "Evaluation".to_owned(), |name| name.to_string_lossy().into_owned())
}

fn is_simulated(take: &impl TakeSource) -> bool {
    take.origin() == Origin::Simulated
}

/// Writes the page, with a surface of each material learned from the expert's first drag and all of the
/// expert's circles, taps and presses.
fn write_report(
    page: &Output,
    arguments: &Arguments,
    takes: &[impl TakeSource],
    found: &Evaluation,
) -> Result<PathBuf, Failure> {
    let settings = LearnSettings {
        processing: arguments.settings.processing(),
        texture: arguments.settings.texture(),
        // What is there was measured above.
        accept_rate: true,
        ..LearnSettings::default()
    };
    let progress = Progress::of("drawing");
    let mut learned = vec![];
    for (number, material) in found.materials.iter().enumerate() {
        let own = takes
            .iter()
            .filter(|take| take.name().material == *material && take.name().person == found.expert);
        let (drags, others): (Vec<_>, Vec<_>) = own.partition(|take| take.gesture() == Gesture::Drag);
        let recordings = drags.iter().take(1).chain(&others).map(|take| take.load().map(Cow::into_owned));
        let recordings =
            recordings.collect::<Result<Vec<AnyRecording>, String>>().map_err(Failure::Message)?;
        let one = learn(material, &recordings, &settings, &|_| ());
        let one = one.map_err(|error| Failure::Message(format!("{material}: {error}")))?;
        one.1.missing.iter().for_each(|missing| eprint(&format!("warning: {missing}\n")));
        learned.push(one);
        progress.at((number + 1) as f64 / found.materials.len() as f64);
    }
    page.write(crate::report::evaluation::page(&title(arguments.dir()), found, &learned))
}

fn study_settings(arguments: &Arguments) -> StudySettings {
    StudySettings {
        processing: arguments.settings.processing(),
        texture: arguments.settings.texture(),
        ..seeded(arguments.pooling, arguments.seed)
    }
}

/// Settings for the comparison and the map, independent of the learning method.
fn seeded(pooling: Pooling, seed: u64) -> StudySettings {
    let mut settings = StudySettings::default();
    (settings.table.pooling, settings.map.pooling) = (pooling, pooling);
    settings.table.synthesis.seed = seed;
    settings.map.synthesis.seed = seed;
    settings.map.walk.seed = seed;
    settings.map.seed = seed;
    settings
}
