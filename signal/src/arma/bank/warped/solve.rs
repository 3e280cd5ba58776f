//! The stages of all lanes at once: what [`Stages`](crate::arma::warped::Stages) is to one voice.

use super::{LANES, Lanes, WarpedGroup};
use crate::arma::MAX_ORDER;
use crate::elementwise::{CacheLines, mul_add};
use crate::prediction::step_down_lanes;
use crate::warped::MAX_WARPING;
use pulp::{Simd, WithSimd};

/// Lanes of the widest vector.
const WIDTH: usize = 8;

/// Lowest product of all `c_m^2`: below it the scales of signals leave the range of numbers.
const LEAST_SHARE: f64 = 1e-200;

/// Gives a group new coefficients; whether it has taken them.
pub(super) struct SetAll<'a> {
    pub group: &'a mut WarpedGroup,
    pub ar: &'a [Lanes],
    pub warping: f64,
    pub power: &'a Lanes,
}

impl WithSimd for SetAll<'_> {
    type Output = bool;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> bool {
        let Self { group, ar, warping, power } = self;
        let order = ar.len();
        if !(1..=MAX_ORDER).contains(&order) || !(0.0..=MAX_WARPING).contains(&warping) {
            return false;
        }
        let mut reflection = CacheLines([[0.0; LANES]; MAX_ORDER]);
        let k = &mut reflection.0[..order];
        k.copy_from_slice(ar);
        if !step_down_lanes(k) {
            return false;
        }
        let mut share = [1.0; LANES];
        for k in &*k {
            for l in 0..LANES {
                share[l] *= (1.0 - k[l]) * (1.0 + k[l]);
            }
        }
        // Nothing is kept before all are found to be sound.
        let are_sound = share.iter().all(|share| *share >= LEAST_SHARE);
        if !are_sound || !power.iter().all(|power| power.is_finite()) {
            return false;
        }
        if (order, warping) != (group.order, group.warping) {
            group.begin(order, warping);
        }
        for part in 0..LANES / WIDTH {
            group.solve(part, k, share.as_chunks().0[part], power.as_chunks().0[part]);
        }
        true
    }
}

impl WarpedGroup {
    /// See [`Stages`](crate::arma::warped::Stages): the same quotients `alpha_{m-1} = a / b` and `delta_m = b / next b`, stage by stage, of
    /// one vector of lanes, so that `p_{m-1} = c_1 ... c_{m-1} / b`. `share` is the product of all `c_m^2`.
    ///
    /// The power of the output of white excitation follows from the step: it is orthogonal, so that all states have variance 1, and
    /// `f_0 = b_0 = (next x_1 - l x_1) / s` has `1 - 2 l g` where `q_1` brings `g q_1` to `f_0`.
    #[inline(always)]
    fn solve(&mut self, part: usize, k: &[Lanes], share: [f64; WIDTH], power: [f64; WIDTH]) {
        let warping = self.warping;
        let turn = 1.0 - warping * warping;
        let mut cosines = [0.0; WIDTH];
        let mut inverse_cosines = [0.0; WIDTH];
        for l in 0..WIDTH {
            cosines[l] = share[l].sqrt();
            inverse_cosines[l] = 1.0 / cosines[l];
        }
        // `below` is the product of the `c^2` of the stages below.
        let (mut a, mut b, mut below) = ([1.0_f64; WIDTH], [1.0_f64; WIDTH], [1.0_f64; WIDTH]);
        let (mut brought, mut onwards) = ([0.0_f64; WIDTH], 1.0);
        for (m, k) in k.iter().enumerate().take(MAX_ORDER) {
            let stage = &mut self.stages[m];
            let state = &mut stage.state[0].as_chunks_mut::<WIDTH>().0[part];
            let scale = &mut self.scale[m].as_chunks_mut::<WIDTH>().0[part];
            // Copies, so that nothing can overlap and all is made into vectors.
            let (k, mut y, mut p) = (k.as_chunks::<WIDTH>().0[part], *state, *scale);
            let (mut turned, mut share) = ([0.0; WIDTH], [0.0; WIDTH]);
            for l in 0..WIDTH {
                let next_a = mul_add(k[l], b[l], -(warping * a[l]));
                let next_b = mul_add(-(warping * k[l]), a[l], b[l]);
                // One division for all quotients.
                let root = below[l].sqrt();
                let inverse = 1.0 / (root * (b[l] * next_b));
                let inverse_root = inverse * (b[l] * next_b);
                turned[l] = -(k[l] * below[l]) * (inverse * root) * inverse_cosines[l];
                share[l] = (turn * cosines[l]) * (a[l] * b[l]) * (inverse_root * inverse_root);
                y[l] *= p[l] * (b[l] * inverse_root);
                p[l] = below[l] * (inverse * next_b);
                brought[l] = mul_add(turned[l], onwards, brought[l]);
                below[l] *= (1.0 - k[l]) * (1.0 + k[l]);
                (a[l], b[l]) = (next_a, next_b);
            }
            (*state, *scale) = (y, p);
            stage.turned[0].as_chunks_mut().0[part] = turned;
            stage.share[0].as_chunks_mut().0[part] = share;
            onwards *= -warping;
        }
        let mut drive = [0.0; WIDTH];
        for l in 0..WIDTH {
            let gain = 1.0 - 2.0 * warping * (cosines[l] * brought[l]);
            drive[l] = (power[l].max(0.0) * share[l] / gain).sqrt() / b[l];
        }
        self.drive[0].as_chunks_mut().0[part] = drive;
    }
}
