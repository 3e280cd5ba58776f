//! Spectra over cycles per metre, and their peaks that exceed all surrogates.

use super::super::whitening::Whitened;
use super::{Stretch, WINDOW_M, windows};
use crate::recording::ProcessedRecording;
use haptograph_signal::Complex64;
use haptograph_signal::fft;
use haptograph_surfaces::bounds::FELT_HZ;
use haptograph_surfaces::layers::lines::{HIGHEST_OF_RATE, LOWEST_HZ, MAX_LINES};
use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use std::f64::consts::PI;

/// Range of spatial frequencies that a tool follows, cycles per metre.
const FINEST_PER_M: f64 = 10_000.0;
/// Fewest cycles in a window; fewer are not enough to estimate the coherence.
const MIN_CYCLES: f64 = 8.0;
/// Least ratio of speeds, without a tenth at both ends, over which a line must be visible.
const SPEED_RATIO: f64 = 1.5;
/// Groups of windows by speed, all of which must have a line.
const MIN_GROUPS: usize = 3;
const MAX_GROUPS: usize = 6;
/// Columns on each side for a peak's background, and the excluded columns next to it.
const BACKGROUND: usize = 20;
const PEAK: usize = 3;
/// Number of surrogates, all of which a line must exceed: one false alarm in 41.
const SURROGATES: usize = 40;
/// A shift is not a surrogate if the speed is equal to within a twentieth over more than this fraction of the distance.
const SAME: f64 = 0.3;
const SHIFTS: usize = 20;
const SEED: u64 = 0x6c69_6e65_735f_6b21;
/// Least samples of a usable window.
const MIN_SAMPLES: usize = 32;

/// Whitened samples and the distance of each, stretch after stretch.
struct Track {
    samples: Vec<f64>,
    steps_m: Vec<f64>,
    lengths: Vec<usize>,
    rate_hz: f64,
}

/// Cycles per metre of the lines, strongest first.
pub(super) fn found(
    recordings: &[ProcessedRecording],
    whitened: &[Whitened],
    stretches: &[Stretch],
    rate_hz: f64,
) -> Vec<f64> {
    let track = Track::new(recordings, whitened, stretches, rate_hz);
    let Some(axis) = Axis::new(&track) else {
        return vec![];
    };
    let spectra = Spectra::new(&track, &track.steps_m, &axis);
    let groups = (spectra.speeds_m_s.len() / 4).clamp(MIN_GROUPS, MAX_GROUPS);
    let scores = spectra.scores(&axis, groups, rate_hz);
    let peaks = peaks(&scores, &axis);
    let Some((_, strongest)) = peaks.first() else {
        return vec![];
    };
    let Some(threshold) = threshold(&track, &axis, groups, *strongest) else {
        return vec![];
    };
    let lines = peaks.iter().filter(|(_, score)| *score > threshold);
    lines.map(|(cycles_per_m, _)| *cycles_per_m).collect()
}

/// The highest score of the surrogates; `None` if one exceeds the strongest peak, or if no surrogate is possible.
fn threshold(track: &Track, axis: &Axis, groups: usize, strongest: f64) -> Option<f64> {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(SEED);
    let mut highest = f64::NEG_INFINITY;
    for _ in 0..SURROGATES {
        let steps_m = track.shifted(&mut random)?;
        let scores = Spectra::new(track, &steps_m, axis).scores(axis, groups, track.rate_hz);
        highest = scores.iter().copied().fold(highest, f64::max);
        if highest >= strongest {
            return None;
        }
    }
    Some(highest)
}

/// The highest scores, at least a window's resolution apart.
fn peaks(scores: &[f64], axis: &Axis) -> Vec<(f64, f64)> {
    let apart = (1.5 / (WINDOW_M * axis.column_per_m)).ceil() as usize;
    let mut left = scores.to_vec();
    let mut peaks = vec![];
    while peaks.len() < MAX_LINES {
        let highest = left.iter().enumerate().max_by(|(_, a), (_, b)| a.total_cmp(b));
        let Some((column, score)) = highest.filter(|(_, score)| score.is_finite()) else {
            break;
        };
        peaks.push((column as f64 * axis.column_per_m, *score));
        let end = (column + apart + 1).min(left.len());
        left[column.saturating_sub(apart)..end].fill(f64::NEG_INFINITY);
    }
    peaks
}

impl Track {
    fn new(
        recordings: &[ProcessedRecording],
        whitened: &[Whitened],
        stretches: &[Stretch],
        rate_hz: f64,
    ) -> Self {
        let mut track = Self { samples: vec![], steps_m: vec![], lengths: vec![], rate_hz };
        for Stretch { recording, samples } in stretches {
            let speeds = &recordings[*recording].signals().speed_m_s[samples.clone()];
            track.samples.extend(&whitened[*recording].samples[samples.clone()]);
            track.steps_m.extend(speeds.iter().map(|speed| speed / rate_hz));
            track.lengths.push(samples.len());
        }
        track
    }

    /// The steps shifted circularly in time, far enough to differ.
    fn shifted(&self, random: &mut Xoshiro256PlusPlus) -> Option<Vec<f64>> {
        let count = self.steps_m.len();
        let way: f64 = self.steps_m.iter().sum();
        for _ in 0..SHIFTS {
            let shift = random.random_range(count / 20..count - count / 20);
            let mut shifted = self.steps_m.clone();
            shifted.rotate_left(shift);
            let pairs = self.steps_m.iter().zip(&shifted);
            let same: f64 = pairs.filter(|(a, b)| (*a - *b).abs() < 0.05 * **a).map(|(step, _)| step).sum();
            if same < SAME * way {
                return Some(shifted);
            }
        }
        None
    }
}

/// The axis of cycles per metre.
struct Axis {
    bin_m: f64,
    bins: usize,
    column_per_m: f64,
    columns: usize,
}

impl Axis {
    /// `None` if the track is too short.
    fn new(track: &Track) -> Option<Self> {
        let mut speeds: Vec<f64> = track.steps_m.iter().map(|step| step * track.rate_hz).collect();
        let quarter = speeds.len() / 4;
        if speeds.is_empty() {
            return None;
        }
        let (_, &mut slow_m_s, _) = speeds.select_nth_unstable_by(quarter, f64::total_cmp);
        let highest_hz = FELT_HZ.min(HIGHEST_OF_RATE * track.rate_hz);
        let finest_per_m = (highest_hz / slow_m_s).min(FINEST_PER_M);
        let bin_m = 0.25 / finest_per_m;
        let bins = ((2.0 * WINDOW_M / bin_m) as usize).max(64).next_power_of_two();
        Some(Self { bin_m, bins, column_per_m: 1.0 / (bins as f64 * bin_m), columns: bins / 4 })
    }
}

/// Spectra over cycles per metre of windows of distance, by speed.
struct Spectra {
    speeds_m_s: Vec<f64>,
    /// Sums of the spectra of all slower windows, a row for each window and one more.
    sums: Vec<Vec<f64>>,
}

impl Spectra {
    fn new(track: &Track, steps_m: &[f64], axis: &Axis) -> Self {
        let mut laid = vec![];
        let mut start = 0;
        for length in &track.lengths {
            let (samples, steps) = (&track.samples[start..start + length], &steps_m[start..start + length]);
            start += length;
            for window in windows(steps) {
                if window.len() >= MIN_SAMPLES {
                    laid.push(ResampledWindow::new(
                        &samples[window.clone()],
                        &steps[window],
                        track.rate_hz,
                        axis,
                    ));
                }
            }
        }
        laid.sort_by(|a, b| a.speed_m_s.total_cmp(&b.speed_m_s));
        let transform = fft::forward(axis.bins);
        let mut sums = vec![vec![0.0; axis.columns]];
        for pair in laid.chunks(2) {
            for spectrum in pair_spectra(pair, &transform, axis.columns) {
                let mut sum = sums[sums.len() - 1].clone();
                sum.iter_mut().zip(spectrum).for_each(|(sum, power)| *sum += power);
                sums.push(sum);
            }
        }
        Self { speeds_m_s: laid.iter().map(|window| window.speed_m_s).collect(), sums }
    }

    /// The excess of each column over its neighbours, in standard errors: the minimum over the groups of windows from slow to
    /// fast; minus infinity if there are too few speeds.
    fn scores(&self, axis: &Axis, groups: usize, rate_hz: f64) -> Vec<f64> {
        let mut scores = vec![f64::NEG_INFINITY; axis.columns];
        let mut known = vec![];
        let mut logs = vec![vec![]; groups];
        for column in 0..axis.columns {
            let Some((low, high)) = self.audible_windows(column as f64 * axis.column_per_m, groups, rate_hz)
            else {
                continue;
            };
            known.push((column, high - low));
            for (group, logs) in logs.iter_mut().enumerate() {
                let edge = |group: usize| low + (high - low) * group / groups;
                let (from, to) = (edge(group), edge(group + 1));
                let power = (self.sums[to][column] - self.sums[from][column]) / (to - from) as f64;
                logs.push(power.max(1e-12).ln());
            }
        }
        let lifts: Vec<Vec<f64>> = logs.iter().map(|logs| lifts(logs)).collect();
        for (place, (column, count)) in known.into_iter().enumerate() {
            let least = lifts.iter().map(|lifts| lifts[place]).fold(f64::INFINITY, f64::min);
            scores[column] = least * (count as f64).sqrt();
        }
        scores
    }

    /// The windows in which a line would be audible, if they are enough and cover enough speeds.
    fn audible_windows(&self, cycles_per_m: f64, groups: usize, rate_hz: f64) -> Option<(usize, usize)> {
        if cycles_per_m < MIN_CYCLES / WINDOW_M {
            return None;
        }
        let speeds = &self.speeds_m_s;
        let low = speeds.partition_point(|speed| speed * cycles_per_m < LOWEST_HZ);
        let high = speeds.partition_point(|speed| speed * cycles_per_m <= HIGHEST_OF_RATE * rate_hz);
        let count = high.saturating_sub(low);
        if count < 2 * groups {
            return None;
        }
        let tenth = count / 10;
        (speeds[high - 1 - tenth] >= SPEED_RATIO * speeds[low + tenth]).then_some((low, high))
    }
}

/// Logarithms minus the mean of their neighbours.
fn lifts(logs: &[f64]) -> Vec<f64> {
    let mut sums = vec![0.0];
    for log in logs {
        sums.push(sums[sums.len() - 1] + log);
    }
    let lift = |n: usize| {
        let (low, high) = (n.saturating_sub(BACKGROUND), (n + BACKGROUND + 1).min(logs.len()));
        let (from, to) = (n.saturating_sub(PEAK), (n + PEAK + 1).min(logs.len()));
        let around = sums[high] - sums[low] - (sums[to] - sums[from]);
        logs[n] - around / ((high - low) - (to - from)).max(1) as f64
    };
    (0..logs.len()).map(lift).collect()
}

/// A window resampled over distance.
struct ResampledWindow {
    speed_m_s: f64,
    bins: Vec<f64>,
}

impl ResampledWindow {
    /// The tapered window, normalised to equal energy.
    fn new(samples: &[f64], steps_m: &[f64], rate_hz: f64, axis: &Axis) -> Self {
        let total: f64 = steps_m.iter().sum();
        let energy = samples.iter().map(|e| e * e).sum::<f64>() / samples.len() as f64;
        let mut bins = vec![0.0; axis.bins];
        let (mut way, mut tapers) = (0.0, 0.0);
        for (e, step) in samples.iter().zip(steps_m) {
            way += step;
            let taper = (PI * way / total).sin();
            tapers += taper * taper;
            // Long windows wrap around, which no frequency of the axis notices.
            bins[(way / axis.bin_m) as usize % axis.bins] += e * taper;
        }
        let scale = 1.0 / (tapers * energy).max(1e-30).sqrt();
        bins.iter_mut().for_each(|bin| *bin *= scale);
        Self { speed_m_s: total / samples.len() as f64 * rate_hz, bins }
    }
}

/// Power spectra of one or two windows by one transform, as its real and its imaginary part.
fn pair_spectra(pair: &[ResampledWindow], transform: &fft::Transform, columns: usize) -> Vec<Vec<f64>> {
    let second = |n: usize| pair.get(1).map_or(0.0, |window| window.bins[n]);
    let both = pair[0].bins.iter().enumerate();
    let mut spectrum: Vec<Complex64> = both.map(|(n, bin)| Complex64::new(*bin, second(n))).collect();
    transform.process(&mut spectrum);
    let bins = spectrum.len();
    let part = |window: usize, column: usize| {
        let (above, below) = (spectrum[column], spectrum[(bins - column) % bins].conj());
        let twice = if window == 0 { above + below } else { above - below };
        0.25 * twice.norm_sqr()
    };
    (0..pair.len()).map(|window| (0..columns).map(|column| part(window, column)).collect()).collect()
}
