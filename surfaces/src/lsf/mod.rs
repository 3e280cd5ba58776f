//! Line spectral frequencies (LSFs): the form in which autoregressive polynomials may be interpolated.
//!
//! For A(z) = 1 + Σ a_k z⁻ᵏ of order p, the sum polynomial P(z) = A(z) + z^-(p+1) A(1/z) and the difference
//! polynomial Q(z) = A(z) − z^-(p+1) A(1/z) have all their zeros on the unit circle exactly when A has all of its
//! own inside, and then the zeros' angles in (0, π) alternate, P's first: the p LSFs. Any convex combination of
//! ascending sets ascends, so that interpolated LSFs always make a stable filter (thesis 2.4.1).

mod from_lsf;
mod power;
mod to_lsf;

pub use from_lsf::lsf_to_ar;
pub(crate) use from_lsf::{lsf_into_ar, lsf_to_ar_lanes};
pub(crate) use power::warped_into_ar;
pub use to_lsf::ar_to_lsf;

pub use haptograph_signal::arma::MAX_ORDER;

/// Reason why a polynomial or its LSFs are not converted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum LsfError {
    /// The polynomial has a zero on or outside the unit circle, or is not finite, so it has no LSFs.
    #[error(
        "the polynomial has a root on or outside the unit circle, so it has no line spectral frequencies"
    )]
    NotStable,
    /// The slices' lengths differ or exceed [`MAX_ORDER`].
    #[error("{from} values cannot be converted into {into}; both lengths are one order, at most {MAX_ORDER}")]
    Lengths {
        /// Number of values given.
        from: usize,
        /// Number of values requested.
        into: usize,
    },
}

fn check_lengths(from: usize, into: usize) -> Result<(), LsfError> {
    match from == into && into <= MAX_ORDER {
        true => Ok(()),
        false => Err(LsfError::Lengths { from, into }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    #[test]
    fn an_empty_spectrum_has_evenly_spaced_frequencies() {
        for order in 1..=MAX_ORDER {
            let mut lsf = vec![0.0; order];
            ar_to_lsf(&vec![0.0; order], &mut lsf).unwrap();
            for (index, w) in lsf.iter().enumerate() {
                let expected = PI * (index + 1) as f64 / (order + 1) as f64;
                assert!((w - expected).abs() < 1e-13, "{order} {index}");
            }
        }
    }

    #[test]
    fn a_first_order_pole_has_a_closed_form() {
        for a in [-0.9, -0.3, 0.5, 0.99] {
            let mut lsf = [0.0];
            ar_to_lsf(&[a], &mut lsf).unwrap();
            assert!((lsf[0] - f64::acos(-a)).abs() < 1e-12);
        }
    }

    #[test]
    fn there_and_back_is_the_identity() {
        let poles: [(f64, f64); 4] = [(0.95, 0.3), (0.8, 1.1), (0.99, 1.9), (0.6, 2.7)];
        let mut ar = vec![0.0; 8];
        let mut product = [0.0; 9];
        product[0] = 1.0;
        for (radius, angle) in poles {
            for k in (1..9).rev() {
                let before = if k >= 2 { product[k - 2] } else { 0.0 };
                product[k] += -2.0 * radius * angle.cos() * product[k - 1] + radius * radius * before;
            }
        }
        ar.copy_from_slice(&product[1..]);
        for order in [7, 8] {
            let ar = if order == 8 { ar.clone() } else { vec![-0.9, 0.2, 0.1, -0.3, 0.05, 0.1, 0.02] };
            let mut lsf = vec![0.0; order];
            ar_to_lsf(&ar, &mut lsf).unwrap();
            let mut back = vec![0.0; order];
            lsf_to_ar(&lsf, &mut back).unwrap();
            for (a, b) in ar.iter().zip(&back) {
                assert!((a - b).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn an_unstable_polynomial_is_refused() {
        let mut lsf = [0.0; 2];
        assert_eq!(ar_to_lsf(&[0.0, 1.0], &mut lsf), Err(LsfError::NotStable));
        assert_eq!(ar_to_lsf(&[-2.1, 1.1], &mut lsf), Err(LsfError::NotStable));
        assert_eq!(ar_to_lsf(&[f64::NAN, 0.0], &mut lsf), Err(LsfError::NotStable));
    }

    #[test]
    fn slices_of_other_lengths_are_refused() {
        let (mut short, mut long) = ([0.5; 3], [0.5; MAX_ORDER + 1]);
        let lengths = |from, into| Err(LsfError::Lengths { from, into });
        assert_eq!(lsf_to_ar(&[1.0, 2.0], &mut short), lengths(2, 3));
        assert_eq!(ar_to_lsf(&[0.1, 0.2], &mut short), lengths(2, 3));
        let order = MAX_ORDER + 1;
        assert_eq!(lsf_to_ar(&long.clone(), &mut long), lengths(order, order));
        assert_eq!(ar_to_lsf(&long.clone(), &mut long), lengths(order, order));
        lsf_into_ar(&[1.0, 2.0], &mut short);
        assert_eq!(short, [0.5; 3]);
    }
}
