//! What the page will show of a run: recorded while it runs.

use crate::engine::graph::Graph;
use crate::engine::node::FrameWriter;
use crate::engine::run::{Outlets, Probe};
use crate::report::asked::{Asked, Trace, asked, tracer};
use crate::report::record::{Record, Watch, recorder, watched};

/// What is recorded for the page.
pub struct Shown {
    /// Signals that are worth a look.
    pub records: Vec<Record>,
    /// The plots that the graph asks for, each with a trace for each of its signals.
    pub asked: Vec<(Asked, Vec<Trace>)>,
}

impl Shown {
    /// Begins to record.
    pub fn of(graph: &Graph, outlets: &mut Outlets<'_>) -> Self {
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
        Self {
            records,
            asked: plots,
        }
    }
}
