//! Signals of any length in a bounded space: what a picture a thousand pixels wide can show of them, and no more.

/// Lowest and highest value in equal stretches of a signal. When there are too many stretches, neighbours are joined,
/// so that a run of an hour costs what a run of a second does.
#[derive(Debug, Clone, PartialEq)]
pub struct Envelope {
    rate_hz: f64,
    /// Samples in a stretch.
    stretch: u64,
    /// (lowest, highest) of each complete stretch.
    complete: Vec<(f64, f64)>,
    open: (f64, f64),
    open_samples: u64,
    samples: u64,
    sum: f64,
    sum_of_squares: f64,
    sum_of_sizes: f64,
    /// Samples that are not zero.
    present: u64,
}

/// Most stretches; at least half as many are left after joining.
const MOST: usize = 2400;
const EMPTY: (f64, f64) = (f64::INFINITY, f64::NEG_INFINITY);

impl Envelope {
    /// Of a signal of `rate_hz` samples a second.
    pub fn new(rate_hz: f64) -> Self {
        Self {
            rate_hz,
            stretch: 1,
            complete: Vec::new(),
            open: EMPTY,
            open_samples: 0,
            samples: 0,
            sum: 0.0,
            sum_of_squares: 0.0,
            sum_of_sizes: 0.0,
            present: 0,
        }
    }

    /// Takes the next samples. One that is not finite leaves no trace but its time.
    pub fn extend(&mut self, samples: impl IntoIterator<Item = f64>) {
        for sample in samples {
            self.push(sample);
        }
    }

    fn push(&mut self, sample: f64) {
        self.samples += 1;
        self.open_samples += 1;
        if sample.is_finite() {
            self.open = (self.open.0.min(sample), self.open.1.max(sample));
            self.sum += sample;
            self.sum_of_squares += sample * sample;
            self.sum_of_sizes += sample.abs();
            self.present += u64::from(sample != 0.0);
        }
        if self.open_samples == self.stretch {
            self.complete.push(self.open);
            (self.open, self.open_samples) = (EMPTY, 0);
            if self.complete.len() == MOST {
                self.join_neighbours();
            }
        }
    }

    fn join_neighbours(&mut self) {
        let joined = self.complete.chunks(2).map(|pair| {
            pair.iter()
                .fold(EMPTY, |(low, high), (l, h)| (low.min(*l), high.max(*h)))
        });
        self.complete = joined.collect();
        self.stretch *= 2;
    }

    /// Samples so far.
    pub fn samples(&self) -> u64 {
        self.samples
    }

    /// Root of the mean square; 0 for a signal of no samples.
    pub fn rms(&self) -> f64 {
        if self.samples == 0 {
            0.0
        } else {
            (self.sum_of_squares / self.samples as f64).sqrt()
        }
    }

    /// Mean; 0 for a signal of no samples.
    pub fn mean(&self) -> f64 {
        match self.samples {
            0 => 0.0,
            samples => self.sum / samples as f64,
        }
    }

    /// Mean magnitude while it is not zero; 0 for a signal that always is.
    pub fn mean_size(&self) -> f64 {
        match self.present {
            0 => 0.0,
            present => self.sum_of_sizes / present as f64,
        }
    }

    /// The part of the time in which it is not zero, 0 to 1.
    pub fn presence(&self) -> f64 {
        self.present as f64 / self.samples.max(1) as f64
    }

    /// Smallest and largest value; `None` where no sample is finite.
    pub fn range(&self) -> Option<(f64, f64)> {
        let (low, high) = self
            .stretches()
            .fold(EMPTY, |(low, high), (l, h)| (low.min(l), high.max(h)));
        (low <= high).then_some((low, high))
    }

    /// The value of a signal that never changes.
    pub fn constant(&self) -> Option<f64> {
        let (low, high) = self.range()?;
        (high - low <= 1e-12 * high.abs().max(low.abs())).then_some(low)
    }

    /// Is this the same curve as another, seen at another rate? Their extremes over equal parts of the time, and their
    /// levels, differ by less than a plot would show.
    pub fn resembles(&self, other: &Self) -> bool {
        let (extremes, others) = (self.coarse(), other.coarse());
        let duration_s = |of: &Self| of.samples as f64 / of.rate_hz;
        let (duration_s, other_s) = (duration_s(self), duration_s(other));
        if (duration_s - other_s).abs() > 0.01 * duration_s
            || (self.rms() - other.rms()).abs() > 0.02 * self.rms()
        {
            return false;
        }
        let (mut apart, mut size) = (0.0, 0.0);
        for ((low, high), (other_low, other_high)) in extremes.into_iter().zip(others) {
            apart += (low - other_low).powi(2) + (high - other_high).powi(2);
            size += low * low + high * high;
        }
        // Where a part has no sample in it, there is nothing to compare, and this is no number.
        apart < 0.05 * 0.05 * size
    }

    /// Extremes over equal parts of the whole.
    fn coarse(&self) -> [(f64, f64); 60] {
        let mut parts = [EMPTY; 60];
        let per_second = parts.len() as f64 * self.rate_hz / self.samples.max(1) as f64;
        let last = parts.len() - 1;
        for (time_s, low, high) in self.points() {
            if let Some(part) = parts.get_mut(((time_s * per_second) as usize).min(last)) {
                *part = (part.0.min(low), part.1.max(high));
            }
        }
        parts
    }

    /// Largest magnitude; 0 where there is none.
    pub fn peak(&self) -> f64 {
        self.range().map_or(0.0, |(low, high)| low.abs().max(high.abs()))
    }

    /// Does every stretch hold one sample, so that the signal is shown as it is?
    pub fn is_exact(&self) -> bool {
        self.stretch == 1
    }

    /// (time of the middle in s, lowest, highest) of every stretch that has a finite sample.
    pub fn points(&self) -> impl Iterator<Item = (f64, f64, f64)> + '_ {
        let length_s = self.stretch as f64 / self.rate_hz;
        let middle = if self.is_exact() { 0.0 } else { 0.5 };
        self.stretches()
            .enumerate()
            .filter(|(_, (low, high))| low <= high)
            .map(move |(i, (low, high))| ((i as f64 + middle) * length_s, low, high))
    }

    fn stretches(&self) -> impl Iterator<Item = (f64, f64)> + '_ {
        self.complete
            .iter()
            .copied()
            .chain((self.open_samples > 0).then_some(self.open))
    }
}

/// Every n-th of a stream of points, n growing so that they stay few.
#[derive(Debug, Clone, PartialEq)]
pub struct Decimated<T> {
    kept: Vec<T>,
    every: u64,
    seen: u64,
    most: usize,
}

impl<T> Decimated<T> {
    /// At most `most` of them, at least half as many once there were.
    pub fn new(most: usize) -> Self {
        Self {
            kept: Vec::new(),
            every: 1,
            seen: 0,
            most: most.max(2),
        }
    }

    /// Takes the next one.
    pub fn push(&mut self, point: T) {
        if self.seen.is_multiple_of(self.every) {
            if self.kept.len() == self.most {
                let mut place = 0;
                self.kept.retain(|_| {
                    place += 1;
                    place % 2 == 1
                });
                self.every *= 2;
            }
            if self.seen.is_multiple_of(self.every) {
                self.kept.push(point);
            }
        }
        self.seen += 1;
    }

    /// Those kept, in order.
    pub fn kept(&self) -> &[T] {
        &self.kept
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_peak_is_lost_however_long_the_signal() {
        let mut envelope = Envelope::new(1000.0);
        envelope.extend((0..1_000_000).map(|i| if i == 765_432 { 9.0 } else { 0.5 }));
        assert_eq!(envelope.peak(), 9.0);
        let points: Vec<_> = envelope.points().collect();
        assert!((MOST / 2..=MOST).contains(&points.len()));
        let at = points.iter().find(|p| p.2 == 9.0).unwrap().0;
        assert!((at - 765.432).abs() < 1.0, "{at}");
    }

    #[test]
    fn the_mean_size_leaves_out_what_is_zero() {
        let mut envelope = Envelope::new(1000.0);
        envelope.extend([0.0, 2.0, -4.0, 0.0]);
        assert_eq!((envelope.mean_size(), envelope.presence()), (3.0, 0.5));
        assert_eq!(
            (Envelope::new(1.0).mean_size(), Envelope::new(1.0).presence()),
            (0.0, 0.0)
        );
    }

    #[test]
    fn a_short_signal_is_shown_sample_by_sample() {
        let mut envelope = Envelope::new(10.0);
        envelope.extend([1.0, f64::NAN, 3.0]);
        assert!(envelope.is_exact());
        assert_eq!(
            envelope.points().collect::<Vec<_>>(),
            [(0.0, 1.0, 1.0), (0.2, 3.0, 3.0)]
        );
    }

    #[test]
    fn a_curve_is_known_again_at_another_rate() {
        let curve = |rate_hz: u32, hz: f64| {
            let mut envelope = Envelope::new(f64::from(rate_hz));
            let time_s = (0..3 * rate_hz).map(|i| f64::from(i) / f64::from(rate_hz));
            envelope.extend(time_s.map(|t| (6.0 * t).sin() * (hz * t).sin()));
            envelope
        };
        let fine = curve(48_000, 400.0);
        assert!(fine.resembles(&curve(10_000, 400.0)) && curve(10_000, 400.0).resembles(&fine));
        let mut louder = Envelope::new(10_000.0);
        louder.extend((0..30_000).map(|i| 1.2 * (f64::from(i) * 6e-4).sin()));
        assert!(!fine.resembles(&louder) && !fine.resembles(&Envelope::new(10.0)));
        assert_eq!((fine.constant(), Envelope::new(1.0).constant()), (None, None));
        let mut flat = Envelope::new(1.0);
        flat.extend([2.0, 2.0]);
        assert_eq!(flat.constant(), Some(2.0));
    }

    #[test]
    fn decimated_points_are_evenly_spaced() {
        let mut points = Decimated::new(100);
        (0..12_345u64).for_each(|i| points.push(i));
        let gaps: Vec<u64> = points.kept().windows(2).map(|w| w[1] - w[0]).collect();
        assert!(gaps.iter().all(|gap| *gap == gaps[0]));
        assert!((50..=100).contains(&points.kept().len()));
    }
}
