//! Samples at an even rate.

use super::RecordingError;
use haptograph_surfaces::bounds::{MAX_TIME_S, RATES_HZ};
use std::borrow::Cow;
use std::fmt::Debug;
use std::ops::Range;
use std::sync::Arc;

/// Samples at an even rate with a start time.
#[derive(Debug, Clone, PartialEq)]
pub struct Series<T> {
    /// Samples per second.
    pub rate_hz: f64,
    /// Time of the first sample, s.
    pub start_s: f64,
    /// The samples in order.
    pub samples: Vec<T>,
}

impl<T> Series<T> {
    /// Samples that start at time zero.
    pub fn new(rate_hz: f64, samples: Vec<T>) -> Self {
        Self { rate_hz, start_s: 0.0, samples }
    }

    /// Time of sample `index`, s.
    pub(crate) fn time_s(&self, index: usize) -> f64 {
        self.start_s + index as f64 / self.rate_hz
    }

    /// Time of the last sample, s.
    pub(crate) fn end_s(&self) -> f64 {
        self.time_s(self.samples.len().saturating_sub(1))
    }

    /// The sample at or before a time, and the fraction of the interval to the next, 0 to 1. Outside the series it is the
    /// first or last sample; there must be at least one.
    pub(crate) fn place(&self, time_s: f64) -> (usize, f64) {
        place((time_s - self.start_s) * self.rate_hz, self.samples.len() - 1)
    }
}

fn place(position: f64, last: usize) -> (usize, f64) {
    let position = position.clamp(0.0, last as f64);
    let before = (position as usize).min(last.saturating_sub(1));
    (before, position - before as f64)
}

/// A sensor's samples at an even rate with a start time: in memory, or in a file, of which a stretch at a time is read.
#[derive(Debug, Clone)]
pub struct Sensor<T> {
    /// Samples per second.
    pub rate_hz: f64,
    /// Time of the first sample, s.
    pub start_s: f64,
    samples: Samples<T>,
}

#[derive(Debug, Clone)]
enum Samples<T> {
    Memory(Vec<T>),
    File(Arc<dyn Rows<T>>),
}

/// Samples in a file.
pub(crate) trait Rows<T>: Debug + Send + Sync {
    fn count(&self) -> usize;

    /// These samples, all of them NaN if they cannot be read (again): no use of them then succeeds.
    fn read(&self, rows: Range<usize>) -> Vec<T>;
}

impl<T> From<Series<T>> for Sensor<T> {
    fn from(Series { rate_hz, start_s, samples }: Series<T>) -> Self {
        Self { rate_hz, start_s, samples: Samples::Memory(samples) }
    }
}

/// Samples that are read from a file at once.
const STRETCH: usize = 1 << 14;

impl<T: Clone> Sensor<T> {
    #[cfg_attr(target_family = "wasm", expect(dead_code, reason = "a page has no archives"))]
    pub(crate) fn in_file(rate_hz: f64, start_s: f64, rows: impl Rows<T> + 'static) -> Self {
        Self { rate_hz, start_s, samples: Samples::File(Arc::new(rows)) }
    }

    /// Number of samples.
    pub(crate) fn count(&self) -> usize {
        match &self.samples {
            Samples::Memory(samples) => samples.len(),
            Samples::File(rows) => rows.count(),
        }
    }

    /// The samples of a range within their number.
    pub(crate) fn stretch(&self, range: Range<usize>) -> Cow<'_, [T]> {
        match &self.samples {
            Samples::Memory(samples) => Cow::Borrowed(&samples[range]),
            Samples::File(rows) => Cow::Owned(rows.read(range)),
        }
    }

    /// The samples in order.
    pub fn iter(&self) -> impl Iterator<Item = T> + '_ {
        let end = |start: usize| (start + STRETCH).min(self.count());
        let starts = (0..self.count()).step_by(STRETCH);
        starts.flat_map(move |start| self.stretch(start..end(start)).into_owned())
    }

    /// Time of sample `index`, s.
    pub(crate) fn time_s(&self, index: usize) -> f64 {
        self.start_s + index as f64 / self.rate_hz
    }

    /// Time of the last sample, s.
    pub(crate) fn end_s(&self) -> f64 {
        self.time_s(self.count().saturating_sub(1))
    }

    /// As [`Series::place`].
    pub(crate) fn place(&self, time_s: f64) -> (usize, f64) {
        place((time_s - self.start_s) * self.rate_hz, self.count() - 1)
    }
}

impl<T: Clone + PartialEq> PartialEq for Sensor<T> {
    fn eq(&self, other: &Self) -> bool {
        let alike = |of: &Self| (of.rate_hz, of.start_s, of.count());
        alike(self) == alike(other) && self.iter().eq(other.iter())
    }
}

/// Checks rate, start and number of samples, and the magnitude of each.
pub(super) fn check(
    quantity: &'static str,
    bound: (f64, &'static str),
    (rate_hz, start_s, samples): (f64, f64, usize),
    magnitudes: impl Iterator<Item = f64>,
) -> Result<(), RecordingError> {
    if !RATES_HZ.contains(&rate_hz) {
        return Err(RecordingError::Rate { quantity, rate_hz });
    }
    if !(-MAX_TIME_S..=MAX_TIME_S).contains(&start_s) {
        return Err(RecordingError::Start { quantity, start_s });
    }
    if samples < 2 {
        return Err(RecordingError::TooShort { quantity, samples });
    }
    RecordingError::check(quantity, bound, magnitudes)
}

impl Series<f64> {
    /// The value at a time: linear between samples, the first or last value outside.
    pub fn at(&self, time_s: f64) -> f64 {
        let (before, part) = self.place(time_s);
        let after = self.samples[(before + 1).min(self.samples.len() - 1)];
        self.samples[before] + part * (after - self.samples[before])
    }
}

impl<const N: usize> Series<[f64; N]> {
    /// The value at a time: linear between samples, the first or last value outside.
    pub fn at(&self, time_s: f64) -> [f64; N] {
        let (before, part) = self.place(time_s);
        let (a, b) = (self.samples[before], self.samples[(before + 1).min(self.samples.len() - 1)]);
        std::array::from_fn(|i| a[i] + part * (b[i] - a[i]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_between_samples_are_linear_and_constant_outside() {
        let series = Series { rate_hz: 10.0, start_s: 1.0, samples: vec![0.0, 2.0, 1.0] };
        for (time, value) in
            [(0.0, 0.0), (1.0, 0.0), (1.05, 1.0), (1.1, 2.0), (1.15, 1.5), (1.2, 1.0), (7.0, 1.0)]
        {
            assert!((series.at(time) - value).abs() < 1e-12, "{time}");
        }
        let single = Series::new(1.0, vec![[3.0]]);
        assert_eq!(single.at(0.7), [3.0]);
    }
}
