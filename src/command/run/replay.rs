//! `haptograph run --replay`: a live run again, as its drivers saw it then.

use super::super::Failure;
use super::folder::MAX_FACTS_BYTES;
use super::summary::Summary;
use super::{Arguments, Making, message, progress_bar, stop_on_interrupt};
use haptograph::engine::graph::{Graph, GraphDevice};
use haptograph::engine::run::{ARRIVALS, Offline};
use haptograph::signal::files;
use serde_json::{Value, json};
use std::path::Path;
use std::time::Instant;

const FACTS: &str = "run.json";

pub fn run(arguments: &Arguments, folder: &Path) -> Result<(), Failure> {
    spare(folder, &super::target(arguments))?;
    let graph = arguments.graph.load_and_warn(arguments.seed)?;
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
    let mut made = Making::begin(arguments, &graph)?;
    let stop = stop_on_interrupt()?;
    made.kept.folder.begin();
    let bar = progress_bar(facts["seconds"].as_f64().unwrap_or(1.0));
    let start = Instant::now();
    let offline = Offline::new(made.outlets, usize::from(arguments.block));
    let outcome = offline.replay(folder, &stop, &mut |done_s| {
        bar.set_position((done_s * 1e3) as u64)
    });
    let outcome = outcome.map_err(message)?;
    bar.finish_and_clear();
    let mut summary = Summary::of(arguments, &graph, &outcome, start.elapsed().as_secs_f64());
    summary.add(
        vec![("replay", "Repeats", json!(folder.to_string_lossy()))],
        differs(&graph, &facts),
    );
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

/// Why the samples cannot be those of the run, or end before it.
fn differs(graph: &Graph, facts: &Value) -> Vec<String> {
    let count = |fact: &str| facts[fact].as_u64().unwrap_or(0);
    let senses = |device: &&GraphDevice| {
        let spec = device.entry.spec;
        !spec.simulated && !spec.senses.is_empty()
    };
    let real = graph.devices().iter().filter(senses);
    let mut list: Vec<String> = real
        .map(|device| {
            format!(
                "what `{}` sensed is not repeated, as it is not simulated: the actuators that depend on it stayed at zero",
                device.name
            )
        })
        .collect();
    let swaps = count("swaps");
    if swaps > 0 {
        list.push(format!(
            "another version of the graph took over while it ran, times: {swaps}; the replay ends where the first did"
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

/// The facts of the run that is to be repeated.
fn facts(folder: &Path) -> Result<Value, Failure> {
    let path = folder.join(FACTS);
    let text = files::read_text(&path, MAX_FACTS_BYTES).map_err(|error| {
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
    use haptograph::engine::document::Document;
    use haptograph::engine::graph::{CheckOptions, check};
    use std::fs;

    #[test]
    fn a_replay_names_what_it_does_not_repeat() {
        let told = |stylus: &str, facts: Value| {
            let text = format!(
                r#"Graph(format: 1, clocks: {{ "servo": Driver(rate_hz: 125) }},
                nodes: {{ "stylus": Tablet(clock: "servo", endpoint: "stylus") }},
                endpoints: {{ "simulated": {{ "stylus": {stylus} }} }})"#
            );
            let document = Document::parse("g.ron", &text).unwrap();
            let graph = check(
                &document,
                &haptograph::nodes::registry(),
                &CheckOptions::default(),
            )
            .unwrap();
            differs(&graph, &facts)
        };
        let hand = "SimulatedTablet(stroke: Circles(radius_mm: 30, period_s: 1))";
        let quiet = json!({"set_while_running": ["0.10 s out.gain=0.3 (OSC)"], "changes": 1, "swaps": 0, "vanished": 0});
        assert_eq!(told(hand, quiet), Vec::<String>::new());
        let real = "EvdevDevice(path: \"/dev/input/event0\", counts_per_mm: 40)";
        let told = told(real, json!({"swaps": 2, "vanished": 1}));
        assert!(
            told[0].contains("`stylus`") && told[1].contains("times: 2") && told[2].contains("soundcard"),
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
