//! Whitens recordings by a learned texture: removes the spectrum and the level of the map.

use crate::recording::ProcessedRecording;
use haptograph_surfaces::interpolation::{Coefficients, Interpolator};
use haptograph_surfaces::{MAX_ORDER, TextureModel};

/// Update interval of the inverse filter, s.
const UPDATE_S: f64 = 0.005;

/// A whitened recording; if the map is correct, it is white with variance 1.
pub(super) struct Whitened {
    /// One sample for each of the recording; 0 where the tool was not dragged.
    pub samples: Vec<f64>,
    /// True for each sample at which the tool was dragged.
    pub dragged: Vec<bool>,
}

impl Whitened {
    /// Filters `recording` by the inverse of `texture` along its speed and force.
    ///
    /// Samples below `min_speed_m_s` or `min_force_n` count as not dragged.
    pub(super) fn new(
        recording: &ProcessedRecording,
        texture: &TextureModel,
        min_speed_m_s: f64,
        min_force_n: f64,
    ) -> Self {
        let signals = recording.signals();
        let update = ((UPDATE_S * signals.rate_hz) as usize).max(1);
        let count = recording.samples();
        let mut interpolator = Interpolator::new(texture);
        let mut filter = Coefficients::SILENCE;
        let mut chain = AllPasses::new(texture.warping());
        let mut whitened = Self { samples: vec![0.0; count], dragged: vec![false; count] };
        for start in (0..count).step_by(update) {
            let samples = start..(start + update).min(count);
            let speed_m_s = haptograph_signal::statistics::mean(&signals.speed_m_s[samples.clone()]);
            let force_n = haptograph_signal::statistics::mean(&signals.force_normal_n[samples.clone()]);
            interpolator.interpolate(speed_m_s, force_n, &mut filter);
            let is_dragged = speed_m_s > min_speed_m_s && force_n > min_force_n && filter.variance > 0.0;
            let scale = if is_dragged { 1.0 / (filter.variance.sqrt() * filter.gain) } else { 0.0 };
            for n in samples {
                whitened.samples[n] = scale * chain.next(signals.acceleration_m_s2[n], filter.ar());
                whitened.dragged[n] = is_dragged;
            }
        }
        whitened
    }

    /// The samples at which the tool was dragged, concatenated.
    pub(super) fn dragged_samples(&self) -> impl Iterator<Item = f64> + '_ {
        let samples = self.samples.iter().zip(&self.dragged);
        samples.filter(|(_, dragged)| **dragged).map(|(e, _)| *e)
    }
}

/// A chain of all-passes (delays if the warping factor is 0) with a tap after each.
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
