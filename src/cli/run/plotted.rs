//! Signals recorded during a run for its page.

use crate::engine::graph::Graph;
use crate::engine::node::FrameWriter;
use crate::engine::run::{FileSinks, Probe};
use crate::report::plot_request::{PlotRequest, Trace, plot_requests, tracer};
use crate::report::record::{Record, WatchedOutput, recorder, watched};
use crate::report::sound::{Clip, ClipRecord, Sound, audible, clip};

/// Recorders of the plots and the sound of a page.
pub struct PlottedSignals {
    /// Signals plotted by default.
    pub records: Vec<Record>,
    /// The plots requested by the graph, each with a trace per signal.
    pub requests: Vec<(PlotRequest, Vec<Trace>)>,
    /// Beginnings of the signals that may be played, the most suitable first.
    clips: Vec<ClipRecord>,
}

impl PlottedSignals {
    /// Attaches the recorders.
    pub fn of(graph: &Graph, file_sinks: &mut FileSinks<'_>) -> Self {
        let mut probe = |watch: &WatchedOutput, writer: Box<dyn FrameWriter>| {
            file_sinks.probe(Probe {
                node: watch.node,
                output: watch.output,
                writer,
            });
        };
        let mut records = Vec::new();
        for watch in watched(graph) {
            let (writer, record) = recorder(watch.stream.clone());
            probe(&watch, Box::new(writer));
            records.push(record);
        }
        let mut plots = Vec::new();
        for request in plot_requests(graph) {
            let mut traces = Vec::new();
            for watch in &request.signals {
                let (writer, trace) = tracer(&watch.stream, request.form);
                probe(watch, Box::new(writer));
                traces.push(trace);
            }
            plots.push((request, traces));
        }
        let mut clips = Vec::new();
        for watch in audible(graph) {
            let (writer, record) = clip(watch.stream.clone());
            probe(&watch, Box::new(writer));
            clips.push(record);
        }
        Self {
            records,
            requests: plots,
            clips,
        }
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
