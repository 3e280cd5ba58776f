//! Rendering of textures: one [`TextureVoice`] along speed and force, as the nodes of a graph and [`synthesise`] play it, and
//! banks of voices in SIMD lanes ([`synthesise_many`]), which play the same but for rounding.
//!
//! ```text
//! speed, force ─► Interpolator ─┬────────────────┐
//!                               ▼                ▼
//!                         Excitation ─► Synthesis (filter, high-pass, upsampling, layers) ─► vibration
//! ```

mod bank;
mod motion;
mod upsampler;
mod voice;

pub(crate) use bank::{BLOCK, LANES, Row};
pub use bank::{Block, Voice, VoiceError, VoiceInto, synthesise_into, synthesise_many, synthesise_many_with};
pub use motion::{RandomWalk, Trajectory, UpdatePoints, update_samples, updates};
pub use upsampler::Upsampler;
pub use voice::{Excitation, Synthesis, TextureVoice};

use crate::TextureModel;
use haptograph_signal::arma::ArmaError;
use std::ops::ControlFlow;

/// Settings of the synthesis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SynthesisSettings {
    /// Rate at which coefficients are interpolated, Hz; 240 in chapter 2.
    pub update_hz: f64,
    /// Seed of the excitation; in a graph, that of the node `Excitation`.
    pub seed: u64,
    /// Seed of the layers of the output, such as lines; in a graph, that of the node `ArmaFilter`.
    pub lines_seed: u64,
}

impl Default for SynthesisSettings {
    fn default() -> Self {
        Self { update_hz: 240.0, seed: 1, lines_seed: 1 }
    }
}

/// Updates between two calls of `progress`.
const UPDATES_PER_REPORT: usize = 512;

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
/// the layers of the excitation, through the interpolated filter, which is updated at
/// [`SynthesisSettings::update_hz`], then the layers of the output.
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
    let mut voice = TextureVoice::new(texture, *rate_hz, settings.seed, settings.lines_seed);
    let mut vibration = vec![0.0; speed_m_s.len()];
    let updates = updates(*rate_hz, settings.update_hz, speed_m_s.len());
    for (number, (place, samples)) in updates.enumerate() {
        if number % UPDATES_PER_REPORT == 0 && progress(place as f64 / speed_m_s.len() as f64).is_break() {
            return Err(SynthesisError::Stopped);
        }
        voice.move_to(speed_m_s[place], force_n[place])?;
        voice.play(&mut vibration[samples]);
    }
    Ok(vibration)
}

/// Checks that texture, trajectory and settings match.
fn check(
    texture: &TextureModel,
    trajectory: &Trajectory,
    settings: &SynthesisSettings,
) -> Result<(), SynthesisError> {
    check_rates(texture, trajectory.rate_hz)?;
    check_lengths(&trajectory.speed_m_s, &trajectory.force_n)?;
    check_update_rate(settings.update_hz)
}

/// Checks that texture, points and output match.
fn check_points(texture: &TextureModel, points: &UpdatePoints, places: usize) -> Result<(), SynthesisError> {
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
