//! Samples at an even rate.

use super::RecordingError;
use haptograph_surfaces::bounds::{MAX_TIME_S, RATES_HZ};

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
        let last = self.samples.len() - 1;
        let position = ((time_s - self.start_s) * self.rate_hz).clamp(0.0, last as f64);
        let before = (position as usize).min(last.saturating_sub(1));
        (before, position - before as f64)
    }

    pub(super) fn check(
        &self,
        quantity: &'static str,
        (most, unit): (f64, &'static str),
        magnitude: impl Fn(&T) -> f64,
    ) -> Result<(), RecordingError> {
        let Self { rate_hz, start_s, samples } = self;
        if !RATES_HZ.contains(rate_hz) {
            return Err(RecordingError::Rate { quantity, rate_hz: *rate_hz });
        }
        if !(-MAX_TIME_S..=MAX_TIME_S).contains(start_s) {
            return Err(RecordingError::Start { quantity, start_s: *start_s });
        }
        if samples.len() < 2 {
            return Err(RecordingError::TooShort { quantity, samples: samples.len() });
        }
        RecordingError::check(quantity, (most, unit), samples.iter().map(magnitude))
    }
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
