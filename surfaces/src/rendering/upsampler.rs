//! Upsampling from the rate of a surface's models to a faster synthesis clock.
//!
//! Models have no content above half of their rate, so a low-pass interpolates their samples.
//! It has minimum phase, because delay is felt and the phase of noise is not: its delay is 2.5 samples of the models' rate in the
//! middle of the band; a symmetric filter of the same steepness has 30.

use haptograph_signal::time::{Rate, gcd};
use haptograph_signal::{Complex64, fft};
use std::f64::consts::{LN_10, TAU};
use std::ops::Range;

/// Band in which the response falls, as a part of the models' Nyquist frequency: flat within 0.05 dB below.
const FALLS: Range<f64> = 0.98..1.06;
/// Stopband level, dB.
const DEPTH_DB: f64 = 80.0;
/// Length of the interpolating filter in samples of the models; a multiple of [`LANES`].
const WIDTH: usize = 160;
/// Length of the design, in samples of the models: long enough to make time aliasing negligible.
const SPAN: usize = 1024;
/// Largest number of tabulated positions between two samples of the models: 1.3 MB.
const MAX_POSITIONS: u64 = 1000;
/// Partial sums of the dot product; part of the order of its sum.
const LANES: usize = 8;

/// Interpolates a signal to a higher rate, one output at a time. Allocates only when made.
#[derive(Debug, Clone)]
pub struct Upsampler {
    /// [`WIDTH`] taps for each position between two inputs, that of the newest input first.
    taps: Box<[f64]>,
    /// Positions from one input to the next.
    up: u64,
    /// Positions from one output to the next.
    down: u64,
    /// Position of the next output, counted from the newest input.
    ahead: u64,
    /// The latest inputs, newest first, from `newest` on; kept twice, so that they lie together.
    inputs: Box<[f64]>,
    newest: usize,
    group_delay_s: f64,
}

impl Upsampler {
    /// An interpolator of a signal that was zero before its first sample. `None` if `to` is not above `from`, or the ratio
    /// needs more than `MAX_POSITIONS`.
    pub fn new(from: Rate, to: Rate) -> Option<Self> {
        let ((from_n, from_d), (to_n, to_d)) = (from.parts(), to.parts());
        let (up, down) = (to_n.checked_mul(from_d)?, from_n.checked_mul(to_d)?);
        let common = gcd(up, down);
        let (up, down) = (up / common, down / common);
        if up <= down || up > MAX_POSITIONS {
            return None;
        }
        let response = minimum_phase(up as usize);
        let taps = (0..up as usize)
            .flat_map(|position| response.iter().skip(position).step_by(up as usize).copied())
            .collect();
        Some(Self {
            taps,
            up,
            down,
            ahead: up,
            inputs: vec![0.0; 2 * WIDTH].into(),
            newest: 0,
            group_delay_s: group_delay(&response, up as usize) / from.hz(),
        })
    }

    /// Group delay in the middle of the models' band, s.
    pub(crate) fn group_delay_s(&self) -> f64 {
        self.group_delay_s
    }

    /// The next output. `input` is called when the next input is due.
    pub fn next(&mut self, input: impl FnOnce() -> f64) -> f64 {
        if self.ahead >= self.up {
            self.ahead -= self.up;
            self.newest = (self.newest + WIDTH - 1) % WIDTH;
            let x = input();
            self.inputs[self.newest] = x;
            self.inputs[self.newest + WIDTH] = x;
        }
        let taps = &self.taps[self.ahead as usize * WIDTH..][..WIDTH];
        self.ahead += self.down;
        let window = &self.inputs[self.newest..][..WIDTH];
        let mut sums = [0.0; LANES];
        for (taps, inputs) in taps.chunks_exact(LANES).zip(window.chunks_exact(LANES)) {
            for ((sum, tap), x) in sums.iter_mut().zip(taps).zip(inputs) {
                *sum += tap * x;
            }
        }
        sums.iter().sum()
    }

    /// Takes over the state of another interpolator if both rates are equal.
    pub fn copy_state_from(&mut self, other: &Self) {
        if (self.up, self.down) == (other.up, other.down) {
            self.inputs.copy_from_slice(&other.inputs);
            (self.ahead, self.newest) = (other.ahead, other.newest);
        }
    }
}

/// The response of minimum phase that passes the models' band and keeps what lies above [`DEPTH_DB`] below, at `up` times
/// the models' rate: by its cepstrum (Oppenheim and Schafer).
fn minimum_phase(up: usize) -> Vec<f64> {
    let length = up * SPAN;
    let log_gain = |bin: usize| {
        // The models' Nyquist frequency is at 1.
        let frequency = 2.0 * bin.min(length - bin) as f64 / SPAN as f64;
        let x = ((frequency - FALLS.start) / (FALLS.end - FALLS.start)).clamp(0.0, 1.0);
        // From 0 to 1, smooth to the second derivative.
        let fallen = x * x * x * (x * (6.0 * x - 15.0) + 10.0);
        -DEPTH_DB / 20.0 * LN_10 * fallen
    };
    let mut values: Vec<Complex64> = (0..length).map(|bin| log_gain(bin).into()).collect();
    fft::inverse(length).process(&mut values);
    // The cepstrum, made causal.
    for (n, value) in values.iter_mut().enumerate() {
        let fold = match n {
            0 => 1.0,
            n if 2 * n < length => 2.0,
            n if 2 * n == length => 1.0,
            _ => 0.0,
        };
        *value *= fold / length as f64;
    }
    fft::forward(length).process(&mut values);
    for value in &mut values {
        *value = value.exp();
    }
    fft::inverse(length).process(&mut values);
    let gain = up as f64 / length as f64;
    values[..up * WIDTH].iter().map(|value| value.re * gain).collect()
}

/// Group delay at half of the models' Nyquist frequency, in samples of the models.
fn group_delay(response: &[f64], up: usize) -> f64 {
    let turn = |n: usize| Complex64::cis(-0.25 * TAU * n as f64 / up as f64);
    let (sum, delayed) =
        response.iter().enumerate().fold((Complex64::ZERO, Complex64::ZERO), |(sum, delayed), (n, h)| {
            (sum + turn(n) * h, delayed + turn(n) * (h * n as f64))
        });
    (delayed / sum).re / up as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    fn rate(hz: u64) -> Rate {
        Rate::from_hz(hz).unwrap()
    }

    /// Gain in dB of the interpolator at a frequency in Hz of its output, for an input of one sample.
    fn gain_db(from_hz: u64, to_hz: u64, frequency_hz: f64) -> f64 {
        let up = Upsampler::new(rate(from_hz), rate(to_hz)).unwrap();
        let (positions, taps) = (up.up as usize, &up.taps);
        let response = (0..positions * WIDTH).map(|n| taps[n % positions * WIDTH + n / positions]);
        let fine_hz = from_hz as f64 * positions as f64;
        let sum: Complex64 = response
            .enumerate()
            .map(|(n, h)| Complex64::cis(-TAU * frequency_hz * n as f64 / fine_hz) * h)
            .sum();
        20.0 * (sum.norm() / positions as f64).log10()
    }

    #[test]
    fn it_is_flat_in_the_models_band_and_adds_nothing_above() {
        for to_hz in [10_000, 48_000, 44_100, 1500] {
            for frequency_hz in [1.0, 20.0, 100.0, 250.0, 400.0, 450.0, 485.0] {
                let db = gain_db(1000, to_hz, frequency_hz);
                assert!(db.abs() < 0.05, "{to_hz}: {db} dB at {frequency_hz} Hz");
            }
            for frequency_hz in [522.5, 530.0, 600.0, 700.0, 740.0] {
                let db = gain_db(1000, to_hz, frequency_hz);
                assert!(db < -63.0, "{to_hz}: {db} dB at {frequency_hz} Hz");
            }
        }
    }

    #[test]
    fn a_sine_comes_out_as_a_sine_later_by_the_group_delay() {
        for (from_hz, to_hz) in [(1000, 10_000), (10_000, 48_000), (1000, 44_100)] {
            let mut up = Upsampler::new(rate(from_hz), rate(to_hz)).unwrap();
            // Near the middle of the band, beating slowly: the envelope has the group delay.
            let (centre_hz, beat_hz) = (0.25 * from_hz as f64, 0.002 * from_hz as f64);
            let wave = |t: f64| (PI * beat_hz * t).sin().powi(2) * (TAU * centre_hz * t).sin();
            let mut k = 0;
            let outputs = to_hz as usize * 1000 / from_hz as usize;
            let out: Vec<f64> = (0..outputs)
                .map(|_| {
                    up.next(|| {
                        k += 1;
                        wave(f64::from(k - 1) / from_hz as f64)
                    })
                })
                .collect();
            let energy: f64 = out.iter().map(|y| y * y).sum();
            let centroid = out.iter().enumerate().map(|(n, y)| n as f64 * y * y).sum::<f64>() / energy;
            let delay_s = centroid / to_hz as f64 - 0.5 / beat_hz * 2.0;
            let tolerance_s = 0.5 / from_hz as f64;
            assert!((delay_s - up.group_delay_s()).abs() < tolerance_s, "{from_hz}: {delay_s}");
            assert!((up.group_delay_s() * from_hz as f64 - 2.5).abs() < 0.5);
            let power = energy / outputs as f64;
            assert!((power / 0.1875 - 1.0).abs() < 0.02, "{power}");
        }
    }

    #[test]
    fn other_ratios_are_refused() {
        assert!(Upsampler::new(rate(1000), rate(1000)).is_none());
        assert!(Upsampler::new(rate(2000), rate(1000)).is_none());
        assert!(Upsampler::new(rate(1000), rate(10_007)).is_none());
        assert!(Upsampler::new(Rate::parse("0.001").unwrap(), rate(10_000)).is_none());
    }
}
