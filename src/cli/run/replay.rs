//! `haptograph run --replay`: repeats a live run from the record of its driver callbacks.

use super::super::Failure;
use super::super::progress::Progress;
use super::summary::Summary;
use super::{Arguments, RunSetup, offline_options, stop_on_interrupt};
use crate::engine::registry::Registry;
use crate::engine::run::{ARRIVALS, Session};
use crate::live::supervisor::replay;
use crate::signal::files;
use serde_json::{Value, json};
use std::path::Path;
use std::time::Instant;

const FACTS: &str = "run.json";

pub(super) fn run(arguments: &Arguments, folder: &Path, registry: &Registry) -> Result<(), Failure> {
    refuse_target(folder, &super::target(arguments))?;
    let graph = arguments.graph.load_and_warn(registry, arguments.seed)?;
    let facts = facts(folder)?;
    let set = arguments.graph.set.iter();
    let set: Vec<String> = set.map(|(name, value)| format!("{name}={value}")).collect();
    for (fact, what, now) in [
        ("seed", "the seed", json!(graph.seed())),
        ("set", "--set", json!(set)),
        ("endpoints", "--endpoints", json!(arguments.graph.endpoints())),
    ] {
        let then = &facts[fact];
        if *then != now {
            return Err(Failure::Message(format!("{what} differs: {then} in that run, {now} now")));
        }
    }
    let bounds = replay::bounds(&graph, &facts).map_err(|why| {
        let path = folder.join(FACTS);
        Failure::Message(format!("{}: {why}; the file is damaged or belongs to another run", path.display()))
    })?;
    let mut setup = RunSetup::begin(arguments, &graph)?;
    let stop = stop_on_interrupt()?;
    let (bar, duration_s) = (Progress::of("running"), facts["seconds"].as_f64().unwrap_or(1.0));
    let start = Instant::now();
    let options = offline_options(arguments, 0.0, &stop);
    let run_folder = &mut setup.completion.folder;
    let outcome = Session::replay(setup.file_sinks, (folder, &bounds), &options, &mut |done_s| {
        // A log that is refused leaves nothing.
        run_folder.begin();
        bar.at(done_s / duration_s)
    });
    let outcome = outcome.map_err(Failure::message)?;
    drop(bar);
    let mut summary = Summary::of(arguments, &graph, &outcome, start.elapsed().as_secs_f64());
    summary.add(vec![("replay", "Repeats", json!(folder.to_string_lossy()))], replay::differences(&facts));
    let sound = setup.completion.complete(arguments, &graph, summary)?;
    arguments.present.play_sound(sound, &stop)
}

/// Refuses a target that is the repeated run or contains it.
fn refuse_target(folder: &Path, target: &Path) -> Result<(), Failure> {
    match (folder.canonicalize(), target.canonicalize()) {
        (Ok(repeated), Ok(replaced)) if repeated.starts_with(&replaced) => Err(Failure::Message(format!(
            "{} holds the run to repeat and would be replaced; give another folder by --out",
            target.display()
        ))),
        // A target that does not exist cannot be overwritten.
        _ => Ok(()),
    }
}

/// The facts of the run to repeat.
fn facts(folder: &Path) -> Result<Value, Failure> {
    let path = folder.join(FACTS);
    let text = files::read_text(&path, files::MAX_REPORT_BYTES).map_err(|error| {
        let why = format!("{error}; give the folder of a live run, with `{ARRIVALS}` in it");
        Failure::file("read", &path, &why)
    })?;
    let path = path.display();
    if text.trim().is_empty() {
        let why = "is empty: a crash or a full disk cut that run short, and it cannot be replayed";
        return Err(Failure::Message(format!("{path} {why}")));
    }
    serde_json::from_str(&text).map_err(|error| Failure::Message(format!("{path}: {error}")))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn a_replay_never_replaces_what_it_repeats() {
        let folder = tempfile::tempdir().unwrap();
        let live = folder.path().join("runs/live");
        fs::create_dir_all(live.join("within")).unwrap();
        for target in [&live, &live.join("within/.."), &folder.path().join("runs")] {
            assert!(refuse_target(&live, target).is_err(), "{}", target.display());
        }
        for target in [live.join("within"), folder.path().join("runs/live-replay")] {
            assert!(refuse_target(&live, &target).is_ok(), "{}", target.display());
        }
    }
}
