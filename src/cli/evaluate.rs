//! `haptograph evaluate`: the error of virtual surfaces against recordings of the real ones (thesis 2.5).

mod holdout;
mod takes;

use takes::read_takes;
pub(super) use takes::{TakeFiles, list_takes, listed, recording_name, take_files};

use super::import::Import;
use super::placing::{Force, Output};
use super::progress::Progress;
use super::result::{CommandResult, show};
use super::table::{facts, significant, table};
use super::{Failure, eprint, learn as learning};
use crate::engine::registry::Registry;
use crate::learning::evaluate::{
    ConditionLoss, DifferenceTable, Evaluation, HoldoutSettings, PerceptualMap, Study, StudyError,
    StudySettings, TakeSource,
};
use crate::learning::learn::{LearnSettings, learn};
use crate::learning::metrics::Pooling;
use crate::learning::recording::{AnyRecording, Gesture, ImportSettings};
use crate::report::evaluation::people_table;
use crate::surfaces::Origin;
use clap::ValueEnum;
use serde::{Serialize, Serializer};
use serde_json::{Value, json};
use std::borrow::Cow;
use std::path::{Path, PathBuf};

/// What to evaluate, and how
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// The folder of recordings
    #[arg(required = true)]
    dir: Option<PathBuf>,
    /// Also write a page with figures into this folder
    #[arg(long, value_name = "DIR")]
    report: Option<PathBuf>,
    #[command(flatten)]
    pub(super) force: Force,
    /// The windows whose deviations scale the spectral difference: those of the compared pair, or those of
    /// all pairs. Textures and materials are shown by both, the chosen one first
    #[arg(long, value_enum, default_value = "all")]
    pooling: PoolingArgument,
    /// Instead of the tables: learn from parts of every drag (halves, interleaved quarters, whole takes),
    /// test on the rest, and show all measures beside a floor, the thesis's method and plain baselines; also
    /// taps, friction and stiffness by speed and force. Takes about 20 s for each material with four takes of
    /// 6 s on two cores; a terminal shows a progress bar
    #[arg(long, conflicts_with = "pooling")]
    holdout: bool,
    /// Seed of the synthesised vibrations and of the map's trajectory
    #[arg(long, default_value_t = 1, value_parser = super::seed)]
    seed: u64,
    /// Print tables and map as JSON
    #[arg(long)]
    pub(super) json: bool,
    #[command(flatten)]
    pub(super) settings: learning::Settings,
    #[command(flatten)]
    pub(super) import: Import,
}

impl Arguments {
    /// The folder of recordings. Clap requires it if there is no subcommand.
    pub(super) fn dir(&self) -> &Path {
        self.dir.as_deref().unwrap_or(Path::new("."))
    }
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum PoolingArgument {
    Pair,
    All,
}

pub fn run(arguments: &Arguments, _: &Registry) -> Result<(), Failure> {
    let page = Output::claim_page(arguments.report.as_deref(), arguments.force)?;
    let import = arguments.settings.import(&arguments.import)?;
    if arguments.holdout {
        return run_holdout(arguments, page.as_ref(), &import);
    }
    let takes = list_takes(arguments.dir(), &import)?;
    let settings = study_settings(arguments);
    let progress = Progress::of("evaluating");
    let study = Study::of(&takes);
    let found = study.and_then(|study| study.evaluate(&settings, &|part| progress.at(part)));
    let found = found.map_err(|error| match error {
        // Hold-out needs only one take per material, since it tests on parts of it.
        StudyError::NoTest { .. } => {
            let error = format!("{error}; or --holdout, which tests on parts of each take");
            Failure::file("evaluate", arguments.dir(), &error)
        }
        error => Failure::file("evaluate", arguments.dir(), &error),
    })?;
    drop(progress);
    let page = match &page {
        Some(page) => Some(write_report(page, arguments, &takes, &found)?),
        None => None,
    };
    let simulated = takes.iter().filter(|take| is_simulated(*take)).count();
    show(&Tables { found, simulated, recordings: takes.len(), page }, arguments.json)
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
        let mut drags = 0;
        let chosen = takes
            .iter()
            .filter(|take| take.name().material == *material && take.name().person == found.expert);
        let chosen = chosen.filter(|take| {
            let drag = take.gesture() == Gesture::Drag;
            drags += usize::from(drag);
            !drag || drags == 1
        });
        let recordings = chosen.map(|take| take.load().map(Cow::into_owned));
        let recordings = recordings.collect::<Result<Vec<AnyRecording>, String>>();
        let recordings = recordings.map_err(Failure::Message)?;
        let one = learn(material, &recordings, &settings, &|_| ());
        let one = one.map_err(|error| Failure::Message(format!("{material}: {error}")))?;
        for missing in &one.1.missing {
            eprint(&format!("warning: {missing}\n"));
        }
        learned.push(one);
        progress.at((number + 1) as f64 / found.materials.len() as f64);
    }
    page.write(&crate::report::evaluation::page(&title(arguments.dir()), found, &learned))
}

pub(super) fn study_settings(arguments: &Arguments) -> StudySettings {
    let pooling = match arguments.pooling {
        PoolingArgument::Pair => Pooling::Pair,
        PoolingArgument::All => Pooling::All,
    };
    StudySettings {
        processing: arguments.settings.processing(),
        texture: arguments.settings.texture(),
        ..seeded(pooling, arguments.seed)
    }
}

/// Settings for the comparison and the map, independent of the learning method.
pub(super) fn seeded(pooling: Pooling, seed: u64) -> StudySettings {
    let mut settings = StudySettings::default();
    (settings.table.pooling, settings.map.pooling) = (pooling, pooling);
    settings.table.synthesis.seed = seed;
    settings.map.synthesis.seed = seed;
    settings.map.walk.seed = seed;
    settings.map.seed = seed;
    settings
}

/// The tables and the map of a study.
pub(super) struct Tables {
    pub found: Evaluation,
    /// Number of simulated recordings.
    pub simulated: usize,
    pub recordings: usize,
    pub page: Option<PathBuf>,
}

impl CommandResult for Tables {
    fn text(&self) -> String {
        describe(&self.found) + &conclusion(self.simulated, self.recordings, self.page.as_ref())
    }
}

fn describe(found: &Evaluation) -> String {
    let mut text = format!(
        "Spectral difference between virtual textures (rows, learned from {}'s first take) and recordings (columns, {}'s other takes).\n\
         [own material]  * smallest of its row and column\n\n",
        found.expert, found.expert
    );
    let other = found.materials_table.pooled(other(found.materials_table.pooling));
    for table in [&found.materials_table, &other] {
        let over = match table.pooling {
            Pooling::Pair => "the compared pair",
            Pooling::All => "all compared pairs",
        };
        text += &format!("Deviations over the windows of {over}:\n\n{}\n", materials_table(table));
        let yes = if table.diagonal_is_least() { "yes" } else { "no" };
        text += &facts(&[
            ("baseline (mean + 2 sd of the diagonal)", significant(table.baseline(), 3)),
            ("each texture nearest to its own material", yes.to_owned()),
            ("smallest margin", margin(table)),
        ]);
        text += "\n";
    }
    if let Some(people) = &found.people_table {
        text += "Each person's textures against the same recordings of their own material.\n\n";
        text += &people_table(people).text();
    }
    if let Some(map) = &found.map {
        text += "\nAll textures against each other, played along one random walk and placed on a map.\n\n";
        let scree = |values: &[f64], digits: usize| {
            let values: Vec<String> = values.iter().map(|value| significant(*value, digits)).collect();
            values.join(" ")
        };
        text += &facts(&[
            ("stress in 1, 2, ... dimensions", scree(&map.scaling.stress, 2)),
            ("R² of the distances there", scree(&map.scaling.r_squared, 3)),
            ("purity of k-means groups", significant(map.k_means_purity, 3)),
            ("purity of hierarchical groups", significant(map.tree_purity, 3)),
            (
                "angle of roughness and fineness",
                map.angle_deg
                    .map_or_else(|| "none".to_owned(), |angle| format!("{} degrees", significant(angle, 3))),
            ),
        ]);
    }
    text += &losses(&found.losses);
    if found.centre.is_some() {
        text += &format!("\n{}", facts(&[Centre::fact(found.centre.map(Centre::from).as_ref())]));
    }
    text
}

/// The variation that textures lose which respond to force only, speed only, or neither (thesis 4.5.3).
fn losses(losses: &[ConditionLoss]) -> String {
    let row = |one: &ConditionLoss| {
        vec![
            format!("virtual {}", one.surface),
            one.condition.symbol().to_owned(),
            significant(one.loss.power, 3),
            significant(one.loss.centroid_hz, 3),
            one.difference.map_or_else(|| "–".to_owned(), |difference| format!("{difference:.2}")),
        ]
    };
    if losses.is_empty() {
        return String::new();
    }
    let rows: Vec<Vec<String>> = losses.iter().map(row).collect();
    let header = ["", "responds to", "power ((m/s²)²)", "centroid (Hz)", "SD_x"];
    format!(
        "\nVariation that is lost if a texture responds to force only (F), speed only (S) or neither (ϕ).\n\n{}",
        table(&header, &rows)
    )
}

/// The centre of a set of surfaces (thesis 4.5.2).
#[derive(Debug, Serialize)]
pub(super) struct Centre {
    force_n: f64,
    speed_mm_s: f64,
}

impl From<(f64, f64)> for Centre {
    fn from((speed_m_s, force_n): (f64, f64)) -> Self {
        Self { force_n, speed_mm_s: 1000.0 * speed_m_s }
    }
}

impl Centre {
    /// A line of facts.
    pub fn fact(centre: Option<&Self>) -> (&'static str, String) {
        let number = |value| significant(value, 3);
        let shown = centre.map_or_else(
            || "none: no measured models".to_owned(),
            |at| format!("{} mm/s, {} N", number(at.speed_mm_s), number(at.force_n)),
        );
        ("mean of the measured models up to 2.75 N", shown)
    }
}

/// The smallest difference between a texture's own material and its nearest other material, with both names.
fn margin(table: &DifferenceTable) -> String {
    table.smallest_margin().map_or_else(
        || "none".to_owned(),
        |(margin, row, column)| {
            format!("{margin:.2} (virtual {} on {})", table.rows[row], table.columns[column])
        },
    )
}

fn other(pooling: Pooling) -> Pooling {
    match pooling {
        Pooling::Pair => Pooling::All,
        Pooling::All => Pooling::Pair,
    }
}

fn materials_table(differences: &DifferenceTable) -> String {
    let rows: Vec<Vec<String>> = differences
        .rows
        .iter()
        .enumerate()
        .map(|(row, name)| {
            let cells = differences.differences[row].iter().enumerate().map(|(column, cell)| {
                let least =
                    differences.is_least_of_row(row, column) && differences.is_least_of_column(row, column);
                let star = if least { "*" } else { "" };
                match cell {
                    Some(value) if row == column => format!("{star}[{value:.2}]"),
                    Some(value) => format!("{star}{value:.2} "),
                    None => "–".to_owned(),
                }
            });
            std::iter::once(format!("virtual {name}")).chain(cells).collect()
        })
        .collect();
    let header: Vec<&str> =
        std::iter::once("").chain(differences.columns.iter().map(String::as_str)).collect();
    table(&header, &rows)
}

impl Serialize for Tables {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let found = &self.found;
        json!({
            "materials": found.materials,
            "people": found.people,
            "expert": found.expert,
            "simulated": self.simulated > 0,
            "table": table_json(&found.materials_table),
            "tables": {
                "pooled_over_pair": table_json(&found.materials_table.pooled(Pooling::Pair)),
                "pooled_over_all": table_json(&found.materials_table.pooled(Pooling::All)),
            },
            "people_table": found.people_table.as_ref().map(|table| json!({ "rows": table.rows, "columns": table.columns, "sd": table.differences })),
            "map": found.map.as_ref().map(map_json),
            "losses": found.losses.iter().map(loss_json).collect::<Vec<_>>(),
            "centre": found.centre.map(Centre::from),
        })
        .serialize(serializer)
    }
}

fn table_json(table: &DifferenceTable) -> Value {
    json!({
        "rows": table.rows,
        "columns": table.columns,
        "sd": table.differences,
        "diagonal": table.diagonal(),
        "baseline": table.baseline(),
        "diagonal_is_least": table.diagonal_is_least(),
        "smallest_margin": table.smallest_margin().map(|(margin, ..)| margin),
    })
}

fn map_json(map: &PerceptualMap) -> Value {
    json!({
        "textures": map.names.iter().map(|(name, _)| name).collect::<Vec<_>>(),
        "places": map.scaling.places,
        "stress": map.scaling.stress,
        "r_squared": map.scaling.r_squared,
        "k_means": map.k_means,
        "k_means_purity": map.k_means_purity,
        "hierarchical_purity": map.tree_purity,
        "power": map.power,
        "spectral_centroid_hz": map.spectral_centroid_hz,
        "angle_deg": map.angle_deg,
    })
}

fn loss_json(one: &ConditionLoss) -> Value {
    json!({
        "texture": one.surface,
        "condition": one.condition.symbol(),
        "power_m2_s4": one.loss.power,
        "spectral_centroid_hz": one.loss.centroid_hz,
        "sd_x": one.difference,
    })
}
