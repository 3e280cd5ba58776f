//! Learns a texture as a law: the spectrum on a warped axis as a function of speed and force, fitted to all windows at once.
//!
//! The thesis models each stretch separately and interpolates between the models, so that every model has the noise of its
//! stretch, and the map ends at the models. Here the mean of each cell of the warped axis is a power of speed and force. The
//! prior of the shape's exponents is 0, that of the total's the mean of real textures. The law is then evaluated on a grid of
//! models, which a renderer interpolates like any other map.

use super::cells::{CELLS, CellSpectrum};
use super::correction::{Place, Stretch};
use super::spectral_law::{Axis, Exponents, Observation, SpectralLaw};
use super::texture::{
    Fate, LearnTextureError, SegmentReport, TextureReport, common_rate, features, nothing_dragged,
};
use crate::recording::ProcessedRecording;
use haptograph_signal::statistics::median;
use haptograph_surfaces::model::warping_for;
use haptograph_surfaces::provenance::VIBRATION_UNIT;
use haptograph_surfaces::{MAX_ORDER, TextureModel};

/// Settings for learning a texture as a law.
#[derive(Debug, Clone, PartialEq)]
pub struct LawSettings {
    /// Order of all models.
    pub order: usize,
    /// Warping factor; if `None`, by the rate ([`warping_for`]).
    pub warping: Option<f64>,
    /// Length of the windows in which speed and force count as constant, s.
    pub span_s: f64,
    /// Corner of the high-pass of the recordings, Hz: divided out before the fit and applied once when rendered.
    pub highpass_hz: Option<f64>,
    /// Windows with a lower median speed are ignored, m/s.
    pub min_speed_m_s: f64,
    /// Windows with a lower median force are ignored, N.
    pub min_force_n: f64,
    /// Keeps clips of a recording of which 4 s or more can be used; else its grain alone.
    pub clips: bool,
}

impl Default for LawSettings {
    fn default() -> Self {
        Self {
            order: 20,
            warping: None,
            span_s: 0.2,
            highpass_hz: Some(20.0),
            min_speed_m_s: 0.005,
            min_force_n: 0.05,
            clips: true,
        }
    }
}

/// Length of the stretches for the long-term spectrum, s: 200 ms cannot resolve 20 Hz from 30 Hz.
const LONG_S: f64 = 1.0;

/// A law fitted to recordings.
pub(super) struct Fitted {
    law: SpectralLaw,
    axis: Axis,
    highpass_hz: Option<f64>,
    /// The recorded spectra of long stretches, and those that the law expects.
    stretches: Vec<Stretch>,
}

impl Fitted {
    /// The fit with its law corrected by the residuals, so that it follows peaks that move with speed.
    pub(super) fn corrected(mut self) -> Self {
        self.law.correct(&self.stretches);
        self
    }

    /// The map of models that is rendered.
    pub(super) fn texture(&self) -> Result<TextureModel, LearnTextureError> {
        Ok(self.law.on_grid(self.axis)?.with_highpass_hz(self.highpass_hz)?)
    }
}

/// Learns a texture from drag recordings as a law over speed and force, corrected by its residuals.
///
/// # Errors
/// [`LearnTextureError`] if the recordings' rates differ, nothing was dragged, or the order is out of range.
#[cfg(test)]
pub(crate) fn learn_law(
    recordings: &[ProcessedRecording],
    settings: &LawSettings,
    progress: &dyn Fn(f64),
) -> Result<(TextureModel, TextureReport), LearnTextureError> {
    let (fitted, report) = fit_law(recordings, settings, progress)?;
    Ok((fitted.corrected().texture()?, report))
}

/// Fits the law alone.
///
/// # Errors
/// [`LearnTextureError`] if the recordings' rates differ, nothing was dragged, or the order is out of range.
pub(super) fn fit_law(
    recordings: &[ProcessedRecording],
    settings: &LawSettings,
    progress: &dyn Fn(f64),
) -> Result<(Fitted, TextureReport), LearnTextureError> {
    let rate_hz = common_rate(recordings)?;
    if !(1..=MAX_ORDER).contains(&settings.order) {
        return Err(LearnTextureError::Order { order: settings.order });
    }
    let warping = settings.warping.unwrap_or_else(|| warping_for(rate_hz));
    let (mut segments, mut windows) = (vec![], vec![]);
    for (number, recording) in recordings.iter().enumerate() {
        for (segment, window) in stretches_of(number, recording, warping, settings) {
            segments.push(segment);
            windows.extend(window);
        }
        progress(0.5 * (number + 1) as f64 / recordings.len() as f64);
    }
    if windows.is_empty() {
        return Err(nothing_dragged(&segments, settings.min_force_n, settings.min_speed_m_s));
    }
    let mut law = SpectralLaw::fit(&windows, exponents(recordings));
    progress(0.7);
    let mut stretches = long_stretches(&law, recordings, warping, settings);
    law.scale_cells(&mut stretches);
    progress(1.0);
    let report = TextureReport {
        order: settings.order,
        segmentations: vec![],
        segments,
        residual_bound: f64::INFINITY,
    };
    let axis = Axis { rate_hz, warping, order: settings.order };
    let fitted = Fitted { law, axis, highpass_hz: settings.highpass_hz, stretches };
    Ok((fitted, report))
}

/// The windows of a recording, with what is observed in those that are kept.
fn stretches_of(
    number: usize,
    recording: &ProcessedRecording,
    warping: f64,
    settings: &LawSettings,
) -> Vec<(SegmentReport, Option<Observation>)> {
    let (signals, rate_hz) = (recording.signals(), recording.rate_hz());
    let span = ((settings.span_s * rate_hz) as usize).clamp(2, recording.samples().max(2));
    let mut spectrum = CellSpectrum::new(span, rate_hz, warping, settings.highpass_hz);
    let of = |start: usize| {
        let samples = start..start + span;
        let stretch = &recording.vibration_m_s2()[samples.clone()];
        let speed_m_s = median(&signals.speed_m_s[samples.clone()]);
        let force_n = median(&signals.force_normal_n[samples.clone()]);
        let fate = match speed_m_s > settings.min_speed_m_s && force_n > settings.min_force_n {
            true => judge(stretch),
            false => Fate::NotDragged,
        };
        let window = (fate == Fate::Kept).then(|| {
            let cells = spectrum.of(stretch);
            Observation { speed_m_s, force_n, power: spectrum.cells.power(&cells), cells }
        });
        let segment = SegmentReport {
            recording: number,
            order: settings.order,
            speed_m_s,
            force_n,
            features: features(stretch, rate_hz),
            residuals: [None; 5],
            fate,
            samples,
        };
        (segment, window)
    };
    (0..=recording.samples().saturating_sub(span)).step_by(span).map(of).collect()
}

fn judge(stretch: &[f64]) -> Fate {
    if stretch.iter().all(|x| *x == 0.0) {
        let reason = "it is silent".to_owned();
        return Fate::Unusable { reason };
    }
    Fate::Kept
}

/// The prior of the power: that of accelerations, unless the vibration of a recording has another unit.
fn exponents(recordings: &[ProcessedRecording]) -> Exponents {
    let is_other =
        |recording: &ProcessedRecording| recording.provenance().settings.contains_key(VIBRATION_UNIT);
    if recordings.iter().any(is_other) {
        return Exponents::UNKNOWN;
    }
    Exponents::ACCELERATION
}

/// The density in stretches long enough to resolve it, and the density that the law expects; stretches without dragging
/// are left out.
fn long_stretches(
    law: &SpectralLaw,
    recordings: &[ProcessedRecording],
    warping: f64,
    settings: &LawSettings,
) -> Vec<Stretch> {
    let mut stretches = vec![];
    for recording in recordings {
        let rate_hz = recording.rate_hz();
        let length = ((LONG_S * rate_hz) as usize).min(recording.samples());
        if length < 2 {
            continue;
        }
        let mut spectrum = CellSpectrum::new(length, rate_hz, warping, settings.highpass_hz);
        let signals = recording.signals();
        let span = ((settings.span_s * rate_hz) as usize).clamp(1, length);
        for start in (0..=recording.samples() - length).step_by((length / 2).max(1)) {
            let mut expected = vec![0.0; CELLS];
            let (mut place, mut dragged) = (Place::zeros(), 0.0);
            for part in (start..start + length).step_by(span) {
                let samples = part..(part + span).min(start + length);
                let speed_m_s = median(&signals.speed_m_s[samples.clone()]);
                let force_n = median(&signals.force_normal_n[samples.clone()]);
                if speed_m_s > settings.min_speed_m_s && force_n > settings.min_force_n {
                    let weight = samples.len() as f64 / length as f64;
                    let cells = law.cells(speed_m_s, force_n);
                    expected.iter_mut().zip(cells).for_each(|(sum, cell)| *sum += weight * cell);
                    place += weight * Place::new(speed_m_s.ln(), force_n.ln());
                    dragged += weight;
                }
            }
            // What is seen is tapered: a touch in the first or last tenth alone would seem faint.
            if dragged >= 0.5 {
                stretches.push(Stretch {
                    place: place / dragged,
                    seen: spectrum.of(&recording.vibration_m_s2()[start..start + length]),
                    expected,
                });
            }
        }
    }
    stretches
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::Gesture;
    use crate::recording::tests::synthetic::{drag, provenance};
    use haptograph_signal::spectrum::welch;
    use haptograph_signal::window::Window as Taper;
    use haptograph_surfaces::interpolation::{Coefficients, Interpolator};
    use haptograph_surfaces::rendering::{SynthesisSettings, synthesise};

    /// Louder with speed squared and the root of force; a resonance that stays.
    fn model(speed: f64, force: f64) -> (Vec<f64>, f64) {
        let (radius, angle) = (0.9_f64, 0.3_f64);
        let power = 400.0 * speed * speed * force.sqrt();
        (vec![-2.0 * radius * angle.cos(), radius * radius], power)
    }

    fn steps(speeds: &[f64], forces: &[f64]) -> Vec<(f64, f64, f64)> {
        let pairs = speeds.iter().flat_map(|v| forces.iter().map(move |f| (0.6, *v, *f)));
        pairs.collect()
    }

    fn settings() -> LawSettings {
        LawSettings { highpass_hz: None, ..LawSettings::default() }
    }

    fn power_at(texture: &TextureModel, speed_m_s: f64, force_n: f64) -> f64 {
        let mut mix = Coefficients::SILENCE;
        Interpolator::new(texture).interpolate(speed_m_s, force_n, &mut mix);
        let gain = haptograph_signal::warped::power_gain(mix.ar(), mix.warping).unwrap();
        mix.variance * gain
    }

    fn learned(speeds: &[f64]) -> TextureModel {
        let drag = drag(&steps(speeds, &[0.5, 1.0, 2.0]), 0.3, 1, model);
        learn_law(&[drag], &settings(), &|_| ()).unwrap().0
    }

    fn true_power(speed: f64, force: f64) -> f64 {
        let (ar, variance) = model(speed, force);
        variance * haptograph_signal::prediction::power_gain(&ar, &[]).unwrap()
    }

    fn db(a: f64, b: f64) -> f64 {
        10.0 * (a / b).log10()
    }

    #[test]
    fn the_power_follows_the_law_inside_and_a_little_beyond_the_data() {
        let texture = learned(&[0.04, 0.08, 0.16]);
        // Below a third of the lightest force measured the amplitude falls linearly.
        let fade = 0.5 / 3.0_f64;
        for (speed, force) in [(0.05, 0.7), (0.1, 1.5), (0.2, 2.4), (0.02, 1.0), (0.1, 0.3), (0.1, 0.1)] {
            let off = db(power_at(&texture, speed, force), true_power(speed, force));
            let wanted = if force < fade { db((force / fade).powf(1.5), 1.0) } else { 0.0 };
            assert!((off - wanted).abs() < 1.2, "{speed} {force}: {off} for {wanted}");
        }
    }

    #[test]
    fn a_take_at_one_speed_gets_the_slope_of_real_textures() {
        let texture = learned(&[0.1]);
        let slope = db(power_at(&texture, 0.14, 1.0), power_at(&texture, 0.07, 1.0)) / db(2.0, 1.0);
        assert!((slope - 1.95).abs() < 0.15, "{slope}");
    }

    #[test]
    fn a_take_in_an_unknown_unit_at_one_speed_gets_no_slope() {
        let take = drag(&steps(&[0.1], &[0.5, 1.0, 2.0]), 0.3, 1, model);
        let unknown = provenance().with_setting(VIBRATION_UNIT, "not known");
        let take = ProcessedRecording::new(take.signals().clone(), Gesture::Drag, unknown).unwrap();
        let texture = learn_law(&[take], &settings(), &|_| ()).unwrap().0;
        let slope = db(power_at(&texture, 0.14, 1.0), power_at(&texture, 0.07, 1.0));
        assert!(slope.abs() < 0.1, "{slope}");
    }

    #[test]
    fn a_power_that_no_law_of_powers_follows_is_corrected_where_it_was_recorded_and_between() {
        // Sixteen times as much at 80 mm/s as far below and above.
        let peaked = |speed: f64, _: f64| {
            let log = (speed / 0.08).ln() / 0.5;
            (vec![-1.72, 0.81], 1.0 + 15.0 * (-0.5 * log * log).exp())
        };
        let steps: Vec<_> = (0..9).map(|k| (2.0, 0.02 * 1.4_f64.powi(k), 1.0)).collect();
        let recording = [drag(&steps, 0.3, 1, peaked)];
        let fitted = || fit_law(&recording, &settings(), &|_| ()).unwrap().0;
        let worst = |texture: &TextureModel| {
            let off = |k: i32| {
                let speed = 0.024 * 1.2_f64.powi(k);
                let (ar, variance) = peaked(speed, 1.0);
                let truth = variance * haptograph_signal::prediction::power_gain(&ar, &[]).unwrap();
                db(power_at(texture, speed, 1.0), truth).abs()
            };
            (0..13).map(off).fold(0.0, f64::max)
        };
        let (powers, corrected) = (fitted().texture().unwrap(), fitted().corrected().texture().unwrap());
        let (powers, corrected) = (worst(&powers), worst(&corrected));
        assert!(corrected < 2.5 && powers > 5.0, "{corrected} {powers}");
    }

    #[test]
    fn at_rest_it_is_silent_and_nowhere_mute_or_much_louder_than_recorded() {
        let texture = learned(&[0.04, 0.08, 0.16]);
        assert_eq!(power_at(&texture, 0.0, 1.0), 0.0);
        assert_eq!(power_at(&texture, 0.1, 0.0), 0.0);
        let loudest = true_power(0.16, 2.0);
        for k in 0..400 {
            let (speed, force) = (0.005 + 0.001 * f64::from(k % 20) * 15.0, 0.1 + 0.2 * f64::from(k / 20));
            let power = power_at(&texture, speed, force);
            let (held_speed, held_force) = (speed.min(0.48), force.min(6.0));
            let law = true_power(held_speed, held_force) * (held_force / 0.5_f64).min(1.0).powf(1.5);
            assert!(power > 0.01 * law.min(loudest), "{speed} {force}: {power} for {law}");
            // Four times the loudest window, which is louder than the process.
            assert!(power < 6.0 * loudest);
        }
    }

    #[test]
    fn what_is_rendered_has_the_recorded_spectrum_from_twenty_hertz_on() {
        let recording = drag(&steps(&[0.06, 0.12], &[0.8, 1.6]), 0.3, 2, model);
        let (texture, report) = learn_law(std::slice::from_ref(&recording), &settings(), &|_| ()).unwrap();
        assert_eq!((report.order, texture.ar_order(), texture.warping()), (20, 20, 0.85));
        let played = synthesise(&texture, &recording.trajectory(), &SynthesisSettings::default()).unwrap();
        let spectrum = |samples: &[f64]| welch(samples, 10_000.0, 1000, 500, Taper::Hann).unwrap();
        let (recorded, played) = (spectrum(&recording.signals().acceleration_m_s2), spectrum(&played));
        for (low, high) in [(20.0, 60.0), (60.0, 200.0), (200.0, 400.0), (400.0, 600.0), (600.0, 1500.0)] {
            let off = db(played.power_between(low, high), recorded.power_between(low, high));
            assert!(off.abs() < 1.5, "{low} to {high} Hz: {off} dB");
        }
    }

    #[test]
    fn a_recording_at_rest_teaches_nothing() {
        let still = drag(&[(1.0, 0.001, 1.0)], 0.3, 1, model);
        assert!(matches!(
            learn_law(&[still], &settings(), &|_| ()),
            Err(LearnTextureError::NothingDragged { .. })
        ));
        assert!(matches!(learn_law(&[], &settings(), &|_| ()), Err(LearnTextureError::NoRecordings)));
    }
}
