//! Signals out of nothing but time, chance or a file.

pub mod csv;
pub mod noise;
pub mod one_shot;
pub mod over_position;
pub mod phase;
pub mod steps;
pub mod wav;
pub mod waves;

use haptograph_engine::frame::Kind;
use haptograph_engine::node::{AfterData, BuildContext, DataEnd, KindRule, OutputSpec, QuantityRule};

haptograph_engine::choices! {
    /// What follows where the data of a file end.
    pub enum AtEnd {
        /// The run ends: the last frame of the data is the last one of the run.
        Stop,
        /// The last value holds.
        Hold,
        /// Zero follows.
        Silence,
        /// The data start again.
        Loop,
    }
}

impl AtEnd {
    /// What the engine is told of data of so many frames.
    fn after(&self, frames: u64) -> Option<DataEnd> {
        let then = match self {
            Self::Stop => AfterData::Stop,
            Self::Hold => AfterData::Hold,
            Self::Silence => AfterData::Silence,
            Self::Loop => return None,
        };
        Some(DataEnd { frames, then })
    }

    /// The same, where the older setting `repeat` may ask for a loop.
    fn or_loop(self, repeat: bool) -> Self {
        if repeat { Self::Loop } else { self }
    }
}

/// A scalar output of the quantity that the setting `quantity` names.
const fn made(doc: &'static str) -> OutputSpec {
    OutputSpec {
        name: "output",
        kind: KindRule::Is(Kind::Scalar),
        quantity: QuantityRule::Setting("quantity"),
        doc,
    }
}

/// The first tick at or after a time, so that an instant falls on the same tick whatever the rounding of `time_s`.
fn tick_at(time_s: f64, cx: &BuildContext) -> u64 {
    (time_s * cx.rate.hz() - 1e-6).ceil().max(0.0) as u64
}
