//! `haptograph study`: studies with people.

use super::interrupt;
use super::progress::Progress;
use super::result::{CommandResult, show};
use super::table::{significant, table};
use super::{Failure, print};
use crate::engine::registry::Registry;
use crate::signal::files::write_atomically;
use clap::Subcommand;
use haptograph_study::analyse::Analysis;
use haptograph_study::check::{Checked, StudyError};
use haptograph_study::data::{DataError, Folder};
use haptograph_study::order::Trial;
use haptograph_study::people::{Motion, People};
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;

/// Check, plan and simulate a study with people
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
    /// Check a study, its graph with every version, and its orders
    Check {
        #[command(flatten)]
        study: StudyFile,
        /// Print the result as JSON
        #[arg(long)]
        json: bool,
    },
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
    /// Run a study with people who do not exist
    ///
    /// The graph runs with its simulated hands, so that the conditions of a trial and its measures are real; the answers are those of
    /// people of known parameters. A repeated run goes on where it ended.
    Simulate {
        #[command(flatten)]
        study: StudyFile,
        /// Number of people in each group; default: as the study says, or 12
        #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=10_000))]
        people: Option<u32>,
        /// A file `People(...)` with their parameters; default: people without a preference
        #[arg(long, value_name = "PEOPLE.ron")]
        model: Option<PathBuf>,
        /// Longest trial, s: conditions that are not reached by then are forced
        #[arg(long, value_name = "SECONDS", default_value_t = 180.0, value_parser = super::run::seconds)]
        longest: f64,
        /// Run no graph: answers alone
        #[arg(long)]
        without_motion: bool,
        /// The folder to write; default: `out/STUDY-simulated`
        #[arg(short, long, value_name = "DIR")]
        output: Option<PathBuf>,
        /// Print the result as JSON
        #[arg(long)]
        json: bool,
    },
    /// Compute the statistics that the phases ask for
    ///
    /// Two tests stand side by side: as in the thesis, with participants as replicates, and with repeated measures, each participant
    /// against themselves. On centred ratings the first finds a difference in 11.7 % of studies without one, at a nominal 5 %. Tables go into
    /// `analysis` in the folder.
    Analyse {
        /// The folder of the study's data
        #[arg(value_name = "DIR")]
        folder: PathBuf,
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
        Command::Check { study, json } => check(&study.load()?, registry, *json),
        Command::Plan { study, participant, group, json } => {
            let study = study.load()?;
            let group = match group {
                None => 0,
                Some(name) => group_of(&study, name)?,
            };
            show(&Plan::new(&study, participant, group), *json)
        }
        Command::Simulate { study, people, model, longest, without_motion, output, json } => {
            let checked = study.load()?;
            let model = match model {
                None => People::indifferent(),
                Some(path) => People::load(path).map_err(failure)?,
            };
            let motion =
                if *without_motion { Motion::None } else { Motion::Simulated { longest_s: *longest } };
            let output = output.clone().unwrap_or_else(|| {
                let name =
                    study.study.file_stem().map_or_else(|| "study".into(), |stem| stem.to_string_lossy());
                Path::new("out").join(format!("{name}-simulated"))
            });
            simulate((&checked, registry), (&model, motion), *people, &output, *json)
        }
        Command::Analyse { folder, json } => {
            let folder = Folder::existing(folder).map_err(Failure::message)?;
            let study = folder.study().map_err(Failure::message)?;
            let analysis = Analysis::of(&study, &folder).map_err(Failure::message)?;
            let output = folder.path().join("analysis");
            super::make_folder(&output)?;
            for (name, table) in analysis.tables().map_err(Failure::message)? {
                let path = output.join(name);
                match table.is_empty() {
                    // One of an analysis before.
                    true => drop(std::fs::remove_file(&path)),
                    false => write_atomically(&path, &table).map_err(Failure::doing("write", &path))?,
                }
            }
            show(&Analysed { analysis, output }, *json)
        }
        Command::Remove { folder, participant } => {
            let folder = Folder::existing(folder).map_err(Failure::message)?;
            let removed = folder.remove(participant).map_err(Failure::message)?;
            print(&(removed + "\n"))
        }
    }
}

fn group_of(study: &Checked, name: &str) -> Result<usize, Failure> {
    study.study.groups.find(name).ok_or_else(|| {
        let known: Vec<&str> = study.study.groups.0.iter().map(|(name, _)| name.text.as_str()).collect();
        Failure::Message(format!("the study has no group `{name}`; it has {}", known.join(", ")))
    })
}

/// A study that can run.
#[derive(Serialize)]
struct CheckedStudy {
    groups: Vec<GroupOf>,
    study: PathBuf,
}

#[derive(Serialize)]
struct GroupOf {
    /// Whose number balances the Latin squares.
    balanced_by: Option<usize>,
    group: String,
    people: Option<u32>,
    phases: Vec<PhaseOf>,
    trials: usize,
}

#[derive(Serialize)]
struct PhaseOf {
    kind: &'static str,
    phase: String,
    training: usize,
    trials: usize,
}

fn check(study: &Checked, registry: &Registry, json: bool) -> Result<(), Failure> {
    study.check_graph(registry).map_err(failure)?;
    let groups = (0..study.study.groups.0.len().max(1)).map(|group| {
        let trials = study.study.trials("1", group);
        let of_phase = |number: usize| trials.iter().filter(move |trial| trial.phase == number);
        let phases = study.study.phases.0.iter().enumerate().map(|(number, (name, phase))| PhaseOf {
            kind: phase.kind(),
            phase: name.text.clone(),
            training: of_phase(number).filter(|trial| trial.is_training).count(),
            trials: of_phase(number).filter(|trial| !trial.is_training).count(),
        });
        GroupOf {
            balanced_by: study.study.balanced_by(group),
            group: study.study.group_name(group).to_owned(),
            people: study.study.groups.0.get(group).map(|(_, people)| *people),
            phases: phases.filter(|phase| phase.trials > 0).collect(),
            trials: trials.len(),
        }
    });
    show(&CheckedStudy { groups: groups.collect(), study: study.path.clone() }, json)
}

impl CommandResult for CheckedStudy {
    fn text(&self) -> String {
        let mut text = format!("{} is valid\n", self.study.display());
        for group in &self.groups {
            let people = group.people.map_or_else(String::new, |people| format!(", {people} people"));
            text += &format!("group {}{people}: {} trials each\n", group.group, group.trials);
            for PhaseOf { kind, phase, training, trials } in &group.phases {
                let training = if *training > 0 { format!(", {training} training") } else { String::new() };
                text += &format!("  {phase}: {kind}, {trials} trials{training}\n");
            }
            if let Some(rows) = group.balanced_by {
                let is_balanced = group.people.is_some_and(|people| (people as usize).is_multiple_of(rows));
                let verdict = if is_balanced { "balanced" } else { "not balanced" };
                text += &format!("  Latin squares: {verdict}; {rows} people or a multiple balance them\n");
            }
        }
        text
    }
}

/// The trials of a participant.
#[derive(Serialize)]
struct Plan {
    group: String,
    participant: String,
    trials: Vec<PlannedTrial>,
}

#[derive(Serialize)]
struct PlannedTrial {
    first: String,
    is_swapped: bool,
    is_training: bool,
    level: Option<f64>,
    number: u32,
    phase: String,
    scale: String,
    second: String,
}

impl Plan {
    fn new(study: &Checked, participant: &str, group: usize) -> Self {
        let trials = study.study.trials(participant, group);
        let planned = |trial: &Trial| {
            let row = study.row(trial);
            let name = |of: Option<_>| of.map_or_else(String::new, |of| study.name(of));
            PlannedTrial {
                first: name(trial.first),
                is_swapped: trial.is_swapped,
                is_training: trial.is_training,
                level: trial.level,
                number: trial.number,
                phase: row.phase,
                scale: row.scale,
                second: name(trial.second),
            }
        };
        Self {
            group: study.study.group_name(group).to_owned(),
            participant: participant.to_owned(),
            trials: trials.iter().map(planned).collect(),
        }
    }
}

impl CommandResult for Plan {
    fn text(&self) -> String {
        let row = |trial: &PlannedTrial| {
            let (mut first, mut second) = (trial.first.clone(), trial.second.clone());
            if trial.is_swapped {
                (first, second) = (second, first);
            }
            let level = trial.level.map_or_else(String::new, |level| significant(level, 4));
            let training = if trial.is_training { " (training)" } else { "" };
            let (phase, scale) = (format!("{}{training}", trial.phase), trial.scale.clone());
            vec![trial.number.to_string(), phase, scale, first, second, level]
        };
        let rows: Vec<Vec<String>> = self.trials.iter().map(row).collect();
        let header = ["trial", "phase", "scale or question", "left, first", "right, second", "level"];
        let trials = table(&header, &rows);
        format!("participant {}, group {}\n{trials}", self.participant, self.group)
    }
}

/// What simulated people did.
#[derive(Serialize)]
struct Simulated {
    folder: PathBuf,
    participants: usize,
    /// True everywhere in the folder too.
    simulated: bool,
    trials: usize,
}

fn simulate(
    (study, registry): (&Checked, &Registry),
    (people, motion): (&People, Motion),
    count: Option<u32>,
    output: &Path,
    json: bool,
) -> Result<(), Failure> {
    study.check_graph(registry).and_then(|()| people.check(study)).map_err(failure)?;
    let folder = Folder::open(output, study, true).map_err(Failure::message)?;
    let groups = study.study.groups.0.len().max(1);
    let usual = |group: usize| study.study.groups.0.get(group).map_or(12, |(_, people)| *people);
    let size = |group: usize| count.unwrap_or_else(|| usual(group)) as usize;
    let all: usize = (0..groups).map(size).sum();
    let mut codes = Folder::codes(all);
    let progress = Progress::of("simulating");
    let stop = interrupt::flag()?;
    let (mut trials, mut participants) = (0, 0);
    for group in 0..groups {
        for code in codes.by_ref().take(size(group)) {
            let name = study.study.group_name(group);
            let mut claim = match folder.claim(&code, name, true) {
                Err(DataError::Withdrawn { .. }) => continue,
                claim => claim.map_err(Failure::message)?,
            };
            loop {
                if stop.load(Ordering::Relaxed) {
                    return Err(Failure::Interrupted);
                }
                let done =
                    study.simulate(registry, (&mut claim, group), people, motion, 1).map_err(failure)?;
                trials += done;
                if done == 0 {
                    break;
                }
            }
            participants += 1;
            progress.at(participants as f64 / all as f64);
        }
    }
    drop(progress);
    show(&Simulated { folder: output.to_path_buf(), participants, simulated: true, trials }, json)
}

impl CommandResult for Simulated {
    fn text(&self) -> String {
        format!(
            "simulated {} people: {} trials in {}\n",
            self.participants,
            self.trials,
            self.folder.display()
        )
    }
}

/// The tables of an analysis.
#[derive(Serialize)]
struct Analysed {
    #[serde(flatten)]
    analysis: Analysis,
    output: PathBuf,
}

impl CommandResult for Analysed {
    fn text(&self) -> String {
        let of = &self.analysis;
        let number = |value: f64| significant(value, 3);
        let maybe = |value: Option<f64>| value.map_or_else(String::new, number);
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
                let df = format!(
                    "{}{}",
                    number(row.df),
                    row.residual_df.map_or_else(String::new, |df| format!(", {}", number(df)))
                );
                let names = [
                    row.phase.clone(),
                    row.scale.clone(),
                    row.of.clone(),
                    row.test.to_owned(),
                    row.term.to_owned(),
                ];
                let corrected = maybe(row.p_greenhouse_geisser);
                names.into_iter().chain([df, number(row.f), number(row.p), corrected]).collect()
            });
            let header = ["phase", "scale", "surface", "test", "term", "df", "F or chi2", "p", "p (GG)"];
            text += &format!("\n{}", table(&header, &rows.collect::<Vec<_>>()));
        }
        for row in &of.thresholds {
            let whose = if row.participant.is_empty() { "all" } else { &row.participant };
            let (threshold, low, high) = (number(row.threshold), number(row.low), number(row.high));
            text += &format!(
                "{}, {}: threshold {threshold} ({low} to {high}), {} trials\n",
                row.phase, whose, row.trials
            );
        }
        for row in &of.scree {
            text += &format!(
                "{}: {} dimensions, stress {}, R2 {}\n",
                row.phase,
                row.dimensions,
                number(row.stress),
                number(row.r_squared)
            );
        }
        of.left_out.iter().for_each(|why| text += &format!("not computed: {why}\n"));
        text + &format!("wrote {}\n", self.output.display())
    }
}
