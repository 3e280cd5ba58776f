//! fundsp's `Net`, in f32.

use crate::work::{Contestant, Operation, Source, Work};
use fundsp::prelude32::*;

pub struct InNet {
    net: Net,
    block: usize,
    input: Vec<f32>,
    output: Vec<f32>,
}

impl InNet {
    pub fn new(work: &Work, input: &[f32]) -> Self {
        let mut net = Net::new(1, 1);
        let mut ids: Vec<NodeId> = Vec::new();
        for node in &work.nodes {
            let id = net.push(unit(node.operation, node.sources.len()));
            for (channel, source) in node.sources.iter().enumerate() {
                match source {
                    Source::Input => net.connect_input(0, id, channel),
                    Source::Node(from) => net.connect(ids[*from], 0, id, channel),
                }
            }
            ids.push(id);
        }
        net.pipe_output(ids[ids.len() - 1]);
        net.set_sample_rate(48_000.0);
        net.allocate();
        Self { net, block: work.block, input: input.to_vec(), output: vec![0.0; input.len()] }
    }
}

fn unit(operation: Operation, sources: usize) -> Box<dyn AudioUnit> {
    match (operation, sources) {
        (Operation::Gain(gain), 1) => Box::new(mul(gain)),
        (Operation::Gain(gain), 2) => Box::new((pass() + pass()) * gain),
        (Operation::Offset(offset), 1) => Box::new(add(offset)),
        (Operation::Biquad { b: [b0, b1, b2], a: [a1, a2], .. }, 1) => Box::new(biquad(a1, a2, b0, b1, b2)),
        (operation, sources) => unimplemented!("{operation:?} of {sources} sources"),
    }
}

impl Contestant for InNet {
    fn name(&self) -> &'static str {
        "fundsp Net"
    }

    fn run(&mut self) {
        if self.block == 1 {
            for (x, y) in self.input.iter().zip(&mut self.output) {
                self.net.tick(std::slice::from_ref(x), std::slice::from_mut(y));
            }
            return;
        }
        let mut from = BufferArray::<U1>::new();
        let mut to = BufferArray::<U1>::new();
        for (x, y) in self.input.chunks(self.block).zip(self.output.chunks_mut(self.block)) {
            from.channel_f32_mut(0)[..x.len()].copy_from_slice(x);
            self.net.process(x.len(), &from.buffer_ref(), &mut to.buffer_mut());
            y.copy_from_slice(&to.channel_f32(0)[..y.len()]);
        }
    }

    fn output(&self) -> Vec<f64> {
        self.output.iter().map(|y| f64::from(*y)).collect()
    }
}
