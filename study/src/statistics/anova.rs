//! Analysis of variance between groups: one factor, or two with or without their interaction.

use super::regression::residual_sum;
use super::tukey::{Comparison, tukey};
use super::variance::squares_about;
use super::{StatisticsError, all_finite, at_least};
use haptograph_signal::statistics::mean;
use nalgebra::{DMatrix, DVector};
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};

pub use super::variance::{Residual, Term};

/// One factor between groups.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct OneWay {
    /// Mean of each group.
    pub means: Vec<f64>,
    /// Number of values of each group.
    pub counts: Vec<usize>,
    /// The factor.
    pub effect: Term,
    /// Within the groups.
    pub residual: Residual,
}

impl OneWay {
    /// Tukey's comparisons of all pairs of groups (Tukey-Kramer where counts differ).
    pub fn tukey(&self, confidence: f64) -> Result<Vec<Comparison>, StatisticsError> {
        tukey(&self.means, &self.counts, &self.residual, confidence)
    }
}

/// Compares the means of two or more groups of values.
pub fn one_way<G: AsRef<[f64]>>(groups: &[G]) -> Result<OneWay, StatisticsError> {
    at_least("groups", groups.len(), 2)?;
    for group in groups {
        at_least("values of a group", group.as_ref().len(), 1)?;
        all_finite("values of a group", group.as_ref())?;
    }
    let counts: Vec<usize> = groups.iter().map(|group| group.as_ref().len()).collect();
    let all: usize = counts.iter().sum();
    at_least("values", all, groups.len() + 1)?;
    let means: Vec<f64> = groups.iter().map(|group| mean(group.as_ref())).collect();
    let grand = means.iter().zip(&counts).map(|(mean, &n)| mean * n as f64).sum::<f64>() / all as f64;
    let between = means.iter().zip(&counts).map(|(mean, &n)| n as f64 * (mean - grand).powi(2)).sum();
    let deviations = |(group, mean): (&G, &f64)| squares_about(group.as_ref(), *mean);
    let within = groups.iter().zip(&means).map(deviations).sum();
    let residual = Residual::new(within, (all - groups.len()) as f64)?;
    let effect = residual.term(between, (groups.len() - 1) as f64)?;
    Ok(OneWay { means, counts, effect, residual })
}

/// Ratings of people (a row each) less the mean of each person: the thesis's normalisation (4.5.3). A one-way test of the
/// columns counts one degree of freedom a person too many, which are not there.
pub fn centred_by_person<R: AsRef<[f64]>>(rows: &[R]) -> Vec<Vec<f64>> {
    let centred = |row: &[f64]| {
        let mean = mean(row);
        row.iter().map(|x| x - mean).collect()
    };
    rows.iter().map(|row| centred(row.as_ref())).collect()
}

/// The columns of rows, as far as the shortest row goes.
pub fn columns<R: AsRef<[f64]>>(rows: &[R]) -> Vec<Vec<f64>> {
    let width = rows.iter().map(|row| row.as_ref().len()).min().unwrap_or(0);
    (0..width).map(|column| rows.iter().map(|row| row.as_ref()[column]).collect()).collect()
}

/// Two factors between groups.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TwoWay {
    /// The first factor.
    pub a: Term,
    /// The second factor.
    pub b: Term,
    /// Their interaction, if it is part of the model.
    pub interaction: Option<Term>,
    /// What the model leaves.
    pub residual: Residual,
}

/// Compares the levels of two factors: observations are (level of a, level of b, value), in any order and number a cell. Levels
/// are any numbers.
///
/// Sums of squares are of Type II: each factor after the other, the interaction after both; the error is that of the whole
/// model. In a balanced table Types I, II and III are the same. With the interaction every combination has to occur.
pub fn two_way(
    observations: &[(usize, usize, f64)],
    with_interaction: bool,
) -> Result<TwoWay, StatisticsError> {
    let values: Vec<f64> = observations.iter().map(|o| o.2).collect();
    all_finite("values", &values)?;
    let places = |level: fn(&(usize, usize, f64)) -> usize| {
        let levels: BTreeSet<usize> = observations.iter().map(level).collect();
        let index: BTreeMap<usize, usize> = levels.into_iter().zip(0..).collect();
        (observations.iter().map(|o| index[&level(o)]).collect::<Vec<_>>(), index.len())
    };
    let ((a, levels_a), (b, levels_b)) = (places(|o| o.0), places(|o| o.1));
    at_least("levels of the first factor", levels_a, 2)?;
    at_least("levels of the second factor", levels_b, 2)?;
    let (df_a, df_b) = ((levels_a - 1) as f64, (levels_b - 1) as f64);
    let parameters = if with_interaction { levels_a * levels_b } else { levels_a + levels_b - 1 };
    at_least("values", values.len(), parameters + 1)?;

    let centre = mean(&values);
    let centred = DVector::from_iterator(values.len(), values.iter().map(|x| x - centre));
    let left = |factors: &[(&[usize], usize)]| residual_sum(dummies(factors), &centred);
    let additive = left(&[(&a, levels_a), (&b, levels_b)])?;
    let cells: Vec<usize> = a.iter().zip(&b).map(|(a, b)| a * levels_b + b).collect();
    let whole = if with_interaction { left(&[(&cells, parameters)])? } else { additive };
    let residual = Residual::new(whole, (values.len() - parameters) as f64)?;
    let interaction = residual.term(additive - whole, df_a * df_b);
    Ok(TwoWay {
        a: residual.term(left(&[(&b, levels_b)])? - additive, df_a)?,
        b: residual.term(left(&[(&a, levels_a)])? - additive, df_b)?,
        interaction: with_interaction.then_some(interaction).transpose()?,
        residual,
    })
}

/// The design of a model with an intercept: a column of ones, then one for each level of each factor but the first.
fn dummies(factors: &[(&[usize], usize)]) -> DMatrix<f64> {
    let rows = factors.first().map_or(0, |(levels, _)| levels.len());
    let width = 1 + factors.iter().map(|(_, count)| count - 1).sum::<usize>();
    let mut design = DMatrix::zeros(rows, width);
    design.column_mut(0).fill(1.0);
    let mut first = 1;
    for (levels, count) in factors {
        for (row, &level) in levels.iter().enumerate() {
            if level > 0 {
                design[(row, first + level - 1)] = 1.0;
            }
        }
        first += count - 1;
    }
    design
}
