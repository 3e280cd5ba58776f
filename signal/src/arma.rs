//! The synthesis filter `gain B(z)/A(z)` for white noise, with coefficients that change at run time.
//!
//! `A(z) = 1 + sum a_k z^-k`, `B(z) = 1 + sum b_k z^-k`. Two forms compute the same filter for constant coefficients.
//! They differ in the state that they carry from one set to the next:
//!
//! - [`DirectForm`] carries the past inputs and outputs, as the thesis does (2.4.2). Its output can grow without bound
//!   when stable sets alternate.
//! - [`Lattice`] carries the signals of a normalised lattice, whose energy no stable set can raise. The output is
//!   bounded for every sequence of sets, and has the power and spectrum of a new set at once.
//!
//! Both give the same bits for every block size and on every processor. Every 256 samples a state below `SILENCE` is
//! cleared, so that silence becomes exact, and so is a state that is NaN or infinite; `reset` clears it at once.

mod bank;
mod direct;
mod lattice;
mod warped;

pub use bank::{VoiceBank, WarpedBank};
pub use direct::DirectForm;
pub use lattice::Lattice;
pub use warped::WarpedLattice;

use crate::prediction::PredictionError;
use thiserror::Error;

/// Highest order of `A(z)` and of `B(z)`.
pub const MAX_ORDER: usize = 32;

/// Magnitude of the state below which it counts as silence.
pub(crate) const SILENCE: f64 = 1e-20;

/// Interval in samples at which the state is checked for silence.
const SETTLE: usize = 256;

/// Error of coefficients. The filter keeps the old ones.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum ArmaError {
    /// Too many coefficients.
    #[error("a synthesis filter of order {order} is too long; at most {MAX_ORDER} coefficients fit")]
    TooLong {
        /// The order given.
        order: usize,
    },
    /// NaN or infinite coefficients, or an unstable denominator, which a lattice cannot realise.
    #[error(transparent)]
    Unusable(#[from] PredictionError),
}

/// Form of a filter.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Form {
    /// [`DirectForm`].
    Direct,
    /// [`Lattice`].
    #[default]
    Lattice,
}

/// A synthesis filter of either form.
#[derive(Debug, Clone)]
#[expect(clippy::large_enum_variant, reason = "a box would be heap in a filter that promises none")]
pub enum ArmaFilter {
    /// See [`DirectForm`].
    Direct(DirectForm),
    /// See [`Lattice`].
    Lattice(Lattice),
}

impl ArmaFilter {
    /// Makes a filter with zero state that passes its excitation.
    pub fn new(form: Form) -> Self {
        match form {
            Form::Direct => Self::Direct(DirectForm::new()),
            Form::Lattice => Self::Lattice(Lattice::new()),
        }
    }

    /// Sets the coefficients from the next sample on: `[a_1, ..., a_p]`, `[b_1, ..., b_q]`, and the gain.
    ///
    /// # Errors
    /// [`ArmaError`], keeping the old coefficients; only the lattice refuses unstable ones.
    pub fn set_coefficients(&mut self, ar: &[f64], ma: &[f64], gain: f64) -> Result<(), ArmaError> {
        match self {
            Self::Direct(filter) => filter.set_coefficients(ar, ma, gain),
            Self::Lattice(filter) => filter.set_coefficients(ar, ma, gain),
        }
    }

    /// Filters `excitation` into `out`, up to the shorter of the two.
    pub fn process(&mut self, excitation: &[f64], out: &mut [f64]) {
        match self {
            Self::Direct(filter) => filter.process(excitation, out),
            Self::Lattice(filter) => filter.process(excitation, out),
        }
    }
}

/// A filter whose state is checked for silence every [`SETTLE`] frames.
trait Settling {
    /// Largest number of frames of a run.
    const RUN: usize;

    /// Frames since the last check.
    fn since_settled(&mut self) -> &mut usize;

    /// Filters up to [`Self::RUN`] frames.
    fn run(&mut self, excitation: &[f64], out: &mut [f64]);

    /// Clears states that are silent, NaN or infinite.
    fn settle(&mut self);
}

/// Filters frames of `width` samples, up to the last whole one of the shorter slice, in runs that end at the checks.
#[inline(always)]
fn in_runs<F: Settling>(filter: &mut F, width: usize, excitation: &[f64], out: &mut [f64]) {
    let frames = excitation.len().min(out.len()) / width;
    let mut done = 0;
    while done < frames {
        let run = (frames - done).min(SETTLE - *filter.since_settled()).min(F::RUN);
        let part = done * width..(done + run) * width;
        filter.run(&excitation[part.clone()], &mut out[part]);
        done += run;
        *filter.since_settled() += run;
        if *filter.since_settled() == SETTLE {
            *filter.since_settled() = 0;
            filter.settle();
        }
    }
}

/// Refuses too many or non-finite coefficients.
fn check(ar: &[f64], ma: &[f64], gain: f64) -> Result<(), ArmaError> {
    let order = ar.len().max(ma.len());
    if order > MAX_ORDER {
        return Err(ArmaError::TooLong { order });
    }
    if are_finite(ar) && are_finite(ma) && gain.is_finite() {
        Ok(())
    } else {
        Err(PredictionError::NotFinite.into())
    }
}

/// True if this state is to be cleared: all of it silent, or some of it NaN or infinite.
fn is_over(inputs: &[f64], outputs: &[f64]) -> bool {
    let silent =
        |values: &[f64]| gather(values, |most, v| if v.abs() > most { v.abs() } else { most }) < SILENCE;
    // Mostly the last output alone shows that it is not silent.
    let sounds = outputs.last().is_some_and(|y| y.abs() >= SILENCE);
    !sounds && silent(outputs) && silent(inputs) || !(are_finite(inputs) && are_finite(outputs))
}

/// True if every value is finite.
fn are_finite(values: &[f64]) -> bool {
    // Nothing times those is nothing; times the others it is not a number.
    gather(values, |sum, v| sum + v * 0.0) == 0.0
}

/// Folds in lanes and from 0, for folds whose order does not matter.
fn gather(values: &[f64], fold: impl Fn(f64, f64) -> f64) -> f64 {
    let mut lanes = [0.0; 4];
    let (rows, rest) = values.as_chunks::<4>();
    for row in rows {
        for (lane, v) in lanes.iter_mut().zip(row) {
            *lane = fold(*lane, *v);
        }
    }
    lanes.iter().chain(rest).fold(0.0, |all, v| fold(all, *v))
}

#[cfg(test)]
mod tests;
