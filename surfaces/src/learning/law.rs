//! Texture as a law: how the spectrum on a warped axis follows speed and force, fitted to all windows at once.
//!
//! The thesis models each stretch alone and interpolates between the models, so that every model carries the noise of its
//! stretch and nothing is known beyond them. Here each cell of the warped axis has a mean that is a power of speed and
//! force, shapes drawn to none and the total to what real textures have on average; the law is then laid on a grid of
//! models, which a renderer interpolates like any other map.

use super::cells::{CELLS, CellSpectrum};
use super::regression::{Law, Place, Prior, fit, fit_robustly};
use super::texture::{
    Fate, LearnTextureError, SegmentReport, TextureReport, common_rate, features, nothing_dragged,
};
use crate::model::warping_for;
use crate::recording::ProcessedRecording;
use crate::statistics::median;
use crate::{ArmaModel, MAX_ORDER, ModelAt, TextureModel, VertexKind};
use haptograph_signal::prediction::levinson;
use haptograph_signal::warped::cell_autocovariance;
use nalgebra::Vector3;

/// How a texture is learned as a law.
#[derive(Debug, Clone, PartialEq)]
pub struct LawSettings {
    /// Order of all models.
    pub order: usize,
    /// Warping factor; by the rate ([`warping_for`]) if `None`.
    pub warping: Option<f64>,
    /// Length of the windows in which speed and force count as constant, s.
    pub span_s: f64,
    /// Corner of the high-pass of the recordings, Hz: divided out before the fit and applied once when rendered.
    pub highpass_hz: Option<f64>,
    /// Windows of a lower median speed tell nothing of sliding, m/s.
    pub min_speed_m_s: f64,
    /// Windows of a lower median force tell nothing of contact, N.
    pub min_force_n: f64,
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
        }
    }
}

/// Power of real textures over speed and force, fitted to the public models of 100 textures; see docs/learning.md.
const POWER: Prior = Prior {
    slopes: [2.15, 0.46],
    strength: 1.0,
};
/// Shapes: no change with speed and force unless the data say so.
const SHAPE: Prior = Prior {
    slopes: [0.0; 2],
    strength: 1.0,
};
/// Exponents of speed and force that textures may have.
const SPEED_EXPONENTS: (f64, f64) = (0.5, 3.5);
const FORCE_EXPONENTS: (f64, f64) = (0.0, 1.5);
/// How far beyond the data the law goes on, as a ratio; and how much louder than the loudest window it may become, 6 dB.
const BEYOND: f64 = 1.5;
const LOUDEST: f64 = 4.0;
/// Ratio between neighbouring speeds and forces of the grid: a chord of speed^2.15 is off by 0.2 dB at most.
const SPEED_RATIO: f64 = 1.5;
const FORCE_RATIO: f64 = 1.6;
/// Slowest speed of the grid, m/s: below it power falls linearly to zero at rest.
const SLOWEST_M_S: f64 = 0.003;
/// Length of the stretches that tell the long-term spectrum, s: 200 ms cannot tell 20 Hz from 30.
const LONG_S: f64 = 1.0;

/// A window: where it was, and its spectrum.
struct Window {
    speed_m_s: f64,
    force_n: f64,
    power: f64,
    cells: Vec<f64>,
}

/// Learns a texture from dragging recordings as a law over speed and force.
///
/// # Errors
/// [`LearnTextureError`] where the recordings' rates differ, nothing was dragged, or the order is out of range.
pub fn learn_law(
    recordings: &[ProcessedRecording],
    settings: &LawSettings,
    progress: &dyn Fn(f64),
) -> Result<(TextureModel, TextureReport), LearnTextureError> {
    let rate_hz = common_rate(recordings)?;
    if !(1..=MAX_ORDER).contains(&settings.order) {
        return Err(LearnTextureError::Order {
            order: settings.order,
        });
    }
    let warping = settings.warping.unwrap_or_else(|| warping_for(rate_hz));
    let mut segments = vec![];
    let mut windows = vec![];
    for (number, recording) in recordings.iter().enumerate() {
        let span = ((settings.span_s * rate_hz) as usize).clamp(2, recording.samples().max(2));
        let spectrum = CellSpectrum::new(span, rate_hz, warping, settings.highpass_hz);
        let signals = recording.signals();
        for start in (0..=recording.samples().saturating_sub(span)).step_by(span) {
            let samples = start..start + span;
            let stretch = &signals.acceleration_m_s2[samples.clone()];
            let mut segment = SegmentReport {
                recording: number,
                order: settings.order,
                speed_m_s: median(&signals.speed_m_s[samples.clone()]),
                force_n: median(&signals.force_normal_n[samples.clone()]),
                features: features(stretch, rate_hz),
                residuals: [None; 5],
                fate: Fate::NotDragged,
                samples,
            };
            if segment.speed_m_s > settings.min_speed_m_s && segment.force_n > settings.min_force_n {
                segment.fate = judge(stretch);
            }
            if segment.fate == Fate::Kept {
                windows.push(Window::new(&segment, spectrum.of(stretch), &spectrum));
            }
            segments.push(segment);
        }
        progress(0.5 * (number + 1) as f64 / recordings.len() as f64);
    }
    if windows.is_empty() {
        return Err(nothing_dragged(
            &segments,
            settings.min_force_n,
            settings.min_speed_m_s,
        ));
    }
    let mut law = SpectralLaw::of(&windows);
    progress(0.7);
    law.match_long_term(recordings, rate_hz, warping, settings);
    progress(0.8);
    let texture = law.on_grid(rate_hz, warping, settings)?;
    progress(1.0);
    let report = TextureReport {
        order: settings.order,
        segmentations: vec![],
        segments,
        residual_bound: f64::INFINITY,
    };
    Ok((texture, report))
}

fn judge(stretch: &[f64]) -> Fate {
    if stretch.iter().all(|x| *x == 0.0) {
        let reason = "it is silent".to_owned();
        return Fate::Unusable { reason };
    }
    Fate::Kept
}

impl Window {
    fn new(segment: &SegmentReport, cells: Vec<f64>, spectrum: &CellSpectrum) -> Self {
        let power = cells.iter().zip(spectrum.widths_hz()).map(|(p, w)| p * w).sum();
        Self {
            speed_m_s: segment.speed_m_s,
            force_n: segment.force_n,
            power,
            cells,
        }
    }
}

/// Densities over the cells as powers of speed and force.
struct SpectralLaw {
    /// Centre of the data, ln m/s and ln N.
    centre: [f64; 2],
    /// Slowest and fastest, lightest and hardest of the data.
    speed_m_s: (f64, f64),
    force_n: (f64, f64),
    power: Law,
    loudest: f64,
    /// Density of each cell over the power.
    shape: Vec<Law>,
}

impl SpectralLaw {
    fn of(windows: &[Window]) -> Self {
        let logs = |value: fn(&Window) -> f64| windows.iter().map(move |w| value(w).ln());
        let mean = |value: fn(&Window) -> f64| logs(value).sum::<f64>() / windows.len() as f64;
        let range = |value: fn(&Window) -> f64| {
            let values = windows.iter().map(value);
            values.fold((f64::INFINITY, 0.0_f64), |(low, high), x| {
                (low.min(x), high.max(x))
            })
        };
        let centre = [mean(|w| w.speed_m_s), mean(|w| w.force_n)];
        let place = |w: &Window| Vector3::new(1.0, w.speed_m_s.ln() - centre[0], w.force_n.ln() - centre[1]);
        let places: Vec<Place> = windows.iter().map(place).collect();
        let powers: Vec<f64> = windows.iter().map(|w| w.power).collect();
        let (power, weights) = fit_robustly(&places, &powers, POWER);
        let power = within_exponents(power, &places, &powers, &weights);
        let shape = (0..CELLS).map(|cell| {
            let shares: Vec<f64> = windows.iter().map(|w| w.cells[cell] / w.power).collect();
            fit(&places, &shares, &weights, SHAPE)
        });
        Self {
            centre,
            speed_m_s: range(|w| w.speed_m_s),
            force_n: range(|w| w.force_n),
            power,
            loudest: LOUDEST * powers.iter().copied().fold(0.0, f64::max),
            shape: shape.collect(),
        }
    }

    /// The place of a speed and force, the shape's held where it leaves the data.
    fn place(&self, speed_m_s: f64, force_n: f64, reach: f64) -> Place {
        let within = |x: f64, (low, high): (f64, f64)| x.clamp(low / reach, high * reach).ln();
        Vector3::new(
            1.0,
            within(speed_m_s, self.speed_m_s) - self.centre[0],
            within(force_n, self.force_n) - self.centre[1],
        )
    }

    /// Density over the cells.
    fn cells(&self, speed_m_s: f64, force_n: f64) -> Vec<f64> {
        let place = self.place(speed_m_s, force_n, BEYOND);
        let power = self.power_at(speed_m_s, force_n);
        self.shape
            .iter()
            .map(|law| power * law.dot(&place).exp())
            .collect()
    }

    /// The law's power: below the lightest force measured the amplitude falls linearly, and nowhere is it much louder than
    /// what was measured.
    fn power_at(&self, speed_m_s: f64, force_n: f64) -> f64 {
        let lightest = self.force_n.0;
        let fall = (force_n / lightest).min(1.0).powi(2);
        let place = self.place(speed_m_s, force_n.max(lightest), f64::INFINITY);
        (self.power.dot(&place).exp() * fall).min(self.loudest)
    }

    /// Scales each cell so that over the recordings, at the resolution of long stretches, the law has the recorded density.
    fn match_long_term(
        &mut self,
        recordings: &[ProcessedRecording],
        rate_hz: f64,
        warping: f64,
        settings: &LawSettings,
    ) {
        let (mut recorded, mut expected) = (vec![0.0; CELLS], vec![0.0; CELLS]);
        for recording in recordings {
            let length = ((LONG_S * rate_hz) as usize).min(recording.samples());
            if length < 2 {
                continue;
            }
            let spectrum = CellSpectrum::new(length, rate_hz, warping, settings.highpass_hz);
            let signals = recording.signals();
            let span = ((settings.span_s * rate_hz) as usize).clamp(1, length);
            for start in (0..=recording.samples() - length).step_by((length / 2).max(1)) {
                let cells = spectrum.of(&signals.acceleration_m_s2[start..start + length]);
                add(&mut recorded, &cells, 1.0);
                for part in (start..start + length).collect::<Vec<_>>().chunks(span) {
                    let samples = part[0]..part[0] + part.len();
                    let speed_m_s = median(&signals.speed_m_s[samples.clone()]);
                    let force_n = median(&signals.force_normal_n[samples]);
                    if speed_m_s > settings.min_speed_m_s && force_n > settings.min_force_n {
                        add(
                            &mut expected,
                            &self.cells(speed_m_s, force_n),
                            part.len() as f64 / length as f64,
                        );
                    }
                }
            }
        }
        for ((law, recorded), expected) in self.shape.iter_mut().zip(&recorded).zip(&expected) {
            if *recorded > 0.0 && *expected > 0.0 {
                law[0] += (recorded / expected).ln();
            }
        }
    }

    /// Models at the points of a grid from rest to beyond the data, and triangles between them.
    fn on_grid(
        &self,
        rate_hz: f64,
        warping: f64,
        settings: &LawSettings,
    ) -> Result<TextureModel, LearnTextureError> {
        let speeds = grid(
            SLOWEST_M_S.min(self.speed_m_s.0),
            self.speed_m_s.1 * BEYOND,
            SPEED_RATIO,
        );
        let lightest = self.force_n.0;
        // Amplitude falls linearly below the lightest force: half of it is a quarter of the power.
        let mut forces = vec![0.0, lightest / 4.0, lightest / 2.0];
        forces.extend(&grid(lightest, self.force_n.1 * BEYOND, FORCE_RATIO)[1..]);
        let mut models = Vec::with_capacity(speeds.len() * forces.len());
        for &speed_m_s in &speeds {
            for &force_n in &forces {
                let at_rest = speed_m_s == 0.0 || force_n == 0.0;
                let (nearest_speed, nearest_force) = (speed_m_s.max(speeds[1]), force_n.max(forces[1]));
                let model = self.model(nearest_speed, nearest_force, rate_hz, warping, settings.order)?;
                let within = |x: f64, (low, high): (f64, f64)| x >= low && x <= high;
                let fitted = within(speed_m_s, self.speed_m_s) && within(force_n, self.force_n);
                models.push(ModelAt {
                    speed_m_s,
                    force_n,
                    model: if at_rest { model.with_power(0.0)? } else { model },
                    kind: if fitted {
                        VertexKind::Fitted
                    } else {
                        VertexKind::Edge
                    },
                });
            }
        }
        let texture = TextureModel::new(rate_hz, models, rectangles(speeds.len(), forces.len()))?;
        Ok(texture.with_highpass_hz(settings.highpass_hz)?)
    }

    fn model(
        &self,
        speed_m_s: f64,
        force_n: f64,
        rate_hz: f64,
        warping: f64,
        order: usize,
    ) -> Result<ArmaModel, LearnTextureError> {
        // One-sided density to power a sample: half the rate.
        let mut cells = self.cells(speed_m_s, force_n);
        cells.iter_mut().for_each(|density| *density *= 0.5 * rate_hz);
        let fitted = levinson(&cell_autocovariance(&cells, order), order);
        let fitted = fitted.map_err(|error| LearnTextureError::NoModels {
            reason: error.to_string(),
        })?;
        let model = ArmaModel::warped_from_ar(&fitted.ar, warping, fitted.variance);
        model.map_err(|error| LearnTextureError::NoModels {
            reason: error.to_string(),
        })
    }
}

/// The law with exponents that textures have, its level fitted again.
fn within_exponents(law: Law, places: &[Place], powers: &[f64], weights: &[f64]) -> Law {
    let mut bounded = law;
    bounded[1] = law[1].clamp(SPEED_EXPONENTS.0, SPEED_EXPONENTS.1);
    bounded[2] = law[2].clamp(FORCE_EXPONENTS.0, FORCE_EXPONENTS.1);
    let scaled = places.iter().zip(powers).zip(weights);
    let (sum, total) = scaled.fold((0.0, 0.0), |(sum, total), ((place, y), w)| {
        (sum + w * y / bounded.dot(place).exp(), total + w)
    });
    if sum > 0.0 {
        bounded[0] += (sum / total).ln();
    }
    bounded
}

fn add(sums: &mut [f64], cells: &[f64], scale: f64) {
    sums.iter_mut()
        .zip(cells)
        .for_each(|(sum, cell)| *sum += scale * cell);
}

/// Zero, then even ratios of about `ratio` from `low` to `high`.
fn grid(low: f64, high: f64, ratio: f64) -> Vec<f64> {
    let steps = ((high / low).ln() / ratio.ln()).ceil().max(1.0);
    let step = |k: usize| low * (high / low).powf(k as f64 / steps);
    // Six decimals, as files have.
    let rounded = |x: f64| (x * 1e6).round() / 1e6;
    std::iter::once(0.0)
        .chain((0..=steps as usize).map(|k| rounded(step(k))))
        .collect()
}

/// Two triangles for each rectangle of the grid.
fn rectangles(speeds: usize, forces: usize) -> Vec<[u32; 3]> {
    let vertex = |speed: usize, force: usize| (speed * forces + force) as u32;
    let corners = (0..speeds - 1).flat_map(|v| (0..forces - 1).map(move |f| (v, f)));
    corners
        .flat_map(|(v, f)| {
            let [a, b, c, d] = [
                vertex(v, f),
                vertex(v + 1, f),
                vertex(v + 1, f + 1),
                vertex(v, f + 1),
            ];
            [[a, b, c], [a, c, d]]
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluate::{SynthesisSettings, Trajectory, synthesise};
    use crate::interpolation::{Coefficients, Interpolator};
    use crate::recording::synthetic::drag;
    use haptograph_signal::spectrum::welch;
    use haptograph_signal::window::Window as Taper;

    /// Louder with speed squared and the root of force; a resonance that stays.
    fn model(speed: f64, force: f64) -> (Vec<f64>, f64) {
        let (radius, angle) = (0.9_f64, 0.3_f64);
        let power = 400.0 * speed * speed * force.sqrt();
        (vec![-2.0 * radius * angle.cos(), radius * radius], power)
    }

    fn steps(speeds: &[f64], forces: &[f64]) -> Vec<(f64, f64, f64)> {
        let pairs = speeds
            .iter()
            .flat_map(|v| forces.iter().map(move |f| (0.6, *v, *f)));
        pairs.collect()
    }

    fn settings() -> LawSettings {
        LawSettings {
            highpass_hz: None,
            ..LawSettings::default()
        }
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
        for (speed, force) in [(0.05, 0.7), (0.1, 1.5), (0.2, 2.4), (0.02, 1.0), (0.1, 0.3)] {
            let off = db(power_at(&texture, speed, force), true_power(speed, force));
            // Below the lightest force measured the amplitude falls linearly.
            let wanted = if force < 0.5 {
                db((force / 0.5_f64).powf(1.5), 1.0)
            } else {
                0.0
            };
            assert!((off - wanted).abs() < 1.2, "{speed} {force}: {off} for {wanted}");
        }
    }

    #[test]
    fn a_take_at_one_speed_gets_the_slope_of_real_textures() {
        let texture = learned(&[0.1]);
        let slope = db(power_at(&texture, 0.14, 1.0), power_at(&texture, 0.07, 1.0)) / db(2.0, 1.0);
        assert!((slope - 2.15).abs() < 0.15, "{slope}");
    }

    #[test]
    fn at_rest_it_is_silent_and_nowhere_mute_or_much_louder_than_recorded() {
        let texture = learned(&[0.04, 0.08, 0.16]);
        assert_eq!(power_at(&texture, 0.0, 1.0), 0.0);
        assert_eq!(power_at(&texture, 0.1, 0.0), 0.0);
        let loudest = true_power(0.16, 2.0);
        for k in 0..400 {
            let (speed, force) = (
                0.005 + 0.001 * f64::from(k % 20) * 15.0,
                0.1 + 0.2 * f64::from(k / 20),
            );
            let power = power_at(&texture, speed, force);
            let (held_speed, held_force) = (speed.min(0.24), force.min(3.0));
            let law = true_power(held_speed, held_force) * (held_force / 0.5_f64).min(1.0).powf(1.5);
            assert!(
                power > 0.01 * law.min(loudest),
                "{speed} {force}: {power} for {law}"
            );
            assert!(power < 4.8 * loudest);
        }
    }

    #[test]
    fn what_is_rendered_has_the_recorded_spectrum_from_twenty_hertz_on() {
        let recording = drag(&steps(&[0.06, 0.12], &[0.8, 1.6]), 0.3, 2, model);
        let (texture, report) = learn_law(std::slice::from_ref(&recording), &settings(), &|_| ()).unwrap();
        assert_eq!(
            (report.order, texture.ar_order(), texture.warping()),
            (20, 20, 0.85)
        );
        let played = synthesise(
            &texture,
            &Trajectory::of(&recording),
            &SynthesisSettings::default(),
        )
        .unwrap();
        let spectrum = |samples: &[f64]| welch(samples, 10_000.0, 1000, 500, Taper::Hann).unwrap();
        let (recorded, played) = (
            spectrum(&recording.signals().acceleration_m_s2),
            spectrum(&played),
        );
        for (low, high) in [
            (20.0, 60.0),
            (60.0, 200.0),
            (200.0, 400.0),
            (400.0, 600.0),
            (600.0, 1500.0),
        ] {
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
        assert!(matches!(
            learn_law(&[], &settings(), &|_| ()),
            Err(LearnTextureError::NoRecordings)
        ));
    }
}
