//! The mean of the frames since the reader's last tick.

use super::{BridgeContext, BridgeSpec, BridgeType, Carries, Direction, Ends, slow_s};
use crate::node::Latency;
use haptograph_signal::time::Rate;

/// The mean of the fast frames since the previous slow tick, component by component.
#[derive(Debug, Clone)]
pub struct Average {
    /// The latest mean.
    mean: Vec<f64>,
    /// Sum of the frames since then.
    sum: Vec<f64>,
    /// Number of frames in the sum.
    summed: u32,
}

impl BridgeType for Average {
    const SPEC: BridgeSpec = BridgeSpec {
        name: "Average",
        doc: "The mean of the frames since the reader's last tick, from a fast clock to a slow one of one driver",
        gives: "the mean of the frames since the last tick",
        direction: Direction::ToSlower,
        carries: Carries::Linear,
    };

    fn new(cx: &BridgeContext) -> Self {
        Self { mean: cx.kind.neutral().collect(), sum: vec![0.0; cx.kind.width()], summed: 0 }
    }

    fn latency(from: Rate, to: Rate) -> Latency {
        Latency::of_group(slow_s(from, to) / 2.0)
    }

    fn cross(&mut self, ends: &Ends, x: &[f64], y: &mut [f64]) {
        let width = self.mean.len();
        let mut frames = x.chunks_exact(width).enumerate().peekable();
        for (j, out) in y.chunks_exact_mut(width).enumerate() {
            let latest = ends.latest_at(j);
            while let Some((_, frame)) = frames.next_if(|(k, _)| ends.first_written() + *k as u64 <= latest) {
                self.add(frame);
            }
            if self.summed > 0 {
                for (mean, sum) in self.mean.iter_mut().zip(&mut self.sum) {
                    *mean = *sum / f64::from(self.summed);
                    *sum = 0.0;
                }
                self.summed = 0;
            }
            out.copy_from_slice(&self.mean);
        }
        for (_, frame) in frames {
            self.add(frame);
        }
    }

    fn copy_state_from(&mut self, old: &Self) {
        self.mean.copy_from_slice(&old.mean);
        self.sum.copy_from_slice(&old.sum);
        self.summed = old.summed;
    }
}

impl Average {
    fn add(&mut self, frame: &[f64]) {
        for (sum, x) in self.sum.iter_mut().zip(frame) {
            *sum += x;
        }
        self.summed += 1;
    }
}
