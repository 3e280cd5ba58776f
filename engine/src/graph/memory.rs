//! Memory bound of a graph, checked before anything is allocated.

use super::Bridge;
use super::attach::Attached;
use super::context::Context;
use crate::diagnostic::{Diagnostic, Span};
use crate::frame::Kind;
use haptograph_signal::time::Rate;

/// Largest sum of the delays, rings and buffers of a graph, bytes.
const MAX_BYTES: u64 = 1 << 30;
/// Capacity of a ring in multiples of its latency.
const LATENCIES_A_RING: f64 = 4.0;

/// Sum so far.
#[derive(Debug, Default)]
pub(super) struct Memory {
    bytes: u64,
    reported: bool,
}

impl Memory {
    /// Adds the delays and rings of all connections.
    pub(super) fn connections(&mut self, cx: &mut Context<'_>, graph: &Attached) {
        for (node, bridges) in graph.nodes.iter().zip(&graph.bridges) {
            for (slot, wire) in node.wires() {
                let kind = graph.carried(wire).kind.unwrap_or(Kind::SCALAR);
                let frames = match bridges[slot] {
                    Bridge::Delay { frames, .. } => frames,
                    Bridge::Ring { latency_s } => {
                        let rate_hz = graph.rate_of(wire.from).map_or(0.0, Rate::hz);
                        (LATENCIES_A_RING * latency_s * rate_hz) as u64
                    }
                    Bridge::Direct | Bridge::Between(_) => 0,
                };
                self.add(cx, bytes(frames, kind.width()), wire.span, &node.path);
            }
        }
    }

    /// Adds memory of a node. Returns whether the sum is within the bound.
    pub(super) fn add(&mut self, cx: &mut Context<'_>, bytes: u64, span: Span, path: &str) -> bool {
        let all = self.bytes.saturating_add(bytes);
        if all <= MAX_BYTES {
            self.bytes = all;
            return true;
        }
        if !std::mem::replace(&mut self.reported, true) {
            let message = format!(
                "the delays, rings and buffers of the graph exceed {} MiB: `{path}` needs {} MiB, those before it {} MiB",
                MAX_BYTES >> 20,
                mebibytes(bytes),
                mebibytes(self.bytes),
            );
            let diagnostic = Diagnostic::error("E0305", span, message)
                .label("exceeds the memory bound")
                .help("shorten delays, lower rates, or use fewer of these nodes");
            cx.report(diagnostic);
        }
        false
    }
}

/// Size of this many frames, bytes.
pub(super) fn bytes(frames: u64, width: usize) -> u64 {
    frames.saturating_mul((width * size_of::<f64>()) as u64)
}

fn mebibytes(bytes: u64) -> String {
    format!("{:.1}", bytes as f64 / f64::from(1 << 20))
}
