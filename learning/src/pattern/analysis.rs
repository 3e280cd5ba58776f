//! Amplitude and frequency of a vibration over time, and its taps; and the sines and taps that a file stands for.

use super::curves::{Point, STEP_S, at_samples, linear};
use haptograph_signal::units::decimal::significant;
use haptograph_signal::{Complex64, fft};
use haptograph_surfaces::bounds::{FELT_HZ, carried_hz};
use std::f64::consts::{PI, TAU};

/// Half the length of the window in which amplitude and frequency are measured, s.
const HALF_S: f64 = 0.0075;
/// A tap has 12 dB more power than the mean from 80 to 20 ms before it, and from 50 to 110 ms after it.
const OVER_AROUND: f64 = 16.0;
const BEFORE: [usize; 2] = [16, 4];
const AFTER: [usize; 2] = [10, 22];
/// It is the largest within 40 ms.
const ALONE: usize = 8;
/// Least power of a tap relative to the largest of the vibration.
const LEAST: f64 = 1e-4;
/// Duration of a tap where a file is decoded, s: two periods of a sine, as in MPEG's reference software. Neither Apple nor Meta states
/// a waveform.
pub(super) const TAP_S: f64 = 0.022;

/// A vibration with a largest magnitude of 1.
pub(super) struct Analysis {
    /// What lies in taps is left out.
    pub rest: Spectrum,
    pub taps: Vec<Tap>,
    pub rate_hz: f64,
    /// Its largest magnitude before, and the unit of that.
    peak: (f64, String),
}

/// A short burst.
pub(super) struct Tap {
    pub time_s: f64,
    /// That of a decoded tap of the same energy.
    pub amplitude: f64,
    pub frequency_hz: f64,
}

/// A file, and what it stands for.
pub(super) struct Written {
    pub file: serde_json::Value,
    /// Physical value of an amplitude of 1, relative to the peak.
    pub full_scale: f64,
    pub points: usize,
}

impl Analysis {
    /// Analyses a vibration with a largest magnitude of 1, which was `peak` before.
    pub(super) fn of(vibration: &[f64], rate_hz: f64, peak: (f64, String)) -> Self {
        let whole = Spectrum::of(vibration, rate_hz).track([0.0, FELT_HZ]);
        let powers: Vec<f64> = whole.amplitude.iter().map(|amplitude| amplitude * amplitude).collect();
        let (mut gain, mut taps) = (vec![1.0; powers.len()], vec![]);
        for (peak, around) in bursts(&powers) {
            let is_above = |frame: &usize| powers[*frame] > 2.0 * around;
            let from =
                { (peak.saturating_sub(ALONE)..peak).rev() }.take_while(is_above).last().unwrap_or(peak);
            let to = (peak..(peak + AFTER[0]).min(powers.len())).take_while(is_above).last();
            let frames = from..to.unwrap_or(peak) + 1;
            frames.clone().for_each(|frame| gain[frame] = (around / powers[frame]).sqrt().min(1.0));
            taps.push((frames, whole.frequency_hz[peak]));
        }
        let gain: Vec<Point> =
            { gain.iter().enumerate() }.map(|(k, gain)| [STEP_S * k as f64, *gain]).collect();
        let gain = at_samples(&gain, rate_hz, vibration.len(), linear);
        let tap = |(frames, frequency_hz): (std::ops::Range<usize>, f64)| {
            let place = |frame: usize| ((frame as f64 * STEP_S * rate_hz) as usize).min(vibration.len());
            let samples = place(frames.start.saturating_sub(1))..place(frames.end);
            let energy = |n: usize| vibration[n] * vibration[n] * (1.0 - gain[n] * gain[n]);
            let all: f64 = samples.clone().map(energy).sum();
            let largest = samples.clone().map(energy).fold(0.0, f64::max);
            let begin = samples.clone().find(|n| energy(*n) >= 0.25 * largest).unwrap_or(samples.start);
            let amplitude = (2.0 * all / (TAP_S * rate_hz)).sqrt();
            Tap { time_s: begin as f64 / rate_hz, amplitude, frequency_hz }
        };
        let taps = taps.into_iter().map(tap).collect();
        let rest: Vec<f64> = vibration.iter().zip(&gain).map(|(x, gain)| x * gain).collect();
        Self { rest: Spectrum::of(&rest, rate_hz), taps, rate_hz, peak }
    }

    /// Amplitude and frequency of all that is felt, and the largest amplitude, taps included.
    pub(super) fn whole(&self) -> (Track, f64) {
        let mut track = self.rest.track([0.0, FELT_HZ]);
        let amplitudes = track.amplitude.iter().copied().chain(self.taps.iter().map(|tap| tap.amplitude));
        let largest = amplitudes.fold(f64::MIN_POSITIVE, f64::max);
        track.amplitude.iter_mut().for_each(|amplitude| *amplitude /= largest);
        (track, largest)
    }

    /// What a file says of itself.
    pub(super) fn note(&self, full_scale: f64) -> String {
        let (peak, unit) = &self.peak;
        format!("by haptograph; an amplitude of 1 is {} {unit}", significant(full_scale * peak, 4))
    }
}

/// The frames of bursts, and the power around each.
fn bursts(powers: &[f64]) -> Vec<(usize, f64)> {
    let least = LEAST * powers.iter().copied().fold(0.0, f64::max);
    let mean = |from: usize, to: usize| {
        let part = powers.get(from..to.min(powers.len())).unwrap_or_default();
        part.iter().sum::<f64>() / part.len().max(1) as f64
    };
    let mut found: Vec<(usize, f64)> = vec![];
    for (at, power) in powers.iter().enumerate() {
        let before = mean(at.saturating_sub(BEFORE[0]), at.saturating_sub(BEFORE[1]));
        let around = before.max(mean(at + AFTER[0], at + AFTER[1])).max(least);
        let near = &powers[at.saturating_sub(ALONE)..(at + ALONE + 1).min(powers.len())];
        let is_first = found.last().is_none_or(|(last, _)| last + ALONE < at);
        if *power > OVER_AROUND * around && is_first && near.iter().all(|other| other <= power) {
            found.push((at, around));
        }
    }
    found
}

/// The spectrum of a vibration.
pub(super) struct Spectrum {
    bins: Vec<Complex64>,
    pub samples: usize,
    rate_hz: f64,
}

/// Amplitude and frequency of the sine that has the power and the mean frequency of a part, every [`STEP_S`].
pub(super) struct Track {
    pub amplitude: Vec<f64>,
    pub frequency_hz: Vec<f64>,
}

impl Spectrum {
    fn of(vibration: &[f64], rate_hz: f64) -> Self {
        let mut bins: Vec<Complex64> = vibration.iter().map(|x| Complex64::new(*x, 0.0)).collect();
        bins.resize(vibration.len().next_power_of_two(), Complex64::default());
        fft::forward(bins.len()).process(&mut bins);
        Self { bins, samples: vibration.len(), rate_hz }
    }

    /// The part between two frequencies as an analytic signal: its real part is that of the vibration.
    pub(super) fn between(&self, [low_hz, high_hz]: [f64; 2]) -> Vec<Complex64> {
        let size = self.bins.len();
        let bin = |hz: f64| (hz.min(carried_hz(self.rate_hz)) * size as f64 / self.rate_hz).round() as usize;
        let mut part = vec![Complex64::default(); size];
        let bins = bin(low_hz)..bin(high_hz);
        for (part, whole) in part[bins.clone()].iter_mut().zip(&self.bins[bins]) {
            *part = whole * (2.0 / size as f64);
        }
        part[0] *= 0.5;
        fft::inverse(size).process(&mut part);
        part.truncate(self.samples);
        part
    }

    /// The frequency is that of the autocorrelation over one sample, which is weighted by power.
    pub(super) fn track(&self, band_hz: [f64; 2]) -> Track {
        let part = self.between(band_hz);
        let (step, half) = (STEP_S * self.rate_hz, HALF_S * self.rate_hz);
        let frame = |frame: usize| {
            let centre = frame as f64 * step;
            let samples =
                (centre - half).max(0.0).ceil() as usize..((centre + half) as usize + 1).min(part.len());
            let (mut power, mut turn, mut all) = (0.0, Complex64::default(), 0.0);
            for n in samples {
                let weight = 1.0 + (PI * (n as f64 - centre) / half).cos();
                power += weight * part[n].norm_sqr();
                all += weight;
                turn += part.get(n + 1).map_or(Complex64::default(), |next| weight * next * part[n].conj());
            }
            ((power / all.max(f64::MIN_POSITIVE)).sqrt(), turn.arg().max(0.0) * self.rate_hz / TAU)
        };
        let frames = 0..=(part.len() as f64 / step).ceil() as usize;
        let (amplitude, frequency_hz) = frames.map(frame).unzip();
        Track { amplitude, frequency_hz }
    }
}

/// Adds a sine of these amplitudes and frequencies.
pub(super) fn add_sine(signal: &mut [f64], amplitude: &[f64], frequency_hz: &[f64], rate_hz: f64) {
    let mut phase = 0.0_f64;
    for ((y, amplitude), frequency_hz) in signal.iter_mut().zip(amplitude).zip(frequency_hz) {
        *y += amplitude * phase.sin();
        phase = (phase + TAU * frequency_hz / rate_hz) % TAU;
    }
}

/// Adds taps: times, s, and amplitudes.
pub(super) fn add_taps(signal: &mut [f64], taps: impl IntoIterator<Item = Point>, rate_hz: f64) {
    for [time_s, amplitude] in taps {
        let first = (time_s * rate_hz).max(0.0).ceil() as usize;
        for (n, y) in signal.iter_mut().enumerate().skip(first).take((TAP_S * rate_hz) as usize) {
            *y += amplitude * (2.0 * TAU * (n as f64 / rate_hz - time_s) / TAP_S).sin();
        }
    }
}
