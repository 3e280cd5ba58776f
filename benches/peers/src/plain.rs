//! What one would write by hand, in f64: a loop over the nodes around a loop over the samples, no graph at all.

use crate::work::{Contestant, Operation, Source, Work};

pub struct ByHand {
    work: Work,
    /// Two values for each node: the state of a biquad.
    states: Vec<[f64; 2]>,
    /// The samples of each node in the present block; a chain needs only one.
    blocks: Vec<Vec<f64>>,
    input: Vec<f64>,
    output: Vec<f64>,
}

impl ByHand {
    pub fn new(work: &Work, input: &[f32]) -> Self {
        Self {
            states: vec![[0.0; 2]; work.nodes.len()],
            blocks: vec![vec![0.0; work.block]; work.nodes.len()],
            work: work.clone(),
            input: input.iter().map(|x| f64::from(*x)).collect(),
            output: vec![0.0; input.len()],
        }
    }
}

impl Contestant for ByHand {
    fn name(&self) -> &'static str {
        "by hand"
    }

    fn run(&mut self) {
        let chain = self.work.nodes.iter().all(|node| node.sources.len() == 1);
        let block = self.work.block;
        for (x, y) in self.input.chunks_exact(block).zip(self.output.chunks_exact_mut(block)) {
            if chain {
                y.copy_from_slice(x);
                for (node, state) in self.work.nodes.iter().zip(&mut self.states) {
                    in_place(node.operation, state, y);
                }
                continue;
            }
            for (index, node) in self.work.nodes.iter().enumerate() {
                let (before, rest) = self.blocks.split_at_mut(index);
                let own = &mut rest[0][..];
                let of = |source: &Source| match source {
                    Source::Input => x,
                    Source::Node(from) => &before[*from],
                };
                own.copy_from_slice(of(&node.sources[0]));
                for source in &node.sources[1..] {
                    own.iter_mut().zip(of(source)).for_each(|(y, x)| *y += x);
                }
                in_place(node.operation, &mut self.states[index], own);
            }
            y.copy_from_slice(&self.blocks[self.work.nodes.len() - 1]);
        }
    }

    fn output(&self) -> Vec<f64> {
        self.output.clone()
    }
}

#[inline]
fn in_place(operation: Operation, [s1, s2]: &mut [f64; 2], samples: &mut [f64]) {
    match operation {
        Operation::Gain(gain) => samples.iter_mut().for_each(|y| *y *= f64::from(gain)),
        Operation::Offset(offset) => samples.iter_mut().for_each(|y| *y += f64::from(offset)),
        Operation::Biquad { b, a, .. } => {
            let ([b0, b1, b2], [a1, a2]) = (b.map(f64::from), a.map(f64::from));
            let (mut t1, mut t2) = (*s1, *s2);
            for sample in samples {
                let x = *sample;
                let y = b0 * x + t1;
                t1 = b1 * x - a1 * y + t2;
                t2 = b2 * x - a2 * y;
                *sample = y;
            }
            (*s1, *s2) = (t1, t2);
        }
    }
}
