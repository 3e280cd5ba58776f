//! What is to be known of a run: as JSON, as a sentence, and on its page.

use super::endpoints::Endpoints;
use super::{Arguments, Shown, has_end};
use crate::engine::graph::Graph;
use crate::engine::limiter::ClipCounts;
use crate::engine::node::AfterData;
use crate::engine::run::{ActuatorReport, Outcome, RingReport};
use crate::nodes::sinks::plots::GROUP as PLOTS;
use crate::report::drawing;
use crate::report::headlines::Headline;
use crate::report::page::{Page, Simulation};
use crate::report::record::{Record, friction};
use crate::report::sound::{Sound, audible};
use crate::surfaces::{Surface, files};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// The facts of a run.
#[derive(Debug)]
pub struct Summary {
    name: String,
    facts: Vec<(&'static str, &'static str, Value)>,
    warnings: Vec<String>,
    headlines: Vec<Headline>,
    endpoints: Endpoints,
    simulation: Simulation,
    seconds: f64,
    took_s: f64,
    stopped: bool,
}

impl Summary {
    pub fn of(arguments: &Arguments, graph: &Graph, outcome: &Outcome, took_s: f64) -> Self {
        let mut files: Vec<&PathBuf> = graph.nodes().iter().flat_map(|node| &node.files).collect();
        files.sort();
        files.dedup();
        let files: Vec<_> = files.iter().map(|path| path.to_string_lossy()).collect();
        let clocks = graph
            .clocks()
            .iter()
            .map(|c| format!("{} {}", c.name, c.rate))
            .collect::<Vec<_>>();
        let set = arguments
            .graph
            .set
            .iter()
            .map(|(name, value)| format!("{name}={value}"))
            .collect::<Vec<_>>();
        let rings: serde_json::Map<String, Value> = outcome.rings.iter().map(ring).collect();
        let endpoints = Endpoints::of(graph, arguments.live);
        let mut facts = vec![
            ("graph", "Graph", json!(arguments.graph.graph.to_string_lossy())),
            ("set", "Set", json!(set)),
            ("endpoints", "Endpoints", json!(arguments.graph.endpoints())),
            ("seed", "Seed", json!(graph.seed())),
            ("files", "Files read", json!(files)),
            ("clocks", "Clocks", json!(clocks)),
            ("nodes", "Nodes", json!(graph.nodes().len())),
            ("seconds", "Seconds", json!(outcome.seconds)),
            ("driver_frames", "Driver frames", json!(outcome.driver_frames)),
            ("stopped", "Stopped early", json!(outcome.stopped)),
            ("block", "Block (driver frames)", json!(arguments.block)),
            ("threads", "Threads", json!(arguments.threads)),
            ("took_s", "Time taken (s)", json!((took_s * 1e4).round() / 1e4)),
            (
                "real_time_factor",
                "Times faster than real time",
                json!(((outcome.seconds / took_s) * 10.0).round() / 10.0),
            ),
            ("faults", "Actuators given no numbers", faults(outcome)),
            ("haptograph", "haptograph", json!(env!("CARGO_PKG_VERSION"))),
        ];
        facts.extend(endpoints.facts());
        if !rings.is_empty() {
            facts.push(("rings", "Rings", Value::Object(rings)));
        }
        Self {
            name: arguments.graph.name(),
            facts,
            warnings: warnings(outcome)
                .into_iter()
                .chain(cut_short(outcome).filter(|_| has_end(arguments)))
                .chain(ended_data(graph, outcome))
                .collect(),
            headlines: outcome.actuators.iter().map(limited).collect(),
            simulation: endpoints.simulation(),
            endpoints,
            seconds: outcome.seconds,
            took_s,
            stopped: outcome.stopped,
        }
    }

    /// Adds what is to be known of a live run only.
    pub fn add(&mut self, facts: Vec<(&'static str, &'static str, Value)>, warnings: Vec<String>) {
        self.facts.extend(facts);
        self.warnings.extend(warnings);
    }

    /// The run had these devices: graphs with others took over.
    pub fn set_endpoints(&mut self, endpoints: Endpoints) {
        let facts = endpoints.facts();
        self.facts
            .retain(|(key, ..)| facts.iter().all(|(new, ..)| new != key));
        self.facts.extend(facts);
        self.simulation = endpoints.simulation();
        self.endpoints = endpoints;
    }

    pub fn simulation(&self) -> &Simulation {
        &self.simulation
    }

    /// Was the run stopped before its end?
    pub fn was_stopped(&self) -> bool {
        self.stopped
    }

    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    pub fn to_json(&self) -> String {
        let mut object: serde_json::Map<String, Value> = self
            .facts
            .iter()
            .map(|(key, _, value)| ((*key).to_owned(), value.clone()))
            .collect();
        object.insert("warnings".to_owned(), json!(self.warnings));
        format!("{:#}\n", Value::Object(object))
    }

    /// What was done; the last line says what to look at and what to listen to.
    pub fn sentence(&self, target: &Path, graph: &Graph, sound: Option<&Sound>) -> String {
        let stopped = if self.stopped { "stopped after" } else { "ran" };
        let simulated = self.endpoints.in_brackets();
        let heard = match sound {
            Some(sound) => format!(", and listen to `{}` there or with --play", sound.stream.name),
            None if audible(graph).is_empty() => {
                "; nothing to listen to: no actuator or file gets an acceleration, a force, a voltage or a current at \
                 2 kHz or more"
                    .to_owned()
            }
            None => "; nothing to listen to: what could be heard is silent".to_owned(),
        };
        format!(
            "{stopped} {:.3} s of {}{simulated} in {:.3} s, {:.1} times real time\nlook at {}{heard}\n",
            self.seconds,
            self.name,
            self.took_s,
            self.seconds / self.took_s,
            target.join("report.html").display()
        )
    }

    /// The page that is left behind.
    pub fn page(&self, graph: &Graph, shown: &Shown, sound: Option<&Sound>) -> String {
        let surfaces = surfaces(graph);
        let textures = surfaces
            .iter()
            .filter_map(|(path, surface)| Some((path.clone(), surface.texture.as_ref()?)));
        let facts = self
            .facts
            .iter()
            // Which devices are simulated and which are real stands beside each.
            .filter(|(key, ..)| !["simulated_devices", "real_devices"].contains(key))
            .filter(|(_, _, value)| !matches!(value, Value::Array(list) if list.is_empty()));
        Page {
            title: self.name.clone(),
            about: graph.about().to_owned(),
            simulation: self.simulation.clone(),
            facts: facts
                .map(|(key, name, value)| match *key {
                    "devices" => ((*name).to_owned(), self.endpoints.listed()),
                    _ => ((*name).to_owned(), plain(value)),
                })
                .collect(),
            warnings: self.warnings.clone(),
            headlines: self.headlines.clone(),
            friction: friction(graph),
            files: files_beside(graph),
            sound,
            asked: shown
                .asked
                .iter()
                .map(|(asked, traces)| (asked, traces.as_slice()))
                .collect(),
            signals: shown.records.iter().map(Record::content).collect(),
            textures: textures.collect(),
            drawing: drawing::svg(graph, ""),
        }
        .to_html()
    }
}

/// How much of the time the limits of an actuator held something back.
fn limited(actuator: &ActuatorReport) -> Headline {
    let ClipCounts {
        peak,
        continuous,
        slew,
        ticks,
        ..
    } = actuator.clipped;
    let held = peak.max(continuous).max(slew);
    let part = 100.0 * held as f64 / ticks.max(1) as f64;
    Headline::new(
        "Held back by limits",
        format!("{part:.2} %"),
        format!("of the time of {}", actuator.path),
    )
}

/// The files that a run leaves beside its page, and what they hold.
fn files_beside(graph: &Graph) -> Vec<(String, String)> {
    let written = graph.written_files().filter_map(|(node, file)| {
        let node = &graph.nodes()[node];
        let holds = format!("what `{}` got", node.path);
        // Plots are on the page.
        (node.entry.spec.group != PLOTS).then(|| (file.to_string_lossy().into_owned(), holds))
    });
    let own = [
        ("run.json", "the facts of the run, for programs"),
        ("graph.svg", "the drawing of the graph"),
    ];
    let own = own.map(|(file, holds)| (file.to_owned(), holds.to_owned()));
    written.chain(own).collect()
}

/// The surfaces of nodes with a place on a map, by the name of that signal.
pub fn surfaces(graph: &Graph) -> Vec<(String, Surface)> {
    let mut found = Vec::new();
    for node in graph.nodes().iter() {
        // The graph was built from these files a moment ago; one that is no surface, or is gone, is not drawn.
        let Some(surface) = node.files.iter().find_map(|path| files::load(path).ok()) else {
            continue;
        };
        found.extend(
            node.outputs
                .iter()
                .map(|port| (format!("{}.{}", node.path, port.name), surface.clone())),
        );
    }
    found
}

/// What is to be known of a ring between two drivers, by its name.
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

/// In how many ticks actuators were given no numbers, and which node these came from; an empty list where none was.
fn faults(outcome: &Outcome) -> Value {
    match &outcome.faults {
        faults if faults.ticks == 0 => json!([]),
        faults => json!([{ "ticks": faults.ticks, "origin": faults.origin.as_deref() }]),
    }
}

/// What followed where the data of sources ended within the run.
fn ended_data(graph: &Graph, outcome: &Outcome) -> Vec<String> {
    let driver = &graph.clocks()[graph.drivers()[0]];
    let mut list = Vec::new();
    for source in graph.data_ends() {
        let data_frames = source.driver_frames(driver.rate);
        let (path, seconds) = (source.path, source.seconds());
        list.extend(match source.end.then {
            AfterData::Stop if outcome.driver_frames == data_frames && !outcome.stopped => Some(format!(
                "the data of `{path}` ended after {seconds:.3} s, and the run with them; `at_end: Hold`, `Silence` or `Loop` goes on"
            )),
            AfterData::Hold if outcome.driver_frames > data_frames => Some(format!(
                "the data of `{path}` ended after {seconds:.3} s; from there on it held its last value"
            )),
            AfterData::Silence if outcome.driver_frames > data_frames => {
                Some(format!("the data of `{path}` ended after {seconds:.3} s; from there on it was zero"))
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
                "the ring {} ran dry {} times and was too full {} times, {} frames lost; a latency above {} ms may help",
                ring.name,
                counts.underruns,
                counts.overruns,
                counts.lost_frames,
                ring.latency_s * 1e3
            ));
        }
    }
    for actuator in &outcome.actuators {
        let clipped = actuator.clipped;
        let ticks = clipped.ticks;
        for (count, limit) in [
            (clipped.peak, "peak"),
            (clipped.continuous, "continuous"),
            (clipped.slew, "slew"),
        ] {
            if count > 0 {
                list.push(format!(
                    "{}: the {limit} limit held back {count} of {ticks} ticks",
                    actuator.path
                ));
            }
        }
    }
    if outcome.faults.ticks > 0 {
        let origin = outcome.faults.origin.as_ref();
        let origin = origin.map_or_else(String::new, |path| format!("; it came from {path}"));
        list.push(format!(
            "an actuator was given no number in {} ticks and was taken to zero{origin}",
            outcome.faults.ticks
        ));
    }
    list
}

/// What is said of a run that had an end of its own and did not reach it.
fn cut_short(outcome: &Outcome) -> Option<String> {
    let seconds = outcome.seconds;
    outcome
        .stopped
        .then(|| format!("the run was stopped after {seconds:.3} s; its files are complete up to there"))
}

fn plain(value: &Value) -> String {
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
