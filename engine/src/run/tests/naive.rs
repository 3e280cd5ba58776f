//! What a graph means: every tick of every node in the order of time, every signal's whole history kept.

use super::world::{Body, LIMIT, Leaky};
use crate::device::Device;
use crate::graph::{Bridge, Graph, Work};
use crate::limiter::Limiter;
use petgraph::graph::NodeIndex;
use petgraph::visit::EdgeRef;

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
    let count = graph.nodes.node_count();
    let nodes = graph.nodes.node_indices().map(|i| match &graph.nodes[i].work {
        Work::Process(_) => Some(Leaky {
            kept: 0.0,
            weight: 0.7,
            held: graph.nodes[i].inputs.iter().map(|input| input.held).collect(),
        }),
        _ => None,
    });
    let limiter = graph
        .devices
        .first()
        .map(|device| Limiter::new(&LIMIT, graph.clocks[device.clock].rate.hz()));
    let mut naive = Naive {
        graph,
        history: vec![Vec::new(); count],
        nodes: nodes.collect(),
        body: Body {
            position: 0.0,
            drive: 0.0,
        },
        limiter: limiter.map(Result::unwrap),
    };
    let end = frames * graph.base.period(0);
    let periods: Vec<u64> = (0..graph.clocks.len())
        .map(|clock| graph.base.period(clock))
        .collect();
    let mut time = 0;
    while time < end {
        for node in graph.nodes.node_indices() {
            naive.value(node, time);
        }
        // The next time at which any clock ticks.
        time = periods
            .iter()
            .map(|period| (time / period + 1) * period)
            .min()
            .unwrap_or(end);
    }
    naive.history
}

impl Naive<'_> {
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
        let mut edges: Vec<_> = self
            .graph
            .nodes
            .edges_directed(node, petgraph::Incoming)
            .collect();
        edges.sort_by_key(|edge| edge.weight().input);
        let period = self.period(node);
        let inputs: Vec<f64> = edges
            .iter()
            .map(|edge| self.input(edge.source(), edge.weight().bridge, tick, period))
            .collect();
        match &mut self.nodes[node.index()] {
            Some(leaky) => leaky.next(tick, inputs.into_iter()),
            None => self.limiter.as_mut().unwrap().apply([inputs[0] * 0.1])[0],
        }
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
                return initial;
            };
            self.value(from, tick * from_period);
            return self.history[from.index()][tick as usize];
        }
        self.value(from, time);
        let history = &self.history[from.index()];
        let latest = (time / from_period) as usize;
        match bridge {
            Bridge::Linear => {
                let (a, b) = (history[latest.saturating_sub(1)], history[latest]);
                let since = time - latest as u64 * from_period;
                a + (b - a) * (since as f64 / from_period as f64)
            }
            Bridge::Average => {
                // Everything since the reader's previous tick that had anything new.
                let before = |t: u64| (t / from_period) as usize + 1;
                let mut begin = tick
                    .checked_sub(1)
                    .map_or(0, |previous| before(previous * period));
                let end = latest + 1;
                let mut back = tick;
                while begin == end && back > 0 {
                    back -= 1;
                    begin = back
                        .checked_sub(1)
                        .map_or(0, |previous| before(previous * period));
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
