//! Linear filters, applied to every lane by itself.

pub mod classical;
pub mod section;

use haptograph_engine::node::{BuildError, Io, Latency, Processor, Single, Tick};
use haptograph_signal::filter::{DesignError, Sections, SectionsState};

use crate::successor;

/// A cascade of second-order sections on every lane of a linear signal.
#[derive(Debug, Clone)]
pub(crate) struct LaneFilter {
    lanes: Box<[SectionsState]>,
    /// Room for one lane of the longest block.
    scratch: Box<[f64]>,
    latency: Latency,
}

impl LaneFilter {
    /// The filter at rest; its group delay is stated for `passband_hz`.
    pub(crate) fn new(
        filter: &Sections,
        cx: &haptograph_engine::node::BuildContext,
        passband_hz: f64,
    ) -> Self {
        let width = cx.input_widths.first().copied().unwrap_or(1).max(1);
        let scratch = if width > 1 { cx.max_frames } else { 0 };
        Self {
            lanes: vec![SectionsState::new(filter); width].into(),
            scratch: vec![0.0; scratch].into(),
            latency: Latency {
                transport_s: 0.0,
                group_delay_s: filter.group_delay_s(passband_hz, cx.rate.hz()),
            },
        }
    }

    /// Filters lane by lane.
    fn filter(&mut self, x: &[f64], y: &mut [f64]) {
        if let [only] = &mut *self.lanes {
            only.process(x, y);
            return;
        }
        let width = self.lanes.len();
        for (lane, filter) in self.lanes.iter_mut().enumerate() {
            let scratch = &mut self.scratch[..x.len() / width];
            for (s, x) in scratch.iter_mut().zip(x.chunks_exact(width)) {
                *s = x[lane];
            }
            filter.process_in_place(scratch);
            for (s, y) in scratch.iter().zip(y.chunks_exact_mut(width)) {
                y[lane] = *s;
            }
        }
    }
}

impl Processor for LaneFilter {
    fn process(&mut self, _: &Tick, io: &mut Io<'_>) {
        let x = io.lanes(0);
        self.filter(x, io.out(0));
    }

    fn single(&self) -> Option<Single> {
        (self.lanes.len() == 1).then_some(Single::Call)
    }

    fn frame(&mut self, x: f64) -> f64 {
        let mut y = [0.0];
        self.filter(&[x], &mut y);
        y[0]
    }

    fn copy_state_into(&self, new: &mut dyn Processor) {
        if let Some(new) = successor::<Self>(new) {
            for (new, old) in new.lanes.iter_mut().zip(&self.lanes) {
                new.copy_state_from(old);
            }
        }
    }

    fn latency(&self) -> Latency {
        self.latency
    }
}

/// A design that is not possible, as an error about the setting that has to change.
pub(crate) fn design_error(cutoff_field: &'static str) -> impl Fn(DesignError) -> BuildError {
    move |error| match &error {
        DesignError::Order { .. } => BuildError::at("order", error.to_string()),
        DesignError::EmptyBand { .. } => BuildError::at("low_hz", error.to_string()).help("swap the edges"),
        DesignError::NarrowBand { .. } => BuildError::at("low_hz", error.to_string()),
        DesignError::Extreme {
            frequency_hz,
            rate_hz,
            ..
        } if frequency_hz / rate_hz < 0.25 => BuildError::at(cutoff_field, error.to_string())
            .help("raise it, or run the node on a slower clock"),
        DesignError::Cutoff { .. } | DesignError::Rate { .. } | DesignError::Extreme { .. } => {
            BuildError::at(cutoff_field, error.to_string())
                .help("lower it, or run the node on a faster clock")
        }
    }
}
