//! `haptograph run --replay`: a live run again, as its drivers saw it then.

use super::super::Failure;
use super::summary::Summary;
use super::{Arguments, Making, message, progress_bar, stop_on_interrupt};
use haptograph::engine::run::{ARRIVALS, Offline};
use serde_json::{Value, json};
use std::fs;
use std::path::Path;
use std::time::Instant;

pub fn run(arguments: &Arguments, folder: &Path) -> Result<(), Failure> {
    let graph = arguments.graph.load_and_warn(arguments.seed)?;
    if let [_] = graph.drivers()[..] {
        return Err(Failure::Message(
            "a graph with one driver needs no replay: run it offline, and the samples are those of the live run".to_owned(),
        ));
    }
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
            return Err(Failure::Message(format!(
                "that run had another value of {what}: {then}, and not {now}"
            )));
        }
    }
    let made = Making::begin(arguments, &graph)?;
    let stop = stop_on_interrupt()?;
    let bar = progress_bar(facts["seconds"].as_f64().unwrap_or(1.0));
    let start = Instant::now();
    let offline = Offline::new(made.outlets, usize::from(arguments.block));
    let outcome = offline.replay(folder, &stop, &mut |done_s| {
        bar.set_position((done_s * 1e3) as u64)
    });
    let outcome = outcome.map_err(message)?;
    bar.finish_and_clear();
    let mut summary = Summary::of(arguments, &graph, &outcome, start.elapsed().as_secs_f64());
    summary.add(vec![("replay", "Repeats", json!(folder))], differs(&facts));
    made.kept.complete(arguments, &graph, &summary)
}

/// Why the samples cannot be those of the run.
fn differs(facts: &Value) -> Vec<String> {
    let set = facts["set_while_running"]
        .as_array()
        .is_some_and(|list| !list.is_empty());
    let changed = facts["changes"].as_u64().is_some_and(|changes| changes > 0);
    let gone = facts["vanished"].as_u64().is_some_and(|times| times > 0);
    let mut list = Vec::new();
    if set || changed {
        list.push("settings were changed while that run ran; that is not repeated".to_owned());
    }
    if gone {
        list.push(
            "the soundcard was gone for a while in that run; how its outputs rose again is not repeated"
                .to_owned(),
        );
    }
    list
}

/// The facts of the run that is to be repeated.
fn facts(folder: &Path) -> Result<Value, Failure> {
    let path = folder.join("run.json");
    let text = fs::read_to_string(&path).map_err(|error| {
        Failure::Message(format!(
            "cannot read {}: {error}; give the folder of a live run, with `{ARRIVALS}` in it",
            path.display()
        ))
    })?;
    serde_json::from_str(&text).map_err(|error| Failure::Message(format!("{}: {error}", path.display())))
}
