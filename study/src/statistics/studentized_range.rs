//! The studentized range: the range of the means of equal groups over their standard error, on which Tukey's test rests.

use super::distributions::{chi_nodes, falling_root_from_zero, normal_cdf};
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::f64::consts::TAU;

/// Range of normal deviates above which the probability is below 1e-300.
const LARGEST_RANGE: f64 = 52.0;
/// Number of groups above which the integral takes too long.
const MOST_GROUPS: usize = 10_000;

/// P(Q >= q) of `groups` groups and `df` degrees of freedom of the error (infinite: a known deviation).
///
/// The complement itself is integrated, twice by the trapezoid rule, whose error on these integrands is below rounding: the
/// relative error is that of the normal distribution, about 1e-10, also of tails of 1e-13. NaN for fewer than two groups or
/// more than 10,000, `df` below 1, or `q` NaN.
pub fn survival(q: f64, groups: usize, df: f64) -> f64 {
    if !(2..=MOST_GROUPS).contains(&groups) || df.is_nan() || df < 1.0 || q.is_nan() {
        return f64::NAN;
    }
    if q <= 0.0 {
        return 1.0;
    }
    chi_nodes(df).iter().map(|(s, weight)| weight * range_survival(q * s, groups)).sum::<f64>().min(1.0)
}

/// Number of quantiles that a thread remembers.
const REMEMBERED: usize = 100;

thread_local! {
    /// Quantiles by `alpha`, groups and degrees of freedom: each takes a search, and simulated studies need few over and over.
    static QUANTILES: RefCell<BTreeMap<(u64, usize, u64), f64>> = const { RefCell::new(BTreeMap::new()) };
}

/// The q with P(Q >= q) = `alpha`. NaN unless `alpha` lies between 0 and 1 and the rest is as in [`survival`].
pub fn quantile(alpha: f64, groups: usize, df: f64) -> f64 {
    let key = (alpha.to_bits(), groups, df.to_bits());
    QUANTILES.with_borrow_mut(|known| {
        if known.len() >= REMEMBERED {
            known.clear();
        }
        *known.entry(key).or_insert_with(|| find_quantile(alpha, groups, df))
    })
}

fn find_quantile(alpha: f64, groups: usize, df: f64) -> f64 {
    let gap = |q: f64| (survival(q, groups, df) / alpha).ln();
    if !(alpha > 0.0 && alpha < 1.0) || gap(1.0).is_nan() {
        return f64::NAN;
    }
    falling_root_from_zero(gap)
}

/// P(range of `groups` standard normal deviates >= w): the integral over the largest deviate z of
/// k φ(z) (Φ(z)^(k-1) - (Φ(z) - Φ(z-w))^(k-1)).
fn range_survival(w: f64, groups: usize) -> f64 {
    if w > LARGEST_RANGE {
        return 0.0;
    }
    let others = (groups - 1) as f64;
    // The more groups, the narrower the integrand.
    let step = 0.25 * (10.0 / groups as f64).min(1.0).sqrt();
    let nodes = (9.0 / step).ceil() as i32;
    let share = |z: f64| {
        let below = normal_cdf(z);
        let outside = (normal_cdf(z - w) / below).min(1.0);
        (-0.5 * z * z).exp() * below.powf(others) * -(others * (-outside).ln_1p()).exp_m1()
    };
    let sum: f64 = (-nodes..=nodes).map(|i| share(0.5 * w + step * f64::from(i))).sum();
    groups as f64 * step * sum / TAU.sqrt()
}
