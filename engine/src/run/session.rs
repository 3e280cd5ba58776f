//! A live run as a whole but for its driver: what it is controlled by, the files it writes, and what is known of it at
//! the end.

use super::live::{Change, Control, ControlError, Live, LiveState, live};
use super::meter::Meters;
use super::outlets::{Outlets, WriteError, file_ports, stream};
use super::rings::{TapRings, WriterThread};
use super::{Outcome, Run};
use crate::graph::{Graph, Work};
use crate::node::Stream;
use crate::plan::{Plan, PlanOptions};
use petgraph::graph::NodeIndex;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// How a graph runs live.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct LiveOptions {
    /// Driver frames of a block at most; 0 stands for the default.
    pub block: usize,
    /// When it ends; until it is stopped if there is none.
    pub seconds: Option<f64>,
}

/// A live run.
pub struct Session {
    control: Control,
    writer: WriterThread,
    block: usize,
    /// Everything that was ever written.
    entries: Vec<Entry>,
    /// Which stream of which entry each tap of the present plan is.
    taps: Vec<(usize, usize)>,
}

struct Entry {
    what: PathBuf,
    sink: Option<PathBuf>,
    streams: Vec<Stream>,
    running: bool,
}

/// What putting another graph in place did.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Changed {
    /// How the graphs differed.
    pub change: Change,
    /// What is written from now on.
    pub begun: Vec<PathBuf>,
    /// What is complete, as the new graph does not have it.
    pub ended: Vec<PathBuf>,
    /// What would have to be begun again, and is not: it holds other signals.
    pub left_out: Vec<PathBuf>,
}

/// Why another graph was not put in place.
#[derive(Debug, thiserror::Error)]
pub enum ChangeError {
    /// It does not go with what runs.
    #[error(transparent)]
    Control(#[from] ControlError),
    /// A file of it cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
}

/// What a live run did.
#[derive(Debug)]
pub struct LiveOutcome {
    /// As of an offline run.
    pub outcome: Outcome,
    /// How it kept time.
    pub meters: Meters,
    /// Did a node panic?
    pub panicked: bool,
    /// What could not be written; the run went on.
    pub failed: Vec<WriteError>,
    /// Numbers that the writer was too slow for.
    pub lost_numbers: u64,
}

impl Session {
    /// Both sides of a live run; the real-time one is for a driver.
    ///
    /// # Errors
    /// What the system says where it gives no thread.
    pub fn open(outlets: Outlets<'_>, options: &LiveOptions) -> std::io::Result<(Live, Self)> {
        let plan_options = PlanOptions {
            block: options.block,
            taps: outlets.taps.clone(),
        };
        let plan = Arc::new(Plan::new(outlets.graph, &plan_options));
        let (rings, outs) = TapRings::new(&plan, |_| true);
        let (mut live, control) = live(Arc::clone(&plan));
        live.send_taps_through(rings);
        if let Some(seconds) = options.seconds {
            live.end_after((seconds * plan.driver_rate().hz()).round().max(0.0) as u64);
        }
        let mut session = Self {
            control,
            writer: WriterThread::start()?,
            block: options.block,
            entries: Vec::new(),
            taps: vec![(0, 0); outlets.taps.len()],
        };
        session.write(outlets, outs);
        Ok((live, session))
    }

    /// The live settings, the stop, the meters.
    pub fn control(&mut self) -> &mut Control {
        &mut self.control
    }

    /// Puts another graph in place of the one that runs. Files that both write go on; new ones are opened in
    /// `folder`, and what the new graph has no more is completed.
    ///
    /// # Errors
    /// [`ChangeError`]; the graph that runs goes on.
    pub fn change(&mut self, graph: &Graph, folder: &Path) -> Result<Changed, ChangeError> {
        let mut outlets = Outlets::new(graph);
        let mut kept = Vec::new();
        let mut places = Vec::new();
        let mut ended = Vec::new();
        for (number, entry) in self.entries.iter().enumerate().filter(|(_, entry)| entry.running) {
            let Some(ports) = entry.ports_in(graph) else {
                ended.push(number);
                continue;
            };
            for (stream, port) in ports.into_iter().enumerate() {
                let old = self.taps.iter().position(|tap| *tap == (number, stream));
                kept.extend(old.map(|old| (old, outlets.taps.len())));
                outlets.taps.push(port);
                places.push((number, stream));
            }
        }
        let mut left_out = Vec::new();
        for (index, file) in files(graph) {
            match self
                .entries
                .iter()
                .position(|entry| entry.sink.as_deref() == Some(file))
            {
                None => {
                    if let Err(error) = outlets.open_file(index, folder) {
                        outlets.take_back();
                        return Err(error.into());
                    }
                }
                Some(known) if ended.contains(&known) || !self.entries[known].running => {
                    left_out.push(self.entries[known].what.clone());
                }
                Some(_) => {}
            }
        }
        let begun = outlets
            .written
            .iter()
            .map(|written| written.what.clone())
            .collect();
        let options = PlanOptions {
            block: self.block,
            taps: outlets.taps.clone(),
        };
        let plan = Arc::new(Plan::new(graph, &options));
        let goes_on = |place: usize| kept.iter().any(|(_, new)| *new == place);
        let (mut rings, outs) = TapRings::new(&plan, |place| !goes_on(place));
        rings.kept.clone_from(&kept);
        let change = match self.control.swap_with(plan, rings) {
            Ok(change) => change,
            Err(error) => {
                outlets.take_back();
                return Err(error.into());
            }
        };
        for number in &ended {
            self.entries[*number].running = false;
        }
        places.resize(outlets.taps.len(), (0, 0));
        self.taps = places;
        self.write(outlets, outs);
        let ended = ended.iter().map(|number| self.entries[*number].what.clone());
        Ok(Changed {
            change,
            begun,
            ended: ended.collect(),
            left_out,
        })
    }

    /// Hands writers and the far ends of their rings to the writing thread.
    fn write(&mut self, outlets: Outlets<'_>, mut rings: Vec<Option<rtrb::Consumer<f64>>>) {
        for written in outlets.written {
            let number = self.entries.len();
            let mut streams = Vec::new();
            let mut ends = Vec::new();
            for (place, tap) in written.taps.iter().enumerate() {
                self.taps[*tap] = (number, place);
                streams.push(stream(outlets.graph, outlets.taps[*tap]));
                ends.extend(rings[*tap].take());
            }
            self.entries.push(Entry {
                what: written.what.clone(),
                sink: written.sink.clone(),
                streams,
                running: true,
            });
            self.writer.add(written, ends);
        }
    }

    /// Completes all files. `live` is what the driver gave back when it was done.
    pub fn finish(mut self, live: Live) -> LiveOutcome {
        let meters = self.control.poll().clone();
        let rate_hz = self.control.plan().driver_rate().hz();
        let outcome = Outcome {
            driver_frames: live.frames(),
            seconds: live.frames() as f64 / rate_hz,
            stopped: live.state() != LiveState::Finished,
            faults: live.faults(),
            actuators: live.run().actuators().collect(),
            rings: Vec::new(),
        };
        let panicked = matches!(live.state(), LiveState::Panicked | LiveState::Lost);
        let lost_numbers = live.lost_numbers();
        // The rings end when both sides are gone: an old plan may still be on its way between them.
        drop(live);
        drop(self.control);
        LiveOutcome {
            outcome,
            meters,
            panicked,
            failed: self.writer.finish(),
            lost_numbers,
        }
    }
}

impl Entry {
    /// The ports of a graph that carry what is written here, if it has them all.
    fn ports_in(&self, graph: &Graph) -> Option<Vec<(NodeIndex, usize)>> {
        if let Some(sink) = &self.sink {
            let (index, _) = files(graph).find(|(_, file)| file == sink)?;
            let ports = file_ports(graph, index);
            let same = ports.len() == self.streams.len()
                && ports
                    .iter()
                    .zip(&self.streams)
                    .all(|(port, known)| carries(graph, *port, known));
            return same.then_some(ports);
        }
        self.streams.iter().map(|known| find(graph, known)).collect()
    }
}

fn files(graph: &Graph) -> impl Iterator<Item = (NodeIndex, &Path)> {
    graph
        .nodes
        .node_indices()
        .filter_map(|index| match &graph.nodes[index].work {
            Work::File(sink) => Some((index, sink.file_name())),
            _ => None,
        })
}

fn find(graph: &Graph, known: &Stream) -> Option<(NodeIndex, usize)> {
    let ports = graph
        .nodes
        .node_indices()
        .flat_map(|index| (0..graph.nodes[index].outputs.len()).map(move |output| (index, output)));
    let mut same = ports.filter(|port| carries(graph, *port, known));
    same.next()
}

fn carries(graph: &Graph, port: (NodeIndex, usize), known: &Stream) -> bool {
    let found = stream(graph, port);
    let simulated = known.simulated;
    Stream { simulated, ..found } == *known
}

impl Run {
    /// Rate of the driver whose frames it counts, Hz.
    pub fn rate_hz(&self) -> f64 {
        self.plan.driver_rate().hz()
    }
}
