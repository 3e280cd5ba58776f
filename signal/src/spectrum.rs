//! Spectra: of signals (Welch's average, spectrogram, third-octave bands) and of models.
//!
//! Densities are one-sided, in the signal's unit squared per hertz: summed over all bins and multiplied by the bin
//! width they give the power. Nothing is detrended.
//!
//! ```
//! use haptograph_signal::spectrum::welch;
//! use haptograph_signal::window::Window;
//! use std::f64::consts::TAU;
//!
//! let rate_hz = 1000.0;
//! let tone: Vec<f64> = (0..4000).map(|k| (TAU * 100.0 * k as f64 / rate_hz).sin()).collect();
//! let psd = welch(&tone, rate_hz, 500, 250, Window::Hann)?;
//! // A sine of amplitude 1 has a power of 1/2.
//! assert!((psd.power_between(90.0, 110.0) - 0.5).abs() < 1e-3);
//! # Ok::<(), haptograph_signal::spectrum::SpectrumError>(())
//! ```

use crate::Complex64;
use crate::fft::{self, Transform};
use crate::window::{Symmetry, Window};
use thiserror::Error;

/// A one-sided power spectral density on evenly spaced frequencies from 0 to the Nyquist frequency.
#[derive(Debug, Clone, PartialEq)]
pub struct Psd {
    /// Frequencies of the bins in Hz.
    pub frequency_hz: Vec<f64>,
    /// Density at each of them, in the signal's unit squared per Hz.
    pub density: Vec<f64>,
}

/// Power spectral densities of successive segments of a signal.
#[derive(Debug, Clone, PartialEq)]
pub struct Spectrogram {
    /// Middle of each segment in seconds from the signal's first sample.
    pub time_s: Vec<f64>,
    /// Frequencies of the bins in Hz.
    pub frequency_hz: Vec<f64>,
    /// Densities, one row of `frequency_hz.len()` values a segment.
    pub density: Vec<f64>,
}

/// Error of a spectrum.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum SpectrumError {
    /// A segment of no samples.
    #[error("a segment must have at least one sample")]
    EmptySegment,
    /// An overlap as long as the segment.
    #[error("an overlap of {overlap} samples must be shorter than the segment, which has {segment}")]
    OverlapTooLarge {
        /// Samples in a segment.
        segment: usize,
        /// Samples shared by neighbours.
        overlap: usize,
    },
    /// A signal shorter than a segment.
    #[error("the signal has {samples} samples, less than one segment of {segment}")]
    SignalTooShort {
        /// Samples given.
        samples: usize,
        /// Samples in a segment.
        segment: usize,
    },
    /// A sample rate that is not a positive number.
    #[error("the sample rate must be a positive number of hertz, not {rate_hz}")]
    BadRate {
        /// The rate given.
        rate_hz: f64,
    },
}

/// Welch's estimate: the mean over overlapping segments of `segment` samples, `overlap` of them shared with the next,
/// under a periodic window. Samples left over at the end of `x` are not used.
///
/// # Errors
/// [`SpectrumError`] for an empty segment, an overlap as long as it, a signal shorter than it, a bad rate.
pub fn welch(
    x: &[f64],
    rate_hz: f64,
    segment: usize,
    overlap: usize,
    window: Window,
) -> Result<Psd, SpectrumError> {
    let mut periodogram = Periodogram::new(rate_hz, segment, window)?;
    let starts = segment_starts(x.len(), segment, overlap)?;
    let count = starts.clone().count() as f64;
    let mut density = vec![0.0; periodogram.bins()];
    for start in starts {
        for (sum, d) in density.iter_mut().zip(periodogram.densities(&x[start..start + segment])) {
            *sum += d / count;
        }
    }
    Ok(Psd { frequency_hz: periodogram.frequency_hz(), density })
}

impl Spectrogram {
    /// The densities of overlapping segments, as in [`welch`] but not averaged.
    ///
    /// # Errors
    /// As [`welch`].
    pub fn new(
        x: &[f64],
        rate_hz: f64,
        segment: usize,
        overlap: usize,
        window: Window,
    ) -> Result<Self, SpectrumError> {
        let mut periodogram = Periodogram::new(rate_hz, segment, window)?;
        let starts = segment_starts(x.len(), segment, overlap)?;
        let mut density = Vec::with_capacity(starts.clone().count() * periodogram.bins());
        for start in starts.clone() {
            density.extend(periodogram.densities(&x[start..start + segment]));
        }
        let middle = (segment - 1) as f64 / 2.0;
        Ok(Self {
            time_s: starts.map(|start| (start as f64 + middle) / rate_hz).collect(),
            frequency_hz: periodogram.frequency_hz(),
            density,
        })
    }

    /// The densities of segment `i`, at `frequency_hz`.
    pub fn row(&self, i: usize) -> &[f64] {
        let bins = self.frequency_hz.len();
        &self.density[i * bins..(i + 1) * bins]
    }
}

impl Psd {
    /// Bin width in Hz; 0 for a single bin.
    fn resolution_hz(&self) -> f64 {
        self.frequency_hz.get(1).copied().unwrap_or(0.0)
    }

    /// Power between two frequencies in the signal's unit squared; a bin counts by the part of it that lies inside.
    pub fn power_between(&self, low_hz: f64, high_hz: f64) -> f64 {
        let width = self.resolution_hz();
        self.frequency_hz
            .iter()
            .zip(&self.density)
            .map(|(f, d)| {
                let inside = (f + width / 2.0).min(high_hz) - (f - width / 2.0).max(low_hz);
                inside.max(0.0) * d
            })
            .sum()
    }
}

/// Power-weighted mean frequency in Hz of powers (or densities) at these frequencies; 0 for silence. Eq. 2.5.4, 4.5.2.
pub fn spectral_centroid(frequency_hz: &[f64], power: &[f64]) -> f64 {
    let total: f64 = power.iter().sum();
    let weighted: f64 = frequency_hz.iter().zip(power).map(|(f, p)| f * p).sum();
    if total > 0.0 { weighted / total } else { 0.0 }
}

/// One-sided density at `frequency_hz` of white noise of this variance after `B(z)/A(z)`, in unit squared per Hz.
///
/// `A(z) = 1 + sum a_k z^-k`, `B(z) = 1 + sum b_k z^-k`. As in the bins of [`welch`], the density at exactly 0 and
/// at the Nyquist frequency is half of that beside it.
pub fn arma_density(ar: &[f64], ma: &[f64], variance: f64, rate_hz: f64, frequency_hz: f64) -> f64 {
    let turn = -std::f64::consts::TAU * frequency_hz / rate_hz;
    let magnitude_squared = |polynomial: &[f64]| {
        let terms = polynomial.iter().zip(1_u32..);
        terms
            .map(|(c, k)| Complex64::from_polar(1.0, turn * f64::from(k)) * *c)
            .fold(Complex64::new(1.0, 0.0), |sum, term| sum + term)
            .norm_sqr()
    };
    let sides = if frequency_hz == 0.0 || frequency_hz == rate_hz / 2.0 { 1.0 } else { 2.0 };
    sides * variance / rate_hz * magnitude_squared(ma) / magnitude_squared(ar)
}

/// The expected value of [`welch`] for a process with these autocovariances (lag 0 first, at least `segment` of them;
/// missing ones count as zero): the model's spectrum convolved with the window's response.
///
/// # Errors
/// [`SpectrumError::EmptySegment`], [`SpectrumError::BadRate`].
pub fn expected_welch(
    autocovariance: &[f64],
    rate_hz: f64,
    segment: usize,
    window: Window,
) -> Result<Psd, SpectrumError> {
    let periodogram = Periodogram::new(rate_hz, segment, window)?;
    let w = &periodogram.window;
    let mut lags = vec![Complex64::default(); 2 * segment];
    for (lag, r) in autocovariance.iter().take(segment).enumerate() {
        let overlap: f64 = w[lag..].iter().zip(w).map(|(a, b)| a * b).sum();
        lags[lag].re = overlap * r;
        if lag > 0 {
            lags[2 * segment - lag].re = overlap * r;
        }
    }
    fft::forward(2 * segment).process(&mut lags);
    let density = (0..periodogram.bins()).map(|bin| lags[2 * bin].re * periodogram.scale(bin)).collect();
    Ok(Psd { frequency_hz: periodogram.frequency_hz(), density })
}

/// First samples of the segments that fit.
fn segment_starts(
    samples: usize,
    segment: usize,
    overlap: usize,
) -> Result<impl Iterator<Item = usize> + Clone, SpectrumError> {
    if overlap >= segment {
        return Err(SpectrumError::OverlapTooLarge { segment, overlap });
    }
    if samples < segment {
        return Err(SpectrumError::SignalTooShort { samples, segment });
    }
    Ok((0..=samples - segment).step_by(segment - overlap))
}

/// The windowed transform of one segment and its scaling to a density.
struct Periodogram {
    rate_hz: f64,
    window: Vec<f64>,
    window_energy: f64,
    transform: Transform,
    bins: Vec<Complex64>,
    scratch: Vec<Complex64>,
}

impl Periodogram {
    fn new(rate_hz: f64, segment: usize, window: Window) -> Result<Self, SpectrumError> {
        if segment == 0 {
            return Err(SpectrumError::EmptySegment);
        }
        if !(rate_hz.is_finite() && rate_hz > 0.0) {
            return Err(SpectrumError::BadRate { rate_hz });
        }
        let window = window.samples(segment, Symmetry::Periodic);
        let transform = fft::forward(segment);
        Ok(Self {
            rate_hz,
            window_energy: window.iter().map(|w| w * w).sum(),
            window,
            bins: vec![Complex64::default(); segment],
            scratch: vec![Complex64::default(); transform.get_inplace_scratch_len()],
            transform,
        })
    }

    /// Number of frequencies from 0 to Nyquist.
    fn bins(&self) -> usize {
        self.window.len() / 2 + 1
    }

    fn frequency_hz(&self) -> Vec<f64> {
        let segment = self.window.len() as f64;
        (0..self.bins()).map(|bin| bin as f64 * self.rate_hz / segment).collect()
    }

    /// Factor from squared magnitude to one-sided density; 0 and Nyquist have no negative twin.
    fn scale(&self, bin: usize) -> f64 {
        let sides = if bin == 0 || 2 * bin == self.window.len() { 1.0 } else { 2.0 };
        sides / (self.rate_hz * self.window_energy)
    }

    fn densities(&mut self, segment: &[f64]) -> impl Iterator<Item = f64> {
        for ((bin, x), w) in self.bins.iter_mut().zip(segment).zip(&self.window) {
            *bin = Complex64::new(x * w, 0.0);
        }
        self.transform.process_with_scratch(&mut self.bins, &mut self.scratch);
        let this = &*self;
        (0..this.bins()).map(|bin| this.bins[bin].norm_sqr() * this.scale(bin))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise::Gaussian;
    use crate::prediction::power_gain;
    use crate::prediction::tests::{arma_autocovariance, reflection_to_ar};
    use std::f64::consts::TAU;

    fn sine(amplitude: f64, frequency_hz: f64, rate_hz: f64, n: usize) -> Vec<f64> {
        (0..n).map(|i| amplitude * (TAU * frequency_hz * i as f64 / rate_hz).sin()).collect()
    }

    #[test]
    fn a_sine_has_its_power_at_its_frequency() {
        let x = sine(3.0, 250.0, 1000.0, 4000);
        for window in [Window::Hann, Window::Hamming, Window::Rectangular] {
            let psd = welch(&x, 1000.0, 400, 200, window).unwrap();
            let power = psd.density.iter().sum::<f64>() * psd.resolution_hz();
            assert!((power - 4.5).abs() < 1e-9, "{window:?} {power}");
            assert!((psd.power_between(245.0, 255.0) - 4.5).abs() < 0.01);
            assert!((spectral_centroid(&psd.frequency_hz, &psd.density) - 250.0).abs() < 1e-6);
        }
    }

    #[test]
    fn the_periodogram_is_the_transform_written_out() {
        let mut x = vec![0.0; 21];
        Gaussian::new(4).fill(&mut x);
        for segment in [20, 21] {
            let psd = welch(&x[..segment], 50.0, segment, 0, Window::Hamming).unwrap();
            let w = Window::Hamming.samples(segment, Symmetry::Periodic);
            let energy: f64 = w.iter().map(|w| w * w).sum();
            for (bin, density) in psd.density.iter().enumerate() {
                let sum: Complex64 = (0..segment)
                    .map(|n| Complex64::from_polar(x[n] * w[n], -TAU * (bin * n) as f64 / segment as f64))
                    .sum();
                let sides = if bin == 0 || 2 * bin == segment { 1.0 } else { 2.0 };
                assert!((density - sides * sum.norm_sqr() / (50.0 * energy)).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn white_noise_is_white() {
        let mut x = vec![0.0; 200_000];
        Gaussian::new(1).fill(&mut x);
        let psd = welch(&x, 10_000.0, 256, 0, Window::Hann).unwrap();
        let count = (200_000 / 256) as f64;
        for d in &psd.density[1..128] {
            assert!((d - 2e-4).abs() < 5.0 * 2e-4 / count.sqrt());
        }
    }

    #[test]
    fn a_model_has_the_power_of_its_spectrum() {
        let ar = reflection_to_ar(&[-0.6, 0.9, 0.2]);
        let (ma, variance, rate_hz) = ([0.5, 0.3], 0.7, 10_000.0);
        let n = 20_000;
        let width = rate_hz / 2.0 / f64::from(n);
        let sum: f64 = (0..n)
            .map(|i| arma_density(&ar, &ma, variance, rate_hz, (f64::from(i) + 0.5) * width) * width)
            .sum();
        assert!((sum / (variance * power_gain(&ar, &ma).unwrap()) - 1.0).abs() < 1e-9);
    }

    #[test]
    fn the_expected_estimate_is_the_model_smeared_by_the_window() {
        let ar = reflection_to_ar(&[-0.6, 0.9, 0.2]);
        let ma = [0.5];
        let (rate_hz, segment) = (1000.0, 64);
        let r = arma_autocovariance(&ar, &ma, 2.0, segment).unwrap();
        let got = expected_welch(&r, rate_hz, segment, Window::Hamming).unwrap();
        let w = Window::Hamming.samples(segment, Symmetry::Periodic);
        let energy: f64 = w.iter().map(|w| w * w).sum();
        let fine = 4096;
        for (bin, f) in got.frequency_hz.iter().enumerate() {
            let smeared: f64 = (0..fine)
                .map(|i| {
                    let g = (f64::from(i) + 0.5) / f64::from(fine) * rate_hz - rate_hz / 2.0;
                    let turn = TAU * (f - g) / rate_hz;
                    let response: Complex64 =
                        w.iter().enumerate().map(|(n, w)| Complex64::from_polar(*w, turn * n as f64)).sum();
                    let two_sided = arma_density(&ar, &ma, 2.0, rate_hz, g.abs()) / 2.0;
                    two_sided * response.norm_sqr() / (energy * f64::from(fine))
                })
                .sum();
            let sides = if bin == 0 || 2 * bin == segment { 1.0 } else { 2.0 };
            assert!((got.density[bin] / (sides * smeared) - 1.0).abs() < 1e-9);
        }
    }

    #[test]
    fn a_spectrogram_is_what_welch_averages() {
        let mut x = vec![0.0; 1000];
        Gaussian::new(8).fill(&mut x);
        let gram = Spectrogram::new(&x, 1000.0, 100, 50, Window::Hann).unwrap();
        let psd = welch(&x, 1000.0, 100, 50, Window::Hann).unwrap();
        assert_eq!((gram.time_s.len(), gram.frequency_hz.len()), (19, 51));
        assert!((gram.time_s[0] - 0.0495).abs() < 1e-12 && (gram.time_s[1] - 0.0995).abs() < 1e-12);
        for bin in 0..51 {
            let mean: f64 = (0..19).map(|i| gram.row(i)[bin]).sum::<f64>() / 19.0;
            assert!((mean - psd.density[bin]).abs() < 1e-12);
        }
    }

    #[test]
    fn bands_split_the_power_of_the_axis() {
        let psd = Psd { frequency_hz: (0..=5000).map(f64::from).collect(), density: vec![2.0; 5001] };
        let edges: Vec<f64> = (-20..=6).map(|k| 1000.0 * 10_f64.powf((f64::from(k) + 0.5) / 10.0)).collect();
        for pair in edges.windows(2) {
            let power = psd.power_between(pair[0], pair[1]);
            assert!((power - 2.0 * (pair[1] - pair[0])).abs() < 1e-6, "{pair:?}");
        }
    }

    #[test]
    fn impossible_questions_are_refused() {
        let x = [0.0; 10];
        assert_eq!(welch(&x, 1.0, 0, 0, Window::Hann), Err(SpectrumError::EmptySegment));
        assert!(matches!(welch(&x, 1.0, 4, 4, Window::Hann), Err(SpectrumError::OverlapTooLarge { .. })));
        assert!(matches!(welch(&x, 1.0, 11, 0, Window::Hann), Err(SpectrumError::SignalTooShort { .. })));
        assert!(matches!(welch(&x, f64::NAN, 4, 0, Window::Hann), Err(SpectrumError::BadRate { .. })));
        assert_eq!(spectral_centroid(&[1.0, 2.0], &[0.0, 0.0]), 0.0);
    }
}
