//! Movements of the tool: speed and force over time, and when a synthesis reads them.

use haptograph_signal::filter::{butterworth_lowpass, filtfilt};
use haptograph_signal::noise::Gaussian;
use std::ops::Range;

/// Speed and force over time.
#[derive(Debug, Clone, PartialEq)]
pub struct Trajectory {
    /// Sampling rate, Hz.
    pub rate_hz: f64,
    /// Speed, m/s.
    pub speed_m_s: Vec<f64>,
    /// Normal force, N; of the same length as the speed.
    pub force_n: Vec<f64>,
}

impl Trajectory {
    /// Speed and force at the updates of a synthesis, up to the end of the shorter signal.
    pub(crate) fn at_updates(&self, update_hz: f64) -> UpdatePoints {
        let samples = self.speed_m_s.len().min(self.force_n.len());
        let read = |values: &[f64]| {
            let places = update_samples(self.rate_hz, update_hz, samples);
            places.map(|place| values[place]).collect()
        };
        UpdatePoints {
            rate_hz: self.rate_hz,
            update_hz,
            samples,
            speed_m_s: read(&self.speed_m_s),
            force_n: read(&self.force_n),
        }
    }
}

/// Speed and force at the updates of a synthesis: all that it reads of a [`Trajectory`].
#[derive(Debug, Clone, PartialEq)]
pub struct UpdatePoints {
    /// Sampling rate of the vibration, Hz.
    pub rate_hz: f64,
    /// Rate of the updates, Hz.
    pub update_hz: f64,
    /// Samples of the vibration.
    pub samples: usize,
    /// Speed, m/s, at each of [`update_samples`].
    pub speed_m_s: Vec<f64>,
    /// Normal force, N; as long as the speed.
    pub force_n: Vec<f64>,
}

/// A smoothed random walk through speed and force, like a hand that explores freely (thesis 2.5.4).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RandomWalk {
    /// Duration, s.
    pub seconds: f64,
    /// Sampling rate, Hz.
    pub rate_hz: f64,
    /// Range of the speed, m/s; both ends are reached.
    pub speed_m_s: (f64, f64),
    /// Range of the force, N; both ends are reached.
    pub force_n: (f64, f64),
    /// Cut-off frequency of the smoothing.
    pub cutoff_hz: f64,
    /// Seed.
    pub seed: u64,
}

impl Default for RandomWalk {
    /// Thirty seconds at 10 kHz over the range of the thesis's test recordings (170 mm/s, 2.8 N).
    fn default() -> Self {
        Self {
            seconds: 30.0,
            rate_hz: 10_000.0,
            speed_m_s: (0.005, 0.17),
            force_n: (0.1, 2.8),
            cutoff_hz: 1.0,
            seed: 1,
        }
    }
}

/// Most samples of a walk: half a minute at 100 kHz.
const MAX_WALK: f64 = 3e6;

/// Rate of the walk before interpolation, Hz.
const WALK_HZ: f64 = 100.0;

impl RandomWalk {
    /// The same walk at the rate of a texture; shorter where it would have more than 3 million samples.
    pub fn at(&self, rate_hz: f64) -> Self {
        let seconds = self.seconds.min(MAX_WALK / rate_hz);
        Self { seconds, rate_hz, ..*self }
    }

    /// Computes the walk; empty for zero duration or rate.
    pub fn trajectory(&self) -> Trajectory {
        let samples = (self.seconds * self.rate_hz).max(0.0) as usize;
        let mut noise = Gaussian::new(self.seed);
        let [speed_m_s, force_n] = [self.speed_m_s, self.force_n].map(|(from, to)| {
            let walk = self.walk(&mut noise);
            let at = |i: usize| {
                let position = i as f64 / self.rate_hz * WALK_HZ;
                let before = (position as usize).min(walk.len() - 2);
                let part = position - before as f64;
                from + (to - from) * (walk[before] + part * (walk[before + 1] - walk[before])).clamp(0.0, 1.0)
            };
            (0..samples).map(at).collect()
        });
        Trajectory { rate_hz: self.rate_hz, speed_m_s, force_n }
    }

    /// A walk between reflecting walls, smoothed and scaled to 0..1.
    fn walk(&self, noise: &mut Gaussian) -> Vec<f64> {
        let steps = (self.seconds * WALK_HZ).max(0.0) as usize + 2;
        let mut place = 0.5;
        let walk: Vec<f64> = (0..steps)
            .map(|_| {
                // A standard deviation of 0.7 per second: the walk crosses the range every few seconds.
                place += 0.07 * noise.next_sample();
                // Reflection of any overshoot.
                place = 1.0 - (place.rem_euclid(2.0) - 1.0).abs();
                place
            })
            .collect();
        let smooth = match butterworth_lowpass(2, self.cutoff_hz, WALK_HZ) {
            Ok(lowpass) => filtfilt(&lowpass, walk),
            Err(_) => walk,
        };
        let least = smooth.iter().copied().fold(f64::INFINITY, f64::min);
        let most = smooth.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        smooth.iter().map(|x| if most > least { (x - least) / (most - least) } else { 0.5 }).collect()
    }
}

/// The samples at which a synthesis reads speed and force, one per update: the last sample at or before k /
/// `update_hz` for update k.
pub fn update_samples(rate_hz: f64, update_hz: f64, samples: usize) -> impl Iterator<Item = usize> {
    updates(rate_hz, update_hz, samples).map(|(place, _)| place)
}

/// The filter updates as a graph's clocks schedule them: the sample at which speed and force are read, and
/// the range of samples for which the filter then applies. Update k is at the first sample at or after k /
/// `update_hz` and reads the last sample at or before it.
pub fn updates(rate_hz: f64, update_hz: f64, samples: usize) -> impl Iterator<Item = (usize, Range<usize>)> {
    let every = (rate_hz / update_hz).max(1.0);
    let start = move |update: usize| ((update as f64 * every - 1e-9).ceil() as usize).min(samples);
    (0..)
        .map(move |update| {
            let place = (update as f64 * every + 1e-9).floor() as usize;
            (place, start(update)..start(update + 1))
        })
        .take_while(move |(_, range)| range.start < samples)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_walk_spans_its_range_and_is_smooth() {
        let walk = RandomWalk::default().trajectory();
        assert_eq!((walk.speed_m_s.len(), walk.force_n.len()), (300_000, 300_000));
        for (values, (from, to)) in [(&walk.speed_m_s, (0.005, 0.17)), (&walk.force_n, (0.1, 2.8))] {
            let least = values.iter().copied().fold(f64::INFINITY, f64::min);
            let most = values.iter().copied().fold(0.0, f64::max);
            assert!(
                least < from + 0.03 * (to - from)
                    && most > to - 0.03 * (to - from)
                    && least >= from
                    && most <= to
            );
            let step = values.windows(2).map(|w| (w[1] - w[0]).abs()).fold(0.0, f64::max);
            assert!(step * 10_000.0 < 10.0 * (to - from), "no jumps");
        }
    }
}
