//! The signals that the page of a run shows and plays, recorded while it runs.

use super::plot_request::{PlotRequest, Trace, plot_requests};
use super::record::{Record, Recorded, Reduction, WatchedOutput, recorder, watch, watched};
use super::sound::{Clip, Sound, audible};
use haptograph_engine::graph::Graph;
use haptograph_engine::node::{FrameWriter, OutputRole};
use haptograph_surfaces::{TextureModel, files};

/// Recorders of the plots and the sound of a page.
#[derive(Debug)]
pub struct PlottedSignals {
    /// Signals plotted by default.
    signals: Vec<Record<Recorded>>,
    /// The plots requested by the graph, each with a trace per signal.
    requests: Vec<(PlotRequest, Vec<Record<Trace>>)>,
    /// Beginnings of the signals that may be played, the most suitable first.
    clips: Vec<Record<Clip>>,
    shortfalls: Vec<(Shortfalls, Record<TickCounts>)>,
}

/// An output that states in which ticks its node could not do what was asked of it.
#[derive(Debug)]
struct Shortfalls {
    output: String,
    reasons: &'static [&'static str],
}

/// The number of ticks without a shortfall, and of those of each reason.
#[derive(Debug, Clone)]
struct TickCounts(Vec<u64>);

impl Reduction for TickCounts {
    fn extend(&mut self, frames: &[f64]) {
        for reason in frames {
            if let Some(ticks) = self.0.get_mut(*reason as usize) {
                *ticks += 1;
            }
        }
    }
}

impl PlottedSignals {
    /// Recorders for a graph; `attach` gives each writer the frames of its output.
    pub fn of(graph: &Graph, mut attach: impl FnMut(&WatchedOutput, Box<dyn FrameWriter>)) -> Self {
        let mut plotted =
            Self { signals: Vec::new(), requests: Vec::new(), clips: Vec::new(), shortfalls: Vec::new() };
        for watch in watched(graph) {
            let recorded = Recorded::of(watch.stream.clone());
            plotted.signals.push(attached(&watch, recorded, &mut attach));
        }
        for request in plot_requests(graph) {
            let trace = |watch: &WatchedOutput| {
                attached(watch, Trace::of(watch.stream.clone(), request.form), &mut attach)
            };
            let traces = request.signals.iter().map(trace).collect();
            plotted.requests.push((request, traces));
        }
        for watch in audible(graph) {
            plotted.clips.push(attached(&watch, Clip::of(watch.stream.clone()), &mut attach));
        }
        for (watch, reasons) in shortfalls(graph) {
            let ticks = attached(&watch, TickCounts(vec![0; reasons.len() + 1]), &mut attach);
            plotted.shortfalls.push((Shortfalls { output: watch.stream.name, reasons }, ticks));
        }
        plotted
    }

    /// Warnings of the nodes that could not do what was asked of them: the reason, and the number of ticks.
    pub fn shortfalls(&self) -> Vec<String> {
        let mut list = Vec::new();
        for (Shortfalls { output, reasons }, ticks) in &self.shortfalls {
            let TickCounts(ticks) = ticks.content();
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
        self.signals.iter().map(Record::content).collect()
    }

    /// The requested plots, each with its traces.
    pub fn plots(&self) -> Vec<(&PlotRequest, Vec<Trace>)> {
        let each = self.requests.iter();
        each.map(|(request, traces)| (request, traces.iter().map(Record::content).collect())).collect()
    }

    /// The sound to play; `None` if nothing vibrates.
    pub fn sound(&self) -> Option<Sound> {
        let clips: Vec<Clip> = self.clips.iter().map(Record::content).collect();
        Sound::of(&clips)
    }

    /// Frees the sound, since many runs would need much memory.
    pub fn forget_sound(&mut self) {
        self.clips.clear();
    }
}

/// Attaches a writer that reduces an output.
fn attached<T: Reduction>(
    watch: &WatchedOutput,
    reduction: T,
    attach: &mut impl FnMut(&WatchedOutput, Box<dyn FrameWriter>),
) -> Record<T> {
    let (writer, record) = recorder(reduction);
    attach(watch, Box::new(writer));
    record
}

/// The outputs that state shortfalls of their nodes, with the reasons.
fn shortfalls(graph: &Graph) -> Vec<(WatchedOutput, &'static [&'static str])> {
    let nodes = graph.nodes();
    let outputs =
        nodes.ids().flat_map(|node| (0..nodes[node].outputs.len()).map(move |output| (node, output)));
    let stated = outputs.filter_map(|(node, output)| match nodes[node].output_spec(output)?.role {
        OutputRole::Shortfall(reasons) => Some((watch(graph, node, output)?, reasons)),
        _ => None,
    });
    stated.collect()
}

/// The textures of nodes with a position on a map, by the name of that signal.
pub fn textures(graph: &Graph) -> Vec<(String, TextureModel)> {
    let mut found = Vec::new();
    for node in graph.nodes().iter() {
        // The graph was built from these files; one that has become unreadable is not drawn.
        let surface = node.files.iter().find_map(|path| files::load(path).ok());
        let Some(texture) = surface.and_then(|surface| surface.texture) else {
            continue;
        };
        let names = node.outputs.iter().map(|port| format!("{}.{}", node.path, port.name));
        found.extend(names.map(|name| (name, texture.clone())));
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
