//! Polynomials and their roots.

use haptograph_signal::Complex64;
use nalgebra::DMatrix;
use nalgebra::linalg::Schur;

/// Roots in z of z^p + c_1 z^(p-1) + ... + c_p, as the eigenvalues of the companion matrix. Single roots of a
/// cluster may be inaccurate, but together they reproduce the polynomial, which suffices here. `None` if they
/// do not.
pub(crate) fn of_monic(coefficients: &[f64]) -> Option<Vec<Complex64>> {
    // Trailing zeros are roots at zero.
    let degree = coefficients.iter().rposition(|&c| c != 0.0).map_or(0, |last| last + 1);
    let mut roots = vec![Complex64::new(0.0, 0.0); coefficients.len() - degree];
    if degree > 0 {
        let companion = DMatrix::from_fn(degree, degree, |i, j| match i {
            0 => -coefficients[j],
            _ => f64::from(u8::from(i == j + 1)),
        });
        let schur = Schur::try_new(companion, f64::EPSILON / 2.0, MAX_ITERATIONS)?;
        roots.extend(schur.complex_eigenvalues().iter());
    }
    let scale = coefficients.iter().fold(1.0_f64, |scale, c| scale.max(c.abs()));
    let back = monic(&roots);
    let exact = back.iter().zip(coefficients).all(|(back, c)| (back - c).abs() <= 1e-9 * scale);
    exact.then_some(roots)
}

const MAX_ITERATIONS: usize = 10_000;

/// Coefficients c_1..c_p of the real polynomial with these roots.
pub(crate) fn monic(roots: &[Complex64]) -> Vec<f64> {
    let mut polynomial = vec![Complex64::new(1.0, 0.0)];
    for root in roots {
        polynomial.push(Complex64::new(0.0, 0.0));
        for k in (1..polynomial.len()).rev() {
            let shifted = polynomial[k - 1] * root;
            polynomial[k] -= shifted;
        }
    }
    polynomial[1..].iter().map(|c| c.re).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn roots_give_the_polynomial_back() {
        for coefficients in [vec![], vec![0.0, 0.0], vec![-0.5], vec![-1.2, 0.7, 0.0, 0.1, 0.0]] {
            let roots = of_monic(&coefficients).unwrap();
            assert_eq!(roots.len(), coefficients.len());
            let back = monic(&roots);
            assert!(back.iter().zip(&coefficients).all(|(a, b)| (a - b).abs() < 1e-14));
        }
    }
}
