//! NaN and infinity in signals, and the nodes that they come from.

use super::window::{Window, range_of};
use crate::io::Placing;
use crate::plan::Step;
use std::sync::Arc;

/// NaN and infinity at actuators.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Faults {
    /// Ticks in which an actuator received NaN or infinity. Its request is then zero.
    pub ticks: u64,
    /// Path of the first node whose output was NaN or infinite. The graph may not have it any more.
    pub origin: Option<Arc<str>>,
    /// True if the outputs of steps are checked to find the origin.
    pub(super) tracing: bool,
}

impl Faults {
    /// Combines the faults of several drivers.
    pub(super) fn of(all: impl Iterator<Item = Self>) -> Self {
        all.fold(Self::default(), |sum, one| Self {
            ticks: sum.ticks + one.ticks,
            origin: sum.origin.or(one.origin),
            tracing: false,
        })
    }

    /// Records this step as the origin if its output is NaN or infinite.
    pub(super) fn trace_origin(&mut self, step: &Step, out: &[f64], window: Window) {
        let bad = |placing: &Placing| {
            !out[range_of(placing.start, placing.width, window)].iter().all(|x| x.is_finite())
        };
        if self.origin.is_none() && step.wires.outputs.iter().any(bad) {
            self.origin = Some(Arc::clone(&step.label));
            self.tracing = false;
        }
    }
}
