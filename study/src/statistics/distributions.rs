//! Tail probabilities and quantiles of F, t, chi-squared and normal distributions, central and noncentral.
//!
//! Upper tails are computed as such, never as 1 - cdf, so that small p keep their digits. Arguments outside of the domain give
//! NaN, not a panic.

use statrs::function::beta::checked_beta_reg;
use statrs::function::erf::{erfc, erfc_inv};
use statrs::function::gamma::{checked_gamma_ur, ln_gamma};
use std::f64::consts::{FRAC_1_SQRT_2, SQRT_2};

/// Degrees of freedom above which the deviation of a sample counts as that of the population.
const KNOWN_DEVIATION: f64 = 1e10;
/// Steps of the search for a root.
const MOST_STEPS: usize = 200;

/// The regularised incomplete beta function; NaN outside of its domain.
fn beta_reg(a: f64, b: f64, x: f64) -> f64 {
    if a.is_finite() && b.is_finite() { checked_beta_reg(a, b, x).unwrap_or(f64::NAN) } else { f64::NAN }
}

/// P(F >= f).
pub(super) fn f_survival(f: f64, df1: f64, df2: f64) -> f64 {
    if f <= 0.0 { 1.0 } else { beta_reg(df2 / 2.0, df1 / 2.0, df2 / (df2 + df1 * f)) }
}

/// P(|T| >= |t|).
pub(super) fn t_two_sided(t: f64, df: f64) -> f64 {
    f_survival(t * t, 1.0, df)
}

/// P(T >= t).
pub(super) fn t_survival(t: f64, df: f64) -> f64 {
    let half = 0.5 * t_two_sided(t, df);
    if t < 0.0 { 1.0 - half } else { half }
}

/// The t with P(|T| >= t) = `alpha`.
pub(super) fn t_quantile(alpha: f64, df: f64) -> f64 {
    falling_root_from_zero(|t| (t_two_sided(t, df) / alpha).ln())
}

/// P(chi-squared >= x).
pub(super) fn chi_squared_survival(x: f64, df: f64) -> f64 {
    if x <= 0.0 { 1.0 } else { checked_gamma_ur(df / 2.0, x / 2.0).unwrap_or(f64::NAN) }
}

/// P(Z <= z).
pub(super) fn normal_cdf(z: f64) -> f64 {
    0.5 * erfc(-z * FRAC_1_SQRT_2)
}

/// The z with P(|Z| >= z) = `alpha`.
pub(super) fn normal_quantile(alpha: f64) -> f64 {
    SQRT_2 * erfc_inv(alpha)
}

/// P(F <= f) where the numerator has the noncentrality `lambda`: the Poisson mixture of central distributions, summed over the
/// terms that reach 1e-14. The terms follow from each other by I(a + 1) = I(a) - T(a) (Abramowitz & Stegun 26.5.16).
pub(super) fn noncentral_f_cdf(f: f64, df1: f64, df2: f64, lambda: f64) -> f64 {
    let (mean, b) = (lambda / 2.0, df2 / 2.0);
    let x = df1 * f / (df1 * f + df2);
    let reach = 8.0 * mean.sqrt() + 40.0;
    let first = (mean - reach).max(0.0).floor();
    let mut a = df1 / 2.0 + first;
    let mut within = beta_reg(a, b, x);
    let mut ln_step =
        a * x.ln() + b * (df2 / (df1 * f + df2)).ln() + ln_gamma(a + b) - ln_gamma(a + 1.0) - ln_gamma(b);
    let mut weight = if mean > 0.0 { (first * mean.ln() - mean - ln_gamma(first + 1.0)).exp() } else { 1.0 };
    let mut sum = 0.0;
    let mut term = first;
    while term < mean + reach {
        sum += weight * within;
        within = (within - ln_step.exp()).max(0.0);
        ln_step += x.ln() + ((a + b) / (a + 1.0)).ln();
        term += 1.0;
        a += 1.0;
        weight *= mean / term;
    }
    sum
}

/// P(T <= t) where T has the noncentrality `delta`: the mean of a normal distribution over the deviations of the sample.
pub(super) fn noncentral_t_cdf(t: f64, df: f64, delta: f64) -> f64 {
    chi_nodes(df).iter().map(|(s, weight)| weight * normal_cdf(t * s - delta)).sum()
}

/// Values of s = sqrt(chi-squared / df) and weights that add to 1: a trapezoid rule in ln s, where the density is analytic and
/// falls fast on both sides, so that a mean over it converges to rounding. `df` is 1 or more.
pub(super) fn chi_nodes(df: f64) -> Vec<(f64, f64)> {
    if df.is_nan() || df < 1.0 {
        return vec![(f64::NAN, 1.0)];
    }
    if df > KNOWN_DEVIATION {
        return vec![(1.0, 1.0)];
    }
    let ln_density = |u: f64| df * (u - 0.5 * (2.0 * u).exp_m1());
    let step = (0.35 / df.sqrt()).min(0.1);
    // Down to e^-80 of the peak: a tail probability may lie in the left flank alone.
    let reach =
        |sign: f64| (1..).map(move |i| sign * step * f64::from(i)).take_while(|&u| ln_density(u) > -80.0);
    let places = reach(-1.0).chain(std::iter::once(0.0)).chain(reach(1.0));
    let mut nodes: Vec<(f64, f64)> = places.map(|u| (u.exp(), ln_density(u).exp())).collect();
    let total: f64 = nodes.iter().map(|(_, weight)| weight).sum();
    nodes.iter_mut().for_each(|(_, weight)| *weight /= total);
    nodes
}

/// Where a function falls through zero that is positive at `low` and negative at `high`: false position, where the value of an
/// end that stays is halved (the Illinois rule).
pub(super) fn falling_root(low: f64, high: f64, f: impl Fn(f64) -> f64) -> f64 {
    let (mut low, mut high) = ((low, f(low)), (high, f(high)));
    let mut last = high.0;
    for _ in 0..MOST_STEPS {
        let secant = (low.0 * high.1 - high.0 * low.1) / (high.1 - low.1);
        let place = if secant > low.0 && secant < high.0 { secant } else { 0.5 * (low.0 + high.0) };
        let here = f(place);
        if here == 0.0 || (place - last).abs() <= 1e-13 * place.abs() {
            return place;
        }
        last = place;
        if here > 0.0 {
            (low, high.1) = ((place, here), 0.5 * high.1);
        } else {
            (high, low.1) = ((place, here), 0.5 * low.1);
        }
    }
    last
}

/// Like [`falling_root`], from 0 to wherever the function is negative; 0 if it is not positive there, infinite if it stays so.
pub(super) fn falling_root_from_zero(f: impl Fn(f64) -> f64) -> f64 {
    if f(0.0) <= 0.0 {
        return 0.0;
    }
    let mut high = 1.0;
    while f(high) > 0.0 {
        high *= 2.0;
        if high > 1e150 {
            return f64::INFINITY;
        }
    }
    falling_root(if high > 1.0 { 0.5 * high } else { 0.0 }, high, f)
}
