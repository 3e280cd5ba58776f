//! The normalised lattice-ladder: bounded however its coefficients change.

use super::{ArmaError, MAX_ORDER, SETTLE, SILENCE, check};
use crate::prediction::{PredictionError, ladder};

/// The normalised lattice-ladder of Gray and Markel (1973, 1975).
///
/// Stage m turns the forward signal `f_m` and the delayed backward signal `g_{m-1}` by the angle whose sine is the
/// reflection coefficient `k_m`; the output is a sum of backward signals. Turning keeps energy, so the energy of the
/// state can only grow by what the excitation brings, whatever the stable coefficients do. For white excitation of
/// variance 1 every backward signal has variance 1 under every set of coefficients.
#[derive(Debug, Clone)]
pub struct Lattice {
    /// Sine (`k_m`) and cosine of each stage, from stage 1.
    stages: [[f64; 2]; MAX_ORDER],
    /// Output taps on the backward signals 0..=order, the gain included.
    taps: [f64; MAX_ORDER + 1],
    order: usize,
    /// Backward signals 0..order of the sample before.
    backward: [f64; MAX_ORDER],
    since_settled: usize,
}

impl Default for Lattice {
    fn default() -> Self {
        Self::new()
    }
}

impl Lattice {
    /// A filter at rest that passes its excitation on.
    pub fn new() -> Self {
        let mut taps = [0.0; MAX_ORDER + 1];
        taps[0] = 1.0;
        Self {
            stages: [[0.0, 1.0]; MAX_ORDER],
            taps,
            order: 0,
            backward: [0.0; MAX_ORDER],
            since_settled: 0,
        }
    }

    /// The coefficients from the next sample on: `[a_1, ..., a_p]`, `[b_1, ..., b_q]`, and the gain.
    ///
    /// # Errors
    /// [`ArmaError`] for too many, not finite or unstable ones, keeping the old.
    pub fn set_coefficients(&mut self, ar: &[f64], ma: &[f64], gain: f64) -> Result<(), ArmaError> {
        check(ar, ma, gain)?;
        let order = ar.len().max(ma.len());
        let mut reflection = [0.0; MAX_ORDER];
        let mut taps = [0.0; MAX_ORDER + 1];
        let mut scratch = [0.0; MAX_ORDER];
        ladder(
            ar,
            ma,
            &mut reflection[..order],
            &mut taps[..=order],
            &mut scratch[..order],
        )?;
        for tap in &mut taps {
            *tap *= gain;
        }
        if !taps.iter().all(|t| t.is_finite()) {
            return Err(PredictionError::NotFinite.into());
        }
        for (stage, k) in self.stages.iter_mut().zip(reflection) {
            *stage = [k, (1.0 - k * k).sqrt()];
        }
        // Signals of stages that are gone must not come back with them.
        self.backward[order..].fill(0.0);
        self.taps = taps;
        self.order = order;
        Ok(())
    }

    /// Filters `excitation` into `out`, up to the shorter of the two.
    pub fn process(&mut self, excitation: &[f64], out: &mut [f64]) {
        for (e, out) in excitation.iter().zip(out) {
            *out = self.step(*e);
            self.since_settled += 1;
            if self.since_settled == SETTLE {
                self.since_settled = 0;
                self.settle();
            }
        }
    }

    /// Puts the filter to rest; the coefficients stay.
    pub fn reset(&mut self) {
        self.backward.fill(0.0);
        self.since_settled = 0;
    }

    fn step(&mut self, e: f64) -> f64 {
        let mut forward = e;
        let mut out = 0.0;
        for m in (0..self.order).rev() {
            let [sine, cosine] = self.stages[m];
            let delayed = self.backward[m];
            let backward = sine * forward + cosine * delayed;
            forward = cosine * forward - sine * delayed;
            out += self.taps[m + 1] * backward;
            if m + 1 < self.order {
                self.backward[m + 1] = backward;
            }
        }
        if self.order > 0 {
            self.backward[0] = forward;
        }
        out + self.taps[0] * forward
    }

    fn settle(&mut self) {
        let silent = self.backward.iter().all(|v| v.abs() < SILENCE);
        let finite = self.backward.iter().all(|v| v.is_finite());
        if silent || !finite {
            self.backward.fill(0.0);
        }
    }
}
