//! The signals that the page of a run shows and plays, recorded while it runs.

use super::plot_request::{PlotRequest, Trace, plot_requests, tracer};
use super::record::{Record, Recorded, WatchedOutput, recorder, watched};
use super::sound::{Clip, ClipRecord, Sound, audible, clip};
use haptograph_engine::graph::Graph;
use haptograph_engine::node::FrameWriter;
use haptograph_surfaces::{Surface, files};

/// Recorders of the plots and the sound of a page.
#[derive(Debug)]
pub struct PlottedSignals {
    /// Signals plotted by default.
    records: Vec<Record>,
    /// The plots requested by the graph, each with a trace per signal.
    pub requests: Vec<(PlotRequest, Vec<Trace>)>,
    /// Beginnings of the signals that may be played, the most suitable first.
    clips: Vec<ClipRecord>,
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
        Self {
            records,
            requests,
            clips,
        }
    }

    /// The signals plotted by default.
    pub fn signals(&self) -> Vec<Recorded> {
        self.records.iter().map(Record::content).collect()
    }

    /// The requested plots, each with its traces.
    pub fn plots(&self) -> Vec<(&PlotRequest, &[Trace])> {
        let each = self.requests.iter();
        each.map(|(request, traces)| (request, traces.as_slice()))
            .collect()
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
            node.outputs
                .iter()
                .map(|port| (format!("{}.{}", node.path, port.name), surface.clone())),
        );
    }
    found
}
