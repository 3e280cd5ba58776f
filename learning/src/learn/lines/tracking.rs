//! Tracks a line over distance: its coherence, and its power by speed and force.

use super::super::regression::{Law, Prior, fit_robustly};
use super::super::spectral_law::POWER_SLOPES;
use super::super::whitening::Whitened;
use super::{Stretch, WINDOW_M, windows};
use crate::recording::ProcessedRecording;
use haptograph_signal::Complex64;
use haptograph_signal::warped::squared_response;
use haptograph_surfaces::TextureModel;
use haptograph_surfaces::interpolation::{Coefficients, Interpolator};
use haptograph_surfaces::layers::lines::{HIGHEST_OF_RATE, LOWEST_HZ};
use nalgebra::Vector3;
use std::f64::consts::TAU;

/// Prior of a line's power over speed and force: that of textures.
const POWER: Prior = Prior { slopes: POWER_SLOPES, strength: 1.0 };
const SPEED_EXPONENTS: (f64, f64) = (-1.0, 4.0);
const FORCE_EXPONENTS: (f64, f64) = (0.0, 1.5);
/// Extrapolation of the law beyond the data, as a ratio; and its limit over the loudest window, 6 dB.
const BEYOND: f64 = 1.5;
const LOUDEST: f64 = 4.0;
/// Cells in a window, and the least number of cycles in a cell.
const CELLS: f64 = 8.0;
const MIN_CYCLES: f64 = 2.0;
/// Lags, in cells, for estimating the coherence, and for a window's power.
const LAGS: usize = 6;
const POWER_LAGS: usize = 3;
/// Lower limit of a window's power, relative to the mean, so that its logarithm is finite.
const LEAST: f64 = 1e-3;

/// A line found in recordings.
#[derive(Debug, Clone)]
pub(in super::super) struct FoundLine {
    pub cycles_per_m: f64,
    pub diffusion_rad2_per_m: f64,
    power: Law,
    /// Centre of the data, ln m/s and ln N.
    centre: [f64; 2],
    speed_m_s: (f64, f64),
    force_n: (f64, f64),
    loudest_m2_s4: f64,
}

impl FoundLine {
    /// Power at a speed and force, (m/s²)²: 0 at rest; below the lightest force the amplitude falls linearly.
    pub(crate) fn power_at(&self, speed_m_s: f64, force_n: f64) -> f64 {
        if speed_m_s <= 0.0 || force_n <= 0.0 {
            return 0.0;
        }
        let ((slowest, fastest), (lightest, hardest)) = (self.speed_m_s, self.force_n);
        let fall = (force_n / lightest).min(1.0).powi(2);
        let speed = speed_m_s.clamp(slowest / BEYOND, fastest * BEYOND).ln() - self.centre[0];
        let force = force_n.clamp(lightest, hardest * BEYOND).ln() - self.centre[1];
        let power = self.power.dot(&Vector3::new(1.0, speed, force)).exp();
        fall * power.min(self.loudest_m2_s4)
    }

    /// Distance of a cell: at least [`MIN_CYCLES`] cycles.
    pub(crate) fn cell_m(&self) -> f64 {
        cell_m(self.cycles_per_m)
    }
}

fn cell_m(cycles_per_m: f64) -> f64 {
    (WINDOW_M / CELLS).max(MIN_CYCLES / cycles_per_m)
}

/// A window in which a line would be audible.
struct Window {
    speed_m_s: f64,
    force_n: f64,
    /// The divisor of the line's power in whitening, (m/s²)².
    density: f64,
    /// Sums of products of the line's complex amplitudes by their lag in cells, from 1, and the number of products.
    products: [Complex64; LAGS],
    counts: [usize; LAGS],
}

/// Tracks a line of about `cycles_per_m`. `None` if it has no power.
pub(super) fn track(
    cycles_per_m: f64,
    recordings: &[ProcessedRecording],
    whitened: &[Whitened<'_>],
    stretches: &[Stretch],
    texture: &TextureModel,
) -> Option<FoundLine> {
    let follow = |cycles_per_m: f64| followed(cycles_per_m, recordings, whitened, stretches, texture);
    let (products, _) = pooled(&follow(cycles_per_m));
    // The error of the peak's position; it exceeds the resolution of a window only near another line.
    let most_per_m = 0.5 / WINDOW_M;
    let off_per_m = products[0].arg() / (TAU * cell_m(cycles_per_m));
    let cycles_per_m = cycles_per_m + off_per_m.clamp(-most_per_m, most_per_m);
    let windows = follow(cycles_per_m);
    let diffusion_rad2_per_m = diffusion(&windows, cell_m(cycles_per_m));
    law(cycles_per_m, diffusion_rad2_per_m, &windows)
}

fn pooled(windows: &[Window]) -> ([Complex64; LAGS], [usize; LAGS]) {
    let mut sums = ([Complex64::new(0.0, 0.0); LAGS], [0; LAGS]);
    for window in windows {
        for lag in 0..LAGS {
            sums.0[lag] += window.products[lag];
            sums.1[lag] += window.counts[lag];
        }
    }
    sums
}

/// Growth of the phase variance with distance, from the decay of the coherence.
fn diffusion(windows: &[Window], cell_m: f64) -> f64 {
    let (products, counts) = pooled(windows);
    let coherence = |lag: usize| products[lag].norm() / counts[lag].max(1) as f64;
    // Below a fifth of the first value, noise dominates.
    let telling: Vec<(f64, f64)> = (0..LAGS)
        .take_while(|lag| counts[*lag] > 0 && coherence(*lag) > 0.2 * coherence(0))
        .map(|lag| ((lag + 1) as f64 * cell_m, coherence(lag).ln()))
        .collect();
    let slope = haptograph_surfaces::Line::fit(&telling).map_or(0.0, |line| line.slope);
    (-2.0 * slope).max(0.0)
}

fn law(cycles_per_m: f64, diffusion_rad2_per_m: f64, windows: &[Window]) -> Option<FoundLine> {
    let cell_m = cell_m(cycles_per_m);
    let coherence = |lag: usize| (-0.5 * diffusion_rad2_per_m * cell_m * (lag + 1) as f64).exp();
    let power = |window: &Window| {
        let squared: f64 = (0..POWER_LAGS).map(|lag| window.products[lag].re).sum();
        let expected: f64 = (0..POWER_LAGS).map(|lag| window.counts[lag] as f64 * coherence(lag)).sum();
        0.5 * window.density * squared / expected.max(f64::MIN_POSITIVE)
    };
    let powers: Vec<f64> = windows.iter().map(power).collect();
    let mean = haptograph_signal::statistics::mean(&powers);
    if !(mean.is_finite() && mean > 0.0) {
        return None;
    }
    let powers: Vec<f64> = powers.into_iter().map(|power| power.max(LEAST * mean)).collect();
    let range = |value: fn(&Window) -> f64| {
        let values = windows.iter().map(value);
        values.fold((f64::INFINITY, 0.0_f64), |(low, high), x| (low.min(x), high.max(x)))
    };
    let centre_of = |value: fn(&Window) -> f64| {
        windows.iter().map(|window| value(window).ln()).sum::<f64>() / windows.len() as f64
    };
    let centre = [centre_of(|w| w.speed_m_s), centre_of(|w| w.force_n)];
    let place = |w: &Window| Vector3::new(1.0, w.speed_m_s.ln() - centre[0], w.force_n.ln() - centre[1]);
    let places: Vec<_> = windows.iter().map(place).collect();
    let (mut law, _) = fit_robustly(&places, &powers, POWER);
    law[1] = law[1].clamp(SPEED_EXPONENTS.0, SPEED_EXPONENTS.1);
    law[2] = law[2].clamp(FORCE_EXPONENTS.0, FORCE_EXPONENTS.1);
    let expected: f64 = places.iter().map(|place| law.dot(place).exp()).sum();
    law[0] += (powers.iter().sum::<f64>() / expected).ln();
    Some(FoundLine {
        cycles_per_m,
        diffusion_rad2_per_m,
        power: law,
        centre,
        speed_m_s: range(|w| w.speed_m_s),
        force_n: range(|w| w.force_n),
        loudest_m2_s4: LOUDEST * powers.iter().copied().fold(0.0, f64::max),
    })
}

/// The line's complex amplitudes in the windows in which it would be audible.
fn followed(
    cycles_per_m: f64,
    recordings: &[ProcessedRecording],
    whitened: &[Whitened<'_>],
    stretches: &[Stretch],
    texture: &TextureModel,
) -> Vec<Window> {
    let rate_hz = texture.rate_hz();
    let mut interpolator = Interpolator::new(texture);
    let mut filter = Coefficients::SILENCE;
    let mut all = vec![];
    for Stretch { recording, samples } in stretches {
        let signals = recordings[*recording].signals();
        let speeds_m_s = &signals.speed_m_s[samples.clone()];
        for window in windows(speeds_m_s.iter().map(|speed| speed / rate_hz), samples.len()) {
            let speed_m_s = haptograph_signal::statistics::mean(&speeds_m_s[window.clone()]);
            let force_n =
                haptograph_signal::statistics::mean(&signals.force_normal_n[samples.clone()][window.clone()]);
            let frequency_hz = cycles_per_m * speed_m_s;
            if !(LOWEST_HZ..=HIGHEST_OF_RATE * rate_hz).contains(&frequency_hz) {
                continue;
            }
            interpolator.interpolate(speed_m_s, force_n, &mut filter);
            let response = squared_response(filter.ar(), filter.warping, TAU * frequency_hz / rate_hz);
            let within = samples.start + window.start..samples.start + window.end;
            let steps_m = speeds_m_s[window].iter().map(|speed| speed / rate_hz);
            let whitened = whitened[*recording].samples(within);
            let (products, counts) = products(&whitened, steps_m, cycles_per_m);
            all.push(Window {
                speed_m_s,
                force_n,
                density: filter.variance * filter.gain * filter.gain * response,
                products,
                counts,
            });
        }
    }
    all
}

fn products(
    samples: &[f64],
    steps_m: impl Iterator<Item = f64>,
    cycles_per_m: f64,
) -> ([Complex64; LAGS], [usize; LAGS]) {
    let cell_m = cell_m(cycles_per_m);
    let mut cells: Vec<(Complex64, usize)> = vec![];
    let mut way = 0.0;
    for (e, step) in samples.iter().zip(steps_m) {
        way += step;
        let cell = (way / cell_m) as usize;
        cells.resize(cells.len().max(cell + 1), (Complex64::new(0.0, 0.0), 0));
        cells[cell].0 += Complex64::cis(-TAU * cycles_per_m * way) * (2.0 * e);
        cells[cell].1 += 1;
    }
    // The last cell is a part of one.
    cells.pop();
    let amplitude = |cell: &(Complex64, usize)| cell.0 / cell.1.max(1) as f64;
    let amplitudes: Vec<Complex64> = cells.iter().map(amplitude).collect();
    let mut sums = ([Complex64::new(0.0, 0.0); LAGS], [0; LAGS]);
    for lag in 0..LAGS {
        for (a, b) in amplitudes.iter().zip(amplitudes.get(lag + 1..).unwrap_or_default()) {
            sums.0[lag] += b * a.conj();
            sums.1[lag] += 1;
        }
    }
    sums
}
