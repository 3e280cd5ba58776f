//! The stages of all lanes at once, with the operations of [`Stages`](crate::arma::warped::Stages).

use super::{LANES, Lanes, WarpedGroup};
use crate::arma::{MAX_ORDER, mul_add};
use crate::prediction::step_down_lanes;
use crate::warped::MAX_WARPING;
use pulp::{Simd, WithSimd};

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
        let mut sine = [[0.0; LANES]; MAX_ORDER];
        let sine = &mut sine[..order];
        sine.copy_from_slice(ar);
        let mut cosine = [[0.0; LANES]; MAX_ORDER];
        let cosine = &mut cosine[..order];
        if !step_down_lanes(sine) {
            return false;
        }
        let product = turn(sine, cosine);
        let (s, mut out_scale) = ((1.0 - warping * warping).sqrt(), [0.0; LANES]);
        for l in 0..LANES {
            out_scale[l] = gain[l] / product[l] / s * s;
        }
        if !out_scale.iter().all(|scale| scale.is_finite()) {
            return false;
        }
        group.out_scale = out_scale;
        group.solve(sine, cosine, warping);
        group.rest_from(order, warping);
        true
    }
}

/// The cosines of angles, and their product.
#[inline(always)]
fn turn(sine: &[Lanes], cosine: &mut [Lanes]) -> Lanes {
    let mut products = [[1.0; LANES]; SUMS];
    for (m, (cosine, k)) in cosine.iter_mut().zip(sine).enumerate() {
        for l in 0..LANES {
            cosine[l] = ((1.0 - k[l]) * (1.0 + k[l])).sqrt();
            products[m % SUMS][l] *= cosine[l];
        }
    }
    let mut product = [1.0; LANES];
    for part in &products {
        for l in 0..LANES {
            product[l] *= part[l];
        }
    }
    product
}

impl WarpedGroup {
    /// See [`Stages`](crate::arma::warped::Stages): the same quotients, stage by stage.
    #[inline(always)]
    fn solve(&mut self, sine: &[Lanes], cosine: &[Lanes], warping: f64) {
        let turn = 1.0 - warping * warping;
        let (mut above, mut below) = ([1.0_f64; LANES], [1.0_f64; LANES]);
        for (m, (k, c)) in sine.iter().zip(cosine).enumerate() {
            for l in 0..LANES {
                let (a, b) = (above[l], below[l]);
                above[l] = mul_add(k[l], b, -(warping * a));
                below[l] = mul_add(-(warping * k[l]), a, b);
                let inverse = 1.0 / (b * below[l]);
                let delta = b * b * inverse;
                self.pass[m][l] = c[l] * delta;
                self.carried[m][l] = -warping * (c[l] * delta);
                self.turned[m][l] = -(k[l] * delta);
                self.share[m][l] = turn * (a * below[l] * inverse);
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
