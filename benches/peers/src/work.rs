//! The work that every contestant does: nodes in an order in which each comes after what it reads.

use haptograph_signal::filter::butterworth_lowpass;
use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;

/// Samples a second.
pub const RATE_HZ: f64 = 48_000.0;
/// Samples of the input, a multiple of every block.
pub const SAMPLES: usize = 1024;

/// What a node does with the sum of what it reads.
#[derive(Debug, Clone, Copy)]
pub enum Operation {
    Gain(f32),
    Offset(f32),
    /// Butterworth low-pass of order 2: `(b0 + b1 z^-1 + b2 z^-2) / (1 + a1 z^-1 + a2 z^-2)`.
    Biquad {
        cutoff_hz: f64,
        b: [f32; 3],
        a: [f32; 2],
    },
}

/// What a node reads.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Source {
    Input,
    Node(usize),
}

#[derive(Debug, Clone)]
pub struct Node {
    pub operation: Operation,
    pub sources: Vec<Source>,
}

/// A graph with one input, whose last node is its output.
#[derive(Debug, Clone)]
pub struct Work {
    pub nodes: Vec<Node>,
    /// Samples at a time.
    pub block: usize,
}

impl Work {
    fn chain(block: usize, operations: impl IntoIterator<Item = Operation>) -> Self {
        let mut source = Source::Input;
        let mut nodes = Vec::new();
        for operation in operations {
            nodes.push(Node { operation, sources: vec![source] });
            source = Source::Node(nodes.len() - 1);
        }
        Self { nodes, block }
    }

    /// Gains and offsets in turn.
    pub fn gains_and_offsets(nodes: usize, block: usize) -> Self {
        let operation = |i| match i % 4 {
            0 => Operation::Gain(1.25),
            1 => Operation::Offset(0.01 * i as f32),
            2 => Operation::Gain(0.75),
            _ => Operation::Offset(-0.01 * i as f32),
        };
        Self::chain(block, (0..nodes).map(operation))
    }

    /// Low-passes from 17 to 22 kHz, so that most of the signal passes all of them.
    pub fn biquads(nodes: usize, block: usize) -> Self {
        let operation = |i| {
            let cutoff_hz = 17_000.0 + 5000.0 * i as f64 / nodes as f64;
            let filter = butterworth_lowpass(2, cutoff_hz, RATE_HZ).expect("order and cut-off are possible");
            let section = filter.sections[0];
            Operation::Biquad { cutoff_hz, b: section.b.map(|b| b as f32), a: section.a.map(|a| a as f32) }
        };
        Self::chain(block, (0..nodes).map(operation))
    }

    /// Gains of two sources each, wired at random so that every node counts for the output.
    pub fn random_gains(nodes: usize, block: usize, seed: u64) -> Self {
        let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
        // Nodes that nobody reads yet.
        let mut open: Vec<usize> = Vec::new();
        let mut made: Vec<Node> = Vec::new();
        for index in 0..nodes {
            let left = nodes - index;
            let unread = |random: &mut Xoshiro256PlusPlus, open: &mut Vec<usize>| {
                let at = random.random_range(0..open.len());
                Source::Node(open.swap_remove(at))
            };
            let sources = if index < 32 {
                vec![Source::Input]
            } else {
                let one = unread(&mut random, &mut open);
                // Towards the end the ends have to be tied up.
                let other = if open.len() >= left {
                    unread(&mut random, &mut open)
                } else {
                    Source::Node(random.random_range(0..index))
                };
                if one == other { vec![one] } else { vec![one, other] }
            };
            let gain = random.random_range(0.4..0.55) * if sources.len() == 1 { 2.0 } else { 1.0 };
            made.push(Node { operation: Operation::Gain(gain), sources });
            open.push(index);
        }
        Self { nodes: made, block }
    }

    pub fn edges(&self) -> usize {
        self.nodes.iter().map(|node| node.sources.len()).sum()
    }
}

/// Uniform noise that f32 holds exactly.
pub fn noise(samples: usize) -> Vec<f32> {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(1);
    (0..samples).map(|_| random.random_range(-1.0..1.0)).collect()
}

/// One way of doing the work.
pub trait Contestant {
    fn name(&self) -> &'static str;
    /// Runs all nodes over the whole input, a multiple of the block.
    fn run(&mut self);
    /// The samples of the last node in the last [`run`](Self::run).
    fn output(&self) -> Vec<f64>;
}
