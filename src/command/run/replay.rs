//! `haptograph run --replay`: a live run again, as its drivers saw it then.

use super::super::Failure;
use super::summary::Summary;
use super::{Arguments, Making, message, progress_bar, stop_on_interrupt};
use haptograph::engine::run::{ARRIVALS, Offline};
use serde_json::{Value, json};
use std::fs;
use std::path::Path;
use std::time::Instant;

const FACTS: &str = "run.json";

pub fn run(arguments: &Arguments, folder: &Path) -> Result<(), Failure> {
    spare(folder, &super::target(arguments))?;
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

/// Refuses to put the new run in the place of the one that it repeats, or of a folder which that is in.
fn spare(folder: &Path, target: &Path) -> Result<(), Failure> {
    match (folder.canonicalize(), target.canonicalize()) {
        (Ok(repeated), Ok(replaced)) if repeated.starts_with(&replaced) => Err(Failure::Message(format!(
            "{} holds the run that is to be repeated, and would be replaced; give another folder by --out",
            target.display()
        ))),
        // What is not there cannot be lost.
        _ => Ok(()),
    }
}

/// Why the samples cannot be those of the run.
fn differs(facts: &Value) -> Vec<String> {
    let count = |fact: &str| facts[fact].as_u64().unwrap_or(0);
    let mut list = Vec::new();
    let set = set_by_hand(&facts["set_while_running"]);
    if !set.is_empty() {
        list.push(format!(
            "settings changed while it ran are not repeated: {}",
            set.join(", ")
        ));
    }
    let changes = count("changes");
    if changes > 0 {
        list.push(format!(
            "another version of the graph took over while it ran, times: {changes}; that is not repeated"
        ));
    }
    if count("vanished") > 0 {
        list.push(
            "the soundcard was gone for a while in that run; how its outputs rose again is not repeated"
                .to_owned(),
        );
    }
    list
}

/// What was set while a run ran, as much as fits in a sentence.
fn set_by_hand(list: &Value) -> Vec<String> {
    const SHOWN: usize = 8;
    let set: Vec<&str> = list
        .as_array()
        .into_iter()
        .flatten()
        .filter_map(Value::as_str)
        .collect();
    let mut shown: Vec<String> = set.iter().take(SHOWN).map(|set| (*set).to_owned()).collect();
    if set.len() > SHOWN {
        shown.push(format!("and more, all of them in its {FACTS}"));
    }
    shown
}

/// The facts of the run that is to be repeated.
fn facts(folder: &Path) -> Result<Value, Failure> {
    let path = folder.join(FACTS);
    let text = fs::read_to_string(&path).map_err(|error| {
        Failure::Message(format!(
            "cannot read {}: {error}; give the folder of a live run, with `{ARRIVALS}` in it",
            path.display()
        ))
    })?;
    serde_json::from_str(&text).map_err(|error| Failure::Message(format!("{}: {error}", path.display())))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_replay_names_what_was_changed_by_hand() {
        let untouched = json!({"set_while_running": [], "changes": 0, "vanished": 0});
        assert_eq!(differs(&untouched), Vec::<String>::new());
        let touched =
            json!({"set_while_running": ["0.10 s out.gain=0.3 (OSC)"], "changes": 2, "vanished": 1});
        let told = differs(&touched);
        assert_eq!(
            told[0],
            "settings changed while it ran are not repeated: 0.10 s out.gain=0.3 (OSC)"
        );
        assert!(
            told[1].contains("times: 2") && told[2].contains("soundcard"),
            "{told:?}"
        );
        let fader: Vec<String> = (0..50).map(|i| format!("{i} s out.gain={i} (OSC)")).collect();
        let told = differs(&json!({"set_while_running": fader}));
        assert!(
            told[0].ends_with("7 s out.gain=7 (OSC), and more, all of them in its run.json"),
            "{told:?}"
        );
    }

    #[test]
    fn a_replay_never_replaces_what_it_repeats() {
        let folder = tempfile::tempdir().unwrap();
        let live = folder.path().join("runs/live");
        fs::create_dir_all(live.join("within")).unwrap();
        for target in [&live, &live.join("within/.."), &folder.path().join("runs")] {
            assert!(spare(&live, target).is_err(), "{}", target.display());
        }
        for target in [live.join("within"), folder.path().join("runs/live-replay")] {
            assert!(spare(&live, &target).is_ok(), "{}", target.display());
        }
    }
}
