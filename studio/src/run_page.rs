//! Facts and page of a recorded run, written into its folder.

use super::actuators::driven;
use super::load::Source;
use super::scope::Scope;
use haptograph_engine::graph::Graph;
use haptograph_engine::node::FrameWriter;
use haptograph_engine::run::Outcome;
use haptograph_report::drawing;
use haptograph_report::facts::{self, Facts};
use haptograph_report::page::{Page, Simulation};
use haptograph_report::record::{Record, Recorder, friction, recorder, watched};
use serde_json::json;
use std::path::Path;

/// File name of the page.
pub const REPORT: &str = "report.html";

/// A signal recorded for the page.
#[derive(Debug)]
pub struct PageSignal {
    port: String,
    recorder: Recorder,
    record: Record,
}

impl PageSignal {
    /// The signals that a run's page shows.
    pub fn of(graph: &Graph) -> Vec<Self> {
        let watched = watched(graph).into_iter();
        let watched = watched.filter(|watch| watch.stream.kind.is_linear());
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

    /// Adds the new frames of the scopes.
    pub fn take(&mut self, scopes: &[Scope]) {
        if let Some(scope) = scopes.iter().find(|scope| scope.port.name == self.port) {
            // The recorder writes to memory and cannot fail.
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
    signals: &[PageSignal],
) -> std::io::Result<()> {
    let set = source.set.iter();
    let set = set.map(|(name, value)| (name.as_str(), value.as_str()));
    let mut run = Facts::of(graph, outcome, &source.path, set, &source.endpoints);
    let devices = graph.devices().iter().map(|device| {
        let spec = device.entry.spec;
        json!({ "name": device.name, "kind": spec.name, "simulated": spec.simulated })
    });
    run.extend([("devices", "Devices", devices.collect())]);
    let page = page(source, graph, outcome, &run, signals);
    haptograph_signal::files::write_atomically(&folder.join(facts::FILE), run.to_json().as_bytes())?;
    haptograph_signal::files::write_atomically(&folder.join(REPORT), page.as_bytes())
}

fn page(source: &Source, graph: &Graph, outcome: &Outcome, run: &Facts, signals: &[PageSignal]) -> String {
    let own = [(
        super::record::STROKES,
        "the moves and turns, to be replayed in the studio",
    )];
    Page {
        friction: friction(graph),
        title: source.name(),
        about: graph.about().to_owned(),
        simulation: Simulation::Some(
            match driven(graph).is_empty() {
                true => {
                    "The hand was real, on the studio's pad; every device was simulated. Their signals show the behaviour of \
                     their models, not a measurement."
                }
                false => {
                    "The hand was real, on the studio's pad, and so were driven devices. What is shown as delivered to them is \
                     the signal behind the limits; they received it only while they were armed, times the gain set then."
                }
            }
            .to_owned(),
        ),
        headlines: facts::limited(outcome),
        facts: run
            .listed()
            .map(|(_, name, value)| (name.to_owned(), value))
            .collect(),
        warnings: run.warnings.clone(),
        files: facts::files_beside(graph, &own),
        sound: None,
        requests: Vec::new(),
        signals: signals.iter().map(|signal| signal.record.content()).collect(),
        textures: Vec::new(),
        drawing: drawing::svg(graph, ""),
    }
    .to_html()
}
