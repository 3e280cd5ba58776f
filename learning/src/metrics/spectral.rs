//! The spectral difference metric (thesis section 2.5.1).
//!
//! Signals are cut into windows. In each window the shapes of the two spectra and the two powers are
//! compared:
//!
//! ```text
//! NSE_j = 1/N_f sum_k |Y_j(f_k) - X_j(f_k)|                                     (2.5.1)
//! PE_j  = |P_Y - P_X| / ((P_Y + P_X) / 2)                                       (2.5.2)
//! SD    = 1/N_w sum_j ( NSE_j / std(NSE) + PE_j / std(PE) )                     (2.5.3)
//! ```
//!
//! The thesis divides amplitudes by power, which is not scale invariant although it says so; here they are
//! divided by the square root of the power, so that the squares of a window's N_f amplitudes add up to one.
//! The spectrum of a silent window is zero, and two silent windows have a power error of zero.

use haptograph_signal::spectrum::spectral_centroid;
use haptograph_signal::statistics::standard_deviation;
use haptograph_signal::window::{Symmetry, Window};
use haptograph_signal::{Complex64, fft};
use serde::{Deserialize, Serialize};

/// Window length, overlap and taper.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct WindowSettings {
    /// Samples in a window.
    pub samples: usize,
    /// Samples shared with the next window.
    pub overlap: usize,
    /// The taper.
    pub window: Window,
}

/// Length of the windows of section 2.5.1, s.
const COMPARISON_S: f64 = 0.0256;

impl WindowSettings {
    /// Section 2.5.1: 256 samples (25.6 ms at 10 kHz), half of them shared, Hamming. Ten seconds have 780
    /// windows.
    pub const COMPARISON: Self = Self { samples: 256, overlap: 128, window: Window::Hamming };
    /// The windows of section 2.5.1 in seconds: 25.6 ms at any rate, half of them shared, at least 8 samples.
    pub fn comparison_at(rate_hz: f64) -> Self {
        let samples = ((COMPARISON_S * rate_hz).round() as usize).max(8);
        Self { samples, overlap: samples / 2, ..Self::COMPARISON }
    }

    /// Section 4.5.3: 32 samples at 1 kHz, none shared; the thesis mentions no taper.
    pub(crate) const RESPONSIVENESS: Self = Self { samples: 32, overlap: 0, window: Window::Rectangular };
}

impl Default for WindowSettings {
    fn default() -> Self {
        Self::COMPARISON
    }
}

/// Error of a comparison.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs)] // see the messages
pub enum MetricError {
    #[error(
        "windows of {samples} samples with an overlap of {overlap} are invalid: a window needs at least two samples and a smaller overlap"
    )]
    Windows { samples: usize, overlap: usize },
    #[error("the signal has {samples} samples, fewer than a window's {window}")]
    TooShort { samples: usize, window: usize },
    #[error("sample {sample} (from 0) is not a finite number")]
    NotFinite { sample: usize },
    #[error(
        "the largest sample has a magnitude of {magnitude:e}; only magnitudes between 1e-100 and 1e100 can be compared, check the units"
    )]
    Magnitude { magnitude: f64 },
    #[error("the windows of the signals differ: rates {rates_hz:?} Hz, windows {windows:?}")]
    Different { rates_hz: (f64, f64), windows: (usize, usize) },
    #[error("the rate is {rate_hz} Hz; it must be a finite number above 0")]
    Rate { rate_hz: f64 },
    #[error(
        "the signals overlap in only {windows} windows; a standard deviation needs at least two: use longer signals"
    )]
    TooFewWindows { windows: usize },
}

/// The spectra of a signal's windows, computed once for any number of comparisons.
#[derive(Debug, Clone, PartialEq)]
pub struct WindowedSpectra {
    rate_hz: f64,
    settings: WindowSettings,
    /// Bins from 0 Hz to the Nyquist frequency.
    bins: usize,
    /// Number of bins after zero padding to whole vectors.
    stride: usize,
    shapes: Vec<f64>,
    power: Vec<f64>,
}

/// Bins processed in parallel; part of the order of the sums.
pub(super) const LANES: usize = 8;

impl WindowedSpectra {
    /// Cuts `signal` (any unit) into windows; a remainder at the end is not used.
    pub fn new(signal: &[f64], rate_hz: f64, settings: &WindowSettings) -> Result<Self, MetricError> {
        let WindowSettings { samples, overlap, window } = *settings;
        if samples < 2 || overlap >= samples {
            return Err(MetricError::Windows { samples, overlap });
        }
        if !(rate_hz.is_finite() && rate_hz > 0.0) {
            return Err(MetricError::Rate { rate_hz });
        }
        if signal.len() < samples {
            return Err(MetricError::TooShort { samples: signal.len(), window: samples });
        }
        if let Some(sample) = signal.iter().position(|x| !x.is_finite()) {
            return Err(MetricError::NotFinite { sample });
        }
        let magnitude = signal.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
        if magnitude != 0.0 && !(1e-100..=1e100).contains(&magnitude) {
            return Err(MetricError::Magnitude { magnitude });
        }
        let taper = window.samples(samples, Symmetry::Symmetric);
        let taper_energy: f64 = taper.iter().map(|w| w * w).sum();
        let fft = fft::forward(samples);
        let mut scratch = vec![Complex64::default(); fft.get_inplace_scratch_len()];
        let mut buffer = vec![Complex64::default(); samples];
        let bins = samples / 2 + 1;
        let stride = bins.next_multiple_of(LANES);
        let (mut shapes, mut power) = (vec![], vec![]);
        for start in (0..=signal.len() - samples).step_by(samples - overlap) {
            let cut = &signal[start..start + samples];
            let mut energy = 0.0;
            for ((value, &x), &w) in buffer.iter_mut().zip(cut).zip(&taper) {
                energy += (w * x) * (w * x);
                *value = Complex64::new(w * x, 0.0);
            }
            power.push(energy / taper_energy);
            fft.process_with_scratch(&mut buffer, &mut scratch);
            let total: f64 = buffer[..bins].iter().map(|y| y.norm_sqr()).sum();
            let scale = if total > 0.0 { 1.0 / total.sqrt() } else { 0.0 };
            shapes.extend(buffer[..bins].iter().map(|y| y.norm() * scale));
            shapes.resize(shapes.len() + stride - bins, 0.0);
        }
        Ok(Self { rate_hz, settings: *settings, bins, stride, shapes, power })
    }

    /// Number of windows.
    pub(crate) fn windows(&self) -> usize {
        self.power.len()
    }

    /// Mean square of each window, weighted by the taper, in the signal's unit squared.
    pub(crate) fn power(&self) -> &[f64] {
        &self.power
    }

    /// The normalized amplitudes of a window, from 0 to the Nyquist frequency.
    pub fn shape(&self, window: usize) -> &[f64] {
        &self.padded_shape(window)[..self.bins]
    }

    pub(super) fn padded_shape(&self, window: usize) -> &[f64] {
        &self.shapes[window * self.stride..][..self.stride]
    }

    /// Spectral centroid of each window in Hz, 0 in silence. Eq. 2.5.4, Eq. 4.5.2.
    pub(crate) fn spectral_centroids_hz(&self) -> Vec<f64> {
        let frequency_hz: Vec<f64> =
            (0..self.bins).map(|k| k as f64 * self.rate_hz / self.settings.samples as f64).collect();
        let centroid = |window| {
            let power: Vec<f64> = self.shape(window).iter().map(|a| a * a).collect();
            spectral_centroid(&frequency_hz, &power)
        };
        (0..self.windows()).map(centroid).collect()
    }

    /// Number of windows that both signals have; an error if their windows differ.
    pub(super) fn shared_windows(&self, other: &Self) -> Result<usize, MetricError> {
        if self.rate_hz == other.rate_hz && self.settings == other.settings {
            Ok(self.windows().min(other.windows()))
        } else {
            Err(MetricError::Different {
                rates_hz: (self.rate_hz, other.rate_hz),
                windows: (self.settings.samples, other.settings.samples),
            })
        }
    }

    /// Normalized spectral error of a window shared with another signal. Eq. 2.5.1.
    #[inline(always)]
    pub(super) fn spectral_error(&self, other: &Self, window: usize) -> f64 {
        let (x, y) = (self.padded_shape(window), other.padded_shape(window));
        let mut sums = [0.0; LANES];
        for (x, y) in x.as_chunks::<LANES>().0.iter().zip(y.as_chunks::<LANES>().0) {
            for lane in 0..LANES {
                sums[lane] += (x[lane] - y[lane]).abs();
            }
        }
        sums.iter().sum::<f64>() / self.bins as f64
    }

    /// Power error of a window shared with another signal. Eq. 2.5.2.
    #[inline(always)]
    pub(super) fn power_error(&self, other: &Self, window: usize) -> f64 {
        let (x, y) = (self.power[window], other.power[window]);
        let mean = 0.5 * (x + y);
        if mean > 0.0 { (y - x).abs() / mean } else { 0.0 }
    }
}

/// The errors of two signals by window.
#[derive(Debug, Clone, PartialEq)]
pub struct PairErrors {
    /// Normalized spectral errors, Eq. 2.5.1.
    pub nse: Vec<f64>,
    /// Power errors, Eq. 2.5.2: 0 for equal powers, 2 if one signal is silent.
    pub pe: Vec<f64>,
}

impl PairErrors {
    /// Compares two signals by window, over the windows that both have.
    pub fn new(a: &WindowedSpectra, b: &WindowedSpectra) -> Result<Self, MetricError> {
        let windows = a.shared_windows(b)?;
        Ok(Self {
            nse: (0..windows).map(|j| a.spectral_error(b, j)).collect(),
            pe: (0..windows).map(|j| a.power_error(b, j)).collect(),
        })
    }

    /// Means and squared deviations of the errors.
    pub(crate) fn statistics(&self) -> ErrorStatistics {
        let mut statistics = ErrorStatistics::default();
        self.nse.iter().zip(&self.pe).for_each(|(&nse, &pe)| statistics.add(nse, pe));
        statistics
    }
}

/// Windows over which the deviations of Eq. 2.5.3 are taken; the thesis says "all tested windows".
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum Pooling {
    /// The windows of the compared pair.
    Pair,
    /// The windows of all compared pairs, which alone reproduces the spread of the printed table.
    #[default]
    All,
}

/// Means and sums of squared deviations of window errors, updated one window at a time.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct ErrorStatistics {
    /// Number of compared windows.
    pub windows: usize,
    /// Mean normalized spectral error.
    pub nse: f64,
    /// Mean power error.
    pub pe: f64,
    nse_squares: f64,
    pe_squares: f64,
}

impl ErrorStatistics {
    /// Adds a window's errors (Welford).
    #[inline]
    pub fn add(&mut self, nse: f64, pe: f64) {
        self.windows += 1;
        let count = self.windows as f64;
        let (nse_before, pe_before) = (nse - self.nse, pe - self.pe);
        self.nse += nse_before / count;
        self.pe += pe_before / count;
        self.nse_squares += nse_before * (nse - self.nse);
        self.pe_squares += pe_before * (pe - self.pe);
    }

    /// The statistics over the windows of both (Chan, Golub and LeVeque).
    pub(crate) fn merged(&self, other: &Self) -> Self {
        let windows = self.windows + other.windows;
        if windows == 0 {
            return *self;
        }
        let part = other.windows as f64 / windows as f64;
        let weight = self.windows as f64 * part;
        let (nse, pe) = (other.nse - self.nse, other.pe - self.pe);
        Self {
            windows,
            nse: self.nse + part * nse,
            pe: self.pe + part * pe,
            nse_squares: self.nse_squares + other.nse_squares + nse * nse * weight,
            pe_squares: self.pe_squares + other.pe_squares + pe * pe * weight,
        }
    }

    /// The standard deviations of the errors.
    pub fn deviations(&self) -> Deviations {
        let deviation = |squares: f64| {
            if self.windows < 2 { 0.0 } else { (squares / (self.windows - 1) as f64).sqrt() }
        };
        Deviations { nse: deviation(self.nse_squares), pe: deviation(self.pe_squares) }
    }

    /// The spectral difference in units of these deviations. Eq. 2.5.3.
    ///
    /// An error of zero counts zero for any deviation; a constant error that is not zero counts as infinite
    /// (see `are_infinite`). Differences at the level of rounding count zero.
    pub fn spectral_difference(&self, deviations: &Deviations) -> f64 {
        in_deviations(self.nse, deviations.nse) + in_deviations(self.pe, deviations.pe)
    }

    /// True for the spectral and the power error if it is infinite in units of these deviations, because it
    /// is the same in every window.
    pub(crate) fn are_infinite(&self, deviations: &Deviations) -> (bool, bool) {
        (
            in_deviations(self.nse, deviations.nse).is_infinite(),
            in_deviations(self.pe, deviations.pe).is_infinite(),
        )
    }
}

/// Window errors are of order one; smaller deviations than this are rounding.
const ROUNDING: f64 = 1e-13;

fn in_deviations(mean: f64, deviation: f64) -> f64 {
    if mean <= ROUNDING {
        0.0
    } else if deviation <= ROUNDING * mean {
        f64::INFINITY
    } else {
        mean / deviation
    }
}

/// Standard deviations of window errors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Deviations {
    /// Deviation of the normalized spectral error.
    pub nse: f64,
    /// Deviation of the power error.
    pub pe: f64,
}

/// Differences between two signals.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Comparison {
    /// Mean normalized spectral error.
    pub nse: f64,
    /// Mean power error.
    pub pe: f64,
    /// Spectral difference, with deviations pooled over this pair.
    pub sd: f64,
    /// True for the spectral and the power error if it is the same in every window, which makes the
    /// difference infinite.
    pub unvarying: (bool, bool),
    /// Number of compared windows.
    pub windows: usize,
}

/// Compares two signals of one rate over the time that both cover.
pub fn compare(
    a: &[f64],
    b: &[f64],
    rate_hz: f64,
    settings: &WindowSettings,
) -> Result<Comparison, MetricError> {
    let (a, b) = (WindowedSpectra::new(a, rate_hz, settings)?, WindowedSpectra::new(b, rate_hz, settings)?);
    let statistics = PairErrors::new(&a, &b)?.statistics();
    if statistics.windows < 2 {
        return Err(MetricError::TooFewWindows { windows: statistics.windows });
    }
    let deviations = statistics.deviations();
    Ok(Comparison {
        nse: statistics.nse,
        pe: statistics.pe,
        sd: statistics.spectral_difference(&deviations),
        unvarying: statistics.are_infinite(&deviations),
        windows: statistics.windows,
    })
}

/// The standard deviation of a windowed quantity over time, for [`super::responsiveness`].
pub(super) fn variation(values: &[f64]) -> f64 {
    standard_deviation(values)
}

#[cfg(test)]
mod tests;
