//! Splits of a material's takes into training and test parts.

use crate::recording::{ProcessedRecording, RecordingError, Signals};
use std::ops::Range;

/// A kind of split.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Split {
    /// Each half of a take against the other, for every take.
    Halves,
    /// The first and third quarter of a take against the second and fourth, and the reverse, for every take.
    Quarters,
    /// Each take against the next one of its material, the last one against the first.
    Takes,
}

impl Split {
    /// All kinds.
    pub(crate) const ALL: [Self; 3] = [Self::Halves, Self::Quarters, Self::Takes];

    /// Name in files and on the command line.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Halves => "halves",
            Self::Quarters => "quarters",
            Self::Takes => "takes",
        }
    }

    /// The folds of a material's takes; empty if there are too few takes.
    pub(crate) fn folds(self, takes: &[ProcessedRecording]) -> Vec<Fold> {
        let part = |take: usize, parts: &[usize], of: usize| {
            let length = takes[take].samples();
            let edge = |number: usize| number * length / of;
            Part { take: takes[take].clone(), ranges: parts.iter().map(|n| edge(*n)..edge(n + 1)).collect() }
        };
        let both_ways = |first: &[usize], second: &[usize], of: usize| -> Vec<Fold> {
            (0..takes.len())
                .flat_map(|take| {
                    let (a, b) = (part(take, first, of), part(take, second, of));
                    [(a.clone(), b.clone()), (b, a)].map(|(train, test)| Fold { train, test })
                })
                .collect()
        };
        match self {
            Self::Halves => both_ways(&[0], &[1], 2),
            Self::Quarters => both_ways(&[0, 2], &[1, 3], 4),
            Self::Takes if takes.len() < 2 => vec![],
            Self::Takes => (0..takes.len())
                .map(|take| Fold {
                    train: part(take, &[0], 1),
                    test: part((take + 1) % takes.len(), &[0], 1),
                })
                .collect(),
        }
    }
}

/// A fold: training and test part.
#[derive(Debug, Clone, PartialEq)]
pub struct Fold {
    /// Training part.
    pub train: Part,
    /// Test part.
    pub test: Part,
}

/// Pieces of one take.
#[derive(Debug, Clone, PartialEq)]
pub struct Part {
    take: ProcessedRecording,
    ranges: Vec<Range<usize>>,
}

/// Rate, as bits, and samples of each piece of the training and the test part.
pub(super) type Lengths = [(u64, Vec<usize>); 2];

impl Fold {
    pub(super) fn lengths(&self) -> Lengths {
        let of = |part: &Part| (part.take.rate_hz().to_bits(), part.ranges.iter().map(Range::len).collect());
        [of(&self.train), of(&self.test)]
    }
}

impl Part {
    /// Each piece as a recording of its own.
    pub(crate) fn recordings(&self) -> Result<Vec<ProcessedRecording>, RecordingError> {
        let signals = self.take.signals();
        let piece = |range: &Range<usize>| {
            let cut = |values: &[f64]| values[range.clone()].to_vec();
            ProcessedRecording::new(
                Signals {
                    rate_hz: signals.rate_hz,
                    acceleration_m_s2: cut(&signals.acceleration_m_s2),
                    force_normal_n: cut(&signals.force_normal_n),
                    force_tangential_n: signals.force_tangential_n.as_deref().map(cut),
                    speed_m_s: cut(&signals.speed_m_s),
                    axes_m_s2: None,
                },
                self.take.gesture(),
                self.take.provenance().clone(),
            )
        };
        self.ranges.iter().map(piece).collect()
    }
}
