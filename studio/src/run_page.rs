//! Facts and page of a recorded run, written into its folder.

use super::actuators::driven;
use super::load::Source;
use super::scope::Scope;
use haptograph_engine::graph::Graph;
use haptograph_engine::node::FrameWriter;
use haptograph_engine::run::Outcome;
use haptograph_report::facts::{self, Facts};
use haptograph_report::page::{Page, Simulation};
use haptograph_report::plotted::PlottedSignals;
use haptograph_report::record::WatchedOutput;
use serde_json::json;
use std::path::Path;

/// File name of the page.
pub(crate) const REPORT: &str = "report.html";

/// The signals recorded for the page, with their ports and writers.
pub(crate) struct PageSignals {
    plotted: PlottedSignals,
    writers: Vec<(String, Box<dyn FrameWriter>)>,
}

impl PageSignals {
    /// The signals that a run's page shows and plays.
    pub(crate) fn of(graph: &Graph) -> Self {
        let mut writers = Vec::new();
        let attach = |watch: &WatchedOutput, writer| writers.push((watch.stream.name.clone(), writer));
        let plotted = PlottedSignals::of(graph, attach);
        Self { plotted, writers }
    }

    /// Adds the new frames of the scopes.
    pub(crate) fn take(&mut self, scopes: &[Scope]) {
        for (port, writer) in &mut self.writers {
            if let Some(scope) = scopes.iter().find(|scope| scope.port.name == *port) {
                // The writers write to memory and cannot fail.
                let _ = writer.write(0, scope.fresh());
            }
        }
    }
}

/// Writes the facts and the page of a run into its folder.
pub(crate) fn write(
    folder: &Path,
    source: &Source,
    graph: &Graph,
    outcome: &Outcome,
    signals: &PageSignals,
) -> std::io::Result<()> {
    let set = source.set.iter();
    let set = set.map(|(name, value)| (name.as_str(), value.as_str()));
    let mut run = Facts::of(graph, outcome, &source.path, set, &source.endpoints);
    let devices = graph.devices().iter().map(|device| {
        let spec = device.entry.spec;
        json!({ "name": device.name, "kind": spec.name, "simulated": spec.simulated })
    });
    run.extend([("devices", "Devices", devices.collect())]);
    run.warnings.extend(signals.plotted.shortfalls());
    let page = page(source, graph, outcome, &run, &signals.plotted);
    haptograph_signal::files::write_atomically(&folder.join(facts::FILE), run.to_json().as_bytes())?;
    haptograph_signal::files::write_atomically(&folder.join(REPORT), page.as_bytes())
}

fn page(source: &Source, graph: &Graph, outcome: &Outcome, run: &Facts, plotted: &PlottedSignals) -> String {
    let sound = plotted.sound();
    let own = [(super::record::STROKES, "the moves and turns, to be replayed in the studio")];
    Page {
        title: source.name(),
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
        ..Page::of(graph, plotted, sound.as_ref())
    }
    .to_html()
}
