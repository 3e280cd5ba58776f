use super::*;
use crate::noise::Gaussian;

fn close(a: &[f64], b: &[f64], tolerance: f64) {
    assert_eq!(a.len(), b.len());
    for (a, b) in a.iter().zip(b) {
        assert!((a - b).abs() <= tolerance * (1.0 + b.abs()), "{a} {b}");
    }
}

/// White noise through B/A, the naive way.
fn simulate(ar: &[f64], ma: &[f64], n: usize, seed: u64) -> Vec<f64> {
    let mut noise = Gaussian::new(seed);
    let e: Vec<f64> = (0..n).map(|_| noise.next_sample()).collect();
    let mut y = vec![0.0; n];
    for i in 0..n {
        let past = |v: &[f64], k: usize| if i >= k { v[i - k] } else { 0.0 };
        y[i] = e[i];
        for (k, b) in ma.iter().enumerate() {
            y[i] += b * past(&e, k + 1);
        }
        for (k, a) in ar.iter().enumerate() {
            y[i] -= a * past(&y, k + 1);
        }
    }
    y
}

#[test]
fn autocovariance_is_the_definition() {
    close(&autocovariance(&[1.0, 2.0, -1.0], 4), &[2.0, 0.0, -1.0 / 3.0, 0.0, 0.0], 1e-15);
    assert_eq!(autocovariance(&[], 2), [0.0; 3]);
}

#[test]
fn levinson_solves_the_normal_equations() {
    let r = autocovariance(&simulate(&[-1.2, 0.8, -0.3], &[0.4], 400, 1), 12);
    let model = levinson(&r, 12).unwrap();
    let at = |lag: i64| r[lag.unsigned_abs() as usize];
    for row in 1..=12_i64 {
        let sum: f64 = (1..=12).map(|k| model.ar[k as usize - 1] * at(row - k)).sum();
        assert!((sum + at(row)).abs() < 1e-12 * r[0]);
    }
    let error: f64 = r[0] + (1..=12).map(|k| model.ar[k - 1] * r[k]).sum::<f64>();
    assert!((error - model.variance).abs() < 1e-12 * r[0]);
}

#[test]
fn levinson_finds_the_model_whose_covariance_it_is_given() {
    // AR(1): r[m] = (-a)^m / (1 - a^2).
    let r: Vec<f64> = (0..5).map(|m| 0.9_f64.powi(m) / (1.0 - 0.81)).collect();
    let model = levinson(&r, 4).unwrap();
    close(&model.ar, &[-0.9, 0.0, 0.0, 0.0], 1e-13);
    assert!((model.variance - 1.0).abs() < 1e-12);
}

#[test]
fn levinson_answers_silence_certainty_and_nonsense() {
    assert_eq!(levinson(&[0.0; 4], 3).unwrap().ar, [0.0; 3]);
    // A pure cosine is predicted perfectly by two values.
    let r: Vec<f64> = (0..9).map(|m| (0.7 * f64::from(m)).cos()).collect();
    let model = levinson(&r, 8).unwrap();
    close(&model.ar[..2], &[-2.0 * 0.7_f64.cos(), 1.0], 1e-6);
    assert!(model.variance.abs() < 1e-12);
    assert!(matches!(levinson(&[1.0, 2.0], 1), Err(PredictionError::NotAnAutocovariance { lag: 1 })));
    assert!(matches!(levinson(&[1.0], 1), Err(PredictionError::TooShort { .. })));
    assert!(matches!(levinson(&[f64::NAN, 0.0], 1), Err(PredictionError::NotFinite)));
}

#[test]
fn burg_recovers_the_process_of_davis_hancock_and_yao() {
    let y = simulate(&[-1.69, 0.81], &[], 100_000, 2);
    let model = burg(&y, 2).unwrap();
    // Asymptotic deviation of a_2 is sqrt((1 - a_2^2)/n) = 0.0019.
    close(&model.ar, &[-1.69, 0.81], 0.008);
    assert!((model.variance - 1.0).abs() < 4.0 * (2.0_f64 / 1e5).sqrt());
    assert!(burg(&y[..2], 2).is_err());
    assert_eq!(burg(&[0.0; 10], 2).unwrap().ar, [0.0; 2]);
}

#[test]
fn reflection_and_polynomial_are_two_names_of_one_thing() {
    let reflection = [0.5, -0.9, 0.3, 0.99, -0.2, 0.7, -0.999];
    let ar = reflection_to_ar(&reflection);
    close(&ar_to_reflection(&ar).unwrap(), &reflection, 1e-9);
    // Order 2 by hand: a_1 = k_1 (1 + k_2), a_2 = k_2.
    close(&reflection_to_ar(&[0.5, -0.9]), &[0.05, -0.9], 1e-15);
    assert!(ar_to_reflection(&[]).unwrap().is_empty());
}

#[test]
fn unstable_polynomials_are_told_apart_from_barely_stable_ones() {
    let pair = |radius: f64| [-2.0 * radius * 0.3_f64.cos(), radius * radius];
    assert!(ar_to_reflection(&pair(0.9999)).is_ok());
    assert!(matches!(ar_to_reflection(&pair(1.0001)), Err(PredictionError::Unstable { order: 2, .. })));
    assert!(ar_to_reflection(&[-1.5]).is_err());
    assert!(matches!(ar_to_reflection(&[f64::NAN, 0.1]), Err(PredictionError::NotFinite)));
}

#[test]
fn power_gain_has_its_closed_forms() {
    assert_eq!(power_gain(&[], &[]).unwrap(), 1.0);
    let gain = power_gain(&[-0.9], &[]).unwrap();
    assert!((gain - 1.0 / 0.19).abs() < 1e-12);
    let gain = power_gain(&[], &[0.5, -2.0]).unwrap();
    assert!((gain - 5.25).abs() < 1e-14);
    // ARMA(1,1): (1 + b^2 - 2ab) / (1 - a^2).
    let gain = power_gain(&[-0.8], &[0.3]).unwrap();
    assert!((gain - (1.0 + 0.09 + 2.0 * 0.8 * 0.3) / 0.36).abs() < 1e-12);
}

#[test]
fn power_gain_is_the_energy_of_the_impulse_response() {
    let ar = reflection_to_ar(&[0.3, -0.95, 0.6, 0.2, -0.7]);
    let ma = [0.4, -1.3, 0.2, 0.0, 0.9, 0.1, -0.6];
    let n = 20_000;
    let mut h = vec![0.0; n];
    for i in 0..n {
        h[i] = if i == 0 { 1.0 } else { ma.get(i - 1).copied().unwrap_or(0.0) };
        for (k, a) in ar.iter().enumerate().take(i) {
            h[i] -= a * h[i - k - 1];
        }
    }
    let energy: f64 = h.iter().map(|h| h * h).sum();
    assert!((power_gain(&ar, &ma).unwrap() / energy - 1.0).abs() < 1e-10);
    assert!(power_gain(&[1.2], &[]).is_err());
}

#[test]
fn arma_autocovariance_is_that_of_the_impulse_response() {
    let ar = reflection_to_ar(&[0.3, -0.9, 0.6]);
    let ma = [0.4, -1.3, 0.2, 0.7];
    let n = 5000;
    let mut h = vec![0.0; n];
    for i in 0..n {
        h[i] = if i == 0 { 1.0 } else { ma.get(i - 1).copied().unwrap_or(0.0) };
        for (k, a) in ar.iter().enumerate().take(i) {
            h[i] -= a * h[i - k - 1];
        }
    }
    let want: Vec<f64> =
        (0..=20).map(|lag| 1.5 * h[lag..].iter().zip(&h).map(|(a, b)| a * b).sum::<f64>()).collect();
    let got = arma_autocovariance(&ar, &ma, 1.5, 20).unwrap();
    let power = want[0];
    for (got, want) in got.iter().zip(&want) {
        assert!((got - want).abs() < 1e-11 * power, "{got} {want}");
    }
    assert_eq!(arma_autocovariance(&[], &[], 2.0, 2).unwrap(), [2.0, 0.0, 0.0]);
    assert!(arma_autocovariance(&[1.5], &[], 2.0, 2).is_err());
}

/// The polynomial with these reflection coefficients (step-up recursion); stable when all lie between -1 and 1.
pub(crate) fn reflection_to_ar(reflection: &[f64]) -> Vec<f64> {
    let mut ar = reflection.to_vec();
    step_up(&mut ar);
    ar
}

/// Autocovariances at lags 0..=max_lag of white noise of this variance after `B(z)/A(z)`, in unit squared.
pub(crate) fn arma_autocovariance(
    ar: &[f64],
    ma: &[f64],
    variance: f64,
    max_lag: usize,
) -> Result<Vec<f64>, PredictionError> {
    let q = ma.len();
    let plain = ar_autocovariance(ar, variance, max_lag + q)?;
    let b = |i: usize| if i == 0 { 1.0 } else { ma[i - 1] };
    let correlation: Vec<f64> = (0..=q).map(|lag| (lag..=q).map(|i| b(i) * b(i - lag)).sum()).collect();
    Ok((0..=max_lag)
        .map(|lag| {
            let both_sides = (1..=q).map(|j| correlation[j] * (plain[lag + j] + plain[lag.abs_diff(j)]));
            correlation[0] * plain[lag] + both_sides.sum::<f64>()
        })
        .collect())
}

/// As [`arma_autocovariance`] with B(z) = 1: Levinson's recursion run from the model to the lags.
fn ar_autocovariance(ar: &[f64], variance: f64, max_lag: usize) -> Result<Vec<f64>, PredictionError> {
    let p = ar.len();
    let reflection = ar_to_reflection(ar)?;
    let mut error = variance / reflection.iter().map(|k| 1.0 - k * k).product::<f64>();
    let mut r = vec![error];
    let mut lower: Vec<f64> = Vec::with_capacity(p);
    for m in 1..=max_lag.max(p) {
        let model = if m <= p { &lower[..] } else { ar };
        let predicted: f64 = model.iter().enumerate().map(|(i, a)| -a * r[m - 1 - i]).sum();
        let k = reflection.get(m - 1).copied().unwrap_or(0.0);
        r.push(predicted - k * error);
        if m <= p {
            lower.push(0.0);
            raise_order(&mut lower, k);
            error *= 1.0 - k * k;
        }
    }
    r.truncate(max_lag + 1);
    Ok(r)
}
