//! The signals that the page of a run shows and plays, recorded while it runs.

use super::plot_request::{PlotRequest, Trace, plot_requests, tracer};
use super::record::{Record, Recorded, WatchedOutput, recorder, watch, watched};
use super::sound::{Clip, ClipRecord, Sound, audible, clip};
use haptograph_engine::graph::Graph;
use haptograph_engine::node::{FrameWriter, OutputRole};
use haptograph_surfaces::{Surface, files};
use std::sync::Arc;
use std::sync::atomic::AtomicU64;
use std::sync::atomic::Ordering::Relaxed;

/// Recorders of the plots and the sound of a page.
#[derive(Debug)]
pub struct PlottedSignals {
    /// Signals plotted by default.
    records: Vec<Record>,
    /// The plots requested by the graph, each with a trace per signal.
    pub requests: Vec<(PlotRequest, Vec<Trace>)>,
    /// Beginnings of the signals that may be played, the most suitable first.
    clips: Vec<ClipRecord>,
    shortfalls: Vec<Shortfalls>,
}

/// The ticks in which a node could not do what was asked of it.
#[derive(Debug)]
struct Shortfalls {
    output: String,
    reasons: &'static [&'static str],
    ticks: TickCounts,
}

/// The ticks without a shortfall, and those of each reason.
type TickCounts = Arc<[AtomicU64]>;

struct ShortfallWriter(TickCounts);

impl FrameWriter for ShortfallWriter {
    fn write(&mut self, _: usize, frames: &[f64]) -> std::io::Result<()> {
        for reason in frames {
            if let Some(ticks) = self.0.get(*reason as usize) {
                ticks.fetch_add(1, Relaxed);
            }
        }
        Ok(())
    }

    fn finish(self: Box<Self>) -> std::io::Result<()> {
        Ok(())
    }
}

impl PlottedSignals {
    /// Recorders for a graph; `attach` gives each writer the frames of its output.
    pub fn of(graph: &Graph, mut attach: impl FnMut(&WatchedOutput, Box<dyn FrameWriter>)) -> Self {
        let mut records = Vec::new();
        for watch in watched(graph) {
            let (writer, record) = recorder(watch.stream.clone());
            attach(&watch, Box::new(writer));
            records.push(record);
        }
        let mut requests = Vec::new();
        for request in plot_requests(graph) {
            let mut traces = Vec::new();
            for watch in &request.signals {
                let (writer, trace) = tracer(&watch.stream, request.form);
                attach(watch, Box::new(writer));
                traces.push(trace);
            }
            requests.push((request, traces));
        }
        let mut clips = Vec::new();
        for watch in audible(graph) {
            let (writer, record) = clip(watch.stream.clone());
            attach(&watch, Box::new(writer));
            clips.push(record);
        }
        let mut shortfalls = Vec::new();
        for node in graph.nodes().ids() {
            for output in 0..graph.nodes()[node].outputs.len() {
                let role = graph.nodes()[node].output_spec(output).map(|spec| spec.role);
                let Some(OutputRole::Shortfall(reasons)) = role else {
                    continue;
                };
                let Some(watch) = watch(graph, node, output) else {
                    continue;
                };
                let ticks: TickCounts = (0..=reasons.len()).map(|_| AtomicU64::new(0)).collect();
                attach(&watch, Box::new(ShortfallWriter(Arc::clone(&ticks))));
                shortfalls.push(Shortfalls { output: watch.stream.name, reasons, ticks });
            }
        }
        Self { records, requests, clips, shortfalls }
    }

    /// Warnings of the nodes that could not do what was asked of them: the reason, and the number of ticks.
    pub fn shortfalls(&self) -> Vec<String> {
        let mut list = Vec::new();
        for Shortfalls { output, reasons, ticks } in &self.shortfalls {
            let ticks: Vec<u64> = ticks.iter().map(|ticks| ticks.load(Relaxed)).collect();
            let all: u64 = ticks.iter().sum();
            let struck = reasons.iter().zip(&ticks[1..]).filter(|(_, count)| **count > 0);
            list.extend(
                struck.map(|(reason, count)| format!("{output}: {reason} in {count} of {all} ticks")),
            );
        }
        list
    }

    /// The signals plotted by default.
    pub fn signals(&self) -> Vec<Recorded> {
        self.records.iter().map(Record::content).collect()
    }

    /// The requested plots, each with its traces.
    pub fn plots(&self) -> Vec<(&PlotRequest, &[Trace])> {
        let each = self.requests.iter();
        each.map(|(request, traces)| (request, traces.as_slice())).collect()
    }

    /// The sound to play; `None` if nothing vibrates.
    pub fn sound(&self) -> Option<Sound> {
        let clips: Vec<Clip> = self.clips.iter().map(ClipRecord::content).collect();
        Sound::of(&clips)
    }

    /// Frees the sound, since many runs would need much memory.
    pub fn forget_sound(&mut self) {
        self.clips.clear();
    }
}

/// The surfaces of nodes with a position on a map, by the name of that signal.
pub fn surfaces(graph: &Graph) -> Vec<(String, Surface)> {
    let mut found = Vec::new();
    for node in graph.nodes().iter() {
        // The graph was built from these files; one that has become unreadable is not drawn.
        let Some(surface) = node.files.iter().find_map(|path| files::load(path).ok()) else {
            continue;
        };
        found.extend(
            node.outputs.iter().map(|port| (format!("{}.{}", node.path, port.name), surface.clone())),
        );
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptograph_engine::document::{Document, LoadOptions};
    use haptograph_engine::graph::{CheckOptions, check};

    #[test]
    fn what_a_node_could_not_do_is_counted_by_its_reason() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../graphs/ar-pen.ron");
        let document = Document::load(path, &LoadOptions::default()).expect("a graph");
        let graph = check(&document, &haptograph_nodes::registry(), &CheckOptions::default());
        let graph = graph.unwrap_or_else(|wrong| panic!("{wrong}"));
        let mut writers = Vec::new();
        let plotted =
            PlottedSignals::of(&graph, |watch, writer| writers.push((watch.stream.name.clone(), writer)));
        assert!(plotted.shortfalls().is_empty());
        for (name, writer) in &mut writers {
            let frames: &[f64] = match name.as_str() {
                "brake.reach" => &[0.0, 3.0, 3.0, 1.0],
                "touch.saturated" => &[0.0, 0.0, 1.0],
                _ => continue,
            };
            writer.write(0, frames).expect("memory");
        }
        let all = plotted.shortfalls();
        for (output, ticks) in
            [("touch.saturated", "1 of 3"), ("brake.reach", "1 of 4"), ("brake.reach", "2 of 4")]
        {
            assert!(all.iter().any(|one| one.starts_with(output) && one.contains(ticks)), "{all:?}");
        }
        assert_eq!(all.len(), 3);
    }
}
