//! A straight line between frames.

use super::{BridgeContext, BridgeSpec, BridgeType, Carries, Direction, Ends, Neighbours, slow_s};
use crate::node::Latency;
use haptograph_signal::time::Rate;

/// Linear interpolation between frames, component by component; delays by one period of the slow clock.
#[derive(Debug, Clone)]
pub struct Linear(Neighbours);

impl BridgeType for Linear {
    const SPEC: BridgeSpec = BridgeSpec {
        name: "Linear",
        doc: "A straight line between frames, one slow period late, from a slow clock to a fast one of one driver",
        gives: "a straight line between frames, one slow frame late",
        direction: Direction::ToFaster,
        carries: Carries::Linear,
    };

    fn new(cx: &BridgeContext) -> Self {
        Self(Neighbours::new(cx))
    }

    fn latency(from: Rate, to: Rate) -> Latency {
        Latency::of_transport(slow_s(from, to))
    }

    fn cross(&mut self, ends: &Ends, x: &[f64], y: &mut [f64]) {
        self.0.cross(ends, x, y, |older, newer, fraction, out| {
            for ((out, a), b) in out.iter_mut().zip(older).zip(newer) {
                *out = a + (b - a) * fraction;
            }
        });
    }

    fn copy_state_from(&mut self, old: &Self) {
        self.0.copy_from(&old.0);
    }
}
