//! The power of a warped model from its line spectral frequencies, without the step-down recursion: that is a chain of as many
//! divisions as the order, which an update would mostly wait for.

use super::MAX_ORDER;
use super::from_lsf::{factors_to_ar_lanes, lsf_to_factors_lanes};
use haptograph_signal::instructions::arch;
use pulp::{Simd, WithSimd};

/// Coefficients of the warped polynomial whose LSFs (radians, ascending) are given, into `ar` of equal length, at most [`MAX_ORDER`];
/// returns the power of white noise of variance 1 after the filter, infinite where rounding leaves two frequencies one.
pub(crate) fn warped_into_ar(lsf: &[f64], warping: f64, ar: &mut [f64]) -> f64 {
    arch().dispatch(Convert { lsf, warping, ar })
}

struct Convert<'a> {
    lsf: &'a [f64],
    warping: f64,
    ar: &'a mut [f64],
}

impl WithSimd for Convert<'_> {
    type Output = f64;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> f64 {
        let Self { lsf, warping, ar } = self;
        if lsf.len() != ar.len() || lsf.len() > MAX_ORDER {
            return f64::INFINITY;
        }
        lsf_to_factors_lanes(lsf.as_chunks::<1>().0, ar.as_chunks_mut::<1>().0);
        let power = match ar.len() {
            0..=16 => power::<16>(ar, warping),
            17..=24 => power::<24>(ar, warping),
            _ => power::<32>(ar, warping),
        };
        factors_to_ar_lanes(ar.as_chunks_mut::<1>().0);
        power
    }
}

/// The power of white noise of variance 1 after `1 / A(D(z))`, of the factors `b = -2 cos W` of its sum polynomial P and difference
/// polynomial Q in turn, at most `PADDED`.
///
/// It is the mean of `1 / |A|^2` over the warped circle, weighted by the Poisson kernel of the point -l (`dw/dW`). Masses at the zeros
/// of P have the same moments as `1 / |A|^2` up to the order: at the zero j of either polynomial
/// `m_j = 2 / ((2 - b_j) (2 + b_j) |prod (b_j - b_i)|)` over all others, those of its conjugate included; at z = -1 and z = 1
/// `1 / prod (2 -+ b_i)` (Szegő quadrature). So their sum with the kernel's values lacks only the kernel's higher moments, and the
/// Wronskian of the polynomials of first and second kind gives these: `-2 l^(p+1) / (A(-l) P(-l))` for P, the same with the other sign
/// for Q. Since P + Q = 2 A, the means of both by P(-l) and Q(-l) lack nothing, and all terms are positive.
#[inline(always)]
fn power<const PADDED: usize>(factors: &[f64], warping: f64) -> f64 {
    if !factors.is_sorted() {
        // Unstable, as where two are equal.
        return f64::INFINITY;
    }
    let order = factors.len();
    let mut b = [0.0; PADDED];
    b[..order].copy_from_slice(factors);
    let mut apart = [1.0; PADDED];
    for (i, other) in factors.iter().enumerate() {
        let itself = unit::<PADDED>(i);
        for j in 0..PADDED {
            apart[j] *= (b[j] - other) + itself[j];
        }
    }
    let (mut kernel, mut below, mut above, mut share) =
        ([1.0; PADDED], [1.0; PADDED], [1.0; PADDED], [0.0; PADDED]);
    for j in 0..PADDED {
        kernel[j] = (1.0 + warping * warping) - warping * b[j];
        (below[j], above[j]) = (2.0 - b[j], 2.0 + b[j]);
        share[j] = 4.0 / (below[j] * above[j] * apart[j].abs() * kernel[j]);
    }
    kernel[order..].fill(1.0);
    below[order..].fill(1.0);
    above[order..].fill(1.0);
    share[order..].fill(0.0);
    let (mut by_sum, mut by_difference) = alternate(&share, [0.0; 2], |sum, share| sum + share).into();
    let (mut sum, mut difference) = alternate(&kernel, [1.0; 2], |product, factor| product * factor).into();
    let [below, above] = [&below, &above].map(|ends| {
        let [even, odd] = alternate(ends, [1.0; 2], |product, end| product * end);
        even * odd
    });
    // The zeros at z = -1 and z = 1: of P and Q, or both of Q.
    let (at_minus_one, at_one) = (1.0 - warping, 1.0 + warping);
    let (low, high) = (1.0 / (below * at_minus_one * at_minus_one), 1.0 / (above * at_one * at_one));
    if order.is_multiple_of(2) {
        (by_sum, by_difference) = (by_sum + low, by_difference + high);
        (sum, difference) = (sum * at_minus_one, difference * at_one);
    } else {
        by_difference += low + high;
        difference *= at_minus_one * at_one;
    }
    (1.0 - warping * warping) * (by_sum * sum + by_difference * difference) / (sum + difference)
}

/// Folds the values of even and of odd places, in lanes; [even, odd].
#[inline(always)]
fn alternate(values: &[f64], start: [f64; 2], fold: impl Fn(f64, f64) -> f64) -> [f64; 2] {
    let [even, odd] = start;
    let mut lanes = [even, odd, even, odd, even, odd, even, odd];
    for row in values.as_chunks::<8>().0 {
        for (lane, value) in lanes.iter_mut().zip(row) {
            *lane = fold(*lane, *value);
        }
    }
    let [a, b, c, d, e, f, g, h] = lanes;
    [fold(fold(a, c), fold(e, g)), fold(fold(b, d), fold(f, h))]
}

/// The unit vector along an axis.
#[inline(always)]
fn unit<const PADDED: usize>(axis: usize) -> &'static [f64; PADDED] {
    static ONE: [f64; 2 * MAX_ORDER] = {
        let mut one = [0.0; 2 * MAX_ORDER];
        one[MAX_ORDER] = 1.0;
        one
    };
    ONE[MAX_ORDER - axis.min(MAX_ORDER)..].first_chunk().unwrap_or(&[0.0; PADDED])
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptograph_signal::warped::power_gain;
    use rand::{RngExt, SeedableRng};
    use rand_xoshiro::Xoshiro256PlusPlus;
    use std::f64::consts::PI;

    #[test]
    fn it_is_the_power_by_reflection_coefficients() {
        let mut random = Xoshiro256PlusPlus::seed_from_u64(3);
        for order in 1..=MAX_ORDER {
            for warping in [0.0, 0.3, 0.8, 0.95] {
                for _ in 0..20 {
                    let mut lsf: Vec<f64> = (0..order).map(|_| random.random_range(0.0..1.0)).collect();
                    lsf.sort_by(f64::total_cmp);
                    // A part of them evenly spread, so that none are the same.
                    let even = |k: usize| (k as f64 + 1.0) / (order as f64 + 1.0);
                    lsf.iter_mut().enumerate().for_each(|(k, w)| *w = PI * (0.8 * *w + 0.2 * even(k)));
                    let mut ar = vec![0.0; order];
                    let found = warped_into_ar(&lsf, warping, &mut ar);
                    let wanted = power_gain(&ar, warping).unwrap();
                    assert!((found / wanted - 1.0).abs() < 1e-6, "{order} {warping}: {found} {wanted}");
                }
            }
        }
    }

    #[test]
    fn a_flat_spectrum_keeps_the_power() {
        for order in 1..=MAX_ORDER {
            let lsf: Vec<f64> = (1..=order).map(|k| PI * k as f64 / (order as f64 + 1.0)).collect();
            let power = warped_into_ar(&lsf, 0.8, &mut vec![0.0; order]);
            assert!((power - 1.0).abs() < 1e-12, "{order}: {power}");
        }
    }

    #[test]
    fn frequencies_in_one_place_have_no_finite_power() {
        let mut ar = [0.0; 2];
        assert_eq!(warped_into_ar(&[1.0, 1.0], 0.5, &mut ar), f64::INFINITY);
        assert_eq!(warped_into_ar(&[1.0], 0.5, &mut ar), f64::INFINITY);
    }
}
