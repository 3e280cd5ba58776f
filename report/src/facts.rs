//! The facts and warnings of a run, for `run.json` and its page.

use super::headlines::Headline;
use super::scale::plain as rounded;
use haptograph_engine::graph::Graph;
use haptograph_engine::limiter::ClipCounts;
use haptograph_engine::node::AfterData;
use haptograph_engine::run::{ActuatorReport, Outcome, RingReport};
use haptograph_nodes::sinks::plots::GROUP as PLOTS;
use serde_json::{Map, Value, json};
use std::path::{Path, PathBuf};

/// Name of the file with the facts, in the folder of a run.
pub const FILE: &str = "run.json";

/// Key of the fact that the headlines of a page already state.
const LIMITS: &str = "limits";

/// A fact: key in `run.json`, name on the page, value.
pub type Fact = (&'static str, &'static str, Value);

/// The facts and the warnings of a run.
#[derive(Debug, Clone)]
pub struct Facts {
    facts: Vec<Fact>,
    /// One sentence each.
    pub warnings: Vec<String>,
}

impl Facts {
    /// Facts of a run of the graph in the file at `path`, with the parameters `set` and this set of
    /// endpoints.
    pub fn of<'s>(
        graph: &Graph,
        outcome: &Outcome,
        path: &Path,
        set: impl Iterator<Item = (&'s str, &'s str)>,
        endpoints: &str,
    ) -> Self {
        let mut files: Vec<&PathBuf> = graph.nodes().iter().flat_map(|node| &node.files).collect();
        files.sort();
        files.dedup();
        let files: Vec<_> = files.iter().map(|path| path.to_string_lossy()).collect();
        let clocks = graph.clocks().iter();
        let clocks: Vec<_> = clocks.map(|clock| format!("{} {}", clock.name, clock.rate)).collect();
        let set: Vec<_> = set.map(|(name, value)| format!("{name}={value}")).collect();
        let mut facts = vec![
            ("graph", "Graph", json!(path.to_string_lossy())),
            ("set", "Set", json!(set)),
            ("endpoints", "Endpoints", json!(endpoints)),
            ("seed", "Seed", json!(graph.seed())),
            ("files", "Files read", json!(files)),
            ("clocks", "Clocks", json!(clocks)),
            ("nodes", "Nodes", json!(graph.nodes().len())),
            ("seconds", "Seconds", json!(outcome.seconds)),
            ("driver_frames", "Driver frames", json!(outcome.driver_frames)),
            ("stopped", "Stopped early", json!(outcome.stopped)),
            ("faults", "NaN or infinity at actuators", faults(outcome)),
            (LIMITS, "Limits that reduced a signal", limits_that_struck(outcome)),
            ("haptograph", "haptograph", json!(env!("CARGO_PKG_VERSION"))),
        ];
        if !outcome.rings.is_empty() {
            let rings: Map<String, Value> = outcome.rings.iter().map(ring).collect();
            facts.push(("rings", "Rings", Value::Object(rings)));
        }
        let scripts = graph.scripted_nodes();
        let scripts: Vec<_> =
            scripts.map(|node| format!("{} ({})", node.path, node.entry.spec.name)).collect();
        if !scripts.is_empty() {
            facts.push(("scripts", "Slow nodes (scripts)", json!(scripts)));
        }
        let warnings = warnings(outcome).into_iter().chain(ended_data(graph, outcome));
        Self { facts, warnings: warnings.collect() }
    }

    /// Adds facts; a fact replaces an earlier one with the same key.
    pub fn extend(&mut self, facts: impl IntoIterator<Item = Fact>) {
        let facts: Vec<Fact> = facts.into_iter().collect();
        self.facts.retain(|(key, ..)| facts.iter().all(|(new, ..)| new != key));
        self.facts.extend(facts);
    }

    /// The text of `run.json`.
    pub fn to_json(&self) -> String {
        let facts = self.facts.iter();
        let mut object: Map<String, Value> =
            facts.map(|(key, _, value)| ((*key).to_owned(), value.clone())).collect();
        object.insert("warnings".to_owned(), json!(self.warnings));
        format!("{:#}\n", Value::Object(object))
    }

    /// For the page: key, name and text of each fact that is not empty and no headline states.
    pub fn listed(&self) -> impl Iterator<Item = (&'static str, &'static str, String)> {
        let facts = self.facts.iter().filter(|(key, ..)| *key != LIMITS);
        let facts = facts.filter(|(_, _, value)| !matches!(value, Value::Array(list) if list.is_empty()));
        facts.map(|(key, name, value)| (*key, *name, plain(value)))
    }
}

/// Share of the time for which each actuator's limits reduced its signal, and the largest request to an
/// actuator with a limit that did.
pub fn limited(outcome: &Outcome) -> Vec<Headline> {
    outcome.actuators.iter().flat_map(limited_one).collect()
}

fn limited_one(actuator: &ActuatorReport) -> impl Iterator<Item = Headline> {
    let (path, held) = (&actuator.path, held_ticks(actuator));
    let part = 100.0 * held as f64 / actuator.clipped.ticks.max(1) as f64;
    let part = match held {
        0 => "none".to_owned(),
        _ => format!("{part:.2} %"),
    };
    let share = Headline::new("Reduced by limits", part, format!("of the time of {path}"));
    let largest = (held > 0).then(|| {
        let (unit, limit) = (&actuator.unit, &actuator.limit);
        let of = format!(
            "of {path}, before its limits: {} {unit} peak, {} {unit} continuous",
            rounded(limit.peak),
            rounded(limit.continuous)
        );
        let value = format!("{} {unit}", rounded(actuator.largest_request));
        Headline::new("Largest request", value, of)
    });
    [share].into_iter().chain(largest)
}

/// Ticks in which a limit reduced the signal of an actuator.
fn held_ticks(actuator: &ActuatorReport) -> u64 {
    let ClipCounts { peak, continuous, slew, .. } = actuator.clipped;
    peak.max(continuous).max(slew)
}

/// The largest request to each actuator with a limit that reduced its signal, beside its limits.
fn limits_that_struck(outcome: &Outcome) -> Value {
    let struck = outcome.actuators.iter().filter(|actuator| held_ticks(actuator) > 0);
    let facts = struck.map(|actuator| {
        json!({
            "actuator": actuator.path, "unit": actuator.unit, "largest_request": actuator.largest_request,
            "peak": actuator.limit.peak, "continuous": actuator.limit.continuous,
        })
    });
    facts.collect()
}

/// The files beside a run's page with their contents; `own` are those that no sink writes.
pub fn files_beside(graph: &Graph, own: &[(&str, &str)]) -> Vec<(String, String)> {
    let written = graph.written_files().filter_map(|(node, file)| {
        let node = &graph.nodes()[node];
        let holds = format!("the input of `{}`", node.path);
        // Plots are on the page.
        (node.entry.spec.group != PLOTS).then(|| (file.to_string_lossy().into_owned(), holds))
    });
    let own = own.iter().map(|(file, holds)| ((*file).to_owned(), (*holds).to_owned()));
    let facts = (FILE.to_owned(), "the facts of the run, for programs".to_owned());
    written.chain([facts]).chain(own).collect()
}

/// The counts of a ring between two drivers, by its name.
fn ring(report: &RingReport) -> (String, Value) {
    let ms = |seconds: f64| (seconds * 1e6).round() / 1e3;
    let counts = &report.counts;
    let facts = json!({
        "latency_ms": ms(report.latency_s),
        "fill_ms": counts.fill_s.map(ms),
        "least_ms": counts.range_s.map(|(least, _)| ms(least)),
        "most_ms": counts.range_s.map(|(_, most)| ms(most)),
        "correction_ppm": (counts.correction_ppm * 10.0).round() / 10.0,
        "underruns": counts.underruns,
        "overruns": counts.overruns,
        "lost_frames": counts.lost_frames,
    });
    (report.name.clone(), facts)
}

/// The number of ticks in which actuators received NaN or infinity, and the node of origin; an empty list for
/// none.
fn faults(outcome: &Outcome) -> Value {
    match &outcome.faults {
        faults if faults.ticks == 0 => json!([]),
        faults => json!([{ "ticks": faults.ticks, "origin": faults.origin.as_deref() }]),
    }
}

/// Warnings about sources whose data ended during the run.
fn ended_data(graph: &Graph, outcome: &Outcome) -> Vec<String> {
    let driver = &graph.clocks()[graph.drivers()[0]];
    let mut list = Vec::new();
    for source in graph.data_ends() {
        let data_frames = source.driver_frames(driver.rate);
        let (path, seconds) = (source.path, source.seconds());
        list.extend(match source.end.then {
            AfterData::Stop if outcome.driver_frames == data_frames && !outcome.stopped => Some(format!(
                "the data of `{path}` ended after {seconds:.3} s, which ended the run; to continue, set `at_end` to `Hold`, `Silence` or `Loop`"
            )),
            AfterData::Hold if outcome.driver_frames > data_frames => Some(format!(
                "the data of `{path}` ended after {seconds:.3} s; it held its last value from then on"
            )),
            AfterData::Silence if outcome.driver_frames > data_frames => {
                Some(format!("the data of `{path}` ended after {seconds:.3} s; it was zero from then on"))
            }
            _ => None,
        });
    }
    list
}

fn warnings(outcome: &Outcome) -> Vec<String> {
    let mut list = Vec::new();
    for ring in &outcome.rings {
        let counts = &ring.counts;
        if counts.underruns + counts.overruns + counts.lost_frames > 0 {
            list.push(format!(
                "ring {}: {} underruns, {} overruns, {} frames lost; a latency above {} ms may help",
                ring.name,
                counts.underruns,
                counts.overruns,
                counts.lost_frames,
                ring.latency_s * 1e3
            ));
        }
    }
    for actuator in &outcome.actuators {
        let (clipped, limit, unit) = (actuator.clipped, &actuator.limit, &actuator.unit);
        let ticks = clipped.ticks;
        let largest = rounded(actuator.largest_request);
        let beside = |limit: f64| {
            format!(": the largest request was {largest} {unit}, the limit is {} {unit}", rounded(limit))
        };
        for (count, name, beside) in [
            (clipped.peak, "peak", beside(limit.peak)),
            (clipped.continuous, "continuous", beside(limit.continuous)),
            // A request has no slew of its own: the output may still be on its way to one before.
            (clipped.slew, "slew", String::new()),
        ] {
            if count > 0 {
                list.push(format!(
                    "{}: the {name} limit reduced {count} of {ticks} ticks{beside}; lower the signal, or raise that \
                     limit if the actuator allows it",
                    actuator.path
                ));
            }
        }
    }
    if outcome.faults.ticks > 0 {
        let origin = outcome.faults.origin.as_ref();
        let origin = origin.map_or_else(String::new, |path| format!("; it came from {path}"));
        list.push(format!(
            "an actuator received NaN or infinity in {} ticks; its output was forced to zero{origin}",
            outcome.faults.ticks
        ));
    }
    list
}

/// Formats a value for readers.
pub fn plain(value: &Value) -> String {
    match value {
        Value::String(text) => text.clone(),
        Value::Array(list) => list.iter().map(plain).collect::<Vec<_>>().join(", "),
        Value::Object(fields) => fields
            .iter()
            .map(|(name, value)| format!("{name} {}", plain(value)))
            .collect::<Vec<_>>()
            .join(", "),
        Value::Bool(true) => "yes".to_owned(),
        Value::Bool(false) => "no".to_owned(),
        other => other.to_string(),
    }
}
