//! Lattices in lanes.

use super::{Frames, Group};
use crate::arma::lattice::Coefficients;
use crate::arma::{ArmaError, MAX_ORDER, is_over};

/// Voices in a group: two of the widest vectors, because one cannot hide the wait from stage to stage.
const LANES: usize = 16;

type Lanes = [f64; LANES];

/// As many [`Lattice`](crate::arma::Lattice)s as there are lanes.
#[derive(Debug, Clone)]
pub(super) struct LatticeGroup {
    /// From stage 1; missing stages turn by 0 and change nothing.
    sine: [Lanes; MAX_ORDER],
    cosine: [Lanes; MAX_ORDER],
    taps: [Lanes; MAX_ORDER + 1],
    order: [usize; LANES],
    has_ladder: [bool; LANES],
    backward: [Lanes; MAX_ORDER + 1],
}

impl Group for LatticeGroup {
    const LANES: usize = LANES;

    fn new() -> Self {
        let mut taps = [[0.0; LANES]; MAX_ORDER + 1];
        taps[0] = [1.0; LANES];
        Self {
            sine: [[0.0; LANES]; MAX_ORDER],
            cosine: [[1.0; LANES]; MAX_ORDER],
            taps,
            order: [0; LANES],
            has_ladder: [false; LANES],
            backward: [[0.0; LANES]; MAX_ORDER + 1],
        }
    }

    #[inline(always)]
    fn run(&mut self, frames: Frames<'_>) {
        if self.has_ladder.contains(&true) {
            self.run_with::<true>(frames);
        } else {
            self.run_with::<false>(frames);
        }
    }

    fn settle(&mut self) {
        for lane in 0..LANES {
            let column: [f64; MAX_ORDER] = std::array::from_fn(|m| self.backward[m][lane]);
            if is_over(&[], &column[..self.order[lane]]) {
                for row in &mut self.backward {
                    row[lane] = 0.0;
                }
            }
        }
    }

    fn reset(&mut self) {
        self.backward.fill([0.0; LANES]);
    }
}

impl LatticeGroup {
    /// See [`VoiceBank::set_coefficients`](super::VoiceBank::set_coefficients).
    pub fn set_coefficients(
        &mut self,
        lane: usize,
        ar: &[f64],
        ma: &[f64],
        gain: f64,
    ) -> Result<(), ArmaError> {
        let coefficients = Coefficients::new(ar, ma, gain)?;
        let old = self.order[lane];
        let order = coefficients.order;
        for m in 0..order.max(old) {
            self.sine[m][lane] = coefficients.sine[m];
            self.cosine[m][lane] = coefficients.cosine[m];
        }
        for m in 0..=order.max(old) {
            self.taps[m][lane] = coefficients.taps[m];
        }
        for row in &mut self.backward[order.min(old)..] {
            row[lane] = 0.0;
        }
        (self.order[lane], self.has_ladder[lane]) = (order, coefficients.has_ladder);
        Ok(())
    }

    #[inline(always)]
    fn run_with<const LADDER: bool>(&mut self, mut frames: Frames<'_>) {
        let order = self.order.into_iter().fold(0, usize::max).min(MAX_ORDER);
        for n in 0..frames.count() {
            let mut forward: Lanes = frames.excitation(n);
            let mut out = [0.0; LANES];
            for m in (0..order).rev() {
                let (sine, cosine, tap) = (&self.sine[m], &self.cosine[m], &self.taps[m + 1]);
                let delayed = self.backward[m];
                let mut backward = [0.0; LANES];
                for l in 0..LANES {
                    backward[l] = sine[l] * forward[l] + cosine[l] * delayed[l];
                    forward[l] = cosine[l] * forward[l] - sine[l] * delayed[l];
                    if LADDER {
                        out[l] += tap[l] * backward[l];
                    }
                }
                self.backward[m + 1] = backward;
            }
            self.backward[0] = forward;
            for l in 0..LANES {
                out[l] += self.taps[0][l] * forward[l];
            }
            frames.put(n, &out);
        }
    }
}
