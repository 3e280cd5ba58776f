//! Stiffness: the slope of force over indentation while pressing (thesis 3.2.2).

use super::friction::shared_moments;
use crate::processing::{ProcessingError, ProcessingSettings, SurfaceNormal, press_curve};
use crate::recording::Recording;
use haptograph_signal::statistics::Line;
use haptograph_surfaces::{Stiffness, SurfaceError};

/// Settings for learning stiffness.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StiffnessSettings {
    /// Lower limit of the fit, N: below it the compliance of the machine dominates.
    pub from_n: f64,
    /// Upper limit of the fit, N: above it the backing dominates.
    pub to_n: f64,
}

impl Default for StiffnessSettings {
    fn default() -> Self {
        Self { from_n: 1.0, to_n: 3.0 }
    }
}

/// The report of learning stiffness.
#[derive(Debug, Clone, PartialEq)]
pub struct StiffnessReport {
    /// Force in N over indentation in m, between the limits.
    pub line: Line,
    /// Indentation in m and force in N on the way in.
    pub curve: Vec<(f64, f64)>,
}

/// An error of learning stiffness.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs)] // see the messages
pub enum StiffnessError {
    #[error(transparent)]
    Processing(#[from] ProcessingError),
    #[error(
        "only {points} samples of the press lie between {from_n} and {to_n} N, or the tip does not move between them: press harder or more slowly"
    )]
    TooFewPoints { points: usize, from_n: f64, to_n: f64 },
    #[error(transparent)]
    Surface(#[from] SurfaceError),
}

/// The line between the force limits on the way in.
pub(crate) fn fit_stiffness(
    curve: Vec<(f64, f64)>,
    settings: &StiffnessSettings,
) -> Result<StiffnessReport, StiffnessError> {
    let hardest = (0..curve.len()).max_by(|&a, &b| curve[a].1.total_cmp(&curve[b].1));
    let curve = curve[..hardest.map_or(0, |i| i + 1)].to_vec();
    let between: Vec<_> = curve
        .iter()
        .copied()
        .filter(|&(_, force)| force >= settings.from_n && force <= settings.to_n)
        .collect();
    let StiffnessSettings { from_n, to_n } = *settings;
    let too_few = StiffnessError::TooFewPoints { points: between.len(), from_n, to_n };
    if between.len() < 3 {
        return Err(too_few);
    }
    let line = Line::fit(&between).ok_or(too_few)?;
    Ok(StiffnessReport { line, curve })
}

/// Learns stiffness from a press.
pub fn learn_stiffness(
    recording: &Recording,
    processing: &ProcessingSettings,
    settings: &StiffnessSettings,
) -> Result<(Stiffness, StiffnessReport), StiffnessError> {
    let normal = match processing.normal {
        // The path of a press does not define a plane.
        SurfaceNormal::PlaneFit => SurfaceNormal::ForceDirection,
        other => other,
    };
    let curve = press_curve(recording, normal, &shared_moments(recording))?;
    let report = fit_stiffness(curve, settings)?;
    Ok((Stiffness::new(report.line.slope / 1000.0, Some(report.line.r_squared))?, report))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::Gesture;
    use crate::recording::tests::synthetic::{Moment, raw};

    /// Presses at 1 N/s to 5 N and back, on a spring that stiffens beyond 3 N as a backing does.
    fn press(n_per_m: f64) -> Recording {
        raw(10.0, Gesture::Press, 10.0, |t| {
            let push_n = if t < 5.0 { t } else { 10.0 - t };
            let soft = push_n.min(3.2);
            // Unloading lags, as real materials do.
            let lag = if t < 5.0 { 0.0 } else { 0.02e-3 };
            let depth_m = soft / n_per_m + (push_n - soft) / (10.0 * n_per_m) + lag;
            Moment { place_m: [0.0, 0.0, -depth_m], push_n, friction_n: [0.0; 2], vibration_m_s2: [0.0; 3] }
        })
    }

    #[test]
    fn a_press_shows_the_spring_and_not_its_backing() {
        for n_per_mm in [10.81, 42.2] {
            let settings = (ProcessingSettings::default(), StiffnessSettings::default());
            let (stiffness, report) =
                learn_stiffness(&press(n_per_mm * 1000.0), &settings.0, &settings.1).unwrap();
            assert!((stiffness.n_per_mm() / n_per_mm - 1.0).abs() < 1e-3, "{}", stiffness.n_per_mm());
            assert!(report.line.r_squared > 0.9999 && report.curve.len() == 51);
        }
    }

    #[test]
    fn a_touch_is_too_light() {
        let touch = vec![(0.0, 0.0), (1e-4, 0.5), (2e-4, 0.9)];
        let error = fit_stiffness(touch, &StiffnessSettings::default()).unwrap_err();
        assert!(matches!(error, StiffnessError::TooFewPoints { points: 0, .. }));
        let stuck = vec![(1e-4, 1.0), (1e-4, 2.0), (1e-4, 3.0)];
        assert!(fit_stiffness(stuck, &StiffnessSettings::default()).is_err());
    }
}
