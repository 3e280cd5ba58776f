//! `haptograph study`: studies with people.

mod check;
mod page;
mod run;
mod simulate;

use super::beside::{Beside, show_with};
use super::placing::{Force, RunFolder};
use super::result::{CommandResult, show};
use super::table::{significant, table};
use super::{Failure, print};
use crate::engine::registry::Registry;
use clap::Subcommand;
use haptograph_study::analyse::{AbxRow, Analysis, ChoiceRow, RelationRow, ScreeRow, ThresholdRow};
use haptograph_study::check::{Checked, StudyError};
use haptograph_study::data::{Folder, Row};
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Check, plan, run, simulate and analyse a study with people
///
/// A study is a RON file beside its graph (docs/studies.md): surfaces, scales, phases. Its trials are drawn from its seed and the
/// participant's code alone.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Check(check::Arguments),
    /// List the trials of a participant
    Plan {
        #[command(flatten)]
        study: StudyFile,
        /// Code of the participant
        #[arg(short, long, value_name = "CODE")]
        participant: String,
        /// Group of the participant; default: the first
        #[arg(short, long, value_name = "GROUP")]
        group: Option<String>,
        /// Print the trials as JSON
        #[arg(long)]
        json: bool,
    },
    /// Run a study with people: a page for the participant, one for the experimenter
    ///
    /// Nothing is kept before the participant agrees; an answer is on disk before the next trial begins. The same command goes on where a
    /// session ended. Devices are simulated unless the study, --live or --endpoints names another set.
    Run(run::Arguments),
    Simulate(simulate::Arguments),
    /// Compute the statistics that the phases ask for
    ///
    /// Two tests stand side by side: as in the thesis, with participants as replicates, and with repeated measures, each participant
    /// against themselves. On centred ratings the first finds a difference in 11.7 % of studies without one, at a nominal 5 %. Tables, a page
    /// of figures (`analysis.html`) and a script that repeats the tests in R (`analysis.R`) go into `analysis` in the folder.
    Analyse {
        /// The folder of the study's data
        #[arg(value_name = "DIR")]
        folder: PathBuf,
        #[command(flatten)]
        beside: Beside,
        /// The study's own file, for its surfaces: regresses similarity on what their signals lose (Table 4.2), or, in 4.6, on what they have
        #[arg(long, value_name = "STUDY.ron")]
        study: Option<PathBuf>,
        /// Take every surface file of this folder, as the study was run
        #[arg(long, value_name = "DIR", requires = "study")]
        surfaces: Option<PathBuf>,
        /// Print all tables as JSON
        #[arg(long)]
        json: bool,
    },
    /// Remove a participant's data, but for a line that says so
    Remove {
        /// The folder of the study's data
        #[arg(value_name = "DIR")]
        folder: PathBuf,
        /// Code of the participant
        #[arg(short, long, value_name = "CODE")]
        participant: String,
    },
}

/// The file of a study.
#[derive(Debug, clap::Args)]
struct StudyFile {
    /// The study
    #[arg(value_name = "STUDY.ron")]
    study: PathBuf,
    /// Take every surface file of this folder in place of the study's surfaces
    #[arg(long, value_name = "DIR")]
    surfaces: Option<PathBuf>,
}

impl StudyFile {
    fn load(&self) -> Result<Checked, Failure> {
        Checked::load(&self.study, self.surfaces.as_deref()).map_err(failure)
    }
}

fn failure(error: StudyError) -> Failure {
    match error {
        StudyError::Study(wrong) => Failure::Graph(wrong),
        error => Failure::message(error),
    }
}

pub(super) fn run(arguments: &Arguments, registry: &Registry) -> Result<(), Failure> {
    match &arguments.command {
        Command::Run(arguments) => run::run(arguments, registry),
        Command::Check(arguments) => check::run(arguments, registry),
        Command::Plan { study, participant, group, json } => {
            let study = study.load()?;
            study.check_code(participant).map_err(Failure::message)?;
            let group = match group {
                None => 0,
                Some(name) => group_of(&study, name)?,
            };
            let trials = study.study.trials(participant, group);
            let trials = trials.iter().map(|trial| study.row(trial)).collect();
            let group = study.study.group_name(group).to_owned();
            show(&Plan { group, participant: participant.clone(), trials }, *json)
        }
        Command::Simulate(arguments) => simulate::run(arguments, registry),
        Command::Analyse { folder, beside, study, surfaces, json } => {
            let own = study.clone().map(|study| StudyFile { study, surfaces: surfaces.clone() });
            analyse(folder, *beside, own.as_ref(), *json)
        }
        Command::Remove { folder, participant } => {
            let folder = Folder::existing(folder).map_err(Failure::message)?;
            print(&(folder.remove(participant).map_err(Failure::message)? + "\n"))
        }
    }
}

fn group_of(study: &Checked, name: &str) -> Result<usize, Failure> {
    let known: Vec<&str> =
        (0..study.study.group_count()).map(|group| study.study.group_name(group)).collect();
    known.iter().position(|known| *known == name).ok_or_else(|| {
        Failure::Message(format!("the study has no group `{name}`; it has {}", known.join(", ")))
    })
}

/// The trials of a participant, with the columns of `trials.csv`.
#[derive(Serialize)]
struct Plan {
    group: String,
    participant: String,
    trials: Vec<Row>,
}

impl CommandResult for Plan {
    fn text(&self) -> String {
        let name = |surface: &str, version: &str| {
            if surface.is_empty() { String::new() } else { format!("{surface}, {version}") }
        };
        let row = |trial: &Row| {
            let first = name(&trial.first_surface, &trial.first_version);
            let second = name(&trial.second_surface, &trial.second_version);
            let is_staircase = trial.level.is_none() && !second.is_empty() && first == second;
            let swapped = trial.second_is_left_or_earlier;
            let [left, right] = if swapped { [second, first] } else { [first, second] };
            let level = match trial.level {
                Some(level) => significant(level, 4),
                None if is_staircase => "by the answers".to_owned(),
                None => String::new(),
            };
            let phase = format!("{}{}", trial.phase, if trial.training { " (training)" } else { "" });
            vec![trial.trial.to_string(), phase, trial.scale.clone(), left, right, level]
        };
        let rows: Vec<Vec<String>> = self.trials.iter().map(row).collect();
        let header = ["trial", "phase", "scale or question", "left, first", "right, second", "level"];
        let trials = table(&header, &rows);
        format!("participant {}, group {}\n{trials}", self.participant, self.group)
    }
}

fn analyse(folder: &Path, beside: Beside, own: Option<&StudyFile>, json: bool) -> Result<(), Failure> {
    let folder = Folder::existing(folder).map_err(Failure::message)?;
    let study = folder.study().map_err(Failure::message)?;
    let mut analysis = Analysis::of(&study, &folder).map_err(Failure::message)?;
    let own = own.map(StudyFile::load).transpose()?;
    let is_beside = beside.beside.is_some() && study.thesis.as_deref() == Some("4.6");
    let added = match &own {
        own if is_beside => analysis.add_components(own.as_ref(), &folder),
        Some(own) => analysis.add_responsiveness(own, &folder),
        None => Ok(()),
    };
    added.map_err(Failure::message)?;
    let beside = beside.rows(|| analysis.beside_thesis(&study).map_err(Failure::message))?;
    let output = folder.path().join("analysis");
    let tables = RunFolder::beside(&output)?;
    tables.write("analysis.html", &page::page(&study, &analysis, &beside))?;
    tables.write("analysis.R", &study.r_script())?;
    for (name, table) in analysis.tables().map_err(Failure::message)? {
        tables.write(name, &table)?;
    }
    tables.commit(&[], Force::default())?;
    show_with(&Analysed { analysis, output }, &beside, json)
}

/// The tables of an analysis.
#[derive(Serialize)]
struct Analysed {
    #[serde(flatten)]
    analysis: Analysis,
    output: PathBuf,
}

/// Header of the table of tests.
const VARIANCE: [&str; 9] =
    ["phase", "scale or surface", "test", "term", "df", "F or chi2", "p", "p (GG)", "partial eta2"];

impl CommandResult for Analysed {
    fn text(&self) -> String {
        let of = &self.analysis;
        let mut text = if of.simulated { "simulated people\n".to_owned() } else { String::new() };
        if !of.means.is_empty() {
            let rows = of.means.iter().map(|row| {
                let names = [&row.phase, &row.scale, &row.surface, &row.version].map(Clone::clone);
                let less = maybe(row.less_than_reference_percent);
                names
                    .into_iter()
                    .chain([number(row.mean), number(row.sd), row.people.to_string(), less])
                    .collect()
            });
            let header = ["phase", "scale", "surface", "version", "mean", "sd", "people", "% less"];
            text += &table(&header, &rows.collect::<Vec<_>>());
        }
        if !of.variance.is_empty() {
            let rows = of.variance.iter().map(|row| {
                let residual_df = row.residual_df.map_or_else(String::new, |df| format!(", {}", number(df)));
                let df = number(row.df) + &residual_df;
                let names = [row.phase.clone(), row.of.clone(), row.test.to_owned(), row.term.to_owned()];
                let sizes = [row.p_greenhouse_geisser, row.partial_eta_squared].map(maybe);
                names.into_iter().chain([df, number(row.f), number(row.p)]).chain(sizes).collect()
            });
            text += &format!("\n{}", table(&VARIANCE, &rows.collect::<Vec<_>>()));
        }
        text += &self.fits();
        of.left_out.iter().for_each(|why| text += &format!("not computed: {why}\n"));
        text + &format!("wrote {}\n", self.output.display())
    }
}

impl Analysed {
    /// Thresholds, maps and relations, one a line.
    fn fits(&self) -> String {
        let (of, mut text) = (&self.analysis, String::new());
        for row in &of.thresholds {
            let ThresholdRow { phase, participant, trials, .. } = row;
            let whose = if participant.is_empty() { "all" } else { participant };
            let of = [100.0 * row.at(row.threshold), row.threshold, row.low, row.high, row.standard];
            let [right, threshold, low, high, standard] = of.map(number);
            let warning =
                if row.slope_at_bound { ", but too few answers between guessed and known" } else { "" };
            text += &format!(
                "{phase}, {whose}: {right} % are right at a difference of {threshold} ({low} to {high}) from {standard}, {trials} trials{warning}\n"
            );
        }
        for row in &of.choices {
            let ChoiceRow { phase, first, second, answers, people, .. } = row;
            let [share, low, high] = [row.share_of_first, row.low, row.high].map(|of| number(100.0 * of));
            let [p, p_of_people] = [row.p_of_answers, row.p_of_people].map(number);
            text += &format!(
                "{phase}: {first} rather than {second}: {share} % ({low} to {high}) of {answers} answers, p {p} (sign test over {people} people: p {p_of_people})\n"
            );
        }
        for row in &of.abx {
            let AbxRow { phase, pair, participant, answers, .. } = row;
            let whose = if participant.is_empty() { "all" } else { participant };
            let [share, low, high] = [row.share_right, row.low, row.high].map(|share| number(100.0 * share));
            let [d, d_low, d_high] = [row.d_prime, row.d_prime_low, row.d_prime_high].map(maybe);
            let people =
                row.p_of_people.map_or_else(String::new, |p| format!(" (over people: p {})", number(p)));
            text += &format!(
                "{phase}, {whose}: X found in {pair}: {share} % ({low} to {high}) of {answers} answers, p {}{people}, d' {d} ({d_low} to {d_high})\n",
                number(row.p)
            );
        }
        for ScreeRow { phase, dimensions, stress, r_squared } in &of.maps.scree {
            let [stress, r_squared] = [*stress, *r_squared].map(number);
            text += &format!("{phase}: {dimensions} dimensions, stress {stress}, R2 {r_squared}\n");
        }
        for RelationRow { phase, kind, of, with, value, low, high, p, r_squared, .. } in &of.relations {
            let [value, low, high, p] = [*value, *low, *high, *p].map(number);
            let r_squared = r_squared.map_or_else(String::new, |of| format!(", R2 {}", number(of)));
            text +=
                &format!("{phase}, {kind}: {of} and {with}: {value} ({low} to {high}), p {p}{r_squared}\n");
        }
        text
    }
}

/// A number of three digits.
fn number(value: f64) -> String {
    if value.is_nan() { "–".to_owned() } else { significant(value, 3) }
}

fn maybe(value: Option<f64>) -> String {
    value.map_or_else(String::new, number)
}
