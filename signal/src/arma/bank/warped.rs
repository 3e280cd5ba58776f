//! Warped lattices in lanes.

mod solve;

use super::{Frames, Group};
use crate::arma::warped::Stages;
use crate::arma::{ArmaError, MAX_ORDER, are_finite, is_over, mul_add};
use crate::warped::first_error;
use pulp::Arch;
use solve::SetAll;

/// Voices in a group: two of the widest vectors, as every stage waits for its neighbour.
const LANES: usize = 16;

type Lanes = [f64; LANES];

/// A signal of each stage, on whole cache lines.
#[repr(align(64))]
struct Signals([Lanes; MAX_ORDER]);

/// As many [`WarpedLattice`](crate::arma::WarpedLattice)s as there are lanes, stage by stage: the lanes fill the time that one voice
/// would wait, and nothing but the stages has to be kept.
///
/// The formulas are those of the step's matrix; states are kept times `s`.
#[derive(Debug, Clone)]
#[repr(C, align(64))]
pub(super) struct WarpedGroup {
    pass: [Lanes; MAX_ORDER],
    /// `-l` times `pass`: what a stage's `beta` takes from the one below.
    carried: [Lanes; MAX_ORDER],
    turned: [Lanes; MAX_ORDER],
    /// `s^2 alpha_{m-1}`.
    share: [Lanes; MAX_ORDER],
    warping: Lanes,
    /// `s^2`.
    turn: Lanes,
    out_scale: Lanes,
    order: [usize; LANES],
    state: [Lanes; MAX_ORDER],
    arch: Arch,
}

impl Group for WarpedGroup {
    const LANES: usize = LANES;

    fn new() -> Self {
        Self {
            pass: [[1.0; LANES]; MAX_ORDER],
            carried: [[0.0; LANES]; MAX_ORDER],
            turned: [[0.0; LANES]; MAX_ORDER],
            share: [[0.0; LANES]; MAX_ORDER],
            warping: [0.0; LANES],
            turn: [1.0; LANES],
            out_scale: [0.0; LANES],
            order: [0; LANES],
            state: [[0.0; LANES]; MAX_ORDER],
            arch: Arch::new(),
        }
    }

    #[inline(always)]
    fn run(&mut self, mut frames: Frames<'_>) {
        let order = self.order.into_iter().fold(0, usize::max).min(MAX_ORDER);
        let (warping, turn) = (self.warping, self.turn);
        let mut entering = Signals([[0.0; LANES]; MAX_ORDER]);
        for n in 0..frames.count() {
            let mut beta = [0.0_f64; LANES];
            for m in 0..order {
                for l in 0..LANES {
                    let (x, below) = (self.state[m][l], beta[l]);
                    entering.0[m][l] = self.turned[m][l] * mul_add(-warping[l], below, x);
                    self.state[m][l] = mul_add(turn[l], below, warping[l] * x);
                    beta[l] = mul_add(self.carried[m][l], below, self.pass[m][l] * x);
                }
            }
            let mut forward: Lanes = frames.excitation(n);
            for m in (0..order).rev() {
                let (pass, share, entering) = (&self.pass[m], &self.share[m], &entering.0[m]);
                let state = &mut self.state[m];
                for l in 0..LANES {
                    forward[l] = mul_add(pass[l], forward[l], entering[l]);
                    state[l] = mul_add(share[l], forward[l], state[l]);
                }
            }
            for (out, scale) in forward.iter_mut().zip(&self.out_scale) {
                *out *= scale;
            }
            frames.put(n, &forward);
        }
    }

    fn settle(&mut self) {
        for lane in 0..LANES {
            let column: [f64; MAX_ORDER] = std::array::from_fn(|m| self.state[m][lane]);
            if is_over(&[], &column[..self.order[lane]]) || !are_finite(&column) {
                self.silence(lane, 0);
            }
        }
    }

    fn reset(&mut self) {
        self.state.fill([0.0; LANES]);
    }
}

impl WarpedGroup {
    /// See [`WarpedBank::set_coefficients`](super::WarpedBank::set_coefficients).
    pub fn set_coefficients(
        &mut self,
        lane: usize,
        ar: &[f64],
        warping: f64,
        gain: f64,
    ) -> Result<(), ArmaError> {
        let stages = Stages::new(self.arch, ar, warping, gain)?;
        let turn = 1.0 - warping * warping;
        // Beyond the order stages pass on and turn nothing.
        for m in 0..ar.len().max(self.order[lane]) {
            self.pass[m][lane] = stages.pass[m];
            self.carried[m][lane] = -warping * stages.pass[m];
            self.turned[m][lane] = stages.turned[m];
            self.share[m][lane] = turn * stages.alpha[m];
        }
        self.begin(lane, ar.len(), warping);
        self.out_scale[lane] = stages.out_scale * turn.sqrt();
        Ok(())
    }

    /// See [`WarpedBank::set_group`](super::WarpedBank::set_group).
    pub fn set_all(&mut self, ar: &[Lanes], warping: f64, gain: &Lanes) -> Result<(), (usize, ArmaError)> {
        let (arch, group) = (self.arch, self);
        let is_set = arch.dispatch(SetAll {
            group,
            ar,
            warping,
            gain,
        });
        let wrong = |lane: usize, ar: &[f64]| Stages::new(arch, ar, warping, gain[lane]).map(drop);
        is_set.then_some(()).ok_or_else(|| first_error(ar, wrong))
    }

    /// Takes a voice to another order and warping factor: signals of stages that are gone must not come back with them.
    #[inline(always)]
    fn begin(&mut self, lane: usize, order: usize, warping: f64) {
        if order != self.order[lane] {
            self.silence(lane, order.min(self.order[lane]));
        }
        let turn = 1.0 - warping * warping;
        if warping != self.warping[lane] {
            let scale = (turn / self.turn[lane]).sqrt();
            self.state.iter_mut().for_each(|row| row[lane] *= scale);
        }
        (self.order[lane], self.warping[lane], self.turn[lane]) = (order, warping, turn);
    }

    /// Puts the stages of a voice from `first` on to rest.
    fn silence(&mut self, lane: usize, first: usize) {
        for row in &mut self.state[first..] {
            row[lane] = 0.0;
        }
    }
}
