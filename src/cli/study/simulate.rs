//! `haptograph study simulate`: people who do not exist, in one study whose data are kept, or in many for the power of its tests.

use super::{StudyFile, failure};
use crate::cli::progress::Progress;
use crate::cli::result::{CommandResult, show};
use crate::cli::table::table;
use crate::cli::{Failure, interrupt};
use crate::engine::registry::Registry;
use haptograph_study::check::Checked;
use haptograph_study::data::{DataError, Folder, Status};
use haptograph_study::people::{People, codes};
use haptograph_study::power::EffectPower;
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;

/// Run a study with people who do not exist
///
/// The graph runs with its simulated hands, so that the conditions of a trial and its measures are real; the answers are those of
/// people of known parameters. A repeated run goes on where it ended.
///
/// With --repeat, or with several numbers of people, whole studies are simulated in memory instead, without motion, and the power of
/// each test is printed: the share of studies in which it has p < 0.05, with its 95 % interval; of thresholds the share in which that of
/// all people together is near theirs.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    #[command(flatten)]
    study: StudyFile,
    /// Number of people in each group; default: as the study says, or 12. Several numbers are compared by the power of the tests
    #[arg(long, value_name = "N,...", value_delimiter = ',', value_parser = clap::value_parser!(u32).range(1..=10_000))]
    people: Vec<u32>,
    /// Number of simulated studies for each number of people; default with several numbers: 500
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100_000))]
    repeat: Option<u32>,
    /// A file `People(...)` with their parameters; default: people without a preference
    #[arg(long, value_name = "PEOPLE.ron")]
    model: Option<PathBuf>,
    /// Longest trial, s: conditions that are not reached by then are forced
    #[arg(long, value_name = "SECONDS", default_value_t = 180.0, value_parser = crate::cli::run::seconds)]
    longest: f64,
    /// Run no graph: answers alone
    #[arg(long)]
    without_motion: bool,
    /// The folder to write; default: `out/STUDY-simulated`
    #[arg(short, long, value_name = "DIR", conflicts_with = "repeat")]
    output: Option<PathBuf>,
    /// Print the result as JSON
    #[arg(long)]
    json: bool,
}

/// Number of studies for the power of a test.
const REPEAT: u32 = 500;

pub(super) fn run(arguments: &Arguments, registry: &Registry) -> Result<(), Failure> {
    let study = arguments.study.load()?;
    let model = match &arguments.model {
        None => People::indifferent(),
        Some(path) => People::load(path, &study).map_err(failure)?,
    };
    let counts = match &*arguments.people {
        [] => vec![None],
        some => some.iter().copied().map(Some).collect(),
    };
    let sizes: Vec<Vec<usize>> = counts.into_iter().map(|count| sizes(&study, count)).collect();
    match (&*sizes, arguments.repeat) {
        ([sizes], None) => simulate((&study, registry), &model, sizes, arguments),
        _ if arguments.output.is_some() => Err(Failure::Message(
            "several numbers of people are simulated in memory; leave out --output".to_owned(),
        )),
        (sizes, repeat) => power(&study, &model, (sizes, repeat.unwrap_or(REPEAT)), arguments.json),
    }
}

/// Number of people in each group.
fn sizes(study: &Checked, count: Option<u32>) -> Vec<usize> {
    let usual = |group: usize| study.study.groups.0.get(group).map_or(12, |(_, people)| *people);
    (0..study.study.group_count()).map(|group| count.unwrap_or_else(|| usual(group)) as usize).collect()
}

/// What simulated people did.
#[derive(Serialize)]
struct Simulated {
    folder: PathBuf,
    /// Trials whose conditions were not reached.
    forced: usize,
    participants: usize,
    /// True everywhere in the folder too.
    simulated: bool,
    trials: usize,
}

fn simulate(
    (study, registry): (&Checked, &Registry),
    people: &People,
    sizes: &[usize],
    arguments: &Arguments,
) -> Result<(), Failure> {
    study.check_graph(registry).map_err(failure)?;
    let longest_s = (!arguments.without_motion).then_some(arguments.longest);
    let output = arguments.output.clone().unwrap_or_else(|| {
        let name = arguments.study.study.file_stem().unwrap_or_default().to_string_lossy();
        Path::new("out").join(format!("{name}-simulated"))
    });
    let folder =
        Folder::open(&output, &study.identity(Some(people.parameters()))).map_err(Failure::message)?;
    let all: usize = sizes.iter().sum();
    let mut codes = codes(all);
    let progress = Progress::of("simulating");
    let stop = interrupt::flag()?;
    let (mut trials, mut participants, mut forced) = (0, 0, 0);
    for (group, size) in sizes.iter().enumerate() {
        for code in codes.by_ref().take(*size) {
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
                    study.simulate(registry, (&mut claim, group), people, longest_s, 1).map_err(failure)?;
                trials += done;
                if done == 0 {
                    break;
                }
            }
            participants += 1;
            forced += claim.rows().iter().filter(|row| row.status == Status::Forced).count();
            progress.at(participants as f64 / all as f64);
        }
    }
    drop(progress);
    let done = Simulated { forced, folder: output, participants, simulated: true, trials };
    show(&done, arguments.json)
}

impl CommandResult for Simulated {
    fn text(&self) -> String {
        let folder = self.folder.display();
        let forced = match self.forced {
            0 => String::new(),
            forced => format!("{forced} trials did not reach their conditions and are marked `forced`\n"),
        };
        match self.trials {
            0 => format!("nothing was left to simulate in {folder}\n{forced}"),
            trials => {
                format!("simulated {} people: {trials} trials in {folder}\n{forced}", self.participants)
            }
        }
    }
}

/// The power of a study's tests.
#[derive(Serialize)]
struct Power {
    effects: Vec<EffectPower>,
    /// Of all groups, for each share of an effect.
    people: Vec<usize>,
    repeat: u32,
    simulated: bool,
}

fn power(
    study: &Checked,
    people: &People,
    (sizes, repeat): (&[Vec<usize>], u32),
    json: bool,
) -> Result<(), Failure> {
    let (stop, progress) = (interrupt::flag()?, Progress::of("simulating"));
    let found = study.power(people, (sizes, repeat as usize), &|part| progress.at(part), &stop);
    drop(progress);
    if stop.load(Ordering::Relaxed) {
        return Err(Failure::Interrupted);
    }
    let people = sizes.iter().map(|sizes| sizes.iter().sum()).collect();
    show(&Power { effects: found.map_err(failure)?, people, repeat, simulated: true }, json)
}

impl CommandResult for Power {
    fn text(&self) -> String {
        let of_people = self.people.iter().map(|people| format!("{people} people"));
        let header = ["phase", "scale, surface or pair", "test", "term"].map(str::to_owned).into_iter();
        let header: Vec<String> = header.chain(of_people).collect();
        let row = |effect: &EffectPower| {
            let names = [&effect.phase, &effect.of, &effect.test, &effect.term].map(Clone::clone);
            let shares = effect.shares.iter();
            let shares = shares.map(|of| format!("{:.3} ({:.3} to {:.3})", of.share, of.low, of.high));
            names.into_iter().chain(shares).collect()
        };
        let rows: Vec<Vec<String>> = self.effects.iter().map(row).collect();
        let header: Vec<&str> = header.iter().map(String::as_str).collect();
        let note = "simulated studies with p < 0.05, or a threshold so near, with 95 % intervals; repeated measures by Greenhouse and Geisser";
        format!("share of {} {note}\n{}", self.repeat, table(&header, &rows))
    }
}
