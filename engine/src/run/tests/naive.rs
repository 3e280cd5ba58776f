//! What a graph means: every tick of every node in the order of time, every signal's whole history kept.

use super::world::{AVERAGE, Body, LIMIT, LINEAR, Leaky, as_leaky};
use crate::device::Device;
use crate::graph::{Bridge, Graph, Work};
use crate::limiter::Limiter;
use petgraph::graph::NodeIndex;
use petgraph::visit::EdgeRef;

#[derive(Clone)]
struct Naive<'a> {
    graph: &'a Graph,
    /// All frames of every node so far.
    history: Vec<Vec<f64>>,
    nodes: Vec<Option<Leaky>>,
    body: Body,
    limiter: Option<Limiter<1>>,
}

/// The output of every node over `frames` frames of clock 0.
pub fn evaluate(graph: &Graph, frames: u64) -> Vec<Vec<f64>> {
    let mut naive = Naive::new(graph);
    for time in naive.times(0, frames) {
        for node in graph.nodes.node_indices() {
            naive.value(node, time);
        }
    }
    naive.history
}

/// The same where at frame `at` of clock 0 another graph of the same nodes, with other weights and gains, rises over
/// the first within `fade` frames: both go on from one history, one body feels the mix of what both ask of it.
pub fn cross_fade(old: &Graph, new: &Graph, at: u64, fade: u64, frames: u64) -> Vec<Vec<f64>> {
    let mut former = Naive::new(old);
    for time in former.times(0, at) {
        for node in old.nodes.node_indices() {
            former.value(node, time);
        }
    }
    let mut naive = Naive { graph: new, ..former.clone() };
    for (node, leaky) in naive.nodes.iter_mut().enumerate() {
        if let (Some(leaky), Some(other)) = (leaky, weight(new, NodeIndex::new(node))) {
            leaky.weight = other;
        }
    }
    let period = old.base.period(0);
    let find = |wanted: fn(&Work) -> bool| old.nodes.node_indices().find(|i| wanted(&old.nodes[*i].work));
    let source = find(|work| matches!(work, Work::Source { .. }));
    let sink = find(|work| matches!(work, Work::Actuator { .. }));
    for time in naive.times(at, frames) {
        if let (Some(source), Some(sink)) = (source, sink) {
            // One body, moved by what both were given at the sink's tick before.
            naive.value(source, time);
            former.history[source.index()].clone_from(&naive.history[source.index()]);
            for node in old.nodes.node_indices().filter(|node| *node != sink) {
                former.value(node, time);
                naive.value(node, time);
            }
            let tick = naive.history[sink.index()].len() as u64;
            if tick * naive.period(sink) <= time {
                let share = ((time - at * period) as f64 / (fade * period) as f64).min(1.0);
                let asked = naive.asked(sink, tick) * share + former.asked(sink, tick) * (1.0 - share);
                let given = naive.limiter.as_mut().unwrap().apply([asked])[0];
                naive.history[sink.index()].push(given);
                former.history[sink.index()].push(given);
            }
        }
        for node in old.nodes.node_indices() {
            naive.value(node, time);
        }
    }
    naive.history
}

fn weight(graph: &Graph, node: NodeIndex) -> Option<f64> {
    let Work::Process(processor) = &graph.nodes[node].work else {
        return None;
    };
    let mut copy = Work::Process(processor.boxed_clone());
    as_leaky(&mut copy).map(|leaky| leaky.weight)
}

impl<'a> Naive<'a> {
    fn new(graph: &'a Graph) -> Self {
        let nodes = graph.nodes.node_indices().map(|i| {
            weight(graph, i).map(|weight| Leaky {
                kept: 0.0,
                weight,
                held: graph.nodes[i].inputs.iter().map(|input| input.held).collect(),
            })
        });
        let limiter =
            graph.devices.first().map(|device| Limiter::new(&LIMIT, graph.clocks[device.clock].rate.hz()));
        Self {
            graph,
            history: vec![Vec::new(); graph.nodes.node_count()],
            nodes: nodes.collect(),
            body: Body { position: 0.0, drive: 0.0 },
            limiter: limiter.map(Result::unwrap),
        }
    }

    /// The times from frame `from` of clock 0 to frame `to` at which any clock ticks.
    fn times(&self, from: u64, to: u64) -> impl Iterator<Item = u64> + use<> {
        let clocks = 0..self.graph.clocks.len();
        let periods: Vec<u64> = clocks.map(|clock| self.graph.base.period(clock)).collect();
        let (begin, end) = (from * periods[0], to * periods[0]);
        let next = move |time: &u64| periods.iter().map(|period| (time / period + 1) * period).min();
        std::iter::successors(Some(begin), next).take_while(move |time| *time < end)
    }

    fn period(&self, node: NodeIndex) -> u64 {
        self.graph.base.period(self.graph.nodes[node].clock.unwrap())
    }

    /// Makes sure that a node's frames up to `time` are there.
    fn value(&mut self, node: NodeIndex, time: u64) {
        while self.history[node.index()].len() as u64 * self.period(node) <= time {
            let tick = self.history[node.index()].len() as u64;
            let out = self.tick(node, tick);
            self.history[node.index()].push(out);
        }
    }

    fn tick(&mut self, node: NodeIndex, tick: u64) -> f64 {
        if let Work::Source { .. } = self.graph.nodes[node].work {
            return self.read_body(tick);
        }
        if self.nodes[node.index()].is_none() {
            let asked = self.asked(node, tick);
            return self.limiter.as_mut().unwrap().apply([asked])[0];
        }
        let inputs = self.inputs(node, tick);
        self.nodes[node.index()].as_mut().unwrap().next(tick, inputs.into_iter())
    }

    /// What a sink asks for.
    fn asked(&mut self, sink: NodeIndex, tick: u64) -> f64 {
        let Work::Actuator { gain, .. } = self.graph.nodes[sink].work else {
            panic!("a sink");
        };
        self.inputs(sink, tick)[0] * gain
    }

    fn inputs(&mut self, node: NodeIndex, tick: u64) -> Vec<f64> {
        let mut edges: Vec<_> = self.graph.nodes.edges_directed(node, petgraph::Incoming).collect();
        edges.sort_by_key(|edge| edge.weight().input);
        let period = self.period(node);
        edges.iter().map(|edge| self.input(edge.source(), edge.weight().bridge, tick, period)).collect()
    }

    /// The body at tick k has been moved under the drive of every tick before k.
    fn read_body(&mut self, tick: u64) -> f64 {
        if tick > 0 {
            let sink = |i: &NodeIndex| matches!(self.graph.nodes[*i].work, Work::Actuator { .. });
            let sink = self.graph.nodes.node_indices().find(sink).unwrap();
            let time = (tick - 1) * self.period(sink);
            self.value(sink, time);
            self.body.drive = self.history[sink.index()][tick as usize - 1];
            self.body.advance();
        }
        let mut frame = [0.0];
        self.body.read(0, &mut frame);
        frame[0]
    }

    fn input(&mut self, from: NodeIndex, bridge: Bridge, tick: u64, period: u64) -> f64 {
        let time = tick * period;
        let from_period = self.period(from);
        if let Bridge::Delay { frames, initial } = bridge {
            let Some(tick) = tick.checked_sub(frames) else {
                return initial.unwrap_or(0.0);
            };
            self.value(from, tick * from_period);
            return self.history[from.index()][tick as usize];
        }
        self.value(from, time);
        let history = &self.history[from.index()];
        let latest = (time / from_period) as usize;
        match bridge {
            linear if linear == LINEAR => {
                let (a, b) = (history[latest.saturating_sub(1)], history[latest]);
                let since = time - latest as u64 * from_period;
                a + (b - a) * (since as f64 / from_period as f64)
            }
            average if average == AVERAGE => {
                // Everything since the reader's previous tick that had anything new.
                let before = |t: u64| (t / from_period) as usize + 1;
                let mut begin = tick.checked_sub(1).map_or(0, |previous| before(previous * period));
                let end = latest + 1;
                let mut back = tick;
                while begin == end && back > 0 {
                    back -= 1;
                    begin = back.checked_sub(1).map_or(0, |previous| before(previous * period));
                    if begin < end {
                        break;
                    }
                }
                let frames = &history[begin..end];
                let mut sum = 0.0;
                for frame in frames {
                    sum += frame;
                }
                sum / frames.len() as f64
            }
            _ => history[latest],
        }
    }
}
