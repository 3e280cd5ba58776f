//! haptograph's engine, in f64.

use crate::work::{Contestant, Operation, Source, Work, noise};
use haptograph_engine::frame::Kind;
use haptograph_engine::node::{
    BuildContext, BuildError, Io, NodeEntry, NodeKind, NodeSpec, Processor, Tick, output,
};
use haptograph_engine::plan::{Plan, PlanOptions};
use haptograph_engine::run::Run;
use haptograph_signal::quantity::Quantity;
use std::sync::Arc;

pub struct Ours {
    run: Run,
    block: usize,
    output: Vec<f64>,
}

haptograph_engine::settings! {
    /** The input. */
    pub struct PlaySettings {
    }
}
struct Play;
impl NodeKind for Play {
    type Settings = PlaySettings;
    const SPEC: NodeSpec = NodeSpec {
        name: "Play", group: "bench", doc: "Plays the input.", source: "", inputs: &[],
        outputs: &[output("output", Kind::Scalar, Quantity::NUMBER, "The input.")], example: "Play()",
    };
    fn build(_: PlaySettings, _: &BuildContext) -> Result<Box<dyn Processor>, BuildError> {
        Ok(Box::new(Player { samples: noise(1024).iter().map(|x| f64::from(*x)).collect(), at: 0 }))
    }
}
#[derive(Clone)]
struct Player { samples: Vec<f64>, at: usize }
impl Processor for Player {
    fn process(&mut self, tick: &Tick, io: &mut Io<'_>) {
        if self.at == self.samples.len() { self.at = 0; }
        copy(&self.samples[self.at..self.at + tick.frames], io.out(0));
        self.at += tick.frames;
    }
}
#[derive(Clone)]
struct Gain(f64);
impl Processor for Gain {
    fn process(&mut self, _: &Tick, io: &mut Io<'_>) {
        let x = io.lanes(0);
        if io.input_count() == 1 {
            haptograph_signal::elementwise::scale(self.0, x, io.out(0));
        } else {
            let b = io.lanes(1);
            haptograph_signal::elementwise::scale_sum(self.0, x, b, io.out(0));
        }
    }
    fn has_frame(&self) -> bool { std::env::var_os("NOFRAME").is_none() }
    fn frame(&mut self, x: f64) -> f64 { self.0 * x }
}
#[derive(Clone)]
struct Offset(f64);
impl Processor for Offset {
    fn process(&mut self, _: &Tick, io: &mut Io<'_>) {
        let x = io.lanes(0);
        haptograph_signal::elementwise::offset(self.0, x, io.out(0));
    }
    fn has_frame(&self) -> bool { std::env::var_os("NOFRAME").is_none() }
    fn frame(&mut self, x: f64) -> f64 { x + self.0 }
}
#[derive(Clone)]
struct Biquad(haptograph_signal::filter::SectionsState);
impl Processor for Biquad {
    fn process(&mut self, _: &Tick, io: &mut Io<'_>) {
        let x = io.lanes(0);
        self.0.process(x, io.out(0));
    }
}

/// A single sample without the call of `memcpy`.
fn copy(x: &[f64], y: &mut [f64]) {
    match (x, y) {
        ([x], [y]) => *y = *x,
        (x, y) => y.copy_from_slice(x),
    }
}

impl Ours {
    pub fn new(work: &Work, input: &[f32]) -> Self {
        let entry = NodeEntry::processor::<Play>();
        let play = Box::new(Player { samples: input.iter().map(|x| f64::from(*x)).collect(), at: 0 });
        let mut nodes: Vec<(NodeEntry, Box<dyn Processor>)> = vec![(entry, play)];
        let mut edges = vec![];
        for (i, node) in work.nodes.iter().enumerate() {
            nodes.push((entry, match node.operation {
                Operation::Gain(g) => Box::new(Gain(f64::from(g))),
                Operation::Offset(g) => Box::new(Offset(f64::from(g))),
                Operation::Biquad { b, a } => Box::new(Biquad(haptograph_signal::filter::SectionsState::new(&haptograph_signal::filter::Sections { sections: vec![haptograph_signal::filter::Biquad { b: b.map(f64::from), a: a.map(f64::from) }] }))),
            }));
            for (j, s) in node.sources.iter().enumerate() {
                edges.push((match s { Source::Input => 0, Source::Node(k) => k + 1 }, i + 1, j));
            }
        }
        let graph = haptograph_engine::graph::by_hand::graph(nodes, &edges);
        let last = graph.nodes().node_indices().last().unwrap();
        let start = std::time::Instant::now();
        let plan = Plan::new(&graph, &PlanOptions { block: work.block, taps: vec![(last, 0)] });
        eprintln!("planned {} nodes in {:?}, {} bytes", work.nodes.len(), start.elapsed(), plan.buffer_bytes());
        Self { run: Run::new(Arc::new(plan)), block: work.block, output: vec![0.0; input.len()] }
    }
}

impl Contestant for Ours {
    fn name(&self) -> &'static str {
        "haptograph"
    }

    fn run(&mut self) {
        for y in self.output.chunks_exact_mut(self.block) {
            self.run.advance(y.len());
            copy(self.run.tap(0), y);
        }
    }

    fn output(&self) -> Vec<f64> {
        self.output.clone()
    }
}
