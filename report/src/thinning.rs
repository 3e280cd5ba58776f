//! Reduction of signals of any length to a bounded size, sufficient for a figure of a thousand pixels.

/// Minimum and maximum over equal intervals of a signal. Neighbouring intervals are joined when there are too
/// many, so that the size does not depend on the length of the run.
#[derive(Debug, Clone, PartialEq)]
pub struct Envelope {
    rate_hz: f64,
    /// Samples per interval.
    stretch: u64,
    /// (minimum, maximum) of each complete interval.
    complete: Vec<(f64, f64)>,
    open: (f64, f64),
    open_samples: u64,
    samples: u64,
    sum: f64,
    sum_of_squares: f64,
    sum_of_sizes: f64,
    /// Number of samples that are not zero.
    present: u64,
    /// The last finite sample.
    last: Option<f64>,
    /// True if no sample is below its predecessor.
    never_falls: bool,
}

/// Maximum number of intervals; joining leaves at least half as many.
const MAX: usize = 2400;
const EMPTY: (f64, f64) = (f64::INFINITY, f64::NEG_INFINITY);

impl Envelope {
    /// Envelope of a signal with `rate_hz` samples per second.
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
            last: None,
            never_falls: true,
        }
    }

    /// Adds samples. A sample that is not finite only advances the time.
    pub(crate) fn extend(&mut self, samples: impl IntoIterator<Item = f64>) {
        let mut samples = samples.into_iter();
        while self.fills_open(&mut samples) {
            self.complete.push(self.open);
            (self.open, self.open_samples) = (EMPTY, 0);
            if self.complete.len() == MAX {
                self.join_neighbours();
            }
        }
    }

    /// Adds samples to the open interval; false if it is not full at their end.
    fn fills_open(&mut self, samples: &mut impl Iterator<Item = f64>) -> bool {
        // Copies stay in registers.
        let Self { mut open, mut sum, mut sum_of_squares, mut sum_of_sizes, mut present, .. } = *self;
        let Self { mut open_samples, mut last, mut never_falls, stretch, .. } = *self;
        while open_samples < stretch
            && let Some(sample) = samples.next()
        {
            open_samples += 1;
            if sample.is_finite() {
                open = (open.0.min(sample), open.1.max(sample));
                sum += sample;
                sum_of_squares += sample * sample;
                sum_of_sizes += sample.abs();
                present += u64::from(sample != 0.0);
                never_falls &= last.is_none_or(|last| last <= sample);
                last = Some(sample);
            }
        }
        self.samples += open_samples - self.open_samples;
        (self.open, self.open_samples, self.last, self.never_falls) = (open, open_samples, last, never_falls);
        (self.sum, self.sum_of_squares, self.sum_of_sizes) = (sum, sum_of_squares, sum_of_sizes);
        self.present = present;
        open_samples == stretch
    }

    fn join_neighbours(&mut self) {
        let joined = self
            .complete
            .chunks(2)
            .map(|pair| pair.iter().fold(EMPTY, |(low, high), (l, h)| (low.min(*l), high.max(*h))));
        self.complete = joined.collect();
        self.stretch *= 2;
    }

    /// Number of samples.
    pub fn samples(&self) -> u64 {
        self.samples
    }

    /// Root mean square; 0 without samples.
    pub(crate) fn rms(&self) -> f64 {
        if self.samples == 0 { 0.0 } else { (self.sum_of_squares / self.samples as f64).sqrt() }
    }

    /// Mean; 0 without samples.
    pub(crate) fn mean(&self) -> f64 {
        match self.samples {
            0 => 0.0,
            samples => self.sum / samples as f64,
        }
    }

    /// Mean magnitude over the samples that are not zero; 0 if there are none.
    pub(crate) fn mean_size(&self) -> f64 {
        match self.present {
            0 => 0.0,
            present => self.sum_of_sizes / present as f64,
        }
    }

    /// Share of the samples that are not zero, 0 to 1.
    pub(crate) fn presence(&self) -> f64 {
        self.present as f64 / self.samples.max(1) as f64
    }

    /// Minimum and maximum; `None` if no sample is finite.
    pub(crate) fn range(&self) -> Option<(f64, f64)> {
        let (low, high) = self.stretches().fold(EMPTY, |(low, high), (l, h)| (low.min(l), high.max(h)));
        (low <= high).then_some((low, high))
    }

    /// The value of a constant signal.
    pub(crate) fn constant(&self) -> Option<f64> {
        let (low, high) = self.range()?;
        (high - low <= 1e-12 * high.abs().max(low.abs())).then_some(low)
    }

    /// First and last value of a signal that rises and never falls, such as a counter or an integral.
    pub(crate) fn rises(&self) -> Option<(f64, f64)> {
        let (low, _) = self.range()?;
        let last = self.last.filter(|last| self.never_falls && *last > low)?;
        Some((low, last))
    }

    /// True if every sample is 0 or 1, and both occur.
    pub(crate) fn is_switch(&self) -> bool {
        // Of the numbers from 0 to 1 only these two equal their squares.
        self.range() == Some((0.0, 1.0))
            && (self.sum - self.sum_of_squares).abs() <= 1e-9 * self.samples as f64
    }

    /// Extremes over equal parts of the whole.
    fn coarse(&self) -> [(f64, f64); PARTS] {
        let mut parts = [EMPTY; PARTS];
        let per_second = parts.len() as f64 * self.rate_hz / self.samples.max(1) as f64;
        let last = parts.len() - 1;
        for (time_s, low, high) in self.points() {
            if let Some(part) = parts.get_mut(((time_s * per_second) as usize).min(last)) {
                *part = (part.0.min(low), part.1.max(high));
            }
        }
        parts
    }

    /// True if the signal hardly varies within a part, or is constant, so that the parts' extremes follow the
    /// curve.
    fn is_resolved(&self) -> bool {
        let Some((low, high)) = self.range().filter(|(low, high)| low < high) else {
            return true;
        };
        let within: f64 = self.coarse().iter().map(|(low, high)| high - low).sum();
        within < RESOLVED * (high - low) * PARTS as f64
    }

    /// Largest magnitude; 0 without samples.
    pub(crate) fn peak(&self) -> f64 {
        self.range().map_or(0.0, |(low, high)| low.abs().max(high.abs()))
    }

    /// True if every interval holds one sample, so that the signal is shown exactly.
    pub(crate) fn is_exact(&self) -> bool {
        self.stretch == 1
    }

    /// (time of the centre in s, minimum, maximum) of every interval with a finite sample.
    pub(crate) fn points(&self) -> impl Iterator<Item = (f64, f64, f64)> + '_ {
        let length_s = self.stretch as f64 / self.rate_hz;
        let middle = if self.is_exact() { 0.0 } else { 0.5 };
        self.stretches()
            .enumerate()
            .filter(|(_, (low, high))| low <= high)
            .map(move |(i, (low, high))| ((i as f64 + middle) * length_s, low, high))
    }

    fn stretches(&self) -> impl Iterator<Item = (f64, f64)> + '_ {
        self.complete.iter().copied().chain((self.open_samples > 0).then_some(self.open))
    }
}

/// Number of parts over which two signals are compared.
const PARTS: usize = 120;
/// A curve is resolved if it varies within a part by less than this fraction of its range, on average.
const RESOLVED: f64 = 0.35;
/// Minimum correlation and maximum level difference, dB, of nearly equal signals.
const ALIKE: (f64, f64) = (0.999, 0.5);

/// True if the signals are equal except for sensor noise and rate. Only slow signals are compared. Their
/// extremes over equal parts of the time must correlate by more than 0.999 over all components, and their
/// levels, with and without the means, must agree within 0.5 dB.
pub(crate) fn are_nearly_same(a: &[Envelope], b: &[Envelope]) -> bool {
    let duration_s = |of: &[Envelope]| of.first().map_or(0.0, |lane| lane.samples as f64 / lane.rate_hz);
    let (a_s, b_s) = (duration_s(a), duration_s(b));
    if a.len() != b.len() || (a_s - b_s).abs() > 0.01 * a_s {
        return false;
    }
    // For a signal that varies within a part, only its amplitude would be compared.
    if !a.iter().chain(b).all(Envelope::is_resolved) {
        return false;
    }
    let (mut squares, mut product) = ([0.0; 2], 0.0);
    for (one, other) in a.iter().zip(b) {
        let about_mean = |of: &Envelope| {
            let mean = of.mean();
            of.coarse().map(|(low, high)| [low - mean, high - mean])
        };
        let pairs = about_mean(one).into_iter().flatten();
        for (x, y) in pairs.zip(about_mean(other).into_iter().flatten()) {
            squares = [squares[0] + x * x, squares[1] + y * y];
            product += x * y;
        }
    }
    let level = |of: &[Envelope]| of.iter().map(|lane| lane.rms().powi(2)).sum::<f64>();
    let within = |x: f64, y: f64| (10.0 * (x / y).log10()).abs() <= ALIKE.1;
    // A part without samples compares as NaN, which is always false.
    product > ALIKE.0 * (squares[0] * squares[1]).sqrt()
        && within(level(a), level(b))
        && within(squares[0], squares[1])
}

/// Every n-th point of a stream; n grows so that the number of points stays bounded.
#[derive(Debug, Clone, PartialEq)]
pub struct Decimated<T> {
    kept: Vec<T>,
    every: u64,
    seen: u64,
    most: usize,
}

impl<T> Decimated<T> {
    /// Keeps at most `most` points, and at least half as many once there were that many.
    pub fn new(most: usize) -> Self {
        Self { kept: Vec::new(), every: 1, seen: 0, most: most.max(2) }
    }

    /// Adds a point.
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

    /// The kept points, in order.
    pub fn kept(&self) -> &[T] {
        &self.kept
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    #[test]
    fn no_peak_is_lost_however_long_the_signal() {
        let mut envelope = Envelope::new(1000.0);
        envelope.extend((0..1_000_000).map(|i| if i == 765_432 { 9.0 } else { 0.5 }));
        assert_eq!(envelope.peak(), 9.0);
        let points: Vec<_> = envelope.points().collect();
        assert!((MAX / 2..=MAX).contains(&points.len()));
        let at = points.iter().find(|p| p.2 == 9.0).unwrap().0;
        assert!((at - 765.432).abs() < 1.0, "{at}");
    }

    #[test]
    fn the_mean_size_leaves_out_what_is_zero() {
        let mut envelope = Envelope::new(1000.0);
        envelope.extend([0.0, 2.0, -4.0, 0.0]);
        assert_eq!((envelope.mean_size(), envelope.presence()), (3.0, 0.5));
        assert_eq!((Envelope::new(1.0).mean_size(), Envelope::new(1.0).presence()), (0.0, 0.0));
    }

    #[test]
    fn a_short_signal_is_shown_sample_by_sample() {
        let mut envelope = Envelope::new(10.0);
        envelope.extend([1.0, f64::NAN, 3.0]);
        assert!(envelope.is_exact());
        assert_eq!(envelope.points().collect::<Vec<_>>(), [(0.0, 1.0, 1.0), (0.2, 3.0, 3.0)]);
    }

    #[test]
    fn a_curve_is_known_again_at_another_rate() {
        let curve = |rate_hz: u32, hz: f64| {
            let mut envelope = Envelope::new(f64::from(rate_hz));
            let time_s = (0..3 * rate_hz).map(|i| f64::from(i) / f64::from(rate_hz));
            envelope.extend(time_s.map(|t| (6.0 * t).sin() * (hz * t).sin()));
            envelope
        };
        let fine = curve(48_000, 20.0);
        let nearly =
            |a: &Envelope, b: &Envelope| are_nearly_same(std::slice::from_ref(a), std::slice::from_ref(b));
        assert!(nearly(&fine, &curve(10_000, 20.0)) && nearly(&curve(10_000, 20.0), &fine));
        let mut louder = Envelope::new(10_000.0);
        louder.extend((0..30_000).map(|i| 1.2 * (f64::from(i) * 6e-4).sin()));
        assert!(!nearly(&fine, &louder) && !nearly(&fine, &Envelope::new(10.0)));
        // As loud, and as far up and down in every part of the time.
        let tone = |hz: f64, sign: f64| {
            let mut envelope = Envelope::new(10_000.0);
            envelope.extend((0..30_000).map(|i| sign * (hz * f64::from(i) * TAU / 10_000.0).sin()));
            envelope
        };
        assert!(!nearly(&tone(60.0, 1.0), &tone(250.0, 1.0)) && !nearly(&tone(60.0, 1.0), &tone(60.0, -1.0)));
        assert_eq!((fine.constant(), Envelope::new(1.0).constant()), (None, None));
        let mut flat = Envelope::new(1.0);
        flat.extend([2.0, 2.0]);
        assert_eq!(flat.constant(), Some(2.0));
    }

    #[test]
    fn noise_of_a_sensor_makes_no_other_signal_and_a_gain_does() {
        let hand = |noise: f64, gain: f64| {
            let mut lanes = vec![Envelope::new(1000.0), Envelope::new(1000.0)];
            for (lane, envelope) in lanes.iter_mut().enumerate() {
                let speed = 2.0 + lane as f64;
                // Any sequence without a relation to the hand.
                let rattle = (0..10_000_i64).map(|i| noise * ((i * 7919 % 1009) as f64 / 504.0 - 1.0));
                let moved = rattle.enumerate().map(|(i, x)| gain * (speed * i as f64 * 1e-3).sin() + x);
                envelope.extend(moved);
            }
            lanes
        };
        assert!(are_nearly_same(&hand(0.0, 1.0), &hand(0.01, 1.0)));
        assert!(!are_nearly_same(&hand(0.0, 1.0), &hand(0.0, 1.1)));
        assert!(!are_nearly_same(&hand(0.0, 1.0), &hand(0.3, 1.0)));
        assert!(!are_nearly_same(&hand(0.0, 1.0)[..1], &hand(0.0, 1.0)[1..]));
    }

    #[test]
    fn counters_and_switches_are_known() {
        let of = |samples: &[f64]| {
            let mut envelope = Envelope::new(10.0);
            envelope.extend(samples.iter().copied());
            envelope
        };
        assert_eq!(of(&[0.0, 1.0, f64::NAN, 1.0, 4.0]).rises(), Some((0.0, 4.0)));
        assert_eq!((of(&[0.0, 2.0, 1.0]).rises(), of(&[3.0, 3.0]).rises()), (None, None));
        assert!(of(&[0.0, 1.0, 1.0]).is_switch());
        assert!(!of(&[0.0, 0.5, 1.0]).is_switch() && !of(&[1.0, 1.0]).is_switch());
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
