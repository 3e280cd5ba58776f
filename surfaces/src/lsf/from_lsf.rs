//! From line spectral frequencies to coefficients: the real-time direction, 240 to 1000 times a second for each voice.

use super::{LsfError, MAX_ORDER, check_lengths};
use haptograph_signal::elementwise::CacheLines;
use haptograph_signal::sine::sine_within;
use std::f64::consts::FRAC_PI_2;

/// Most quadratic factors of the sum or the difference polynomial.
const MAX_FACTORS: usize = MAX_ORDER / 2;

/// Coefficients a_1..a_p of the polynomial whose LSFs (radians, ascending) are given, into `ar` of equal length.
///
/// # Errors
/// [`LsfError::Lengths`] if the slices' lengths differ or exceed [`MAX_ORDER`].
pub fn lsf_to_ar(lsf: &[f64], ar: &mut [f64]) -> Result<(), LsfError> {
    check_lengths(lsf.len(), ar.len())?;
    lsf_into_ar(lsf, ar);
    Ok(())
}

/// [`lsf_to_ar`] for slices of one length, at most [`MAX_ORDER`]; others are left as they are.
#[inline(always)]
pub(crate) fn lsf_into_ar(lsf: &[f64], ar: &mut [f64]) {
    lsf_to_ar_lanes(lsf.as_chunks::<1>().0, ar.as_chunks_mut::<1>().0);
}

/// [`lsf_into_ar`] for one polynomial per lane, with the same bits; row k holds the k-th value of all lanes.
#[inline(always)]
pub(crate) fn lsf_to_ar_lanes<const L: usize>(lsf: &[[f64; L]], ar: &mut [[f64; L]]) {
    if check_lengths(lsf.len(), ar.len()).is_ok() {
        lsf_to_factors_lanes(lsf, ar);
        factors_to_ar_lanes(ar);
    }
}

/// The quadratic factors `1 + b z⁻¹ + z⁻²` of the sum and, in turn, the difference polynomial: their b, one for each frequency.
#[inline(always)]
pub(crate) fn lsf_to_factors_lanes<const L: usize>(lsf: &[[f64; L]], factors: &mut [[f64; L]]) {
    // Loops throughout: the closures of arrays' methods are compiled apart, and not for the instructions of the caller.
    for (b, frequencies) in factors.iter_mut().zip(lsf) {
        for l in 0..L {
            b[l] = -2.0 * cos(frequencies[l]);
        }
    }
}

/// Makes the coefficients, at most [`MAX_ORDER`], of the factors in their places.
#[inline(always)]
pub(crate) fn factors_to_ar_lanes<const L: usize>(ar: &mut [[f64; L]]) {
    let order = ar.len();
    // Either polynomial is palindromic once rid of its zeros at z = 1 and z = -1: the first half is enough. Both are
    // multiplied up side by side, [sum, difference].
    let pairs = order / 2;
    let mut half = CacheLines([[[0.0; L]; 2]; MAX_FACTORS + 1]);
    let half = &mut half.0;
    half[0] = [[1.0; L]; 2];
    for (factors, &pair) in SPREAD[pairs][..pairs].iter().enumerate() {
        multiply(half, factors, &ar.as_chunks::<2>().0[pair as usize]);
    }
    let (mut p, mut q) = ([0.0; L], [0.0; L]);
    if order.is_multiple_of(2) {
        // P = sum (1 + 1/z), Q = difference (1 - 1/z).
        for k in 1..=pairs {
            let (before, here) = (&half[k - 1], &half[k]);
            for l in 0..L {
                p[l] = here[0][l] + before[0][l];
                q[l] = here[1][l] - before[1][l];
            }
            put(ar, k, &p, &q);
        }
    } else {
        // P has one factor more, Q = difference (1 - 1/z²), of which the middle coefficient is zero.
        let difference = *half;
        multiply(half, pairs, &[ar[order - 1], [0.0; L]]);
        for k in 1..=pairs {
            let before = if k >= 2 { difference[k - 2][1] } else { [0.0; L] };
            for l in 0..L {
                q[l] = difference[k][1][l] - before[l];
            }
            put(ar, k, &half[k][0], &q);
        }
        for l in 0..L {
            p[l] = 0.5 * half[pairs + 1][0][l];
        }
        ar[pairs] = p;
    }
}

/// Coefficient k of A = (P + Q) / 2 and the one as far from the end: P is a palindrome, and Q one but for its sign.
#[inline(always)]
fn put<const L: usize>(ar: &mut [[f64; L]], k: usize, p: &[f64; L], q: &[f64; L]) {
    let (mut first, mut last) = ([0.0; L], [0.0; L]);
    for l in 0..L {
        first[l] = 0.5 * (p[l] + q[l]);
        last[l] = 0.5 * (p[l] - q[l]);
    }
    (ar[k - 1], ar[ar.len() - k]) = (first, last);
}

/// For each number of factors the order in which to multiply them: halves, quarters, eighths of the range, so that
/// the product at each step has its zeros spread around the circle and stays small. In ascending order it grows by orders
/// of magnitude before it shrinks again, and takes as many digits with it.
const SPREAD: [[u8; MAX_FACTORS]; MAX_FACTORS + 1] = {
    let mut orders = [[0; MAX_FACTORS]; MAX_FACTORS + 1];
    let mut count = 0;
    while count <= MAX_FACTORS {
        let (mut placed, mut k) = (0, 0_u8);
        while k < MAX_FACTORS as u8 {
            // Reverses four bits.
            let reversed = k.reverse_bits() >> 4;
            if (reversed as usize) < count {
                orders[count][placed] = reversed;
                placed += 1;
            }
            k += 1;
        }
        count += 1;
    }
    orders
};

/// A coefficient of the sum and of the difference polynomial, for each lane.
type Pair<const L: usize> = [[f64; L]; 2];

/// Multiplies palindromes of `factors` quadratic factors, of which `half` holds coefficients 0 to `factors`, by
/// 1 + b z⁻¹ + z⁻².
#[inline(always)]
fn multiply<const L: usize>(half: &mut [Pair<L>; MAX_FACTORS + 1], factors: usize, b: &Pair<L>) {
    // A palindrome's coefficient after the middle one is the one before it.
    let beyond = if factors >= 1 { half[factors - 1] } else { [[0.0; L]; 2] };
    let (lower, upper) = half.split_at_mut(factors + 1);
    let (middle, next) = (&lower[factors], &mut upper[0]);
    for i in 0..2 {
        for l in 0..L {
            next[i][l] = b[i][l] * middle[i][l] + 2.0 * beyond[i][l];
        }
    }
    for k in (2..=factors).rev() {
        let (lower, upper) = half.split_at_mut(k);
        let (second, first, row) = (&lower[k - 2], &lower[k - 1], &mut upper[0]);
        for i in 0..2 {
            for l in 0..L {
                row[i][l] = row[i][l] + b[i][l] * first[i][l] + second[i][l];
            }
        }
    }
    if factors >= 1 {
        for i in 0..2 {
            for l in 0..L {
                half[1][i][l] += b[i][l];
            }
        }
    }
}

/// Cosine on [0, π] to within two units in the last place of 1.
#[inline(always)]
fn cos(x: f64) -> f64 {
    const FRAC_PI_2_LOW: f64 = 6.123233995736766e-17;
    sine_within((FRAC_PI_2 - x) + FRAC_PI_2_LOW)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    #[test]
    fn the_cosine_is_the_librarys() {
        let worst = (0..=100_000).map(|k| PI * f64::from(k) / 100_000.0).map(|x| (cos(x) - x.cos()).abs());
        assert!(worst.fold(0.0, f64::max) <= 4.0 * f64::EPSILON / 2.0);
    }

    #[test]
    fn it_is_the_product_of_the_factors() {
        for order in 0..=MAX_ORDER {
            let lsf: Vec<f64> = (0..order)
                .map(|k| PI * (k as f64 + 1.0 + 0.3 * (k as f64).sin()) / (order as f64 + 1.0))
                .collect();
            let mut ar = vec![0.0; order];
            lsf_into_ar(&lsf, &mut ar);
            let expected = by_full_products(&lsf);
            // The plain product in ascending order loses digits.
            let tolerance = 1e-14 * f64::powi(2.0, order as i32 / 2);
            for (a, e) in ar.iter().zip(&expected) {
                assert!((a - e).abs() < tolerance, "order {order}: {ar:?} {expected:?}");
            }
        }
    }

    /// The definition: A = (P + Q) / 2 with P and Q from their zeros.
    fn by_full_products(lsf: &[f64]) -> Vec<f64> {
        let order = lsf.len();
        let times = |a: &[f64], b: &[f64]| {
            let mut product = vec![0.0; a.len() + b.len() - 1];
            for (i, x) in a.iter().enumerate() {
                for (j, y) in b.iter().enumerate() {
                    product[i + j] += x * y;
                }
            }
            product
        };
        let (mut p, mut q) = if order.is_multiple_of(2) {
            (vec![1.0, 1.0], vec![1.0, -1.0])
        } else {
            (vec![1.0], vec![1.0, 0.0, -1.0])
        };
        for (index, frequency) in lsf.iter().enumerate() {
            let factor = [1.0, -2.0 * frequency.cos(), 1.0];
            let half = if index % 2 == 0 { &mut p } else { &mut q };
            *half = times(half, &factor);
        }
        (1..=order).map(|k| 0.5 * (p[k] + q[k])).collect()
    }
}
