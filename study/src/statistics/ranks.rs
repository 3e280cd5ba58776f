//! Tests on ranks, which assume no scale of the answers: Friedman, Wilcoxon, and Holm's correction.

use super::distributions::{chi_squared_survival, normal_cdf};
use super::{StatisticsError, all_finite, at_least, complete};
use serde::Serialize;

/// Number of differences below which Wilcoxon's test is exact, if none are equal or zero: as in R.
const EXACT_BELOW: usize = 50;

/// Ranks from 1; equal values have the mean of their ranks.
pub fn ranks(values: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|&a, &b| values[a].total_cmp(&values[b]));
    let mut ranks = vec![0.0; values.len()];
    let mut first = 0;
    for tied in order.chunk_by(|&a, &b| values[a] == values[b]) {
        let rank = first as f64 + (tied.len() + 1) as f64 / 2.0;
        tied.iter().for_each(|&i| ranks[i] = rank);
        first += tied.len();
    }
    ranks
}

/// The sum of t^3 - t over groups of t equal ranks.
fn ties(ranks: &[f64]) -> f64 {
    let mut sorted = ranks.to_vec();
    sorted.sort_by(f64::total_cmp);
    let cube = |t: f64| t * t * t - t;
    sorted.chunk_by(|a, b| a == b).map(|tied| cube(tied.len() as f64)).sum()
}

/// Friedman's (1937) test that conditions do not differ.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Friedman {
    /// People in the test.
    pub people: usize,
    /// The statistic, corrected for ties.
    pub chi_squared: f64,
    /// Degrees of freedom.
    pub df: f64,
    /// p by the chi-squared distribution.
    pub p: f64,
}

/// Compares conditions by the ranks within each person: a row a person, a column a condition. A person with a missing cell (NaN)
/// is left out.
pub fn friedman<R: AsRef<[f64]>>(rows: &[R]) -> Result<Friedman, StatisticsError> {
    let conditions = rows.first().map_or(0, |row| row.as_ref().len());
    at_least("conditions", conditions, 2)?;
    let table = complete(rows, conditions)?;
    let (people, k) = (table.nrows() as f64, conditions as f64);
    let ranked: Vec<Vec<f64>> =
        table.row_iter().map(|row| ranks(&row.iter().copied().collect::<Vec<_>>())).collect();
    let mean_rank = |c: usize| ranked.iter().map(|row| row[c]).sum::<f64>() / people;
    let spread: f64 = (0..conditions).map(|c| (people * (mean_rank(c) - (k + 1.0) / 2.0)).powi(2)).sum();
    let tied: f64 = ranked.iter().map(|row| ties(row)).sum();
    let scale = people * k * (k + 1.0) - tied / (k - 1.0);
    if scale <= 0.0 {
        return Err(StatisticsError::NoVariation { what: "ratings of every person" });
    }
    let (chi_squared, df) = (12.0 * spread / scale, k - 1.0);
    let p = chi_squared_survival(chi_squared, df);
    Ok(Friedman { people: table.nrows(), chi_squared, df, p })
}

/// Wilcoxon's (1945) signed-rank test that differences lie about zero.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Wilcoxon {
    /// Differences that are not zero.
    pub count: usize,
    /// Sum of the ranks of the positive ones (R's V).
    pub positive_ranks: f64,
    /// Two-sided p.
    pub p: f64,
    /// Whether p comes from all signs, not from the normal distribution.
    pub exact: bool,
}

/// Tests differences of pairs. The convention is R's: differences of zero are dropped; below 50 differences, none of them equal
/// in size or zero, p is exact; otherwise it is normal, corrected for ties and for continuity. Differences
/// of decimals that ought to be equal differ by rounding, as in R: where that matters, round them first.
pub fn wilcoxon(differences: &[f64]) -> Result<Wilcoxon, StatisticsError> {
    all_finite("differences", differences)?;
    let left: Vec<f64> = differences.iter().copied().filter(|&d| d != 0.0).collect();
    at_least("differences other than zero", left.len(), 1)?;
    let sizes = ranks(&left.iter().map(|d| d.abs()).collect::<Vec<_>>());
    let positive_ranks = sizes.iter().zip(&left).filter(|(_, d)| **d > 0.0).map(|(rank, _)| rank).sum();
    let (n, tied) = (left.len() as f64, ties(&sizes));
    let exact = tied == 0.0 && left.len() == differences.len() && left.len() < EXACT_BELOW;
    let p = if exact {
        exact_p(left.len(), positive_ranks)
    } else {
        let variance = n * (n + 1.0) * (2.0 * n + 1.0) / 24.0 - tied / 48.0;
        let distance = (positive_ranks - n * (n + 1.0) / 4.0).abs();
        (2.0 * normal_cdf(-(distance - 0.5).max(0.0) / variance.sqrt())).min(1.0)
    };
    Ok(Wilcoxon { count: left.len(), positive_ranks, p, exact })
}

/// Two-sided p of a sum of ranks by counting signs.
fn exact_p(count: usize, positive_ranks: f64) -> f64 {
    let largest = count * (count + 1) / 2;
    let mut ways = vec![0.0; largest + 1];
    ways[0] = 1.0;
    for rank in 1..=count {
        for sum in (rank..=largest).rev() {
            ways[sum] += ways[sum - rank];
        }
    }
    let extreme = (positive_ranks as usize).min(largest - positive_ranks as usize);
    let tail: f64 = ways[..=extreme].iter().sum();
    (2.0 * tail * 0.5_f64.powi(count as i32)).min(1.0)
}

/// p adjusted for several tests by Holm's (1979) method, in the given order. NaN are not counted and stay.
pub fn holm(p: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..p.len()).filter(|&i| !p[i].is_nan()).collect();
    order.sort_by(|&a, &b| p[a].total_cmp(&p[b]));
    let mut adjusted = p.to_vec();
    let mut largest: f64 = 0.0;
    for (rank, &i) in order.iter().enumerate() {
        largest = largest.max((order.len() - rank) as f64 * p[i]).min(1.0);
        adjusted[i] = largest;
    }
    adjusted
}

/// Two conditions compared by ranks.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct RankComparison {
    /// The condition that is subtracted.
    pub from: usize,
    /// The condition it is subtracted from.
    pub to: usize,
    /// The test; `None` if all people rated both alike.
    pub test: Option<Wilcoxon>,
    /// Its p by Holm's method over all pairs; 1 without a test.
    pub p_holm: f64,
}

/// Wilcoxon's test of all pairs of conditions with Holm's correction: a row a person, a column a condition. A person with a
/// missing cell (NaN) is left out.
pub fn wilcoxon_pairs<R: AsRef<[f64]>>(rows: &[R]) -> Result<Vec<RankComparison>, StatisticsError> {
    let conditions = rows.first().map_or(0, |row| row.as_ref().len());
    at_least("conditions", conditions, 2)?;
    let table = complete(rows, conditions)?;
    let pairs = (0..conditions).flat_map(|from| (from + 1..conditions).map(move |to| (from, to)));
    let compare = |(from, to)| {
        let differences: Vec<f64> = (table.column(to) - table.column(from)).iter().copied().collect();
        all_finite("differences", &differences)?;
        Ok(RankComparison { from, to, test: wilcoxon(&differences).ok(), p_holm: 1.0 })
    };
    let mut found: Vec<RankComparison> = pairs.map(compare).collect::<Result<_, StatisticsError>>()?;
    let p: Vec<f64> = found.iter().map(|pair| pair.test.map_or(1.0, |test| test.p)).collect();
    found.iter_mut().zip(holm(&p)).for_each(|(pair, p)| pair.p_holm = p);
    Ok(found)
}

/// The sign test: the probability, if both outcomes are as likely, of a share at least as far from one half as so many of all.
pub fn sign_test(count: u64, all: u64) -> f64 {
    let far = count.max(all.saturating_sub(count));
    let share = |k: u64| (statrs::function::factorial::ln_binomial(all, k) - all as f64 * 2.0_f64.ln()).exp();
    (2.0 * (far..=all).map(share).sum::<f64>()).min(1.0)
}
