//! Warped lattices in lanes.

mod solve;

use super::{Frames, Group, LATTICES as LANES, UNDER_WAY, vectors, vectors_mut};
use crate::arma::warped::Stages;
use crate::arma::{ArmaError, MAX_ORDER, are_finite, is_over};
use crate::elementwise::{CacheLines, mul_add_lanes};
use crate::instructions::arch;
use crate::warped::first_error;
use pulp::{Arch, Simd};
use solve::SetAll;

type Lanes = [f64; LANES];

/// As many [`WarpedLattice`](crate::arma::WarpedLattice)s as there are lanes, of one order and warping factor, stage by stage: the lanes
/// fill the time that one voice would wait, and nothing but the stages has to be kept.
///
/// The formulas are those of the step's matrix, with signals scaled so that a stage has four products and not eight. With
/// `p_m = c_1 delta_1 ... c_m delta_m` and `C = c_1 ... c_p`, the states are `s x_m = p_{m-1} y_m`, the signals `q_m = p_{m-1} u_m` and
/// `f_m = F_m C / p_m`. Upwards a stage is then `u_m = y_m - l u_{m-1}`; downwards `F_{m-1} = F_m + turned_m u_m` and
/// `next y_m = u_{m-1} + l u_m + share_m F_{m-1}`. The output is `F_0`.
#[derive(Debug, Clone)]
#[repr(C, align(64))]
pub(super) struct WarpedGroup {
    stages: [Stage; MAX_ORDER],
    /// `F_p` of an excitation of 1.
    drive: [Lanes; 1],
    /// `p_{m-1}`.
    scale: [Lanes; MAX_ORDER],
    order: usize,
    warping: f64,
    arch: Arch,
}

/// The values of stage m for a sample, side by side: rows of their own would lie whole pages apart, where a processor
/// takes what it reads for what it has just written elsewhere, and keeps few of them in its cache.
#[derive(Debug, Clone, Copy)]
#[repr(C, align(64))]
struct Stage {
    /// `-k_m delta_m p_{m-1}^2 / C`.
    turned: [Lanes; 1],
    /// `s^2 alpha_{m-1} C / p_{m-1}^2`.
    share: [Lanes; 1],
    state: [Lanes; 1],
    /// `u_{m-1}`, within a sample.
    below: [Lanes; 1],
}

impl Stage {
    const SILENT: Self =
        Self { turned: [[0.0; LANES]], share: [[0.0; LANES]], state: [[0.0; LANES]], below: [[0.0; LANES]] };
}

impl Group for WarpedGroup {
    const LANES: usize = LANES;

    fn new() -> Self {
        Self {
            stages: [Stage::SILENT; MAX_ORDER],
            drive: [[0.0; LANES]],
            scale: [[1.0; LANES]; MAX_ORDER],
            order: 0,
            warping: 0.0,
            arch: arch(),
        }
    }

    #[inline(always)]
    fn run<S: Simd>(&mut self, simd: S, mut frames: Frames<'_>) {
        for n in 0..frames.count() {
            let mut samples = CacheLines([frames.excitation(n)]);
            for (part, samples) in vectors_mut::<S>(&mut samples.0).iter_mut().enumerate() {
                self.step(simd, part, samples);
            }
            frames.put(n, &samples.0[0]);
        }
    }

    fn settle(&mut self) {
        for lane in 0..LANES {
            let column: [f64; MAX_ORDER] =
                std::array::from_fn(|m| self.stages[m].state[0][lane] * self.scale[m][lane]);
            if is_over(&[], &column[..self.order]) || !are_finite(&column) {
                for stage in &mut self.stages {
                    stage.state[0][lane] = 0.0;
                }
            }
        }
    }
}

impl WarpedGroup {
    /// Takes the samples of some voices through all stages.
    #[inline(always)]
    fn step<S: Simd>(&mut self, simd: S, part: usize, samples: &mut [S::f64s; UNDER_WAY]) {
        let stages = &mut self.stages[..self.order.min(MAX_ORDER)];
        let drive = vectors::<S>(&self.drive)[part];
        let (warping, against) = (simd.splat_f64s(self.warping), simd.splat_f64s(-self.warping));
        let mut u = [simd.splat_f64s(0.0); UNDER_WAY];
        for stage in &mut *stages {
            vectors_mut::<S>(&mut stage.below)[part] = u;
            let state = vectors::<S>(&stage.state)[part];
            for i in 0..UNDER_WAY {
                u[i] = mul_add_lanes(simd, against, u[i], state[i]);
            }
        }
        let mut forward = *samples;
        for i in 0..UNDER_WAY {
            forward[i] = simd.mul_f64s(forward[i], drive[i]);
        }
        for stage in stages.iter_mut().rev() {
            let turned = vectors::<S>(&stage.turned)[part];
            let share = vectors::<S>(&stage.share)[part];
            let below = vectors::<S>(&stage.below)[part];
            let state = &mut vectors_mut::<S>(&mut stage.state)[part];
            for i in 0..UNDER_WAY {
                forward[i] = mul_add_lanes(simd, turned[i], u[i], forward[i]);
                let onwards = mul_add_lanes(simd, warping, u[i], below[i]);
                state[i] = mul_add_lanes(simd, share[i], forward[i], onwards);
            }
            u = below;
        }
        *samples = forward;
    }

    /// See [`WarpedBank::set_group`](super::WarpedBank::set_group).
    pub(super) fn set_all(
        &mut self,
        ar: &[Lanes],
        warping: f64,
        power: &Lanes,
    ) -> Result<(), (usize, ArmaError)> {
        let (arch, group) = (self.arch, self);
        let is_set = arch.dispatch(SetAll { group, ar, warping, power });
        let wrong = |lane: usize, ar: &[f64]| Stages::new(arch, ar, warping, power[lane]).map(drop);
        is_set.then_some(()).ok_or_else(|| first_error(ar, wrong))
    }

    /// Takes all voices to another order and warping factor: signals of stages that are gone must not come back with them.
    fn begin(&mut self, order: usize, warping: f64) {
        for stage in &mut self.stages[order.min(self.order)..] {
            stage.state = [[0.0; LANES]];
        }
        if warping != self.warping {
            let turn = |warping: f64| 1.0 - warping * warping;
            let scale = (turn(warping) / turn(self.warping)).sqrt();
            let states = self.stages.iter_mut().flat_map(|stage| &mut stage.state[0]);
            states.for_each(|y| *y *= scale);
        }
        (self.order, self.warping) = (order, warping);
    }
}
