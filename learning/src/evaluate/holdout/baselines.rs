//! Plain baselines without a map of models: one warped model, regressed spectra with random phases, and clips.

use crate::learn::cells::CellSpectrum;
use crate::recording::ProcessedRecording;
use haptograph_signal::arma::WarpedLattice;
use haptograph_signal::noise::Gaussian;
use haptograph_signal::prediction::levinson;
use haptograph_signal::statistics::mean;
use haptograph_signal::warped::{cell_autocovariance, power_gain};
use haptograph_signal::window::{Symmetry, Window};
use haptograph_signal::{Complex64, fft};
use haptograph_surfaces::rendering::Trajectory;
use nalgebra::{Matrix3, Vector3};
use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use std::f64::consts::{FRAC_PI_2, TAU};

/// Order and factor of the warped model, and length of the stretches of its spectrum, s.
const ORDER: usize = 12;
const WARPING: f64 = 0.8;
const STRETCH_S: f64 = 0.5;
/// Length of the frames with random phases, s. They overlap by half.
const FRAME_S: f64 = 0.064;
/// Ridge of the regression: the variance of the logarithm of a bin's power, π²/6, over that of slopes around zero, 2².
const RIDGE: f64 = 0.4;
/// Lowest power of a bin, (m/s²)².
const LEAST_POWER: f64 = 1e-30;
/// Length of clips and of the fades at both of their ends, s, and the number of the nearest that one is drawn from.
const CLIP_S: f64 = 0.35;
const FADE_S: f64 = 0.05;
const NEAREST: usize = 3;
/// Lower bounds of speed, m/s, and force, N, before their logarithms are taken.
const LEAST: [f64; 2] = [0.001, 0.01];

/// A baseline that renders a vibration without a map of models.
#[derive(Debug, Clone)]
pub(super) enum Plain {
    /// One warped autoregressive model, whatever the speed and force.
    Warped(Box<WarpedLattice>),
    /// Overlapping frames with random phases.
    Phases {
        /// Samples of a frame.
        frame: usize,
        /// The level of each bin, in natural logarithms of power: a plane over the logarithms of speed and force.
        planes: Vec<Vector3<f64>>,
    },
    /// Clips of the recording.
    Granular {
        /// Mean logarithms of speed and force, and samples, of clips of one length.
        clips: Vec<([f64; 2], Vec<f64>)>,
        /// Samples of a fade.
        fade: usize,
    },
}

fn rate_hz(parts: &[ProcessedRecording]) -> f64 {
    parts.first().map_or(0.0, ProcessedRecording::rate_hz)
}

fn longest(parts: &[ProcessedRecording]) -> usize {
    parts.iter().map(ProcessedRecording::samples).max().unwrap_or(0)
}

/// Mean logarithms of speed and force.
fn log_place(speed_m_s: &[f64], force_n: &[f64]) -> [f64; 2] {
    [(speed_m_s, LEAST[0]), (force_n, LEAST[1])].map(|(values, least)| mean(values).max(least).ln())
}

/// Stretches of a length, each begun `hop` after the last: places and vibrations.
fn stretches(
    parts: &[ProcessedRecording],
    length: usize,
    hop: usize,
) -> impl Iterator<Item = ([f64; 2], &[f64])> {
    parts.iter().flat_map(move |part| {
        let signals = part.signals();
        let starts = (0..(part.samples() + 1).saturating_sub(length)).step_by(hop.max(1));
        starts.map(move |start| {
            let here = start..start + length;
            let place = log_place(&signals.speed_m_s[here.clone()], &signals.force_normal_n[here.clone()]);
            (place, &signals.acceleration_m_s2[here])
        })
    })
}

impl Plain {
    /// One warped model of order 12 at a factor of 0.8; `None` for silence.
    pub(super) fn warped(parts: &[ProcessedRecording]) -> Option<Self> {
        let length = longest(parts).min((STRETCH_S * rate_hz(parts)) as usize).max(2);
        let mut spectrum = CellSpectrum::new(length, rate_hz(parts), WARPING, None);
        let (mut cells, mut power, mut count) = (vec![], 0.0, 0);
        for (_, stretch) in stretches(parts, length, length / 2) {
            let densities = spectrum.of(stretch);
            cells.resize(densities.len(), 0.0);
            cells.iter_mut().zip(&densities).for_each(|(sum, density)| *sum += density);
            power += stretch.iter().map(|x| x * x).sum::<f64>();
            count += length;
        }
        let fit = levinson(&cell_autocovariance(&cells, ORDER), ORDER).ok()?;
        let gain = (power / count as f64 / power_gain(&fit.ar, WARPING).ok()?).sqrt();
        let mut filter = WarpedLattice::new();
        filter.set_coefficients(&fit.ar, WARPING, gain).ok()?;
        Some(Self::Warped(Box::new(filter)))
    }

    /// Planes of the levels of a short-time spectrum, whose mean power is the part's; `None` for fewer than four frames.
    pub(super) fn phases(parts: &[ProcessedRecording]) -> Option<Self> {
        let frame = ((FRAME_S * rate_hz(parts)) as usize).max(4) & !1;
        let window = Window::Hann.samples(frame, Symmetry::Periodic);
        let forward = fft::forward(frame);
        let powers = |vibration: &[f64]| -> Vec<f64> {
            let windowed = vibration.iter().zip(&window).map(|(x, w)| Complex64::new(x * w, 0.0));
            let mut spectrum: Vec<Complex64> = windowed.collect();
            forward.process(&mut spectrum);
            spectrum[..=frame / 2].iter().map(|x| x.norm_sqr().max(LEAST_POWER)).collect()
        };
        let frames: Vec<(Vector3<f64>, Vec<f64>)> = stretches(parts, frame, frame / 2)
            .map(|([speed, force], vibration)| (Vector3::new(1.0, speed, force), powers(vibration)))
            .collect();
        let normal: Matrix3<f64> = frames.iter().map(|(place, _)| place * place.transpose()).sum();
        let ridge = Matrix3::from_diagonal(&Vector3::new(0.0, RIDGE, RIDGE));
        let solver = (normal + ridge).cholesky().filter(|_| frames.len() >= 4)?;
        let plane = |bin: usize| {
            let mut plane =
                solver.solve(&frames.iter().map(|(place, powers)| place * powers[bin].ln()).sum());
            let recorded: f64 = frames.iter().map(|(_, powers)| powers[bin]).sum();
            // A mean of logarithms is too soft.
            plane[0] += (recorded / frames.iter().map(|(place, _)| plane.dot(place).exp()).sum::<f64>()).ln();
            plane
        };
        Some(Self::Phases { frame, planes: (0..=frame / 2).map(plane).collect() })
    }

    /// Clips of 0.3 s and a fade, or as long as the longest part; they begin every 0.15 s. `None` without samples.
    pub(super) fn granular(parts: &[ProcessedRecording]) -> Option<Self> {
        let length = longest(parts).min((CLIP_S * rate_hz(parts)) as usize);
        let fade = ((length as f64 * FADE_S / CLIP_S) as usize).max(1);
        let clips: Vec<_> = stretches(parts, length, length.saturating_sub(fade) / 2)
            .map(|(place, clip)| (place, clip.to_vec()))
            .collect();
        (length > fade && !clips.is_empty()).then_some(Self::Granular { clips, fade })
    }

    /// The vibration along a trajectory.
    pub(super) fn play(&self, along: &Trajectory, seed: u64) -> Vec<f64> {
        let mut y = vec![0.0; along.speed_m_s.len()];
        match self {
            Self::Warped(filter) => {
                let mut noise = vec![0.0; y.len()];
                Gaussian::new(seed).fill(&mut noise);
                filter.clone().process(&noise, &mut y);
            }
            Self::Phases { frame, planes } => with_phases(*frame, planes, along, seed, &mut y),
            Self::Granular { clips, fade } => clip_by_clip(clips, *fade, along, seed, &mut y),
        }
        y
    }
}

/// Frames whose magnitudes follow speed and force, with random phases, overlapped by half.
fn with_phases(frame: usize, planes: &[Vector3<f64>], along: &Trajectory, seed: u64, y: &mut [f64]) {
    let window = Window::Hann.samples(frame, Symmetry::Periodic);
    let power: f64 = window.iter().map(|w| w * w).sum();
    let inverse = fft::inverse(frame);
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
    let hop = frame / 2;
    // The first frame begins one hop before the vibration.
    for end in (hop..y.len() + frame).step_by(hop) {
        let here = end.saturating_sub(frame)..end.min(y.len());
        let [speed, force] = log_place(&along.speed_m_s[here.clone()], &along.force_n[here]);
        let place = Vector3::new(1.0, speed, force);
        let mut spectrum = vec![Complex64::new(0.0, 0.0); frame];
        for (k, plane) in planes.iter().enumerate() {
            // The planes are of windowed frames, whose power is the window's times the density.
            // Of the two bins without a partner only the real part is used, half the power.
            let partners = if k == 0 || 2 * k == frame { 2.0 } else { 1.0 };
            let magnitude = (partners * plane.dot(&place).exp() / power / frame as f64).sqrt();
            spectrum[k] = Complex64::from_polar(magnitude, random.random_range(0.0..TAU));
            spectrum[(frame - k) % frame] = spectrum[k].conj();
        }
        inverse.process(&mut spectrum);
        for (n, (x, w)) in spectrum.iter().zip(&window).enumerate() {
            if let Some(y) = (end + n).checked_sub(frame).and_then(|n| y.get_mut(n)) {
                // Square roots of windows that sum to 1 keep the power of independent frames.
                *y += x.re * w.sqrt();
            }
        }
    }
}

/// Clips drawn from the nearest in speed and force, cross-faded at equal power.
fn clip_by_clip(clips: &[([f64; 2], Vec<f64>)], fade: usize, along: &Trajectory, seed: u64, y: &mut [f64]) {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
    let length = clips[0].1.len() - fade;
    let mut last = usize::MAX;
    for start in (0..y.len()).step_by(length) {
        let end = (start + length).min(y.len());
        let here = log_place(&along.speed_m_s[start..end], &along.force_n[start..end]);
        let away = |at: &[f64; 2]| (at[0] - here[0]).powi(2) + (at[1] - here[1]).powi(2);
        let others = (0..clips.len()).filter(|number| *number != last || clips.len() == 1);
        let mut nearest: Vec<(f64, usize)> = others.map(|number| (away(&clips[number].0), number)).collect();
        let drawn = random.random_range(0..nearest.len().min(NEAREST));
        last = nearest.select_nth_unstable_by(drawn, |a, b| a.0.total_cmp(&b.0)).1.1;
        for (n, (y, x)) in y[start..].iter_mut().zip(&clips[last].1).enumerate() {
            let turn = |n: usize| FRAC_PI_2 * (n as f64 + 0.5) / fade as f64;
            let weight = match n {
                _ if n < fade && start > 0 => turn(n).sin(),
                _ if n >= length => turn(n - length).cos(),
                _ => 1.0,
            };
            *y += weight * x;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrics::{Bands, log_spectral_distance};
    use crate::recording::tests::synthetic::drag;

    /// A resonance, at two speeds that differ by 12 dB in power, in pieces.
    fn parts(seconds: f64) -> Vec<ProcessedRecording> {
        let piece = |seed: u64, speed: f64| {
            let model = |speed: f64, _| (vec![-1.8, 0.95], 1e4 * speed * speed);
            drag(&[(seconds, speed, 1.0)], 0.3, seed, model)
        };
        vec![piece(1, 0.05), piece(2, 0.2)]
    }

    fn power(x: &[f64]) -> f64 {
        x.iter().map(|x| x * x).sum::<f64>() / x.len() as f64
    }

    fn all(parts: &[ProcessedRecording]) -> [Plain; 3] {
        [Plain::warped(parts), Plain::phases(parts), Plain::granular(parts)]
            .map(|plain| plain.expect("it is long enough"))
    }

    #[test]
    fn all_have_the_spectrum_and_two_follow_the_level() {
        let parts = parts(5.0);
        let [warped, phases, clips] = all(&parts);
        for part in &parts {
            let recorded = &part.signals().acceleration_m_s2;
            for (plain, follows) in [(&warped, false), (&phases, true), (&clips, true)] {
                let played = plain.play(&part.trajectory(), 7);
                let scale = (power(recorded) / power(&played)).sqrt();
                assert_eq!((scale.log10() * 20.0).abs() < 1.0, follows, "{scale}");
                let scaled: Vec<f64> = played.iter().map(|x| scale * x).collect();
                let bands = Bands::counted(5.0, part.rate_hz());
                let [a, b] = [recorded, &scaled].map(|x| bands.of_signal([x.as_slice()], part.rate_hz()));
                let lsd_db = log_spectral_distance(a.powers(), b.powers());
                assert!(lsd_db < 2.5, "{lsd_db} dB");
            }
        }
    }

    #[test]
    fn a_rendering_is_as_loud_at_its_ends_as_in_its_middle() {
        let parts = parts(5.0);
        let along = parts[1].trajectory();
        for plain in &all(&parts)[1..] {
            let ends = |seed: u64| {
                let y = plain.play(&along, seed);
                let end = y.len() - 300;
                [power(&y[..300]), power(&y[end..]), power(&y)]
            };
            let powers: Vec<[f64; 3]> = (0..40).map(ends).collect();
            let [first, last, whole] = [0, 1, 2].map(|i| powers.iter().map(|powers| powers[i]).sum::<f64>());
            for end in [first / whole, last / whole] {
                assert!((0.7..1.4).contains(&end), "{end}");
            }
        }
    }

    #[test]
    fn a_short_part_has_short_clips_and_nothing_has_none() {
        let parts = parts(0.2);
        for plain in all(&parts) {
            let played = plain.play(&parts[0].trajectory(), 1);
            assert!(played.len() == parts[0].samples() && power(&played) > 0.0);
        }
        assert!(
            Plain::warped(&[]).is_none() && Plain::phases(&[]).is_none() && Plain::granular(&[]).is_none()
        );
    }
}
