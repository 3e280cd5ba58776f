//! Whitens recordings by a learned texture: removes the spectrum and the level of the map.

use crate::recording::ProcessedRecording;
use haptograph_surfaces::interpolation::{Coefficients, Interpolator};
use haptograph_surfaces::{MAX_ORDER, TextureModel};
use std::borrow::Cow;
use std::ops::Range;

/// Update interval of the inverse filter, s.
const UPDATE_S: f64 = 0.005;

/// Whitened samples of recordings of at most this many are kept; those of others are computed again where they are used.
const KEPT: usize = 1 << 21;
/// Updates after which the state of the filter is noted, to begin again from there.
const UPDATES: usize = 64;

/// A whitened recording; if the map is correct, it is white with variance 1.
pub(super) struct Whitened<'a> {
    recording: &'a ProcessedRecording,
    texture: &'a TextureModel,
    /// Below this speed, m/s, or this force, N, samples count as not dragged.
    least: [f64; 2],
    update: usize,
    /// True for each update interval in which the tool was dragged.
    dragged: Vec<bool>,
    states: Vec<AllPasses>,
    kept: Vec<f64>,
}

impl<'a> Whitened<'a> {
    /// Filters `recording` by the inverse of `texture` along its speed and force.
    ///
    /// Samples below `min_speed_m_s` or `min_force_n` count as not dragged.
    pub(super) fn new(
        recording: &'a ProcessedRecording,
        texture: &'a TextureModel,
        min_speed_m_s: f64,
        min_force_n: f64,
    ) -> Self {
        let update = ((UPDATE_S * recording.rate_hz()) as usize).max(1);
        let (least, count) = ([min_speed_m_s, min_force_n], recording.samples());
        let kept = Vec::with_capacity(if count <= KEPT { count } else { 0 });
        let mut whitened = Self { recording, texture, least, update, dragged: vec![], states: vec![], kept };
        let mut chain = AllPasses::new(texture.warping());
        let piece = update * UPDATES;
        for start in (0..count).step_by(piece) {
            whitened.states.push(chain.clone());
            let (samples, dragged) = whitened.filtered(&mut chain, start..(start + piece).min(count));
            whitened.dragged.extend(dragged);
            if count <= KEPT {
                whitened.kept.extend(samples);
            }
        }
        whitened
    }

    /// Whitened samples, and whether the tool was dragged in each update interval. A range begins with an interval.
    fn filtered(&self, chain: &mut AllPasses, range: Range<usize>) -> (Vec<f64>, Vec<bool>) {
        let signals = self.recording.signals();
        let mut interpolator = Interpolator::new(self.texture);
        let mut filter = Coefficients::SILENCE;
        let (mut whitened, mut dragged) = (Vec::with_capacity(range.len()), vec![]);
        for start in range.clone().step_by(self.update) {
            // The last interval of a range may go on beyond it.
            let samples = start..(start + self.update).min(self.recording.samples());
            let speed_m_s = haptograph_signal::statistics::mean(&signals.speed_m_s[samples.clone()]);
            let force_n = haptograph_signal::statistics::mean(&signals.force_normal_n[samples.clone()]);
            interpolator.interpolate(speed_m_s, force_n, &mut filter);
            let is_dragged = speed_m_s > self.least[0] && force_n > self.least[1] && filter.variance > 0.0;
            let scale = if is_dragged { 1.0 / (filter.variance.sqrt() * filter.gain) } else { 0.0 };
            let vibration = &self.recording.vibration_m_s2()[start..samples.end.min(range.end)];
            whitened.extend(vibration.iter().map(|x| scale * chain.next(*x, filter.ar())));
            dragged.push(is_dragged);
        }
        (whitened, dragged)
    }

    /// One sample for each of the range; 0 where the tool was not dragged.
    pub(super) fn samples(&self, range: Range<usize>) -> Cow<'_, [f64]> {
        if !self.kept.is_empty() {
            return Cow::Borrowed(&self.kept[range]);
        }
        let piece = range.start / (self.update * UPDATES);
        let start = piece * self.update * UPDATES;
        let Some(mut chain) = self.states.get(piece).cloned() else { return Cow::default() };
        let (mut samples, _) = self.filtered(&mut chain, start..range.end);
        samples.drain(..range.start - start);
        Cow::Owned(samples)
    }

    /// True for each sample at which the tool was dragged.
    pub(super) fn dragged(&self) -> impl Iterator<Item = bool> + '_ {
        (0..self.recording.samples()).map(|sample| self.dragged[sample / self.update])
    }

    /// The ranges of samples in which the tool was dragged.
    pub(super) fn runs(&self) -> Vec<Range<usize>> {
        let (mut start, mut runs) = (0, vec![]);
        for run in self.dragged.chunk_by(|a, b| a == b) {
            let end = start + run.len();
            if run[0] {
                runs.push(start * self.update..(end * self.update).min(self.recording.samples()));
            }
            start = end;
        }
        runs
    }
}

/// A chain of all-passes (delays if the warping factor is 0) with a tap after each.
#[derive(Clone)]
struct AllPasses {
    warping: f64,
    taps: [f64; MAX_ORDER + 1],
}

impl AllPasses {
    fn new(warping: f64) -> Self {
        Self { warping, taps: [0.0; MAX_ORDER + 1] }
    }

    /// `input` plus the taps weighted by `ar`.
    fn next(&mut self, input: f64, ar: &[f64]) -> f64 {
        let (mut now, mut before) = (input, self.taps[0]);
        self.taps[0] = input;
        let mut sum = input;
        // D(z) = (z^-1 - l) / (1 - l z^-1): the output is the last input minus l times (this input - last output).
        for (tap, a) in self.taps[1..].iter_mut().zip(ar) {
            let passed = before - self.warping * (now - *tap);
            (before, now) = (*tap, passed);
            *tap = passed;
            sum += a * passed;
        }
        sum
    }
}
