//! `haptograph run --replay`: repeats a live run from the record of its driver callbacks.

use super::super::Failure;
use super::folder::MAX_FACTS_BYTES;
use super::summary::Summary;
use super::{Arguments, RunSetup, message, progress_bar, stop_on_interrupt};
use crate::engine::graph::Graph;
use crate::engine::registry::Registry;
use crate::engine::run::{ARRIVALS, Offline, ReplayBounds};
use crate::signal::files;
use serde_json::{Value, json};
use std::path::Path;
use std::time::Instant;

const FACTS: &str = "run.json";

pub fn run(arguments: &Arguments, folder: &Path, registry: &Registry) -> Result<(), Failure> {
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
            return Err(Failure::Message(format!(
                "{what} differs: {then} in that run, {now} now"
            )));
        }
    }
    let bounds = bounds(&graph, &facts).map_err(|why| {
        let path = folder.join(FACTS);
        Failure::Message(format!(
            "{}: {why}; the file is damaged or belongs to another run",
            path.display()
        ))
    })?;
    let mut setup = RunSetup::begin(arguments, &graph)?;
    let stop = stop_on_interrupt()?;
    setup.completion.folder.begin();
    let bar = progress_bar(facts["seconds"].as_f64().unwrap_or(1.0));
    let start = Instant::now();
    let offline = Offline::new(setup.file_sinks, usize::from(arguments.block));
    let outcome = offline.replay((folder, &bounds), &stop, &mut |done_s| {
        bar.set_position((done_s * 1e3) as u64)
    });
    let outcome = outcome.map_err(message)?;
    bar.finish_and_clear();
    let mut summary = Summary::of(arguments, &graph, &outcome, start.elapsed().as_secs_f64());
    summary.add(
        vec![("replay", "Repeats", json!(folder.to_string_lossy()))],
        differs(&facts),
    );
    let sound = setup.completion.complete(arguments, &graph, &summary)?;
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

/// Maximum duration of a run, s, and the tolerance between its drivers' time and the wall clock: relative,
/// and absolute in s.
const MAX_S: f64 = 1e7;
const CLOCKS_DIFFER: f64 = 0.01;
const SPARE_S: f64 = 1.0;

/// Bounds of a replay from the facts of the run, if these are consistent with each other and with the graph.
fn bounds(graph: &Graph, facts: &Value) -> Result<ReplayBounds, String> {
    if facts["live"] != true {
        return Err("it does not describe a live run".to_owned());
    }
    let clocks: Vec<String> = { graph.clocks().iter() }
        .map(|clock| format!("{} {}", clock.name, clock.rate))
        .collect();
    if facts["clocks"] != json!(clocks) {
        let (then, now) = (&facts["clocks"], json!(clocks));
        return Err(format!("`clocks` is {then}, the clocks of the graph are {now}"));
    }
    let time = |name: &str| {
        let time_s = facts[name]
            .as_f64()
            .filter(|time_s| (0.0..=MAX_S).contains(time_s));
        time_s.ok_or_else(|| format!("`{name}` is {}, which is not a possible duration", facts[name]))
    };
    let (seconds, took_s) = (time("seconds")?, time("took_s")?);
    let longest_s = took_s * (1.0 + CLOCKS_DIFFER) + SPARE_S;
    if seconds > longest_s {
        return Err(format!("`seconds` is {seconds}, more than `took_s`, {took_s}"));
    }
    let driver = graph
        .drivers()
        .first()
        .map(|driver| graph.clocks()[*driver].rate.hz());
    let rate_hz = driver.unwrap_or(1.0);
    let frames = facts["driver_frames"].as_u64();
    let is_right = |frames: &u64| (*frames as f64 - seconds * rate_hz).abs() <= 0.5 + 1e-9 * *frames as f64;
    let frames = frames.filter(is_right).ok_or_else(|| {
        let frames = &facts["driver_frames"];
        format!("`driver_frames` is {frames}, inconsistent with {seconds} s at {rate_hz} Hz")
    })?;
    let none = |name: &str| facts[name] == 0;
    // Earlier versions called panics `faults`.
    let panics = facts.get("panics").or_else(|| facts.get("faults"));
    let is_whole = none("swaps") && none("lost_callbacks") && panics == Some(&json!([]));
    Ok(ReplayBounds {
        longest_s,
        frames: Some((frames, is_whole)),
    })
}

/// Reasons why the samples differ from those of the run, or end early.
fn differs(facts: &Value) -> Vec<String> {
    let count = |fact: &str| facts[fact].as_u64().unwrap_or(0);
    let mut list = Vec::new();
    let swaps = count("swaps");
    if swaps > 0 {
        let times = if swaps == 1 {
            "once".to_owned()
        } else {
            format!("{swaps} times")
        };
        list.push(format!(
            "the graph was swapped {times} during that run; the replay ends at the first swap"
        ));
    }
    if count("vanished") > 0 {
        list.push(
            "the soundcard was lost for a while in that run; the fade-in after its return is not repeated"
                .to_owned(),
        );
    }
    list
}

/// The facts of the run to repeat.
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
    use crate::engine::document::Document;
    use crate::engine::graph::{CheckOptions, check};
    use std::fs;

    #[test]
    fn a_replay_names_what_it_does_not_repeat() {
        let quiet = json!({"set_while_running": ["0.10 s out.gain=0.3 (OSC)"], "changes": 1, "swaps": 0, "vanished": 0});
        assert_eq!(differs(&quiet), Vec::<String>::new());
        let told = differs(&json!({"swaps": 2, "vanished": 1}));
        assert!(
            told[0].contains("swapped 2 times") && told[1].contains("soundcard"),
            "{told:?}"
        );
    }

    #[test]
    fn facts_that_do_not_go_together_are_refused() {
        let text = r#"Graph(format: 1, clocks: { "servo": Driver(rate_hz: 125) },
            nodes: { "one": Constant(clock: "servo", value: 1, quantity: "number") })"#;
        let document = Document::parse("g.ron", text).unwrap();
        let registry = crate::nodes::registry();
        let graph = check(&document, &registry, &CheckOptions::default()).unwrap();
        let whole = json!({
            "live": true, "clocks": ["servo 125 Hz"], "seconds": 2.0, "took_s": 2.1, "driver_frames": 250, "swaps": 0,
            "lost_callbacks": 0, "panics": [],
        });
        let is = bounds(&graph, &whole).unwrap();
        assert_eq!(is.frames, Some((250, true)));
        assert!((2.1..5.0).contains(&is.longest_s), "{is:?}");
        let with = |name: &str, value: Value| {
            let mut facts = whole.clone();
            facts[name] = value;
            bounds(&graph, &facts)
        };
        for (name, value) in [
            ("live", json!(false)),
            ("clocks", json!(["servo 126 Hz"])),
            ("clocks", json!("servo")),
            ("seconds", json!(-1)),
            ("seconds", json!(1e300)),
            ("seconds", json!("2")),
            ("seconds", json!(3.0)),
            ("took_s", json!(0.0)),
            ("took_s", json!(null)),
            ("took_s", json!(1e18)),
            ("driver_frames", json!(251)),
            ("driver_frames", json!(2.5)),
            ("driver_frames", json!(u64::MAX)),
        ] {
            assert!(with(name, value.clone()).is_err(), "{name}: {value}");
        }
        for (name, value) in [
            ("swaps", json!(1)),
            ("lost_callbacks", json!(7)),
            ("panics", json!(["x"])),
        ] {
            assert_eq!(with(name, value).unwrap().frames, Some((250, false)), "{name}");
        }
    }

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
