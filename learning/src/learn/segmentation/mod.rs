//! Segmentation of a vibration at its changes of character, by minimum description length (thesis section 2.3.2).
//!
//! A recorded acceleration is modelled as a piecewise autoregressive process. [`segment`] finds the breaks and the
//! order of every segment that minimise Eq. 2.3.3, by default exactly (dynamic programming over a grid of possible
//! breaks, then breaks refined sample by sample), or with the island genetic algorithm of Auto-PARM to compare with
//! (the feature `genetic`).
//!
//! The objective, with the two logarithms that the printed equation leaves undefined at zero read as `log max(1, .)`:
//!
//! ```text
//! MDL = log⁺ m + (m+1) log n + sum_j [ log⁺ p_j + (p_j+2)/2 log n_j + n_j/2 log(2 pi s_j²) ]
//! ```
//!
//! `s_j²` is the innovation variance of segment j at order `p_j`, by the estimator chosen in
//! [`SegmentationSettings::variance`]; a floor of 1e-15 of the signal's mean square keeps digital silence finite.

mod exact;
#[cfg(feature = "genetic")]
mod genetic;
mod moments;
mod objective;
mod refine;
#[cfg(test)]
mod tests;
mod variance;

#[cfg(feature = "genetic")]
pub use genetic::GeneticSettings;

use haptograph_surfaces::MAX_ORDER;
use moments::Moments;
use objective::Objective;
use std::ops::Range;
use variance::{Burg, ConditionalLeastSquares, Estimator, YuleWalker};

/// Segments of a signal, each modelled by one autoregressive process.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Segmentation {
    /// 0-based first samples of the second and later segments, ascending.
    pub breaks: Vec<usize>,
    /// The order of each segment; one more than there are breaks.
    pub orders: Vec<usize>,
    /// The objective of Eq. 2.3.3 (natural logarithms) at these breaks and orders.
    pub mdl: f64,
}

impl Segmentation {
    /// The segments as ranges of samples, for a signal of `samples` samples.
    pub fn segments(&self, samples: usize) -> impl Iterator<Item = Range<usize>> + '_ {
        let starts = std::iter::once(0).chain(self.breaks.iter().copied());
        let ends = self.breaks.iter().copied().chain(std::iter::once(samples));
        starts.zip(ends).map(|(start, end)| start..end)
    }
}

/// Settings of a segmentation. The defaults are the thesis's: spans of at least 50 samples, orders 1 to 20.
#[derive(Debug, Clone, PartialEq)]
pub struct SegmentationSettings {
    /// The fewest samples a segment may have (at least 4). An order may not exceed half of its segment's samples.
    pub min_span: usize,
    /// The highest order, 1 to [`MAX_ORDER`].
    pub max_order: usize,
    /// Estimator of the innovation variance of Eq. 2.3.3.
    pub variance: VarianceEstimate,
    /// Search method that minimises the objective.
    pub method: SegmentationMethod,
}

impl Default for SegmentationSettings {
    fn default() -> Self {
        Self {
            min_span: 50,
            max_order: 20,
            variance: VarianceEstimate::ConditionalLeastSquares,
            method: SegmentationMethod::Exact { grid: None },
        }
    }
}

/// The estimate of a segment's innovation variance.
///
/// The thesis pairs its objective with the Levinson-Durbin recursion, which is Yule-Walker; but for that estimate the
/// number of breaks found need not converge to the true one, while for conditional maximum likelihood it does
/// (Davis, Hancock and Yao 2016). So conditional least squares is the default. It is also the only one of the
/// three that is a likelihood of the whole signal (each residual is predicted from the samples that really came before,
/// across the break), which makes the exact search prunable, and it does not smear a sharp resonance in short
/// segments as the implied taper of Yule-Walker does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum VarianceEstimate {
    /// Mean squared residual of the least-squares predictor, given the true past.
    #[default]
    ConditionalLeastSquares,
    /// Estimate from the biased autocovariance by Levinson-Durbin, as in the thesis.
    YuleWalker,
    /// Burg's forward-backward lattice.
    Burg,
}

/// Search method that minimises the objective.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum SegmentationMethod {
    /// Dynamic programming over every `grid`-th sample, exact there, then breaks refined at single samples.
    Exact {
        /// Samples between possible breaks, 1 to the minimum span. `None` takes the finest with at most 500 points: 1 for short
        /// signals, the minimum span from 25 000 samples on.
        grid: Option<usize>,
    },
    /// The island genetic algorithm of the thesis and of Auto-PARM. Much slower, and never better.
    #[cfg(feature = "genetic")]
    Genetic(GeneticSettings),
}

/// Reason why a signal cannot be segmented.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs)] // see the messages
pub enum SegmentationError {
    #[error(
        "sample {index} is {value}: repair or cut the recording there, segmentation needs finite numbers"
    )]
    NotFinite { index: usize, value: f64 },
    #[error(
        "{samples} samples are fewer than the minimum span of {min_span}: record longer or lower the minimum span"
    )]
    TooShort { samples: usize, min_span: usize },
    #[error(
        "the signal is {value} at every sample: there is no vibration to model (is the sensor connected, the right column chosen?)"
    )]
    Constant { value: f64 },
    #[error("setting {setting} is {value}, but must lie between {least} and {most}")]
    Setting { setting: &'static str, value: usize, least: usize, most: usize },
}

/// Segments `signal` (any unit, mean removed or high-passed) by minimum description length.
///
/// The result depends on the signal and the settings only, to the bit (a genetic search bounded by time excepted).
pub fn segment(signal: &[f64], settings: &SegmentationSettings) -> Result<Segmentation, SegmentationError> {
    check(signal, settings)?;
    Ok(at_unit_scale(signal, |signal| match settings.variance {
        VarianceEstimate::ConditionalLeastSquares => search::<ConditionalLeastSquares>(signal, settings),
        VarianceEstimate::YuleWalker => search::<YuleWalker>(signal, settings),
        VarianceEstimate::Burg => search::<Burg>(signal, settings),
    }))
}

/// Calls `find` with the signal divided by the power of two that brings its largest magnitude to between 1 and 2, so
/// that no second moment overflows or vanishes in any unit. The division is exact, and adds n times its logarithm to
/// the objective.
fn at_unit_scale(signal: &[f64], find: impl FnOnce(&[f64]) -> Segmentation) -> Segmentation {
    let magnitude = signal.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
    let exponent = magnitude.log2().floor() as i32;
    // In two steps, as the whole factor need not be a number.
    let half = -exponent / 2;
    let (first, second) = (2.0_f64.powi(half), 2.0_f64.powi(-exponent - half));
    let scaled: Vec<f64> = signal.iter().map(|x| x * first * second).collect();
    let mut found = find(&scaled);
    found.mdl += signal.len() as f64 * f64::from(exponent) * std::f64::consts::LN_2;
    found
}

/// The objective of Eq. 2.3.3 for given `breaks`, each segment at its best order. Breaks must ascend within the signal and leave
/// every segment its minimum span, else `None`.
pub fn description_length(
    signal: &[f64],
    breaks: &[usize],
    settings: &SegmentationSettings,
) -> Result<Option<Segmentation>, SegmentationError> {
    check(signal, settings)?;
    let ends = breaks.iter().copied().chain(std::iter::once(signal.len()));
    let mut start = 0;
    for end in ends {
        if end > signal.len() || end < start + settings.min_span {
            return Ok(None);
        }
        start = end;
    }
    let breaks = breaks.to_vec();
    Ok(Some(at_unit_scale(signal, |signal| match settings.variance {
        VarianceEstimate::ConditionalLeastSquares => {
            rate::<ConditionalLeastSquares>(signal, breaks, settings)
        }
        VarianceEstimate::YuleWalker => rate::<YuleWalker>(signal, breaks, settings),
        VarianceEstimate::Burg => rate::<Burg>(signal, breaks, settings),
    })))
}

fn search<E: Estimator>(signal: &[f64], settings: &SegmentationSettings) -> Segmentation {
    match &settings.method {
        SegmentationMethod::Exact { grid } => {
            let step = grid.unwrap_or_else(|| affordable_grid(signal.len(), settings.min_span));
            let moments = Moments::new(signal, settings.max_order, step);
            let mut objective = Objective::<E>::new(&moments, settings);
            let on_grid = exact::best_on_grid(&objective);
            let breaks = refine::refined(&mut objective, on_grid, step);
            objective.rate(breaks)
        }
        #[cfg(feature = "genetic")]
        SegmentationMethod::Genetic(genetic) => {
            let moments =
                Moments::new(signal, settings.max_order, affordable_grid(signal.len(), settings.min_span));
            genetic::best_found(&mut Objective::<E>::new(&moments, settings), settings, genetic)
        }
    }
}

fn rate<E: Estimator>(signal: &[f64], breaks: Vec<usize>, settings: &SegmentationSettings) -> Segmentation {
    let moments = Moments::new(signal, settings.max_order, affordable_grid(signal.len(), settings.min_span));
    Objective::<E>::new(&moments, settings).rate(breaks)
}

/// The finest grid with about 500 points, and never coarser than the minimum span.
fn affordable_grid(samples: usize, min_span: usize) -> usize {
    samples.div_ceil(500).clamp(1, min_span)
}

fn check(signal: &[f64], settings: &SegmentationSettings) -> Result<(), SegmentationError> {
    let within = |setting, value, least, most| {
        if (least..=most).contains(&value) {
            Ok(())
        } else {
            Err(SegmentationError::Setting { setting, value, least, most })
        }
    };
    within("min_span", settings.min_span, 4, usize::MAX)?;
    within("max_order", settings.max_order, 1, MAX_ORDER)?;
    match &settings.method {
        SegmentationMethod::Exact { grid: Some(grid) } => within("grid", *grid, 1, settings.min_span)?,
        SegmentationMethod::Exact { grid: None } => {}
        #[cfg(feature = "genetic")]
        SegmentationMethod::Genetic(genetic) => {
            within("islands", genetic.islands, 1, 1000)?;
            within("population", genetic.population, 4, 100_000)?;
        }
    }
    if let Some((index, &value)) = signal.iter().enumerate().find(|(_, x)| !x.is_finite()) {
        return Err(SegmentationError::NotFinite { index, value });
    }
    if signal.len() < settings.min_span {
        return Err(SegmentationError::TooShort { samples: signal.len(), min_span: settings.min_span });
    }
    if signal.iter().all(|&x| x == signal[0]) {
        return Err(SegmentationError::Constant { value: signal[0] });
    }
    Ok(())
}
