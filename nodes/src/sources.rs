//! Sources of signals: generators, noise and files.

pub mod csv;
pub(crate) mod live;
pub mod noise;
pub(crate) mod one_shot;
pub(crate) mod over_position;
pub(crate) mod phase;
pub(crate) mod steps;
pub mod wav;
pub(crate) mod waves;

use haptograph_engine::node::{AfterData, BuildContext, DataEnd};

haptograph_engine::choices! {
    /// Output of a source after the end of its file.
    pub(crate) enum AtEnd {
        /// The run ends: the last frame of the data is the last one of the run.
        Stop,
        /// The output holds the last value.
        Hold,
        /// The output is zero.
        Silence,
        /// The data repeat from the start.
        Loop,
    }
}

impl AtEnd {
    /// The end of the signal, for the engine, of a source with data of `frames` frames.
    fn after(&self, frames: u64) -> Option<DataEnd> {
        let then = match self {
            Self::Stop => AfterData::Stop,
            Self::Hold => AfterData::Hold,
            Self::Silence => AfterData::Silence,
            Self::Loop => return None,
        };
        Some(DataEnd { frames, then })
    }

    /// `Loop` where the older setting `repeat` is true.
    fn or_loop(self, repeat: bool) -> Self {
        if repeat { Self::Loop } else { self }
    }
}

/// The first tick at or after a time. Rounding of `time_s` does not change it.
fn tick_at(time_s: f64, cx: &BuildContext) -> u64 {
    (time_s * cx.rate.hz() - 1e-6).ceil().max(0.0) as u64
}
