//! `dasp_graph` over a petgraph, in f32; its buffers are always 64 samples long.

use crate::work::{Contestant, Operation, Source, Work};
use dasp_graph::{BoxedNode, Buffer, Input, Node, NodeData, Processor};
use petgraph::graph::{DiGraph, NodeIndex};

type Graph = DiGraph<NodeData<BoxedNode>, (), u32>;

pub struct InDasp {
    graph: Graph,
    processor: Processor<Graph>,
    source: NodeIndex,
    last: NodeIndex,
    input: Vec<f32>,
    output: Vec<f32>,
}

impl InDasp {
    /// None for other blocks than its own.
    pub fn new(work: &Work, input: &[f32]) -> Option<Self> {
        if work.block != Buffer::LEN {
            return None;
        }
        let mut graph = Graph::with_capacity(work.nodes.len() + 1, work.edges());
        let source = graph.add_node(NodeData::boxed1(Played));
        let mut last = source;
        let mut placed: Vec<NodeIndex> = Vec::new();
        for node in &work.nodes {
            last = graph.add_node(match node.operation {
                Operation::Gain(gain) => NodeData::boxed1(Gain(gain)),
                Operation::Offset(offset) => NodeData::boxed1(Offset(offset)),
                Operation::Biquad { b, a, .. } => NodeData::boxed1(Biquad { b, a, state: [0.0; 2] }),
            });
            for from in &node.sources {
                let from = match from {
                    Source::Input => source,
                    Source::Node(from) => placed[*from],
                };
                graph.add_edge(from, last, ());
            }
            placed.push(last);
        }
        Some(Self {
            processor: Processor::with_capacity(graph.node_count()),
            graph,
            source,
            last,
            input: input.to_vec(),
            output: vec![0.0; input.len()],
        })
    }
}

impl Contestant for InDasp {
    fn name(&self) -> &'static str {
        "dasp_graph"
    }

    fn run(&mut self) {
        for (x, y) in self.input.chunks_exact(Buffer::LEN).zip(self.output.chunks_exact_mut(Buffer::LEN)) {
            self.graph[self.source].buffers[0].copy_from_slice(x);
            self.processor.process(&mut self.graph, self.last);
            y.copy_from_slice(&self.graph[self.last].buffers[0]);
        }
    }

    fn output(&self) -> Vec<f64> {
        self.output.iter().map(|y| f64::from(*y)).collect()
    }
}

/// Its buffer is filled from outside.
struct Played;

impl Node for Played {
    fn process(&mut self, _: &[Input], _: &mut [Buffer]) {}
}

struct Gain(f32);

impl Node for Gain {
    fn process(&mut self, inputs: &[Input], output: &mut [Buffer]) {
        match inputs {
            [x] => output[0].iter_mut().zip(&x.buffers()[0][..]).for_each(|(y, x)| *y = self.0 * x),
            [a, b] => {
                let sources = a.buffers()[0].iter().zip(&b.buffers()[0][..]);
                output[0].iter_mut().zip(sources).for_each(|(y, (a, b))| *y = self.0 * (a + b));
            }
            _ => unimplemented!("{} sources", inputs.len()),
        }
    }
}

struct Offset(f32);

impl Node for Offset {
    fn process(&mut self, inputs: &[Input], output: &mut [Buffer]) {
        output[0].iter_mut().zip(&inputs[0].buffers()[0][..]).for_each(|(y, x)| *y = x + self.0);
    }
}

struct Biquad {
    b: [f32; 3],
    a: [f32; 2],
    state: [f32; 2],
}

impl Node for Biquad {
    fn process(&mut self, inputs: &[Input], output: &mut [Buffer]) {
        let ([b0, b1, b2], [a1, a2], [mut s1, mut s2]) = (self.b, self.a, self.state);
        for (y, x) in output[0].iter_mut().zip(&inputs[0].buffers()[0][..]) {
            *y = b0 * x + s1;
            s1 = b1 * x - a1 * *y + s2;
            s2 = b2 * x - a2 * *y;
        }
        self.state = [s1, s2];
    }
}
