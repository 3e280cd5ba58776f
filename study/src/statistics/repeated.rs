//! Analysis of variance within people: every person answers in every condition.

use super::distributions::f_survival;
use super::tukey::{Comparison, tukey};
use super::variance::{Residual, Term};
use super::{StatisticsError, at_least, complete};
use nalgebra::DMatrix;
use serde::Serialize;

/// An effect within people, with what it is compared with.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct WithinTerm {
    /// The effect; its p assumes sphericity.
    pub effect: Term,
    /// The effect times people.
    pub error: Residual,
    /// Greenhouse and Geisser's (1959) epsilon, from 1 / df to 1.
    pub epsilon: f64,
    /// p with both degrees of freedom times epsilon.
    pub p_corrected: f64,
}

/// One factor within people.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RepeatedOneWay {
    /// People in the analysis.
    pub people: usize,
    /// Mean of each condition.
    pub means: Vec<f64>,
    /// The factor.
    pub term: WithinTerm,
}

impl RepeatedOneWay {
    /// Tukey's comparisons of all pairs of conditions on the error within people.
    pub fn tukey(&self, confidence: f64) -> Result<Vec<Comparison>, StatisticsError> {
        tukey(&self.means, &vec![self.people; self.means.len()], &self.term.error, confidence)
    }
}

/// Two factors within people.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RepeatedTwoWay {
    /// People in the analysis.
    pub people: usize,
    /// The first factor.
    pub a: WithinTerm,
    /// The second factor.
    pub b: WithinTerm,
    /// Their interaction.
    pub interaction: WithinTerm,
}

/// Compares conditions: a row a person, a column a condition. A person with a missing cell (NaN) is left out.
pub fn one_way<R: AsRef<[f64]>>(rows: &[R]) -> Result<RepeatedOneWay, StatisticsError> {
    let conditions = rows.first().map_or(0, |row| row.as_ref().len());
    at_least("conditions", conditions, 2)?;
    let table = complete(rows, conditions)?;
    Ok(RepeatedOneWay {
        people: table.nrows(),
        means: table.row_mean().iter().copied().collect(),
        term: within(&table, &contrasts(conditions))?,
    })
}

/// Compares the levels of two factors: a row a person, with `levels_a` times `levels_b` cells, those of the first level of a
/// first. A person with a missing cell (NaN) is left out.
pub fn two_way<R: AsRef<[f64]>>(
    rows: &[R],
    levels_a: usize,
    levels_b: usize,
) -> Result<RepeatedTwoWay, StatisticsError> {
    at_least("levels of the first factor", levels_a, 2)?;
    at_least("levels of the second factor", levels_b, 2)?;
    let table = complete(rows, levels_a.saturating_mul(levels_b))?;
    let (a, b) = (contrasts(levels_a), contrasts(levels_b));
    let average = |levels: usize| DMatrix::from_element(levels, 1, (levels as f64).sqrt().recip());
    Ok(RepeatedTwoWay {
        people: table.nrows(),
        a: within(&table, &a.kronecker(&average(levels_b)))?,
        b: within(&table, &average(levels_a).kronecker(&b))?,
        interaction: within(&table, &a.kronecker(&b))?,
    })
}

/// Orthonormal contrasts (Helmert): one column for each level but the first.
fn contrasts(levels: usize) -> DMatrix<f64> {
    DMatrix::from_fn(levels, levels - 1, |row, column| {
        let before = (column + 1) as f64;
        let norm = (before * (before + 1.0)).sqrt();
        match row {
            row if row <= column => -1.0 / norm,
            row if row == column + 1 => before / norm,
            _ => 0.0,
        }
    })
}

/// The test of an effect, given by orthonormal contrasts of the conditions, from the people's values of these contrasts.
fn within(table: &DMatrix<f64>, contrasts: &DMatrix<f64>) -> Result<WithinTerm, StatisticsError> {
    let (people, df) = (table.nrows() as f64, contrasts.ncols() as f64);
    let mut scores = table * contrasts;
    let means = scores.row_mean();
    scores.row_iter_mut().for_each(|mut row| row -= &means);
    let products = scores.transpose() * &scores;
    let size = products.trace();
    // What rounding leaves of people who all differ between conditions by the same amounts.
    let rounding = table.amax() * 1e-14;
    let spread = if size > rounding * rounding * people * df { size } else { 0.0 };
    let error = Residual::new(spread, (people - 1.0) * df)?;
    let effect = error.term(people * means.norm_squared(), df)?;
    let epsilon = ((products / size).norm_squared() * df).recip().clamp(1.0 / df, 1.0);
    let p_corrected = f_survival(effect.f, epsilon * df, epsilon * error.df);
    Ok(WithinTerm { effect, error, epsilon, p_corrected })
}
