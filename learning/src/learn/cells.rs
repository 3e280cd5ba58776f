//! Estimates the spectrum of a stretch of vibration on the warped axis: multitaper estimates, averaged over equal cells.

use crate::metrics::multitaper::Multitaper;
use haptograph_signal::filter::butterworth_highpass;
use haptograph_signal::warped::unwarp;
use haptograph_surfaces::texture::HIGHPASS_ORDER;
use std::f64::consts::PI;

/// Cells of the warped axis from 0 to half the rate.
pub(crate) const CELLS: usize = 128;
/// Sine tapers of an estimate: its resolution is twice its length's inverse each way (Riedel and Sidorenko 1995).
const TAPERS: usize = 3;

/// Points at which a density is taken in each cell.
const POINTS: usize = 8;

/// The cells of an axis, from 0 to half the rate.
pub(crate) struct Cells {
    edges_hz: Vec<f64>,
}

impl Cells {
    /// The cells for models of this rate and warping factor.
    pub(crate) fn new(rate_hz: f64, warping: f64) -> Self {
        let edge = |edge: usize| unwarp(PI * edge as f64 / CELLS as f64, warping) * rate_hz / (2.0 * PI);
        Self { edges_hz: (0..=CELLS).map(edge).collect() }
    }

    /// The power of densities over the cells.
    pub(crate) fn power(&self, densities: &[f64]) -> f64 {
        let widths = self.edges_hz.windows(2).map(|edge| edge[1] - edge[0]);
        densities.iter().zip(widths).map(|(p, w)| p * w).sum()
    }

    /// Means over the cells of a density that is given at any frequency.
    pub(crate) fn means_of(&self, density: impl Fn(f64) -> f64) -> Vec<f64> {
        let mean = |edge: &[f64]| {
            let step = (edge[1] - edge[0]) / POINTS as f64;
            let points = (0..POINTS).map(|k| density(edge[0] + step * (k as f64 + 0.5)));
            points.sum::<f64>() / POINTS as f64
        };
        self.edges_hz.windows(2).map(mean).collect()
    }
}

/// Estimates the density of stretches of one length.
pub(crate) struct CellSpectrum {
    rate_hz: f64,
    multitaper: Multitaper,
    /// The divisor of each bin, and the bins below the high-pass.
    highpass: Vec<f64>,
    below: usize,
    /// Bins just above the corner, whose mean stands for those below.
    corner: usize,
    pub(super) cells: Cells,
}

impl CellSpectrum {
    /// An estimator for stretches of `length` samples (at least 2) that were high-passed at `highpass_hz`.
    pub(crate) fn new(length: usize, rate_hz: f64, warping: f64, highpass_hz: Option<f64>) -> Self {
        let scale = (2.0 / (length as f64 + 1.0)).sqrt();
        let multitaper = Multitaper::new([length, length, TAPERS.min(length)], |order, n| {
            scale * (PI * order as f64 / (length as f64 + 1.0) * n as f64).sin()
        });
        let bins = length / 2 + 1;
        let width_hz = rate_hz / length as f64;
        let filter =
            highpass_hz.and_then(|cutoff| butterworth_highpass(HIGHPASS_ORDER, cutoff, rate_hz).ok());
        let response = |bin: usize| match &filter {
            // Forward and backward filtering squares the power response.
            Some(filter) => filter.response(bin as f64 * width_hz, rate_hz).norm_sqr().powi(2),
            None => 1.0,
        };
        let bin_of = |frequency_hz: f64| ((frequency_hz / width_hz).ceil() as usize).min(bins - 1);
        let cutoff_hz = highpass_hz.unwrap_or(0.0);
        let below = bin_of(0.9 * cutoff_hz);
        Self {
            rate_hz,
            multitaper,
            highpass: (0..bins).map(response).collect(),
            below,
            corner: bin_of(1.25 * cutoff_hz).max(below + 1).min(bins),
            cells: Cells::new(rate_hz, warping),
        }
    }

    /// Means of the one-sided density over the cells, (m/s²)²/Hz, the high-pass divided out.
    ///
    /// Below the high-pass nothing was recorded, so the density is extended from just above it. An all-pole model, which has no
    /// zeros, could not follow a gap.
    pub(crate) fn of(&mut self, samples: &[f64]) -> Vec<f64> {
        let mut density = self.multitaper.powers(samples, self.highpass.len());
        let scale = 1.0 / (self.rate_hz * TAPERS.min(samples.len()) as f64);
        for (density, highpass) in density.iter_mut().zip(&self.highpass).skip(self.below) {
            *density *= scale / highpass.max(f64::MIN_POSITIVE);
        }
        let corner = &density[self.below.min(self.corner - 1)..self.corner];
        let level = corner.iter().sum::<f64>() / corner.len() as f64;
        density[..self.below].fill(level);
        self.means(&density)
    }

    /// Cell means of a density by bins, each bin taken as constant over its width.
    fn means(&self, density: &[f64]) -> Vec<f64> {
        let width_hz = 0.5 * self.rate_hz / (density.len() - 1).max(1) as f64;
        let mut sums = vec![0.0];
        for value in density {
            sums.push(sums[sums.len() - 1] + value * width_hz);
        }
        let integral = |frequency_hz: f64| {
            let place = (frequency_hz / width_hz + 0.5).clamp(0.0, density.len() as f64);
            let before = (place as usize).min(density.len() - 1);
            sums[before] + (place - before as f64) * (sums[before + 1] - sums[before])
        };
        let cell = |edge: &[f64]| (integral(edge[1]) - integral(edge[0])) / (edge[1] - edge[0]);
        self.cells.edges_hz.windows(2).map(cell).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptograph_signal::noise::Gaussian;

    #[test]
    fn white_noise_has_an_even_density_and_its_own_power() {
        let mut noise = vec![0.0; 20_000];
        Gaussian::new(1).fill(&mut noise);
        let mut spectrum = CellSpectrum::new(20_000, 10_000.0, 0.85, None);
        let cells = spectrum.of(&noise);
        let power = spectrum.cells.power(&cells);
        assert!((power - 1.0).abs() < 0.05, "{power}");
        let above = cells[64..].iter().sum::<f64>() / 64.0;
        assert!((above * 5000.0 - 1.0).abs() < 0.1);
    }

    #[test]
    fn a_high_pass_that_was_applied_is_divided_out() {
        let mut noise = vec![0.0; 40_000];
        Gaussian::new(2).fill(&mut noise);
        let filter = butterworth_highpass(HIGHPASS_ORDER, 20.0, 10_000.0).unwrap();
        let filtered = haptograph_signal::filter::filtfilt(&filter, noise);
        let cells = CellSpectrum::new(40_000, 10_000.0, 0.85, Some(20.0)).of(&filtered);
        // The lowest cells, 20 Hz and below, are estimates of a few bins each.
        let low = cells[..16].iter().sum::<f64>() / 16.0 * 5000.0;
        assert!((low - 1.0).abs() < 0.35, "{low}");
    }
}
