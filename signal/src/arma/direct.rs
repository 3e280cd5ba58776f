//! The direct form of the thesis.

use super::{ArmaError, MAX_ORDER, SETTLE, SILENCE, check};

/// `y[n] = gain (e[n] + sum b_k e[n-k]) - sum a_k y[n-k]`; past inputs and outputs outlive the coefficients.
///
/// Sums run from the oldest term to the newest, the input joining before the newest output:
/// `y[n] = ((-a_p y[n-p] - ... - a_2 y[n-2]) + w[n]) - a_1 y[n-1]`. No multiplication is fused.
#[derive(Debug, Clone)]
pub struct DirectForm {
    ar: [f64; MAX_ORDER],
    ma: [f64; MAX_ORDER],
    p: usize,
    q: usize,
    gain: f64,
    /// The last inputs, then room for those of a run between two looks.
    e: [f64; MAX_ORDER + SETTLE],
    /// Outputs likewise.
    y: [f64; MAX_ORDER + SETTLE],
    since_settled: usize,
}

impl Default for DirectForm {
    fn default() -> Self {
        Self::new()
    }
}

impl DirectForm {
    /// A filter at rest that passes its excitation on.
    pub fn new() -> Self {
        Self {
            ar: [0.0; MAX_ORDER],
            ma: [0.0; MAX_ORDER],
            p: 0,
            q: 0,
            gain: 1.0,
            e: [0.0; MAX_ORDER + SETTLE],
            y: [0.0; MAX_ORDER + SETTLE],
            since_settled: 0,
        }
    }

    /// The coefficients from the next sample on: `[a_1, ..., a_p]`, `[b_1, ..., b_q]`, and the gain.
    ///
    /// # Errors
    /// [`ArmaError`] for too many or not finite ones, keeping the old. Unstable ones are taken.
    pub fn set_coefficients(&mut self, ar: &[f64], ma: &[f64], gain: f64) -> Result<(), ArmaError> {
        check(ar, ma, gain)?;
        (self.p, self.q, self.gain) = (ar.len(), ma.len(), gain);
        self.ar[..self.p].copy_from_slice(ar);
        self.ma[..self.q].copy_from_slice(ma);
        Ok(())
    }

    /// Filters `excitation` into `out`, up to the shorter of the two.
    pub fn process(&mut self, excitation: &[f64], out: &mut [f64]) {
        let length = excitation.len().min(out.len());
        let mut done = 0;
        while done < length {
            let run = (length - done).min(SETTLE - self.since_settled);
            self.run(&excitation[done..done + run], &mut out[done..done + run]);
            done += run;
            self.since_settled += run;
            if self.since_settled == SETTLE {
                self.since_settled = 0;
                self.settle();
            }
        }
    }

    /// Puts the filter to rest; the coefficients stay.
    pub fn reset(&mut self) {
        self.e.fill(0.0);
        self.y.fill(0.0);
        self.since_settled = 0;
    }

    fn run(&mut self, excitation: &[f64], out: &mut [f64]) {
        let (ar, ma) = (&self.ar[..self.p], &self.ma[..self.q]);
        for (i, (e, out)) in excitation.iter().zip(out).enumerate() {
            let now = MAX_ORDER + i;
            self.e[now] = *e;
            let mut w = 0.0;
            for (k, b) in ma.iter().enumerate().rev() {
                w += b * self.e[now - 1 - k];
            }
            let w = self.gain * (w + e);
            let mut y = 0.0;
            for (k, a) in ar.iter().enumerate().skip(1).rev() {
                y -= a * self.y[now - 1 - k];
            }
            y += w;
            if let Some(a) = ar.first() {
                y -= a * self.y[now - 1];
            }
            self.y[now] = y;
            *out = y;
        }
        self.e
            .copy_within(excitation.len()..excitation.len() + MAX_ORDER, 0);
        self.y
            .copy_within(excitation.len()..excitation.len() + MAX_ORDER, 0);
    }

    fn settle(&mut self) {
        let (e, y) = (&mut self.e[..MAX_ORDER], &mut self.y[..MAX_ORDER]);
        let silent = e.iter().chain(y.iter()).all(|v| v.abs() < SILENCE);
        let finite = e.iter().chain(y.iter()).all(|v| v.is_finite());
        if silent || !finite {
            e.fill(0.0);
            y.fill(0.0);
        }
    }
}
