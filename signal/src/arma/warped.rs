//! The warped normalised lattice: an all-pole filter over all-pass sections, bounded however its coefficients change.

mod step;

use super::{ArmaError, SETTLE, Settling, are_finite, in_runs, is_over};
use crate::elementwise::mul_add;
use crate::instructions::arch;
use pulp::{Arch, Simd, WithSimd};
pub(super) use step::Stages;
use step::{ROWS, SUMS, Step};

/// `gain / A(D(z))` with `D` the all-pass of [`crate::warped`], as a normalised lattice.
///
/// The delays of the normalised lattice ([`super::Lattice`]) become all-pass sections, each a rotation of its state
/// and its input by the angle whose sine is `sqrt(1 - l^2)`; the loops without delay that this makes are solved stage
/// by stage (`1 - k l alpha >= 1 - l > 0`). A step from (states, excitation) to (states, last backward signal) is
/// then orthogonal **whatever the coefficients**: the energy of the states grows by no more than the excitation's,
/// however the sets follow one another, and for white excitation of variance 1 the output stays within
/// `(1 + l) / (1 - l)` of the variance that the gain gives it. Expanding `A(D)` to a polynomial in z would need more
/// than double precision.
///
/// Because a set lasts for tens of samples, the step is written out as a matrix when the set is taken (a column a
/// state), and a sample is one product of matrix and vector: no chain from stage to stage. Its multiplications are
/// fused with the additions, which doubles what a processor does at a time and is exact on all of them: one that
/// cannot (x86-64 before 2013) works them out in software, some twenty times slower.
#[derive(Debug, Clone)]
pub struct WarpedLattice {
    step: Box<Step>,
    state: [f64; ROWS],
    since_settled: usize,
    arch: Arch,
}

impl Default for WarpedLattice {
    fn default() -> Self {
        Self::new()
    }
}

impl WarpedLattice {
    /// Makes a silent filter without coefficients.
    pub fn new() -> Self {
        Self { step: Box::new(Step::SILENT), state: [0.0; ROWS], since_settled: 0, arch: arch() }
    }

    /// Sets the coefficients from the next sample on: the warped polynomial `[a_1, ..., a_p]`, the warping factor in
    /// 0..=[`MAX_WARPING`](crate::warped::MAX_WARPING), and the gain. Does not allocate.
    ///
    /// # Errors
    /// [`ArmaError`] for no coefficients, too many, NaN, infinite or unstable ones, or a factor out of range; the old
    /// ones are then kept.
    pub fn set_coefficients(&mut self, ar: &[f64], warping: f64, gain: f64) -> Result<(), ArmaError> {
        let before = self.step.order;
        let stages = Stages::new(self.arch, ar, warping, gain)?;
        self.step.set(self.arch, &stages);
        // Signals of stages that are gone, or were never there, must not come back with them.
        self.state[before.min(ar.len())..].fill(0.0);
        Ok(())
    }

    /// Filters `excitation` into `out`, up to the shorter of the two.
    pub fn process(&mut self, excitation: &[f64], out: &mut [f64]) {
        in_runs(self, 1, excitation, out);
    }

    /// Copies the coefficients and the state of another filter. Does not allocate.
    pub fn copy_state_from(&mut self, other: &Self) {
        self.step.clone_from(&other.step);
        (self.state, self.since_settled) = (other.state, other.since_settled);
    }
}

impl Settling for WarpedLattice {
    const RUN: usize = SETTLE;

    fn since_settled(&mut self) -> &mut usize {
        &mut self.since_settled
    }

    #[inline(always)]
    fn run(&mut self, excitation: &[f64], out: &mut [f64]) {
        self.arch.dispatch(Run { step: &self.step, state: &mut self.state, excitation, out });
    }

    fn settle(&mut self) {
        if is_over(&[], &self.state[..self.step.order]) || !are_finite(&self.state) {
            self.state.fill(0.0);
        }
    }
}

/// Filters up to [`SETTLE`] samples.
struct Run<'a> {
    step: &'a Step,
    state: &'a mut [f64; ROWS],
    excitation: &'a [f64],
    out: &'a mut [f64],
}

impl WithSimd for Run<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        match self.step.order {
            0..=16 => self.run::<16>(),
            17..=24 => self.run::<24>(),
            _ => self.run::<32>(),
        }
    }
}

impl Run<'_> {
    #[inline(always)]
    fn run<const PADDED: usize>(self) {
        let step = self.step;
        let mut state = [0.0; PADDED];
        state.copy_from_slice(&self.state[..PADDED]);
        let columns = step.columns[..step.order.next_multiple_of(SUMS)].as_chunks::<SUMS>().0;
        for (e, out) in self.excitation.iter().zip(self.out) {
            let mut even: [f64; PADDED] = std::array::from_fn(|i| step.drive[i] * e);
            let mut odd = [0.0; PADDED];
            for ([left, right], x) in columns.iter().zip(state.as_chunks::<SUMS>().0) {
                for i in 0..PADDED {
                    even[i] = mul_add(left[i], x[0], even[i]);
                    odd[i] = mul_add(right[i], x[1], odd[i]);
                }
            }
            let first = state[0];
            for i in 0..PADDED {
                state[i] = even[i] + odd[i];
            }
            *out = (state[0] - step.warping * first) * step.out_scale;
        }
        self.state[..PADDED].copy_from_slice(&state);
    }
}

#[cfg(test)]
mod tests;
