//! The latest frame.

use super::{BridgeContext, BridgeSpec, BridgeType, Carries, Direction, Ends, slow_s};
use crate::node::Latency;
use haptograph_signal::time::Rate;

/// Zero-order hold: the latest frame with time <= t.
#[derive(Debug, Clone)]
pub struct Hold {
    last: Vec<f64>,
}

impl BridgeType for Hold {
    const SPEC: BridgeSpec = BridgeSpec {
        name: "Hold",
        doc: "The latest frame, between clocks of one driver",
        gives: "the latest frame",
        direction: Direction::Any,
        carries: Carries::Every,
    };

    fn new(cx: &BridgeContext) -> Self {
        Self { last: cx.kind.neutral().collect() }
    }

    fn latency(from: Rate, to: Rate) -> Latency {
        Latency::of_group(slow_s(from, to) / 2.0)
    }

    fn cross(&mut self, ends: &Ends, x: &[f64], y: &mut [f64]) {
        let width = self.last.len();
        if ends.goes_slower() {
            for (j, out) in y.chunks_exact_mut(width).enumerate() {
                let k = ends.latest_at(j).checked_sub(ends.first_written());
                let frame = k.and_then(|k| x.chunks_exact(width).nth(k as usize));
                out.copy_from_slice(frame.unwrap_or(&self.last));
            }
        } else {
            let first = ends.reader_at(ends.first_written());
            fill(&mut y[..first * width], &self.last);
            let mut begin = first;
            for (k, frame) in x.chunks_exact(width).enumerate() {
                let end = ends.reader_at(ends.first_written() + k as u64 + 1);
                fill(&mut y[begin * width..end * width], frame);
                begin = end;
            }
        }
        self.keep_last(x);
    }

    fn copy_state_from(&mut self, old: &Self) {
        self.last.copy_from_slice(&old.last);
    }
}

impl Hold {
    fn keep_last(&mut self, x: &[f64]) {
        if let Some(last) = x.chunks_exact(self.last.len()).last() {
            self.last.copy_from_slice(last);
        }
    }
}

fn fill(frames: &mut [f64], frame: &[f64]) {
    match frame {
        [value] => frames.fill(*value),
        _ => frames.chunks_exact_mut(frame.len()).for_each(|out| out.copy_from_slice(frame)),
    }
}

/// Zero-order hold for an input that reads runs. Its output is run-length encoded: `[count, (start, components..), ..]`.
#[derive(Debug, Clone)]
pub(crate) struct HoldRuns(Hold);

impl BridgeType for HoldRuns {
    const SPEC: BridgeSpec = Hold::SPEC;

    fn new(cx: &BridgeContext) -> Self {
        Self(Hold::new(cx))
    }

    fn latency(from: Rate, to: Rate) -> Latency {
        Hold::latency(from, to)
    }

    fn cross(&mut self, ends: &Ends, x: &[f64], y: &mut [f64]) {
        let width = self.0.last.len();
        let stride = width + 1;
        let mut runs = 0;
        let mut begin = 0;
        let mut put = |begin: usize, frame: &[f64]| {
            let run = &mut y[1 + runs * stride..][..stride];
            run[0] = begin as f64;
            run[1..].copy_from_slice(frame);
            runs += 1;
        };
        let first = ends.reader_at(ends.first_written());
        if first > 0 {
            put(0, &self.0.last);
            begin = first;
        }
        for (k, frame) in x.chunks_exact(width).enumerate() {
            let end = ends.reader_at(ends.first_written() + k as u64 + 1);
            if end > begin {
                put(begin, frame);
                begin = end;
            }
        }
        y[0] = runs as f64;
        self.0.keep_last(x);
    }

    fn copy_state_from(&mut self, old: &Self) {
        self.0.copy_state_from(&old.0);
    }
}
