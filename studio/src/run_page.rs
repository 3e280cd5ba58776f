//! What a recorded stroke leaves in its folder besides its files: the facts of the run and the page about it.

use super::load::Source;
use super::scope::Scope;
use haptograph_engine::frame::Kind;
use haptograph_engine::graph::Graph;
use haptograph_engine::node::FrameWriter;
use haptograph_engine::run::Outcome;
use haptograph_nodes::sinks::plots::GROUP as PLOTS;
use haptograph_report::drawing;
use haptograph_report::headlines::Headline;
use haptograph_report::page::{Page, Simulation};
use haptograph_report::record::{Record, Recorder, friction, recorder, watched};
use serde_json::{Value, json};
use std::path::Path;

/// The facts in a run's folder, and the page.
const FACTS: &str = "run.json";
pub const REPORT: &str = "report.html";

/// A signal that the page will show.
#[derive(Debug)]
pub struct Kept {
    port: String,
    recorder: Recorder,
    record: Record,
}

impl Kept {
    /// The signals that a run's page shows.
    pub fn of(graph: &Graph) -> Vec<Self> {
        // Scopes look at numbers only.
        let numbers = [Kind::Scalar, Kind::Vector, Kind::Wrench];
        let watched = watched(graph).into_iter();
        let watched = watched.filter(|watch| numbers.contains(&watch.stream.kind));
        let kept = watched.map(|watch| {
            let port = watch.stream.name.clone();
            let (recorder, record) = recorder(watch.stream);
            Self {
                port,
                recorder,
                record,
            }
        });
        kept.collect()
    }

    /// Takes in what came since the last look.
    pub fn take(&mut self, scopes: &[Scope]) {
        if let Some(scope) = scopes.iter().find(|scope| scope.port.name == self.port) {
            // A recorder keeps in memory and cannot fail.
            let _ = self.recorder.write(0, scope.fresh());
        }
    }
}

/// Writes the facts and the page of a run into its folder.
pub fn write(
    folder: &Path,
    source: &Source,
    graph: &Graph,
    outcome: &Outcome,
    kept: &[Kept],
) -> std::io::Result<()> {
    let facts = facts(source, graph, outcome);
    let page = page(source, graph, outcome, &facts, kept);
    let facts = format!("{facts:#}\n");
    haptograph_surfaces::files::write_atomically(&folder.join(FACTS), facts.as_bytes())?;
    haptograph_surfaces::files::write_atomically(&folder.join(REPORT), page.as_bytes())
}

/// By the names that `haptograph run` has for them.
fn facts(source: &Source, graph: &Graph, outcome: &Outcome) -> Value {
    let mut files: Vec<_> = graph.nodes().iter().flat_map(|node| &node.files).collect();
    files.sort();
    files.dedup();
    let set = source.set.iter().map(|(name, value)| format!("{name}={value}"));
    let clocks = graph.clocks().iter();
    let faults = &outcome.faults;
    let faulty =
        (faults.ticks > 0).then(|| json!({ "ticks": faults.ticks, "origin": faults.origin.as_deref() }));
    let devices = graph.devices().iter().map(|device| {
        let spec = device.entry.spec;
        json!({ "name": device.name, "kind": spec.name, "simulated": spec.simulated })
    });
    json!({
        "graph": source.path.to_string_lossy(),
        "set": set.collect::<Vec<_>>(),
        "endpoints": "simulated",
        "seed": graph.seed(),
        "files": files.iter().map(|path| path.to_string_lossy()).collect::<Vec<_>>(),
        "clocks": clocks.map(|clock| format!("{} {}", clock.name, clock.rate)).collect::<Vec<_>>(),
        "nodes": graph.nodes().len(),
        "seconds": outcome.seconds,
        "driver_frames": outcome.driver_frames,
        "devices": devices.collect::<Vec<_>>(),
        "faults": faulty.into_iter().collect::<Vec<_>>(),
        "haptograph": env!("CARGO_PKG_VERSION"),
    })
}

fn page(source: &Source, graph: &Graph, outcome: &Outcome, facts: &Value, kept: &[Kept]) -> String {
    let listed = facts.as_object().into_iter().flatten();
    let listed = listed.filter_map(|(name, value)| {
        let text = match value {
            Value::String(text) => text.clone(),
            Value::Array(list) => list
                .iter()
                .filter_map(Value::as_str)
                .collect::<Vec<_>>()
                .join(", "),
            other => other.to_string(),
        };
        (!text.is_empty()).then(|| (name.replace('_', " "), text))
    });
    let headlines = outcome.actuators.iter().map(|actuator| {
        let clipped = actuator.clipped;
        let held = clipped.peak.max(clipped.continuous).max(clipped.slew);
        let part = 100.0 * held as f64 / clipped.ticks.max(1) as f64;
        let of = format!("of the time of {}", actuator.path);
        Headline::new("Held back by limits", format!("{part:.2} %"), of)
    });
    let written = graph.written_files().filter_map(|(node, file)| {
        let node = &graph.nodes()[node];
        let holds = format!("what `{}` got", node.path);
        (node.entry.spec.group != PLOTS).then(|| (file.to_string_lossy().into_owned(), holds))
    });
    let own = [
        (
            super::again::STROKES,
            "the moves and turns, to be replayed in the studio",
        ),
        (FACTS, "the facts of the run, for programs"),
    ];
    let own = own.map(|(file, holds)| (file.to_owned(), holds.to_owned()));
    Page {
        friction: friction(graph),
        title: source.name(),
        about: graph.about().to_owned(),
        simulation: Simulation::Some(
            "The hand was real, on the studio's pad; every device was simulated. What is shown of these is what their \
             models did, not a measurement."
                .to_owned(),
        ),
        headlines: headlines.collect(),
        facts: listed.collect(),
        warnings: Vec::new(),
        files: written.chain(own).collect(),
        sound: None,
        asked: Vec::new(),
        signals: kept.iter().map(|kept| kept.record.content()).collect(),
        textures: Vec::new(),
        drawing: drawing::svg(graph, ""),
    }
    .to_html()
}
