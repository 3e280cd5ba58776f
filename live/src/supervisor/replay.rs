//! Bounds of a replay of a live run, and reasons why it can differ from the run.

use haptograph_engine::graph::Graph;
use haptograph_engine::run::ReplayBounds;
use serde_json::{Value, json};

/// Maximum duration of a run, s, and the tolerance between its drivers' time and the wall clock: relative,
/// and absolute in s.
const MAX_S: f64 = 1e7;
const CLOCKS_DIFFER: f64 = 0.01;
const SPARE_S: f64 = 1.0;

/// The clocks of a graph, as the facts of a run name them.
pub(super) fn clocks(graph: &Graph) -> Vec<String> {
    let clocks = graph.clocks().iter();
    let clock = clocks.map(|clock| format!("{} {}", clock.name, clock.rate));
    clock.collect()
}

/// Bounds of a replay from the facts of the run, if these are consistent with each other and with the graph. The facts are
/// those of `run.json`, or a [`RunReport`](super::RunReport) that is serialised.
///
/// # Errors
/// A description of the inconsistency.
pub fn bounds(graph: &Graph, facts: &Value) -> Result<ReplayBounds, String> {
    if facts["live"] != true {
        return Err("it does not describe a live run".to_owned());
    }
    let clocks = clocks(graph);
    if facts["clocks"] != json!(clocks) {
        let (then, now) = (&facts["clocks"], json!(clocks));
        return Err(format!("`clocks` is {then}, the clocks of the graph are {now}"));
    }
    let time = |name: &str| {
        let time_s = facts[name].as_f64().filter(|time_s| (0.0..=MAX_S).contains(time_s));
        time_s.ok_or_else(|| format!("`{name}` is {}; it must be from 0 to {MAX_S} s", facts[name]))
    };
    let (seconds, took_s) = (time("seconds")?, time("took_s")?);
    let longest_s = took_s * (1.0 + CLOCKS_DIFFER) + SPARE_S;
    if seconds > longest_s {
        return Err(format!("`seconds` is {seconds}, more than `took_s`, {took_s}"));
    }
    let driver = graph.drivers().first().map(|driver| graph.clocks()[*driver].rate.hz());
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
    let mut bounds = ReplayBounds::new(longest_s);
    bounds.frames = Some((frames, is_whole));
    Ok(bounds)
}

/// Reasons why the samples differ from those of the run, or end early.
pub fn differences(facts: &Value) -> Vec<String> {
    let mut list = Vec::new();
    let swaps = facts["swaps"].as_u64().unwrap_or(0);
    if swaps > 0 {
        let times = if swaps == 1 { "once".to_owned() } else { format!("{swaps} times") };
        list.push(format!(
            "the graph was swapped {times} during that run; the replay ends at the first swap"
        ));
    }
    list
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptograph_engine::document::Document;
    use haptograph_engine::graph::{CheckOptions, check};

    #[test]
    fn a_replay_names_what_it_does_not_repeat() {
        let quiet = json!({"set_while_running": ["0.10 s out.gain=0.3 (OSC)"], "changes": 1, "swaps": 0, "vanished": 0});
        assert_eq!(differences(&quiet), Vec::<String>::new());
        let differences = differences(&json!({"swaps": 2, "vanished": 1}));
        assert!(differences.len() == 1 && differences[0].contains("2 times"), "{differences:?}");
    }

    #[test]
    fn facts_that_do_not_go_together_are_refused() {
        let text = r#"Graph(format: 1, clocks: { "servo": Driver(rate_hz: 125) },
            nodes: { "one": Constant(clock: "servo", value: 1, quantity: "number") })"#;
        let document = Document::parse("g.ron", text).unwrap();
        let registry = haptograph_nodes::registry();
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
        for (name, value) in [("swaps", json!(1)), ("lost_callbacks", json!(7)), ("panics", json!(["x"]))] {
            assert_eq!(with(name, value).unwrap().frames, Some((250, false)), "{name}");
        }
    }
}
