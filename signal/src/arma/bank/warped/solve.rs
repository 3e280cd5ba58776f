//! The stages of all lanes at once, with the operations of [`Stages`](crate::arma::warped::Stages).

use super::{LANES, Lanes, WarpedGroup};
use crate::arma::{MAX_ORDER, mul_add};
use crate::elementwise::CacheLines;
use crate::prediction::step_down_lanes;
use crate::warped::MAX_WARPING;
use pulp::{Simd, WithSimd};

/// Lanes of the widest vector.
const WIDTH: usize = 8;
/// Vectors of a group.
const PARTS: usize = LANES / WIDTH;

/// Sums that the product of the cosines is split into.
const SUMS: usize = 8;

/// Gives a group new coefficients; whether it has taken them.
pub(super) struct SetAll<'a> {
    pub group: &'a mut WarpedGroup,
    pub ar: &'a [Lanes],
    pub warping: f64,
    pub gain: &'a Lanes,
}

impl WithSimd for SetAll<'_> {
    type Output = bool;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> bool {
        let Self {
            group,
            ar,
            warping,
            gain,
        } = self;
        let order = ar.len();
        if !(1..=MAX_ORDER).contains(&order) || !(0.0..=MAX_WARPING).contains(&warping) {
            return false;
        }
        // A vector of lanes at a time; nothing is kept before all are found to be sound.
        let mut solved = CacheLines([[[0.0; WIDTH]; MAX_ORDER]; 2 * PARTS]);
        let mut out_scale = [0.0; LANES];
        let s = (1.0 - warping * warping).sqrt();
        for (part, both) in solved.0.as_chunks_mut::<2>().0.iter_mut().enumerate() {
            let [sine, cosine] = both;
            let (sine, cosine) = (&mut sine[..order], &mut cosine[..order]);
            for (sine, ar) in sine.iter_mut().zip(ar) {
                *sine = ar.as_chunks::<WIDTH>().0[part];
            }
            if !step_down_lanes(sine) {
                return false;
            }
            let product = turn(sine, cosine);
            let gain = &gain.as_chunks::<WIDTH>().0[part];
            let out_scale = &mut out_scale.as_chunks_mut::<WIDTH>().0[part];
            for l in 0..WIDTH {
                out_scale[l] = gain[l] / product[l] / s * s;
            }
        }
        if !out_scale.iter().all(|scale| scale.is_finite()) {
            return false;
        }
        group.out_scale = out_scale;
        for (part, [sine, cosine]) in solved.0.as_chunks::<2>().0.iter().enumerate() {
            group.solve(part, &sine[..order], &cosine[..order], warping);
        }
        group.rest_from(order, warping);
        true
    }
}

/// The cosines of angles, and their product.
#[inline(always)]
fn turn(sine: &[[f64; WIDTH]], cosine: &mut [[f64; WIDTH]]) -> [f64; WIDTH] {
    let mut products = CacheLines([[1.0; WIDTH]; SUMS]);
    let products = &mut products.0;
    for (m, (cosine, k)) in cosine.iter_mut().zip(sine).enumerate() {
        for l in 0..WIDTH {
            cosine[l] = ((1.0 - k[l]) * (1.0 + k[l])).sqrt();
            products[m % SUMS][l] *= cosine[l];
        }
    }
    let mut product = [1.0; WIDTH];
    for part in products {
        for l in 0..WIDTH {
            product[l] *= part[l];
        }
    }
    product
}

impl WarpedGroup {
    /// See [`Stages`](crate::arma::warped::Stages): the same quotients, stage by stage, of one vector of lanes.
    #[inline(always)]
    fn solve(&mut self, part: usize, sine: &[[f64; WIDTH]], cosine: &[[f64; WIDTH]], warping: f64) {
        let turn = 1.0 - warping * warping;
        let (mut above, mut below) = ([1.0_f64; WIDTH], [1.0_f64; WIDTH]);
        for (m, (k, c)) in sine.iter().zip(cosine).enumerate().take(MAX_ORDER) {
            let pass = &mut self.pass[m].as_chunks_mut::<WIDTH>().0[part];
            let carried = &mut self.carried[m].as_chunks_mut::<WIDTH>().0[part];
            let turned = &mut self.turned[m].as_chunks_mut::<WIDTH>().0[part];
            let share = &mut self.share[m].as_chunks_mut::<WIDTH>().0[part];
            for l in 0..WIDTH {
                let (a, b) = (above[l], below[l]);
                above[l] = mul_add(k[l], b, -(warping * a));
                below[l] = mul_add(-(warping * k[l]), a, b);
                let inverse = 1.0 / (b * below[l]);
                let delta = b * b * inverse;
                pass[l] = c[l] * delta;
                carried[l] = -warping * (c[l] * delta);
                turned[l] = -(k[l] * delta);
                share[l] = turn * (a * below[l] * inverse);
            }
        }
    }

    /// Stages from `order` on pass on and turn nothing.
    #[inline(always)]
    fn rest_from(&mut self, order: usize, warping: f64) {
        if self.order == [order; LANES] && self.warping == [warping; LANES] {
            return;
        }
        let before = self.order.into_iter().fold(0, usize::max);
        for m in order..before {
            self.pass[m] = [1.0; LANES];
            self.carried[m] = [-warping; LANES];
            (self.turned[m], self.share[m]) = ([0.0; LANES], [0.0; LANES]);
        }
        for lane in 0..LANES {
            self.begin(lane, order, warping);
        }
    }
}
