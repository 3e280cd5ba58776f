//! Signals that are not numbers, and the nodes that they come from.

use super::program::Line;
use super::window::{Window, range_of};
use crate::io::Placing;
use std::sync::Arc;

/// What was seen of signals that are not numbers.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Faults {
    /// Ticks at which an actuator was given NaN or infinity, which asks for zero.
    pub ticks: u64,
    /// Path of the first node found to put one out. It may be gone from the graph by now.
    pub origin: Option<Arc<str>>,
    /// The next steps are watched to find the origin.
    pub(super) tracing: bool,
}

impl Faults {
    /// Of several drivers.
    pub(super) fn of(all: impl Iterator<Item = Self>) -> Self {
        all.fold(Self::default(), |sum, one| Self {
            ticks: sum.ticks + one.ticks,
            origin: sum.origin.or(one.origin),
            tracing: false,
        })
    }

    /// After an actuator was given something that is not a number: is this step where it comes from?
    pub(super) fn trace_origin(&mut self, line: &Line, out: &[f64], window: Window) {
        let bad = |placing: &Placing| {
            !out[range_of(placing.start, placing.width, window)]
                .iter()
                .all(|x| x.is_finite())
        };
        if self.origin.is_none() && line.outputs.iter().any(bad) {
            self.origin = Some(Arc::clone(&line.path));
            self.tracing = false;
        }
    }
}
