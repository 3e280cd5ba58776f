//! The vibration of a texture along a trajectory of speed and force (thesis 2.4.2), offline.

use crate::crackle::CrackleSource;
use crate::lines::{LineSource, mixed_powers};
use crate::{Coefficients, Interpolator, TextureModel};
use haptograph_signal::arma::{ArmaError, ArmaFilter, Form, WarpedLattice};
use haptograph_signal::filter::{SectionsState, butterworth_lowpass, filtfilt};
use haptograph_signal::noise::{Gaussian, stream_seed};
use std::ops::{ControlFlow, Range};

/// Settings of the synthesis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SynthesisSettings {
    /// Rate at which coefficients are interpolated, Hz; 240 in chapter 2.
    pub update_hz: f64,
    /// Seed of the excitation; in a graph, that of the node `Excitation`.
    pub seed: u64,
    /// Seed of the lines; in a graph, that of the node `ArmaFilter`.
    pub lines_seed: u64,
}

impl Default for SynthesisSettings {
    fn default() -> Self {
        Self { update_hz: 240.0, seed: 1, lines_seed: 1 }
    }
}

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
    pub fn at_updates(&self, update_hz: f64) -> UpdatePoints {
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

/// Updates between two calls of `progress`.
pub(super) const TOLD_EVERY: usize = 512;

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
            Ok(lowpass) => filtfilt(&lowpass, &walk),
            Err(_) => walk,
        };
        let least = smooth.iter().copied().fold(f64::INFINITY, f64::min);
        let most = smooth.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        smooth.iter().map(|x| if most > least { (x - least) / (most - least) } else { 0.5 }).collect()
    }
}

/// Error of a synthesis.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs)] // see the messages
pub enum SynthesisError {
    #[error(
        "the texture's rate is {texture_hz} Hz, the trajectory's {trajectory_hz} Hz: resample one of them"
    )]
    Rates { texture_hz: f64, trajectory_hz: f64 },
    #[error("the trajectory has {speeds} speeds but {forces} forces")]
    Lengths { speeds: usize, forces: usize },
    #[error("the update rate of {update_hz} Hz is out of range")]
    UpdateRate { update_hz: f64 },
    #[error("the synthesis has {updates} updates, but {points} speeds are given")]
    Updates { updates: usize, points: usize },
    #[error("the vibration has {samples} samples, but its output has {places}")]
    Output { samples: usize, places: usize },
    #[error("the texture has invalid filter coefficients: {0}")]
    Filter(#[from] ArmaError),
    #[error("the synthesis was stopped")]
    Stopped,
}

/// The acceleration, m/s², of `texture` along `trajectory`: white noise with the interpolated variance and
/// the texture's crackle, through the interpolated filter, which is updated at
/// [`SynthesisSettings::update_hz`], plus the texture's lines.
pub fn synthesise(
    texture: &TextureModel,
    trajectory: &Trajectory,
    settings: &SynthesisSettings,
) -> Result<Vec<f64>, SynthesisError> {
    synthesise_with(texture, trajectory, settings, &|_| ControlFlow::Continue(()))
}

/// Like [`synthesise`]; `progress` receives the fraction done every few seconds of the vibration, and returns whether
/// to continue.
///
/// # Errors
/// As [`synthesise`]; [`SynthesisError::Stopped`] if `progress` breaks.
pub fn synthesise_with(
    texture: &TextureModel,
    trajectory: &Trajectory,
    settings: &SynthesisSettings,
    progress: &dyn Fn(f64) -> ControlFlow<()>,
) -> Result<Vec<f64>, SynthesisError> {
    check(texture, trajectory, settings)?;
    let Trajectory { rate_hz, speed_m_s, force_n } = trajectory;
    let mut interpolator = Interpolator::new(texture);
    let mut coefficients = Coefficients::SILENCE;
    let mut filter = ArmaFilter::new(Form::Lattice);
    let mut warped = WarpedLattice::new();
    let mut noise = Gaussian::new(settings.seed);
    let mut crackle = texture.crackle().map(|crackle| {
        let seed = stream_seed(settings.seed, "crackle");
        CrackleSource::new(crackle, *rate_hz, seed)
    });
    let seed = stream_seed(settings.lines_seed, "lines");
    let mut lines = LineSource::new(texture.lines(), *rate_hz, texture.rate_hz(), seed);
    let has_lines = !texture.lines().is_empty();
    let mut vibration = vec![0.0; speed_m_s.len()];
    let mut moves = vec![];
    let mut excitation = vec![];
    let updates = updates(*rate_hz, settings.update_hz, speed_m_s.len());
    for (number, (place, samples)) in updates.enumerate() {
        if number % TOLD_EVERY == 0 && progress(place as f64 / speed_m_s.len() as f64).is_break() {
            return Err(SynthesisError::Stopped);
        }
        let spot = interpolator.interpolate(speed_m_s[place], force_n[place], &mut coefficients);
        let is_warped = coefficients.warping != 0.0;
        if is_warped {
            warped.set_coefficients(coefficients.ar(), coefficients.warping, coefficients.gain)?;
        } else {
            filter.set_coefficients(coefficients.ar(), coefficients.ma(), coefficients.gain)?;
        }
        if has_lines {
            let powers = mixed_powers(texture.lines(), spot.vertices, spot.weights);
            moves.push((samples.clone(), spot.speed_m_s, powers));
        }
        excitation.resize(samples.len(), 0.0);
        noise.fill(&mut excitation);
        if let Some(crackle) = &mut crackle {
            crackle.modulate(&mut excitation);
        }
        let deviation = coefficients.variance.sqrt();
        excitation.iter_mut().for_each(|e| *e *= deviation);
        if is_warped {
            warped.process(&excitation, &mut vibration[samples]);
        } else {
            filter.process(&excitation, &mut vibration[samples]);
        }
    }
    if let Some(highpass) = texture.output_highpass() {
        SectionsState::new(&highpass).process_in_place(&mut vibration);
    }
    for (samples, speed_m_s, powers) in moves {
        lines.set(speed_m_s, powers);
        lines.add_to(&mut vibration[samples]);
    }
    Ok(vibration)
}

/// Checks that texture, trajectory and settings match.
pub(super) fn check(
    texture: &TextureModel,
    trajectory: &Trajectory,
    settings: &SynthesisSettings,
) -> Result<(), SynthesisError> {
    check_rates(texture, trajectory.rate_hz)?;
    check_lengths(&trajectory.speed_m_s, &trajectory.force_n)?;
    check_update_rate(settings.update_hz)
}

/// Checks that texture, points and output match.
pub(super) fn check_points(
    texture: &TextureModel,
    points: &UpdatePoints,
    places: usize,
) -> Result<(), SynthesisError> {
    check_rates(texture, points.rate_hz)?;
    check_lengths(&points.speed_m_s, &points.force_n)?;
    check_update_rate(points.update_hz)?;
    let samples = points.samples;
    if samples != places {
        return Err(SynthesisError::Output { samples, places });
    }
    let updates = update_samples(points.rate_hz, points.update_hz, samples).count();
    match points.speed_m_s.len() {
        points if points == updates => Ok(()),
        points => Err(SynthesisError::Updates { updates, points }),
    }
}

fn check_rates(texture: &TextureModel, trajectory_hz: f64) -> Result<(), SynthesisError> {
    let texture_hz = texture.rate_hz();
    if texture_hz == trajectory_hz {
        return Ok(());
    }
    Err(SynthesisError::Rates { texture_hz, trajectory_hz })
}

fn check_lengths(speed_m_s: &[f64], force_n: &[f64]) -> Result<(), SynthesisError> {
    let (speeds, forces) = (speed_m_s.len(), force_n.len());
    if speeds == forces {
        return Ok(());
    }
    Err(SynthesisError::Lengths { speeds, forces })
}

fn check_update_rate(update_hz: f64) -> Result<(), SynthesisError> {
    if update_hz.is_finite() && update_hz > 0.0 {
        return Ok(());
    }
    Err(SynthesisError::UpdateRate { update_hz })
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
    use crate::hull::Hull;
    use crate::{ArmaModel, ModelAt, VertexKind};

    pub(super) fn texture() -> TextureModel {
        let at = |speed_m_s: f64, force_n: f64, variance: f64| ModelAt {
            speed_m_s,
            force_n,
            model: ArmaModel::from_ar(&[-1.2, 0.7], variance).unwrap(),
            kind: VertexKind::Measured,
        };
        let measured = vec![
            at(0.05, 0.5, 1.0),
            at(0.2, 0.5, 2.0),
            at(0.05, 2.0, 2.0),
            at(0.2, 2.0, 4.0),
            at(0.1, 1.0, 1.5),
        ];
        TextureModel::from_measured(10_000.0, measured, &Hull::default()).unwrap()
    }

    fn constant(speed: f64, force: f64, samples: usize) -> Trajectory {
        Trajectory { rate_hz: 10_000.0, speed_m_s: vec![speed; samples], force_n: vec![force; samples] }
    }

    #[test]
    fn silence_at_zero_speed_and_at_zero_force() {
        for (speed, force) in [(0.0, 1.0), (0.1, 0.0)] {
            let silence = synthesise(&texture(), &constant(speed, force, 1000), &Default::default()).unwrap();
            assert!(silence.iter().all(|&y| y == 0.0));
        }
    }

    #[test]
    fn the_power_at_a_model_is_the_models() {
        let vibration = synthesise(&texture(), &constant(0.2, 2.0, 200_000), &Default::default()).unwrap();
        let power = vibration.iter().map(|y| y * y).sum::<f64>() / 200_000.0;
        let expected = 4.0 * haptograph_signal::prediction::power_gain(&[-1.2, 0.7], &[]).unwrap();
        assert!((power / expected - 1.0).abs() < 0.05, "{power} for {expected}");
    }

    #[test]
    fn the_same_seed_gives_the_same_bits_and_another_does_not() {
        let trajectory = RandomWalk { seconds: 0.5, ..Default::default() }.trajectory();
        let with = |seed| {
            synthesise(&texture(), &trajectory, &SynthesisSettings { seed, ..Default::default() }).unwrap()
        };
        assert_eq!(with(1), with(1));
        assert_ne!(with(1), with(2));
    }

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

    #[test]
    fn trajectories_that_do_not_fit_are_refused() {
        let mut short = constant(0.1, 1.0, 10);
        short.force_n.pop();
        assert!(matches!(
            synthesise(&texture(), &short, &Default::default()),
            Err(SynthesisError::Lengths { .. })
        ));
        let slow = Trajectory { rate_hz: 1000.0, ..constant(0.1, 1.0, 10) };
        assert!(matches!(
            synthesise(&texture(), &slow, &Default::default()),
            Err(SynthesisError::Rates { .. })
        ));
        let never = SynthesisSettings { update_hz: 0.0, ..Default::default() };
        let error = synthesise(&texture(), &constant(0.1, 1.0, 10), &never);
        assert!(matches!(error, Err(SynthesisError::UpdateRate { .. })));
        assert_eq!(synthesise(&texture(), &constant(0.1, 1.0, 0), &Default::default()), Ok(vec![]));
    }
}
