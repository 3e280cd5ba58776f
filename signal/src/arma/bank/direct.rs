//! Direct forms in lanes.

use super::{Frames, Group, RUN};
use crate::arma::{ArmaError, MAX_ORDER, check, is_over};
use pulp::Simd;

/// Voices in a group.
const LANES: usize = 8;
/// Frames computed together, so that a coefficient is fetched once for all of them.
const TILE: usize = 4;

type Lanes = [f64; LANES];

/// As many [`DirectForm`](crate::arma::DirectForm)s as there are lanes, each with its own order of summation.
#[derive(Debug, Clone)]
pub(super) struct DirectGroup {
    /// `a_k` at index k; missing ones are 0 and change nothing.
    ar: [Lanes; MAX_ORDER + 1],
    /// `b_k` at index k.
    ma: [Lanes; MAX_ORDER + 1],
    gain: Lanes,
    p: [usize; LANES],
    q: [usize; LANES],
    /// The last inputs, then those of a run.
    e: [Lanes; MAX_ORDER + RUN],
    /// Outputs likewise.
    y: [Lanes; MAX_ORDER + RUN],
}

impl Group for DirectGroup {
    const LANES: usize = LANES;

    fn new() -> Self {
        Self {
            ar: [[0.0; LANES]; MAX_ORDER + 1],
            ma: [[0.0; LANES]; MAX_ORDER + 1],
            gain: [1.0; LANES],
            p: [0; LANES],
            q: [0; LANES],
            e: [[0.0; LANES]; MAX_ORDER + RUN],
            y: [[0.0; LANES]; MAX_ORDER + RUN],
        }
    }

    #[inline(always)]
    fn run<S: Simd>(&mut self, _: S, mut frames: Frames<'_>) {
        let count = frames.count();
        let p = self.p.into_iter().fold(0, usize::max);
        let q = self.q.into_iter().fold(0, usize::max);
        for n in 0..count {
            self.e[MAX_ORDER + n] = frames.excitation(n);
        }
        let whole = count / TILE * TILE;
        for n in (0..whole).step_by(TILE) {
            self.tile::<TILE>(MAX_ORDER + n, p, q);
        }
        for n in whole..count {
            self.tile::<1>(MAX_ORDER + n, p, q);
        }
        for n in 0..count {
            frames.put(n, &self.y[MAX_ORDER + n]);
        }
        self.e.copy_within(count..count + MAX_ORDER, 0);
        self.y.copy_within(count..count + MAX_ORDER, 0);
    }

    fn settle(&mut self) {
        for lane in 0..LANES {
            let column = |rows: &[Lanes]| -> [f64; MAX_ORDER] { std::array::from_fn(|i| rows[i][lane]) };
            if is_over(&column(&self.e), &column(&self.y)) {
                for row in self.e.iter_mut().chain(&mut self.y) {
                    row[lane] = 0.0;
                }
            }
        }
    }
}

/// Puts new coefficients in the place of `old` ones in a lane.
fn replace(rows: &mut [Lanes], lane: usize, old: usize, new: &[f64]) {
    for (row, value) in rows.iter_mut().zip(new) {
        row[lane] = *value;
    }
    for row in rows.iter_mut().take(old).skip(new.len()) {
        row[lane] = 0.0;
    }
}

#[expect(clippy::needless_range_loop, reason = "constant indices keep the sums in registers")]
impl DirectGroup {
    /// See [`VoiceBank::set_coefficients`](super::VoiceBank::set_coefficients).
    pub(super) fn set_coefficients(
        &mut self,
        lane: usize,
        ar: &[f64],
        ma: &[f64],
        gain: f64,
    ) -> Result<(), ArmaError> {
        check(ar, ma, gain)?;
        replace(&mut self.ar[1..], lane, self.p[lane], ar);
        replace(&mut self.ma[1..], lane, self.q[lane], ma);
        (self.p[lane], self.q[lane], self.gain[lane]) = (ar.len(), ma.len(), gain);
        Ok(())
    }

    /// The outputs from `now` on.
    #[inline(always)]
    fn tile<const FRAMES: usize>(&mut self, now: usize, p: usize, q: usize) {
        let w = self.moving_average::<FRAMES>(now, q);
        let mut sums = [[0.0; LANES]; FRAMES];
        for k in (FRAMES.max(2)..=p).rev() {
            let (a, past) = (&self.ar[k], &self.y[now - k..now - k + FRAMES]);
            for n in 0..FRAMES {
                sums[n] = less(sums[n], a, &past[n]);
            }
        }
        let near: [Lanes; FRAMES] = std::array::from_fn(|k| self.ar[k]);
        for k in (2..FRAMES).rev() {
            for n in 0..k {
                sums[n] = less(sums[n], &near[k], &self.y[now + n - k]);
            }
        }
        let mut newest = self.y[now - 1];
        for n in 0..FRAMES {
            for l in 0..LANES {
                newest[l] = (sums[n][l] + w[n][l]) - self.ar[1][l] * newest[l];
            }
            self.y[now + n] = newest;
            for later in n + 2..FRAMES {
                sums[later] = less(sums[later], &near[later - n], &newest);
            }
        }
    }

    /// Contribution of the inputs: `w = gain (e + sum b_k e[n-k])`.
    #[inline(always)]
    fn moving_average<const FRAMES: usize>(&self, now: usize, q: usize) -> [Lanes; FRAMES] {
        let mut w = [[0.0; LANES]; FRAMES];
        for k in (1..=q).rev() {
            let (b, past) = (&self.ma[k], &self.e[now - k..now - k + FRAMES]);
            for n in 0..FRAMES {
                for l in 0..LANES {
                    w[n][l] += b[l] * past[n][l];
                }
            }
        }
        for n in 0..FRAMES {
            for l in 0..LANES {
                w[n][l] = self.gain[l] * (w[n][l] + self.e[now + n][l]);
            }
        }
        w
    }
}

/// `sums` less `a` times `y`, lane by lane.
#[inline(always)]
fn less(mut sums: Lanes, a: &Lanes, y: &Lanes) -> Lanes {
    for l in 0..LANES {
        sums[l] -= a[l] * y[l];
    }
    sums
}
