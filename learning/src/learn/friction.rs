//! Friction: the slope of tangential over normal force (thesis 2.2.3, 3.2.3, 4.2.1 and A.2.2).

use crate::processing::{Kept, ProcessingError, ProcessingSettings, contact_signals};
use crate::recording::{AnyRecording, Recording};
use haptograph_signal::statistics::{Line, median};
use haptograph_surfaces::{Friction, SurfaceError};

/// Settings for learning friction.
#[derive(Debug, Clone, PartialEq)]
pub struct FrictionSettings {
    /// The fit; if `None`, by the gesture: through the origin, robust for free drags.
    pub fit: Option<FrictionFit>,
    /// Samples at a lower speed are ignored, because the tool may stick, m/s.
    pub min_speed_m_s: f64,
    /// Samples with a lower force count as a tool in the air, N.
    pub min_force_n: f64,
    /// Rate of the force pairs if the recording has no tracker (processed recordings), Hz.
    pub rate_hz: f64,
}

impl Default for FrictionSettings {
    fn default() -> Self {
        Self { fit: None, min_speed_m_s: 0.01, min_force_n: 0.1, rate_hz: 240.0 }
    }
}

/// The line fitted to (normal force, tangential force).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FrictionFit {
    /// Constrained to the origin: thesis 4.2.1.
    ThroughOrigin,
    /// Fitted with an intercept, outliers removed: thesis 2.2.3 and 3.2.3. The rendered friction has no intercept.
    Robust,
    /// Constrained to the origin, outliers removed.
    RobustThroughOrigin,
}

/// The report of learning friction.
#[derive(Debug, Clone, PartialEq)]
pub struct FrictionReport {
    /// Fit of the line.
    pub fit: FrictionFit,
    /// The line; its slope is the friction coefficient.
    pub line: Line,
    /// Pairs of normal and tangential force, N.
    pub points: Vec<(f64, f64)>,
    /// True for each pair that was used for the fit.
    pub used: Vec<bool>,
}

/// An error of learning friction.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs)] // see the messages
pub enum FrictionError {
    #[error(transparent)]
    Processing(#[from] ProcessingError),
    #[error("the recording has no tangential force")]
    NoTangentialForce,
    #[error(
        "only {points} samples have a sliding tool (more than {min_force_n} N and {min_speed_mm_s} mm/s), or their forces do not vary: drag faster or harder"
    )]
    TooFewPoints { points: usize, min_force_n: f64, min_speed_mm_s: f64 },
    #[error(
        "the friction coefficient would be {mu:.3}; it must be at least 0: check the signs of the forces and the calibration"
    )]
    Negative { mu: f64 },
    #[error(
        "the tangential force is {force_n} N at every moment: it was not measured; leave its column out, or record it"
    )]
    Constant { force_n: f64 },
    #[error(transparent)]
    Surface(#[from] SurfaceError),
}

/// A sample of a sliding tool.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Sliding {
    /// Normal force, N.
    pub normal_n: f64,
    /// Tangential force against the motion, N.
    pub tangential_n: f64,
    /// Speed, m/s.
    pub speed_m_s: f64,
}

/// The samples of a recording in which the tool slides.
///
/// Forces are interpolated at the tracker's sample times and split there: an upsampled path would give wrong signs where the
/// tool turns (thesis 4.2.1).
pub(crate) fn sliding(
    recording: &AnyRecording,
    processing: &ProcessingSettings,
    settings: &FrictionSettings,
) -> Result<Vec<Sliding>, FrictionError> {
    let moment =
        |normal_n: f64, tangential_n: f64, speed_m_s: f64| Sliding { normal_n, tangential_n, speed_m_s };
    let moments: Vec<Sliding> = match recording {
        AnyRecording::Raw(raw) => {
            let moments = shared_moments(raw);
            let contact = contact_signals(raw, processing, moments.iter().copied(), Kept::Forces)?;
            let tangential = contact.force_tangential_n.ok_or(FrictionError::NoTangentialForce)?;
            (0..contact.speed_m_s.len())
                .map(|i| moment(contact.force_normal_n[i], tangential[i], contact.speed_m_s[i]))
                .collect()
        }
        AnyRecording::Processed(processed) => {
            let signals = processed.signals();
            let tangential = signals.force_tangential_n.as_ref().ok_or(FrictionError::NoTangentialForce)?;
            let step = (signals.rate_hz / settings.rate_hz).round().max(1.0) as usize;
            (0..processed.samples())
                .step_by(step)
                .map(|i| moment(signals.force_normal_n[i], tangential[i], signals.speed_m_s[i]))
                .collect()
        }
    };
    let slides = |m: &Sliding| m.normal_n > settings.min_force_n && m.speed_m_s > settings.min_speed_m_s;
    Ok(moments.into_iter().filter(slides).collect())
}

/// The tracker's sample times within the force sensor's recording.
pub(super) fn shared_moments(recording: &Recording) -> Vec<f64> {
    let (motion, wrench) = (recording.motion(), recording.wrench());
    let times = (0..motion.samples.len()).map(|i| motion.time_s(i));
    times.filter(|time| *time >= wrench.start_s && *time <= wrench.end_s() + 0.5 / motion.rate_hz).collect()
}

/// Fits the line to pairs of normal and tangential force.
pub(crate) fn fit_friction(points: Vec<(f64, f64)>, fit: FrictionFit) -> Option<FrictionReport> {
    let (line, used) = match fit {
        FrictionFit::ThroughOrigin => (Line::fit_through_origin(&points)?, vec![true; points.len()]),
        FrictionFit::Robust => robust_line(&points, Line::fit)?,
        FrictionFit::RobustThroughOrigin => robust_line(&points, Line::fit_through_origin)?,
    };
    Some(FrictionReport { fit, line, points, used })
}

/// Fits a line and removes points farther than three deviations (estimated from the median residual) until none remain.
fn robust_line(points: &[(f64, f64)], fit: fn(&[(f64, f64)]) -> Option<Line>) -> Option<(Line, Vec<bool>)> {
    let mut used = vec![true; points.len()];
    let through = |used: &[bool]| {
        let kept = points.iter().zip(used).filter(|(_, used)| **used);
        fit(&kept.map(|(point, _)| *point).collect::<Vec<_>>())
    };
    for _ in 0..50 {
        let line = through(&used)?;
        let distances: Vec<f64> = points.iter().map(|&(x, y)| (y - line.at(x)).abs()).collect();
        let kept = distances.iter().zip(&used).filter(|(_, used)| **used);
        let among_kept: Vec<f64> = kept.map(|(distance, _)| *distance).collect();
        // 1.4826 medians of the magnitude are one deviation of a normal distribution.
        let bound = 3.0 * 1.4826 * median(&among_kept);
        let now: Vec<bool> = distances.iter().map(|&distance| distance <= bound).collect();
        if now == used || bound == 0.0 {
            return Some((line, used));
        }
        used = now;
    }
    Some((through(&used)?, used))
}

/// Learns friction from recordings of one gesture.
pub(crate) fn learn_friction(
    recordings: &[&AnyRecording],
    processing: &ProcessingSettings,
    settings: &FrictionSettings,
    default_fit: FrictionFit,
) -> Result<(Friction, FrictionReport), FrictionError> {
    let mut points = vec![];
    for recording in recordings {
        let moments = sliding(recording, processing, settings)?;
        points.extend(moments.iter().map(|m| (m.normal_n, m.tangential_n)));
    }
    let too_few = FrictionError::TooFewPoints {
        points: points.len(),
        min_force_n: settings.min_force_n,
        min_speed_mm_s: settings.min_speed_m_s * 1000.0,
    };
    if points.len() < 10 {
        return Err(too_few);
    }
    let force_n = points[0].1;
    if points.iter().all(|point| point.1 == force_n) {
        return Err(FrictionError::Constant { force_n });
    }
    let report = fit_friction(points, settings.fit.unwrap_or(default_fit)).ok_or(too_few)?;
    let mu = report.line.slope;
    if mu < 0.0 {
        return Err(FrictionError::Negative { mu });
    }
    Ok((Friction::new(mu, Some(report.line.r_squared))?, report))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::tests::synthetic::{circle, drag};
    use haptograph_signal::noise::Gaussian;

    fn learned(
        recording: AnyRecording,
        fit: FrictionFit,
    ) -> Result<(Friction, FrictionReport), FrictionError> {
        learn_friction(&[&recording], &ProcessingSettings::default(), &FrictionSettings::default(), fit)
    }

    #[test]
    fn a_circle_under_constant_push_shows_its_friction() {
        let raw = AnyRecording::Raw(circle(4.0, 0.03, 1.0, 1.5, 0.42));
        let (friction, report) = learned(raw, FrictionFit::ThroughOrigin).unwrap();
        assert!((friction.mu() - 0.42).abs() < 2e-3, "{}", friction.mu());
        assert!(report.points.len() > 900);
    }

    #[test]
    fn all_lines_find_the_friction_of_a_drag() {
        let steps: Vec<_> = (1..8).map(|i| (0.2, 0.1, 0.4 * i as f64)).collect();
        let recording = AnyRecording::Processed(drag(&steps, 0.3, 1, |_, _| (vec![], 1.0)));
        for fit in [FrictionFit::ThroughOrigin, FrictionFit::Robust, FrictionFit::RobustThroughOrigin] {
            let (friction, _) = learned(recording.clone(), fit).unwrap();
            assert!((friction.mu() - 0.3).abs() < 1e-9);
            assert!(friction.r_squared().unwrap() > 0.999);
        }
    }

    #[test]
    fn impacts_do_not_tilt_the_robust_line() {
        let mut noise = Gaussian::new(1);
        let mut points: Vec<_> = (0..400)
            .map(|i| {
                (
                    0.5 + 0.005 * f64::from(i),
                    0.05 + 0.25 * (0.5 + 0.005 * f64::from(i)) + 0.02 * noise.next_sample(),
                )
            })
            .collect();
        for i in 0..60 {
            points[6 * i].1 += 1.0 + 0.5 * noise.next_sample().abs();
        }
        let robust = fit_friction(points.clone(), FrictionFit::Robust).unwrap();
        assert!(
            (robust.line.slope - 0.25).abs() < 0.01 && (robust.line.intercept - 0.05).abs() < 0.02,
            "{:?}",
            robust.line
        );
        assert!(robust.line.r_squared > 0.9);
        let coefficient = fit_friction(points.clone(), FrictionFit::RobustThroughOrigin).unwrap();
        // 0.05 + 0.25 f over f, of 0.5 to 2.5 N.
        assert!(
            (coefficient.line.slope - 0.28).abs() < 0.01 && coefficient.line.intercept == 0.0,
            "{:?}",
            coefficient.line
        );
        let removed = robust.used.iter().filter(|used| !**used).count();
        assert!((60..75).contains(&removed), "{removed}");
        let plain = fit_friction(points, FrictionFit::ThroughOrigin).unwrap();
        assert!((plain.line.slope - 0.25).abs() > 0.05, "the plain line is tilted: {:?}", plain.line);
    }

    #[test]
    fn a_tool_in_the_air_or_pulled_along_has_no_friction() {
        let in_air = AnyRecording::Processed(drag(&[(1.0, 0.1, 0.01)], 0.3, 1, |_, _| (vec![], 1.0)));
        assert!(matches!(
            learned(in_air, FrictionFit::Robust),
            Err(FrictionError::TooFewPoints { points: 0, .. })
        ));
        let pulled = AnyRecording::Processed(drag(&[(1.0, 0.1, 1.0)], -0.3, 1, |_, _| (vec![], 1.0)));
        assert!(matches!(learned(pulled, FrictionFit::ThroughOrigin), Err(FrictionError::Negative { .. })));
    }
}
