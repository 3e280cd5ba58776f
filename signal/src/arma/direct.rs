//! The direct form of the thesis.

use super::{ArmaError, MAX_ORDER, Settling, check, in_runs, is_over};
use crate::instructions::arch;
use pulp::{Arch, Simd, WithSimd};

/// Outputs computed together.
const LANES: usize = 8;
/// Vectors of outputs that the last [`LANES`] outputs and the coefficients reach.
const REACH: usize = MAX_ORDER / LANES + 1;
/// Samples filtered at a time.
const RUN: usize = 64;
/// Samples kept before the past has to be moved back to the front.
const ROOM: usize = 4 * RUN + LANES;

type Sums = [[f64; LANES]; REACH];

/// `y[n] = gain (e[n] + sum b_k e[n-k]) - sum a_k y[n-k]`; new coefficients keep the past inputs and outputs.
///
/// Sums run from the oldest term to the newest, the input joining before the newest output:
/// `y[n] = ((-a_p y[n-p] - ... - a_2 y[n-2]) + w[n]) - a_1 y[n-1]`. No multiplication is fused.
///
/// Inside, each output is added to the sums of all later ones as soon as it is known. That keeps the order, and leaves
/// one multiplication and one subtraction between an output and the next.
#[derive(Debug, Clone)]
pub struct DirectForm {
    /// `a_k` at index `LANES + k` for k from 2 to p, 0 elsewhere, with room for what lies beyond p.
    ar: [f64; 2 * LANES * REACH],
    /// `a_1`.
    nearest: f64,
    /// `b_k` at index k - 1.
    ma: [f64; MAX_ORDER],
    p: usize,
    q: usize,
    gain: f64,
    /// Sums of the outputs to come, except for what the newest output brings to the first.
    sums: Sums,
    /// The sums belong to coefficients that have been replaced.
    stale: bool,
    /// Newest outputs that the sums have not been moved past; fewer than [`LANES`].
    owed: usize,
    /// Inputs, the last of them before `now`.
    e: [f64; MAX_ORDER + ROOM],
    /// Outputs likewise.
    y: [f64; MAX_ORDER + ROOM],
    now: usize,
    since_settled: usize,
    arch: Arch,
}

impl Default for DirectForm {
    fn default() -> Self {
        Self::new()
    }
}

impl Settling for DirectForm {
    const RUN: usize = RUN;

    fn since_settled(&mut self) -> &mut usize {
        &mut self.since_settled
    }

    #[inline(always)]
    fn run(&mut self, excitation: &[f64], out: &mut [f64]) {
        self.arch.dispatch(Run { filter: self, excitation, out });
    }

    fn settle(&mut self) {
        let past = self.now - MAX_ORDER..self.now;
        if is_over(&self.e[past.clone()], &self.y[past]) {
            self.reset();
        }
    }
}

#[expect(clippy::needless_range_loop, reason = "constant indices keep the sums in registers")]
impl DirectForm {
    /// Makes a filter with zero state that passes its excitation.
    pub fn new() -> Self {
        Self {
            ar: [0.0; 2 * LANES * REACH],
            nearest: 0.0,
            ma: [0.0; MAX_ORDER],
            p: 0,
            q: 0,
            gain: 1.0,
            sums: [[0.0; LANES]; REACH],
            stale: false,
            owed: 0,
            e: [0.0; MAX_ORDER + ROOM],
            y: [0.0; MAX_ORDER + ROOM],
            now: MAX_ORDER,
            since_settled: 0,
            arch: arch(),
        }
    }

    /// Sets the coefficients from the next sample on: `[a_1, ..., a_p]`, `[b_1, ..., b_q]`, and the gain.
    ///
    /// # Errors
    /// [`ArmaError`] for too many, NaN or infinite coefficients; the old ones are then kept. Unstable ones are
    /// accepted.
    pub(crate) fn set_coefficients(&mut self, ar: &[f64], ma: &[f64], gain: f64) -> Result<(), ArmaError> {
        check(ar, ma, gain)?;
        let (nearest, farther) = ar.split_first().unwrap_or((&0.0, &[]));
        self.nearest = *nearest;
        // Loops, as a call to copy a handful of numbers costs more than copying them.
        for (kept, a) in self.ar[LANES + 2..].iter_mut().zip(farther) {
            *kept = *a;
        }
        for gone in self.ar[LANES + 2..].iter_mut().take(self.p).skip(farther.len()) {
            *gone = 0.0;
        }
        for (kept, b) in self.ma.iter_mut().zip(ma) {
            *kept = *b;
        }
        (self.p, self.q, self.gain) = (ar.len(), ma.len(), gain);
        self.stale = true;
        Ok(())
    }

    /// Filters `excitation` into `out`, up to the shorter of the two.
    pub fn process(&mut self, excitation: &[f64], out: &mut [f64]) {
        in_runs(self, 1, excitation, out);
    }

    /// Clears the state; keeps the coefficients.
    pub(crate) fn reset(&mut self) {
        self.e.fill(0.0);
        self.y.fill(0.0);
        self.sums = [[0.0; LANES]; REACH];
        (self.now, self.since_settled, self.owed) = (MAX_ORDER, 0, 0);
    }

    /// Contribution of the moving average to the outputs: `w = gain (e + sum b_k e[n-k])`.
    #[inline(always)]
    fn moving_average(&self, excitation: &[f64]) -> [[f64; LANES]; RUN / LANES] {
        let mut w = [[0.0; LANES]; RUN / LANES];
        let starts = (self.now..self.now + excitation.len()).step_by(LANES);
        for (w, start) in w.iter_mut().zip(starts) {
            let delayed = self.e[start - self.q..start + LANES - 1].windows(LANES);
            for (e, b) in delayed.zip(self.ma[..self.q].iter().rev()) {
                for l in 0..LANES {
                    w[l] += b * e[l];
                }
            }
        }
        for (w, e) in w.as_flattened_mut().iter_mut().zip(excitation) {
            *w = self.gain * (*w + e);
        }
        w
    }

    /// The sums of the outputs to come, from the past and the coefficients.
    #[inline(always)]
    fn sum_again<const REACHED: usize>(&self) -> Sums {
        let mut sums = [[0.0; LANES]; REACH];
        // The farther back, the fewer of the outputs to come are reached.
        if REACHED == 3 {
            self.add_past::<1>(&mut sums, 2 * LANES);
            self.add_past::<2>(&mut sums, LANES);
            self.add_past::<3>(&mut sums, 0);
        } else {
            self.add_past::<1>(&mut sums, 3 * LANES);
            self.add_past::<2>(&mut sums, 2 * LANES);
            self.add_past::<3>(&mut sums, LANES);
            self.add_past::<4>(&mut sums, 0);
        }
        sums
    }

    /// Adds what the [`LANES`] outputs before the `nearer` last ones bring to the first `REACHED` vectors of sums.
    #[inline(always)]
    fn add_past<const REACHED: usize>(&self, sums: &mut Sums, nearer: usize) {
        for back in (nearer + 1..=self.p.min(nearer + LANES)).rev() {
            let y = self.y[self.now - back];
            let a = &self.ar[LANES + back..LANES + back + REACHED * LANES];
            for reach in 0..REACHED {
                for l in 0..LANES {
                    sums[reach][l] -= a[reach * LANES + l] * y;
                }
            }
        }
    }

    /// Turns inputs into outputs; `REACHED` is how many vectors of sums behind the present one the coefficients reach.
    #[inline(always)]
    fn recurse<const REACHED: usize>(&mut self, excitation: &[f64], out: &mut [f64]) {
        let mut sums = match (self.stale, self.owed) {
            (true, _) => self.sum_again::<REACHED>(),
            (false, 0) => self.sums,
            (false, owed) => self.moved_past::<REACHED>(owed),
        };
        self.stale = false;
        let now = self.now..self.now + out.len();
        let averages = if self.q > 0 {
            self.e[now.clone()].copy_from_slice(excitation);
            Some(self.moving_average(excitation))
        } else {
            None
        };
        let gain = self.gain;
        let w = |at: usize, e: &[f64; LANES]| match &averages {
            Some(averages) => averages[at % averages.len()],
            None => e.map(|e| gain * e),
        };
        let near: [f64; LANES] = std::array::from_fn(|k| match k {
            1 => self.nearest,
            _ => self.ar[LANES + k],
        });
        let mut newest = self.y[self.now - 1];
        let mut first = [sums[0][0], sums[0][1]];
        let (inputs, last_inputs) = excitation.as_chunks::<LANES>();
        let (outputs, last_outputs) = out.as_chunks_mut::<LANES>();
        let (e_kept, last_e) = self.e[now.clone()].as_chunks_mut::<LANES>();
        let (y_kept, last_y) = self.y[now.clone()].as_chunks_mut::<LANES>();
        let whole = inputs.len();
        let kept = e_kept.iter_mut().zip(y_kept);
        for (at, ((e, out), (e_kept, y_kept))) in inputs.iter().zip(outputs).zip(kept).enumerate() {
            let y = next(LANES, &near, newest, first, &sums[0], &w(at, e));
            for (older, newer) in y.iter().enumerate() {
                // The two outputs that follow wait for the two newest ones: those go to them past the vectors.
                if older >= LANES - 2 {
                    let l = older - (LANES - 2);
                    first[l] = sums[1][l] - near[2] * newer;
                }
                for reach in 1..=REACHED {
                    sums[reach] = passed_on(&self.ar, older, *newer, reach, sums[reach]);
                }
            }
            for reach in 0..REACHED {
                sums[reach] = sums[reach + 1];
            }
            sums[REACHED] = [0.0; LANES];
            newest = y[LANES - 1];
            (*out, *y_kept, *e_kept) = (y, y, *e);
        }
        self.sums = sums;
        self.owed = last_outputs.len();
        if !last_outputs.is_empty() {
            let e = std::array::from_fn(|l| last_inputs.get(l).copied().unwrap_or(0.0));
            let y = next(self.owed, &near, newest, first, &sums[0], &w(whole, &e));
            for (l, out) in last_outputs.iter_mut().enumerate().take(LANES) {
                (*out, last_y[l], last_e[l]) = (y[l], y[l], e[l]);
            }
        }
        self.now = now.end;
    }

    /// The sums moved on past the newest outputs, fewer than [`LANES`].
    #[inline(always)]
    fn moved_past<const REACHED: usize>(&self, outputs: usize) -> Sums {
        let mut sums = self.sums;
        for (older, y) in self.y[self.now - outputs..self.now].iter().enumerate() {
            for reach in 0..=REACHED {
                sums[reach] = passed_on(&self.ar, older, *y, reach, sums[reach]);
            }
        }
        let mut flat = [0.0; LANES * (REACH + 1)];
        flat[..LANES * REACH].copy_from_slice(sums.as_flattened());
        let mut moved = [[0.0; LANES]; REACH];
        moved.as_flattened_mut().copy_from_slice(&flat[outputs..outputs + LANES * REACH]);
        moved
    }
}

/// The next `count` outputs, from their sums (the first two apart) and what the inputs bring; `a_k` is `near[k]`.
#[inline(always)]
fn next(
    count: usize,
    near: &[f64; LANES],
    mut newest: f64,
    first: [f64; 2],
    sums: &[f64; LANES],
    w: &[f64; LANES],
) -> [f64; LANES] {
    let mut y = [0.0; LANES];
    for l in 0..LANES.min(count) {
        let mut sum = if l < 2 { first[l] } else { sums[l] };
        for older in 0..l.max(1) - 1 {
            sum -= near[l - older] * y[older];
        }
        newest = (sum + w[l]) - near[1] * newest;
        y[l] = newest;
    }
    y
}

/// The sums `reach` vectors on, with what output `older` of the present vector brings to them.
#[inline(always)]
fn passed_on(
    ar: &[f64; 2 * LANES * REACH],
    older: usize,
    y: f64,
    reach: usize,
    mut sums: [f64; LANES],
) -> [f64; LANES] {
    let first = LANES * (reach + 1) - older;
    let a = &ar[first..first + LANES];
    for l in 0..LANES {
        sums[l] -= a[l] * y;
    }
    sums
}

/// Filters up to [`RUN`] samples.
struct Run<'a> {
    filter: &'a mut DirectForm,
    excitation: &'a [f64],
    out: &'a mut [f64],
}

impl WithSimd for Run<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self { filter, excitation, out } = self;
        if filter.now + excitation.len() + LANES > MAX_ORDER + ROOM {
            filter.e.copy_within(filter.now - MAX_ORDER..filter.now, 0);
            filter.y.copy_within(filter.now - MAX_ORDER..filter.now, 0);
            filter.now = MAX_ORDER;
        }
        match filter.p {
            0..=24 => filter.recurse::<3>(excitation, out),
            _ => filter.recurse::<4>(excitation, out),
        }
    }
}
