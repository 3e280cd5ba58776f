//! Signals recorded during a run for its page.

use crate::engine::graph::Graph;
use crate::engine::node::FrameWriter;
use crate::engine::run::{FileSinks, Probe};
use crate::report::asked::{Asked, Trace, asked, tracer};
use crate::report::record::{Record, Watch, recorder, watched};
use crate::report::sound::{Clip, ClipRecord, Sound, audible, clip};

/// Recorders of the plots and the sound of a page.
pub struct Shown {
    /// Signals plotted by default.
    pub records: Vec<Record>,
    /// The plots requested by the graph, each with a trace per signal.
    pub asked: Vec<(Asked, Vec<Trace>)>,
    /// Beginnings of the signals that may be played, the most suitable first.
    clips: Vec<ClipRecord>,
}

impl Shown {
    /// Attaches the recorders.
    pub fn of(graph: &Graph, outlets: &mut FileSinks<'_>) -> Self {
        let mut probe = |watch: &Watch, writer: Box<dyn FrameWriter>| {
            outlets.probe(Probe {
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
        for asked in asked(graph) {
            let mut traces = Vec::new();
            for watch in &asked.signals {
                let (writer, trace) = tracer(&watch.stream, asked.form);
                probe(watch, Box::new(writer));
                traces.push(trace);
            }
            plots.push((asked, traces));
        }
        let mut clips = Vec::new();
        for watch in audible(graph) {
            let (writer, record) = clip(watch.stream.clone());
            probe(&watch, Box::new(writer));
            clips.push(record);
        }
        Self {
            records,
            asked: plots,
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
