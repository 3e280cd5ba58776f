//! Detects models that differ from their neighbours (thesis 2.3.3): for each of several criteria, fits a plane over force and
//! speed and tests the studentized residuals by their t-distribution.

use nalgebra::{Matrix3, Vector3};
use statrs::distribution::{ContinuousCDF, StudentsT};

/// Settings for detecting outliers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OutlierSettings {
    /// Confidence of the residuals' interval; the thesis does not state it.
    pub confidence: f64,
    /// Criteria a model must fail to be dropped.
    pub criteria: usize,
}

impl Default for OutlierSettings {
    fn default() -> Self {
        Self { confidence: 0.95, criteria: 2 }
    }
}

/// The externally studentized residuals of `values` from their least-squares plane over `positions`: each in units of
/// the deviation that the others leave, t-distributed with n - 4 degrees of freedom. `None` if there are too few points
/// for a plane, or they do not determine one.
///
/// The residual of a point that alone determines the plane is 0.
pub(crate) fn studentized_residuals(positions: &[(f64, f64)], values: &[f64]) -> Option<Vec<f64>> {
    let n = positions.len();
    if n < 5 || values.len() != n {
        return None;
    }
    // Centred and scaled, so that units do not decide what is singular.
    let (x, y): (Vec<f64>, Vec<f64>) = positions.iter().copied().unzip();
    let (x, y) = (haptograph_signal::statistics::z_scores(&x), haptograph_signal::statistics::z_scores(&y));
    let rows: Vec<Vector3<f64>> = x.iter().zip(&y).map(|(&x, &y)| Vector3::new(1.0, x, y)).collect();
    let products: Matrix3<f64> = rows.iter().map(|row| row * row.transpose()).sum();
    // Determinant relative to that of uncorrelated positions.
    if products.determinant() < 1e-9 * (n as f64).powi(3) {
        return None;
    }
    let inverse = products.try_inverse()?;
    let plane = inverse * rows.iter().zip(values).map(|(row, &value)| row * value).sum::<Vector3<f64>>();
    let residuals: Vec<f64> = rows.iter().zip(values).map(|(row, &value)| value - plane.dot(row)).collect();
    let sum: f64 = residuals.iter().map(|r| r * r).sum();
    let scale: f64 = values.iter().map(|v| v * v).sum();
    let studentize = |(row, &residual): (&Vector3<f64>, &f64)| {
        let leverage = row.dot(&(inverse * row));
        let rest = 1.0 - leverage;
        let others = (sum - residual * residual / rest) / (n - 4) as f64;
        // Residuals at rounding level have no distribution.
        if rest < 1e-9 || sum <= 1e-24 * scale {
            0.0
        } else {
            residual / (others.max(f64::MIN_POSITIVE) * rest).sqrt()
        }
    };
    Some(rows.iter().zip(&residuals).map(studentize).collect())
}

/// The bound of the two-sided interval that holds `confidence` of the studentized residuals of `n` points.
pub(crate) fn residual_bound(n: usize, confidence: f64) -> f64 {
    let freedom = n.saturating_sub(4).max(1) as f64;
    let probability = 0.5 + confidence.clamp(0.0, 1.0 - 1e-9) / 2.0;
    StudentsT::new(0.0, 1.0, freedom).map_or(f64::INFINITY, |t| t.inverse_cdf(probability))
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptograph_signal::noise::Gaussian;

    fn grid() -> Vec<(f64, f64)> {
        (0..24).map(|i| (0.05 * (i % 6) as f64, 0.4 * (i / 6) as f64)).collect()
    }

    #[test]
    fn residuals_are_those_of_leaving_each_point_out() {
        let positions = grid();
        let mut noise = Gaussian::new(3);
        let values: Vec<f64> =
            positions.iter().map(|(s, f)| 2.0 + 3.0 * s - f + 0.1 * noise.next_sample()).collect();
        let residuals = studentized_residuals(&positions, &values).unwrap();
        for left_out in [0, 7, 23] {
            // Predict the point by the plane through the others, over the prediction's own deviation.
            let others =
                || positions.iter().zip(&values).enumerate().filter(|(i, _)| *i != left_out).map(|(_, o)| o);
            let row = |(s, f): (f64, f64)| Vector3::new(1.0, s, f);
            let products: Matrix3<f64> = others().map(|(&p, _)| row(p) * row(p).transpose()).sum();
            let inverse = products.try_inverse().unwrap();
            let plane = inverse * others().map(|(&p, &v)| row(p) * v).sum::<Vector3<f64>>();
            let variance = others().map(|(&p, &v)| (v - plane.dot(&row(p))).powi(2)).sum::<f64>() / 20.0;
            let here = row(positions[left_out]);
            let deviation = (variance * (1.0 + here.dot(&(inverse * here)))).sqrt();
            let expected = (values[left_out] - plane.dot(&here)) / deviation;
            assert!((residuals[left_out] - expected).abs() < 1e-9, "{left_out}");
        }
    }

    #[test]
    fn a_stray_value_stands_out_and_the_others_do_not() {
        let positions = grid();
        let mut noise = Gaussian::new(4);
        let mut values: Vec<f64> =
            positions.iter().map(|(s, f)| s + f + 0.01 * noise.next_sample()).collect();
        values[9] += 0.5;
        let residuals = studentized_residuals(&positions, &values).unwrap();
        let bound = residual_bound(positions.len(), 0.99);
        let out: Vec<_> = (0..24).filter(|&i| residuals[i].abs() > bound).collect();
        assert_eq!(out, [9]);
    }

    #[test]
    fn the_interval_holds_as_many_as_it_says() {
        let positions = grid();
        let mut noise = Gaussian::new(5);
        let bound = residual_bound(positions.len(), 0.95);
        let mut inside = 0;
        for _ in 0..500 {
            let values: Vec<f64> = positions.iter().map(|_| noise.next_sample()).collect();
            let residuals = studentized_residuals(&positions, &values).unwrap();
            inside += residuals.iter().filter(|r| r.abs() <= bound).count();
        }
        let part = inside as f64 / 12_000.0;
        assert!((part - 0.95).abs() < 0.01, "{part}");
        assert!((residual_bound(24, 0.95) - 2.086).abs() < 1e-3, "t table, 20 degrees of freedom");
    }

    #[test]
    fn no_plane_no_residuals() {
        let line: Vec<_> = (0..10).map(|i| (i as f64, 2.0 * i as f64)).collect();
        assert_eq!(studentized_residuals(&line, &[1.0; 10]), None);
        assert_eq!(studentized_residuals(&grid()[..4], &[1.0; 4]), None);
        assert_eq!(studentized_residuals(&grid(), &[1.0; 24]), Some(vec![0.0; 24]));
    }
}
