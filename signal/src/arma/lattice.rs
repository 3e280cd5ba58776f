//! The normalised lattice-ladder: bounded however its coefficients change.

use super::{ArmaError, MAX_ORDER, SETTLE, Settling, check, in_runs, is_over};
use crate::instructions::arch;
use crate::prediction::{PredictionError, ladder};
use pulp::{Arch, Simd, WithSimd};

/// The normalised lattice-ladder of Gray and Markel (1973, 1975).
///
/// Stage m turns the forward signal `f_m` and the delayed backward signal `g_{m-1}` by the angle whose sine is the
/// reflection coefficient `k_m`; the output is a sum of backward signals. Turning keeps energy, so the energy of the
/// state can only grow by what the excitation brings, whatever the stable coefficients do. For white excitation of
/// variance 1 every backward signal has variance 1 under every set of coefficients.
///
/// A sample has to pass all stages one by one, but stage m can take the next sample as soon as stage m - 1 has seen
/// this one. So all even stages run at once, then all odd ones, on as many samples under way as there are pairs of
/// stages.
#[derive(Debug, Clone)]
pub struct Lattice {
    coefficients: Coefficients,
    /// Backward signals `g_0` to `g_{order-1}` of the sample before; the others are 0, or of no meaning right at
    /// `order`.
    backward: [f64; MAX_ORDER + 1],
    since_settled: usize,
    arch: Arch,
}

/// Parameters of a lattice.
#[derive(Debug, Clone)]
pub(super) struct Coefficients {
    /// Number of stages.
    pub order: usize,
    /// The reflection coefficient `k_m` of each stage, from stage 1; beyond the order 0.
    pub sine: [f64; MAX_ORDER],
    /// `sqrt(1 - k_m^2)`; beyond the order 1.
    pub cosine: [f64; MAX_ORDER],
    /// Output taps on the backward signals 0 to order, the gain included.
    pub taps: [f64; MAX_ORDER + 1],
    /// True if any tap but the first is not 0.
    pub has_ladder: bool,
}

impl Coefficients {
    pub(super) const IDENTITY: Self = {
        let mut taps = [0.0; MAX_ORDER + 1];
        taps[0] = 1.0;
        Self { order: 0, sine: [0.0; MAX_ORDER], cosine: [1.0; MAX_ORDER], taps, has_ladder: false }
    };

    /// Computes the rotations from the polynomials; see [`Lattice::set_coefficients`].
    pub(super) fn new(ar: &[f64], ma: &[f64], gain: f64) -> Result<Self, ArmaError> {
        check(ar, ma, gain)?;
        let order = ar.len().max(ma.len());
        let mut this = Self { order, has_ladder: !ma.is_empty(), ..Self::IDENTITY };
        let mut scratch = [0.0; MAX_ORDER];
        let (sine, cosine) = (&mut this.sine[..order], &mut this.cosine[..order]);
        ladder(ar, ma, sine, cosine, &mut this.taps[..=order], &mut scratch[..order])?;
        for tap in &mut this.taps {
            *tap *= gain;
        }
        // A gain can be too much for a tap that was finite.
        if this.taps.iter().all(|tap| tap.is_finite()) {
            Ok(this)
        } else {
            Err(PredictionError::NotFinite.into())
        }
    }
}

impl Default for Lattice {
    fn default() -> Self {
        Self::new()
    }
}

impl Lattice {
    /// Makes a filter with zero state that passes its excitation.
    pub fn new() -> Self {
        Self {
            coefficients: Coefficients::IDENTITY,
            backward: [0.0; MAX_ORDER + 1],
            since_settled: 0,
            arch: arch(),
        }
    }

    /// Sets the coefficients from the next sample on: `[a_1, ..., a_p]`, `[b_1, ..., b_q]`, and the gain.
    ///
    /// # Errors
    /// [`ArmaError`] for too many, NaN, infinite or unstable coefficients; the old ones are then kept.
    pub(crate) fn set_coefficients(&mut self, ar: &[f64], ma: &[f64], gain: f64) -> Result<(), ArmaError> {
        let coefficients = Coefficients::new(ar, ma, gain)?;
        // Signals of stages that are gone, or were never there, must not come back with them.
        self.backward[coefficients.order.min(self.coefficients.order)..].fill(0.0);
        self.coefficients = coefficients;
        Ok(())
    }

    /// Filters `excitation` into `out`, up to the shorter of the two.
    pub fn process(&mut self, excitation: &[f64], out: &mut [f64]) {
        in_runs(self, 1, excitation, out);
    }

    /// Clears the state; keeps the coefficients.
    pub(crate) fn reset(&mut self) {
        self.backward.fill(0.0);
        self.since_settled = 0;
    }

    /// One sample through all stages.
    fn step(&mut self, e: f64) -> f64 {
        let Coefficients { order, sine, cosine, taps, .. } = &self.coefficients;
        let mut forward = e;
        let mut out = 0.0;
        for m in (0..*order).rev() {
            let delayed = self.backward[m];
            let backward = sine[m] * forward + cosine[m] * delayed;
            forward = cosine[m] * forward - sine[m] * delayed;
            out += taps[m + 1] * backward;
            self.backward[m + 1] = backward;
        }
        self.backward[0] = forward;
        out + taps[0] * forward
    }
}

impl Settling for Lattice {
    const RUN: usize = SETTLE;

    fn since_settled(&mut self) -> &mut usize {
        &mut self.since_settled
    }

    #[inline(always)]
    fn run(&mut self, excitation: &[f64], out: &mut [f64]) {
        if out.len() < self.coefficients.order / 2 {
            // Too short to fill the stages.
            for (e, out) in excitation.iter().zip(out) {
                *out = self.step(*e);
            }
        } else {
            self.arch.dispatch(Run { lattice: self, excitation, out });
        }
    }

    fn settle(&mut self) {
        if is_over(&[], &self.backward[..self.coefficients.order]) {
            self.reset();
        }
    }
}

/// Filters up to [`SETTLE`] samples, all stages at once.
struct Run<'a> {
    lattice: &'a mut Lattice,
    excitation: &'a [f64],
    out: &'a mut [f64],
}

impl WithSimd for Run<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        match (self.lattice.coefficients.order, self.lattice.coefficients.has_ladder) {
            (0..=16, false) => Wavefront::<8, false>::new(self.lattice).run(self),
            (0..=16, true) => Wavefront::<8, true>::new(self.lattice).run(self),
            (_, false) => Wavefront::<16, false>::new(self.lattice).run(self),
            (_, true) => Wavefront::<16, true>::new(self.lattice).run(self),
        }
    }
}

/// Stages 2i + 2 and 2i + 1 in lane i. A sample enters in the lane of the highest stages and moves down one lane a
/// tick.
struct Wavefront<const PAIRS: usize, const LADDER: bool> {
    upper: Stages<PAIRS>,
    lower: Stages<PAIRS>,
    first_tap: f64,
    /// The lane in which samples enter.
    entry: usize,
    /// Forward signals and partial outputs on their way to the next lane.
    forward: [f64; PAIRS],
    out: [f64; PAIRS],
    /// Backward signals 2i + 2 and 2i + 1 of the last sample that passed.
    upper_backward: [f64; PAIRS],
    lower_backward: [f64; PAIRS],
}

struct Stages<const PAIRS: usize> {
    sine: [f64; PAIRS],
    cosine: [f64; PAIRS],
    tap: [f64; PAIRS],
}

impl<const PAIRS: usize> Stages<PAIRS> {
    /// Stages `first`, `first + 2`, ...
    #[inline(always)]
    fn new(c: &Coefficients, first: usize) -> Self {
        Self {
            sine: std::array::from_fn(|i| c.sine[2 * i + first - 1]),
            cosine: std::array::from_fn(|i| c.cosine[2 * i + first - 1]),
            tap: std::array::from_fn(|i| c.taps[2 * i + first]),
        }
    }
}

impl<const PAIRS: usize, const LADDER: bool> Wavefront<PAIRS, LADDER> {
    #[inline(always)]
    fn new(lattice: &Lattice) -> Self {
        let c = &lattice.coefficients;
        Self {
            upper: Stages::new(c, 2),
            lower: Stages::new(c, 1),
            first_tap: c.taps[0],
            entry: c.order.div_ceil(2).max(1) - 1,
            forward: [0.0; PAIRS],
            out: [0.0; PAIRS],
            upper_backward: std::array::from_fn(|i| lattice.backward[2 * i + 2]),
            lower_backward: std::array::from_fn(|i| lattice.backward[2 * i + 1]),
        }
    }

    #[inline(always)]
    fn run(mut self, run: Run<'_>) {
        let Run { lattice, excitation, out } = run;
        let entry = self.entry;
        let count = excitation.len();
        self.forward[0] = lattice.backward[0];
        // Lane i sees sample n at tick n + entry - i. While the first sample has not reached it, and after the last has
        // left it, it must keep what it has.
        let (first, rest) = excitation.split_at(entry);
        for (tick, e) in first.iter().enumerate() {
            self.tick(*e, |i| i + tick >= entry);
        }
        for (e, out) in rest.iter().zip(&mut *out) {
            self.tick(*e, |_| true);
            *out = self.output();
        }
        for tick in count..count + entry {
            self.tick(0.0, |i| i + tick < count + entry);
            out[tick - entry] = self.output();
        }
        lattice.backward[0] = self.forward[0];
        for i in 0..PAIRS {
            lattice.backward[2 * i + 1] = self.lower_backward[i];
            lattice.backward[2 * i + 2] = self.upper_backward[i];
        }
    }

    /// Output of the lowest stage.
    #[inline(always)]
    fn output(&self) -> f64 {
        self.out[0] + self.first_tap * self.forward[0]
    }

    /// Moves every sample under way through the two stages of a lane; `active` lanes change their state.
    #[inline(always)]
    fn tick(&mut self, e: f64, active: impl Fn(usize) -> bool) {
        let before = self.forward[0];
        let (mut forward, mut out) = (self.forward, self.out);
        for i in 0..PAIRS {
            let (from_above, sum_above) =
                if i + 1 < PAIRS { (self.forward[i + 1], self.out[i + 1]) } else { (0.0, 0.0) };
            forward[i] = if i == self.entry { e } else { from_above };
            out[i] = if i == self.entry { 0.0 } else { sum_above };
        }
        let (upper, lower) = (&self.upper, &self.lower);
        let mut upper_backward = [0.0; PAIRS];
        for i in 0..PAIRS {
            let delayed = self.lower_backward[i];
            let backward = upper.sine[i] * forward[i] + upper.cosine[i] * delayed;
            forward[i] = upper.cosine[i] * forward[i] - upper.sine[i] * delayed;
            if LADDER {
                out[i] += upper.tap[i] * backward;
            }
            upper_backward[i] = if active(i) { backward } else { self.upper_backward[i] };
        }
        for i in 0..PAIRS {
            let delayed = if i == 0 { before } else { upper_backward[i - 1] };
            let backward = lower.sine[i] * forward[i] + lower.cosine[i] * delayed;
            forward[i] = lower.cosine[i] * forward[i] - lower.sine[i] * delayed;
            if LADDER {
                out[i] += lower.tap[i] * backward;
            }
            self.lower_backward[i] = if active(i) { backward } else { self.lower_backward[i] };
        }
        // The last output is a state too.
        forward[0] = if active(0) { forward[0] } else { before };
        (self.forward, self.out, self.upper_backward) = (forward, out, upper_backward);
    }
}
