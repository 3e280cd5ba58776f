//! Statistics for measuring and learning.

/// Median; for an even number of values the mean of the middle two; 0 for no values.
pub fn median(values: &[f64]) -> f64 {
    let mut values = values.to_vec();
    let middle = values.len() / 2;
    if values.is_empty() {
        return 0.0;
    }
    let (below, &mut upper, _) = values.select_nth_unstable_by(middle, f64::total_cmp);
    let lower = below.iter().copied().max_by(f64::total_cmp);
    match lower {
        Some(lower) if below.len() == values.len() - middle => (lower + upper) / 2.0,
        _ => upper,
    }
}

/// The mean; 0 if empty.
pub fn mean(values: &[f64]) -> f64 {
    if values.is_empty() { 0.0 } else { values.iter().sum::<f64>() / values.len() as f64 }
}

/// The sample standard deviation (n - 1); 0 for fewer than two values.
pub fn standard_deviation(values: &[f64]) -> f64 {
    if values.len() < 2 {
        return 0.0;
    }
    let mean = mean(values);
    let squares: f64 = values.iter().map(|x| (x - mean) * (x - mean)).sum();
    (squares / (values.len() - 1) as f64).sqrt()
}

/// `values` minus their mean, divided by their standard deviation; zeros if they do not vary.
pub fn z_scores(values: &[f64]) -> Vec<f64> {
    let (mean, deviation) = (mean(values), standard_deviation(values));
    values.iter().map(|x| if deviation > 0.0 { (x - mean) / deviation } else { 0.0 }).collect()
}

/// A straight line through points.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Line {
    /// Rise per unit of x.
    pub slope: f64,
    /// Value at x = 0.
    pub intercept: f64,
    /// The fraction of the variance of y that the line explains; negative if the mean fits better. 1 if y is constant and on
    /// the line.
    pub r_squared: f64,
}

impl Line {
    /// The least-squares line. `None` unless x has at least two values.
    pub fn fit(points: &[(f64, f64)]) -> Option<Self> {
        let (mean_x, mean_y) = means(points);
        let (mut xx, mut xy) = (0.0, 0.0);
        for &(x, y) in points {
            xx += (x - mean_x) * (x - mean_x);
            xy += (x - mean_x) * (y - mean_y);
        }
        let slope = xy / xx;
        slope.is_finite().then(|| Self::with(slope, mean_y - slope * mean_x, points))
    }

    /// The least-squares line through the origin. `None` if every x is zero.
    pub fn fit_through_origin(points: &[(f64, f64)]) -> Option<Self> {
        let (mut xx, mut xy) = (0.0, 0.0);
        for &(x, y) in points {
            xx += x * x;
            xy += x * y;
        }
        let slope = xy / xx;
        slope.is_finite().then(|| Self::with(slope, 0.0, points))
    }

    fn with(slope: f64, intercept: f64, points: &[(f64, f64)]) -> Self {
        let (_, mean_y) = means(points);
        let total: f64 = points.iter().map(|&(_, y)| (y - mean_y) * (y - mean_y)).sum();
        let mut line = Self { slope, intercept, r_squared: 1.0 };
        let left: f64 = points.iter().map(|&(x, y)| (y - line.at(x)).powi(2)).sum();
        if left > 0.0 {
            line.r_squared = 1.0 - left / total;
        }
        line
    }

    /// The line's value at `x`.
    pub fn at(&self, x: f64) -> f64 {
        self.intercept + self.slope * x
    }
}

fn means(points: &[(f64, f64)]) -> (f64, f64) {
    let count = points.len() as f64;
    points.iter().fold((0.0, 0.0), |(a, b), &(x, y)| (a + x / count, b + y / count))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn medians_of_odd_and_even_numbers() {
        assert_eq!(median(&[3.0, 1.0, 2.0]), 2.0);
        assert_eq!(median(&[4.0, 1.0, 2.0, 3.0]), 2.5);
        assert_eq!(median(&[7.0]), 7.0);
        assert_eq!(median(&[7.0, 9.0]), 8.0);
        assert_eq!(median(&[]), 0.0);
    }

    #[test]
    fn lines_are_found_through_and_past_the_origin() {
        let points: Vec<_> = (0..10).map(|i| (i as f64, 3.0 - 0.5 * i as f64)).collect();
        let line = Line::fit(&points).unwrap();
        assert!(
            (line.slope + 0.5).abs() < 1e-12
                && (line.intercept - 3.0).abs() < 1e-12
                && line.r_squared > 0.999_999
        );
        let line = Line::fit_through_origin(&[(1.0, 1.0), (2.0, 2.4), (-1.0, -1.0)]).unwrap();
        assert!((line.slope - 6.8 / 6.0).abs() < 1e-12);
        assert_eq!(Line::fit(&[(1.0, 1.0), (1.0, 2.0)]), None);
        assert_eq!(Line::fit(&[]), None);
        assert_eq!(Line::fit_through_origin(&[(0.0, 1.0)]), None);
    }

    #[test]
    fn z_scores_have_mean_zero_and_deviation_one() {
        let z = z_scores(&[1.0, 2.0, 4.0, 9.0]);
        assert!(mean(&z).abs() < 1e-15 && (standard_deviation(&z) - 1.0).abs() < 1e-15);
        assert_eq!(z_scores(&[5.0, 5.0]), [0.0, 0.0]);
    }
}
