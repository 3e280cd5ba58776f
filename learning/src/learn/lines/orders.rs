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
use std::ops::Range;

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
struct Track<'a> {
    recordings: &'a [ProcessedRecording],
    whitened: &'a [Whitened<'a>],
    stretches: &'a [Stretch],
    /// The place of each stretch, and the number of samples of all.
    starts: Vec<usize>,
    samples: usize,
    rate_hz: f64,
}

/// Cycles per metre of the lines, strongest first.
pub(super) fn found(
    recordings: &[ProcessedRecording],
    whitened: &[Whitened<'_>],
    stretches: &[Stretch],
    rate_hz: f64,
) -> Vec<f64> {
    let track = Track::new(recordings, whitened, stretches, rate_hz);
    let Some(axis) = Axis::new(&track) else {
        return vec![];
    };
    let windows = track.windows(0);
    let groups = (windows.len() / 4).clamp(MIN_GROUPS, MAX_GROUPS);
    let peaks = peaks(&scores(&track, windows, &axis, groups), &axis);
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
fn threshold(track: &Track<'_>, axis: &Axis, groups: usize, strongest: f64) -> Option<f64> {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(SEED);
    let mut highest = f64::NEG_INFINITY;
    for _ in 0..SURROGATES {
        let scores = scores(track, track.windows(track.shift(&mut random)?), axis, groups);
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

impl<'a> Track<'a> {
    fn new(
        recordings: &'a [ProcessedRecording],
        whitened: &'a [Whitened<'a>],
        stretches: &'a [Stretch],
        rate_hz: f64,
    ) -> Self {
        let mut samples = 0;
        let starts = stretches.iter().map(|stretch| {
            samples += stretch.samples.len();
            samples - stretch.samples.len()
        });
        let starts = starts.collect();
        Self { recordings, whitened, stretches, starts, samples, rate_hz }
    }

    fn speeds_m_s(&self, stretch: usize) -> &'a [f64] {
        let Stretch { recording, samples } = &self.stretches[stretch];
        &self.recordings[*recording].signals().speed_m_s[samples.clone()]
    }

    /// The distances of the samples from one on, m, round and round.
    fn steps_m(&self, from: usize) -> impl Iterator<Item = f64> + Clone {
        let (from, count) = (from % self.samples.max(1), self.stretches.len());
        let first = self.starts.partition_point(|start| *start <= from).saturating_sub(1);
        let begun = self.speeds_m_s(first)[from - self.starts[first]..].iter();
        let further = (first + 1..).flat_map(move |stretch| self.speeds_m_s(stretch % count));
        begun.chain(further).map(|speed| speed / self.rate_hz)
    }

    /// The windows in which samples are at the distances of those `shift` later.
    fn windows(&self, shift: usize) -> Vec<Window> {
        let mut all = vec![];
        for (number, Stretch { samples, .. }) in self.stretches.iter().enumerate() {
            let from = self.starts[number] + shift;
            for window in windows(self.steps_m(from), samples.len()) {
                if window.len() >= MIN_SAMPLES {
                    let total: f64 = self.steps_m(from + window.start).take(window.len()).sum();
                    let speed_m_s = total / window.len() as f64 * self.rate_hz;
                    all.push(Window {
                        stretch: number,
                        from: from + window.start,
                        samples: window,
                        speed_m_s,
                    });
                }
            }
        }
        all.sort_by(|a, b| a.speed_m_s.total_cmp(&b.speed_m_s));
        all
    }

    /// A circular shift of the steps in time, far enough to differ.
    fn shift(&self, random: &mut Xoshiro256PlusPlus) -> Option<usize> {
        let count = self.samples;
        let steps_m = || self.steps_m(0).take(count);
        let way: f64 = steps_m().sum();
        for _ in 0..SHIFTS {
            let shift = random.random_range(count / 20..count - count / 20);
            let pairs = steps_m().zip(self.steps_m(shift));
            let same: f64 = pairs.filter(|(a, b)| (a - b).abs() < 0.05 * a).map(|(step, _)| step).sum();
            if same < SAME * way {
                return Some(shift);
            }
        }
        None
    }
}

/// The value of this rank, from 0, among values that are not negative: a sixteenth of their bits after the other.
fn ranked(values: impl Iterator<Item = f64> + Clone, mut rank: usize) -> f64 {
    let mut known = 0;
    for shift in [48, 32, 16, 0] {
        let mut counts = vec![0; 1 << 16];
        for bits in values.clone().map(f64::to_bits) {
            if (bits ^ known) >> shift < 1 << 16 {
                counts[usize::from((bits >> shift) as u16)] += 1;
            }
        }
        let mut digit = 0;
        while counts.get(digit).is_some_and(|count| *count <= rank) {
            rank -= counts[digit];
            digit += 1;
        }
        known |= (digit as u64) << shift;
    }
    f64::from_bits(known)
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
    fn new(track: &Track<'_>) -> Option<Self> {
        if track.samples == 0 {
            return None;
        }
        let speeds_m_s = track.steps_m(0).take(track.samples).map(|step| step * track.rate_hz);
        let slow_m_s = ranked(speeds_m_s, track.samples / 4);
        let highest_hz = FELT_HZ.min(HIGHEST_OF_RATE * track.rate_hz);
        let finest_per_m = (highest_hz / slow_m_s).min(FINEST_PER_M);
        let bin_m = 0.25 / finest_per_m;
        let bins = ((2.0 * WINDOW_M / bin_m) as usize).max(64).next_power_of_two();
        Some(Self { bin_m, bins, column_per_m: 1.0 / (bins as f64 * bin_m), columns: bins / 4 })
    }
}

/// A window of distance.
struct Window {
    stretch: usize,
    /// The samples in the stretch, and the place of the first one's distance in the track.
    samples: Range<usize>,
    from: usize,
    speed_m_s: f64,
}

/// The excess of each column over its neighbours, in standard errors, from windows sorted by speed: the minimum over the
/// groups of windows from slow to fast; minus infinity if there are too few speeds.
fn scores(track: &Track<'_>, windows: Vec<Window>, axis: &Axis, groups: usize) -> Vec<f64> {
    let known: Vec<_> = (0..axis.columns)
        .filter_map(|column| {
            let cycles_per_m = column as f64 * axis.column_per_m;
            Some((column, audible_windows(&windows, cycles_per_m, groups, track.rate_hz)?))
        })
        .collect();
    let transform = fft::forward(axis.bins);
    // Sums of the spectra of all slower windows: the last, and for each column those at the edges of its groups.
    let mut sums = vec![0.0; axis.columns];
    let mut at_edges: Vec<Vec<f64>> = vec![vec![]; known.len()];
    let edge = |(low, high): (usize, usize), group: usize| low + (high - low) * group / groups;
    let note = |summed: usize, sums: &[f64], at_edges: &mut [Vec<f64>]| {
        for ((column, of), at_edges) in known.iter().zip(at_edges) {
            if at_edges.len() <= groups && edge(*of, at_edges.len()) == summed {
                at_edges.push(sums[*column]);
            }
        }
    };
    note(0, &sums, &mut at_edges);
    for (pair, windows) in windows.chunks(2).enumerate() {
        let resampled: Vec<_> = windows.iter().map(|window| resampled(track, window, axis)).collect();
        for (second, spectrum) in pair_spectra(&resampled, &transform, axis.columns).into_iter().enumerate() {
            sums.iter_mut().zip(spectrum).for_each(|(sum, power)| *sum += power);
            note(2 * pair + second + 1, &sums, &mut at_edges);
        }
    }
    let lifts: Vec<Vec<f64>> = (0..groups)
        .map(|group| {
            let logs = known.iter().zip(&at_edges).map(|((_, of), sums)| {
                let power =
                    (sums[group + 1] - sums[group]) / (edge(*of, group + 1) - edge(*of, group)) as f64;
                power.max(1e-12).ln()
            });
            lifts(&logs.collect::<Vec<_>>())
        })
        .collect();
    let mut scores = vec![f64::NEG_INFINITY; axis.columns];
    for (place, (column, (low, high))) in known.into_iter().enumerate() {
        let least = lifts.iter().map(|lifts| lifts[place]).fold(f64::INFINITY, f64::min);
        scores[column] = least * ((high - low) as f64).sqrt();
    }
    scores
}

/// The windows in which a line would be audible, if they are enough and cover enough speeds.
fn audible_windows(
    windows: &[Window],
    cycles_per_m: f64,
    groups: usize,
    rate_hz: f64,
) -> Option<(usize, usize)> {
    if cycles_per_m < MIN_CYCLES / WINDOW_M {
        return None;
    }
    let low = windows.partition_point(|window| window.speed_m_s * cycles_per_m < LOWEST_HZ);
    let high = windows.partition_point(|window| window.speed_m_s * cycles_per_m <= HIGHEST_OF_RATE * rate_hz);
    let count = high.saturating_sub(low);
    if count < 2 * groups {
        return None;
    }
    let tenth = count / 10;
    (windows[high - 1 - tenth].speed_m_s >= SPEED_RATIO * windows[low + tenth].speed_m_s)
        .then_some((low, high))
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

/// A window resampled over distance, tapered, normalised to equal energy.
fn resampled(track: &Track<'_>, window: &Window, axis: &Axis) -> Vec<f64> {
    let (count, stretch) = (window.samples.len(), &track.stretches[window.stretch]);
    let start = stretch.samples.start + window.samples.start;
    let samples = track.whitened[stretch.recording].samples(start..start + count);
    let steps_m = track.steps_m(window.from).take(count);
    let total: f64 = steps_m.clone().sum();
    let energy = samples.iter().map(|e| e * e).sum::<f64>() / count as f64;
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
    bins
}

/// Power spectra of one or two windows by one transform, as its real and its imaginary part.
fn pair_spectra(pair: &[Vec<f64>], transform: &fft::Transform, columns: usize) -> Vec<Vec<f64>> {
    let second = |n: usize| pair.get(1).map_or(0.0, |bins| bins[n]);
    let both = pair[0].iter().enumerate();
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
