//! `haptograph study check`: whether a study can run, how long it takes, and what limits do to its stimuli.

use super::{StudyFile, failure};
use crate::cli::progress::Progress;
use crate::cli::result::{CommandResult, show};
use crate::cli::surface::headroom::{self, Headroom, SECONDS, headroom_of};
use crate::cli::table::significant;
use crate::cli::{Failure, interrupt};
use crate::engine::registry::Registry;
use crate::signal::parallel;
use haptograph_study::check::Checked;
use serde::Serialize;
use std::path::PathBuf;

/// Check a study, its graph with every version, its orders, and how long it takes
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    #[command(flatten)]
    study: StudyFile,
    /// Run every stimulus with simulated hands, and show how often the limits of the actuators act
    #[arg(long)]
    headroom: bool,
    /// Print the result as JSON
    #[arg(long)]
    json: bool,
}

/// A study that can run.
#[derive(Serialize)]
struct CheckedStudy {
    groups: Vec<GroupOf>,
    /// With `--headroom`.
    #[serde(skip_serializing_if = "Option::is_none")]
    headroom: Option<Vec<OfStimulus>>,
    study: PathBuf,
}

#[derive(Serialize)]
struct GroupOf {
    /// Whose number balances the Latin squares.
    balanced_by: Option<usize>,
    group: String,
    /// Of a participant.
    minutes: f64,
    people: Option<u32>,
    phases: Vec<PhaseOf>,
    trials: usize,
}

#[derive(Serialize)]
struct PhaseOf {
    kind: &'static str,
    /// Surfaces without what is presented of others.
    lacking: Vec<String>,
    phase: String,
    training: usize,
    trials: usize,
}

/// What limits do to a stimulus.
#[derive(Serialize)]
struct OfStimulus {
    actuators: Vec<Headroom>,
    /// Surface and version, and the level of a varied parameter.
    stimulus: String,
}

pub(super) fn run(arguments: &Arguments, registry: &Registry) -> Result<(), Failure> {
    let study = arguments.study.load()?;
    study.check_graph(registry).map_err(failure)?;
    let groups = (0..study.study.group_count()).map(|group| {
        let trials = study.study.trials("1", group);
        let of_phase = |number: usize| trials.iter().filter(move |trial| trial.phase == number);
        let phases = study.study.phases.0.iter().enumerate().map(|(number, (name, phase))| PhaseOf {
            kind: phase.kind(),
            lacking: study.study.lacking(phase).into_iter().map(str::to_owned).collect(),
            phase: name.text.clone(),
            training: of_phase(number).filter(|trial| trial.is_training).count(),
            trials: of_phase(number).filter(|trial| !trial.is_training).count(),
        });
        GroupOf {
            balanced_by: study.study.balanced_by(group),
            group: study.study.group_name(group).to_owned(),
            minutes: study.study.duration_s(&trials) / 60.0,
            people: study.study.groups.0.get(group).map(|(_, people)| *people),
            phases: phases.filter(|phase| phase.trials > 0).collect(),
            trials: trials.len(),
        }
    });
    let groups = groups.collect();
    let headroom = arguments.headroom.then(|| headroom(&study, registry)).transpose()?;
    show(&CheckedStudy { groups, headroom, study: study.path.clone() }, arguments.json)
}

/// Runs every stimulus that the study renders, with simulated hands.
fn headroom(study: &Checked, registry: &Registry) -> Result<Vec<OfStimulus>, Failure> {
    let mut study = study.clone();
    "simulated".clone_into(&mut study.study.endpoints);
    let (stop, progress) = (interrupt::flag()?, Progress::of("running"));
    let stimuli = study.rendered();
    parallel::try_map(parallel::cores(), stimuli, &|part| progress.at(part), |(phase, stimulus, level)| {
        let phase = &study.study.phases.0[phase].1;
        let graph =
            study.graph(registry, phase, (Some(stimulus), level), study.study.seed).map_err(failure)?;
        let level = level.map_or_else(String::new, |level| format!(", {}", significant(level, 4)));
        let stimulus = study.name(stimulus) + &level;
        Ok(OfStimulus { actuators: headroom_of(&graph, SECONDS, &stop)?, stimulus })
    })
}

impl CommandResult for CheckedStudy {
    fn text(&self) -> String {
        let mut text = format!("{} is valid\n", self.study.display());
        for group in &self.groups {
            let people = group.people.map_or_else(String::new, |people| format!(", {people} people"));
            let minutes = significant(group.minutes, 2);
            text += &format!(
                "group {}{people}: {} trials each, about {minutes} minutes\n",
                group.group, group.trials
            );
            for PhaseOf { kind, lacking, phase, training, trials } in &group.phases {
                let training = if *training > 0 { format!(", {training} training") } else { String::new() };
                let most = if *kind == "staircase" { "at most " } else { "" };
                text += &format!("  {phase}: {kind}, {most}{trials} trials{training}\n");
                if !lacking.is_empty() {
                    let names = lacking.join(", ");
                    text += &format!("    without a `sample` or a `file` that others have: {names}\n");
                }
            }
            if let Some(rows) = group.balanced_by {
                let verdict = match group.people {
                    None => "balanced by",
                    Some(people) if (people as usize).is_multiple_of(rows) => "balanced:",
                    Some(_) => "not balanced:",
                };
                text += &format!("  Latin squares: {verdict} {rows} people or a multiple\n");
            }
        }
        if let Some(stimuli) = &self.headroom {
            let runs = stimuli.iter().map(|of| (of.stimulus.clone(), &*of.actuators));
            text += &headroom::text_of("stimulus", SECONDS, runs);
        }
        text
    }
}
