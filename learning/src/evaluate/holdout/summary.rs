//! Summary of a hold-out evaluation: means by material, and means over materials with standard errors.

use super::FoldResult;
use super::folds::Split;
use super::measures::Measures;
use super::methods::{BASELINES, Method};
use haptograph_signal::statistics::{mean, standard_deviation};

/// All folds of all materials.
#[derive(Debug, Clone, PartialEq)]
pub struct Holdout {
    /// Names of the materials.
    pub materials: Vec<String>,
    /// Number of noise seeds per method.
    pub seeds: u64,
    /// Results of the folds.
    pub folds: Vec<FoldResult>,
}

/// A mean over materials with its standard error, `None` for a single material.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mean {
    /// The mean.
    pub mean: f64,
    /// The standard error.
    pub error: Option<f64>,
}

impl Mean {
    pub(super) fn of(values: &[f64]) -> Self {
        Self {
            mean: mean(values),
            error: (values.len() > 1).then(|| standard_deviation(values) / (values.len() as f64).sqrt()),
        }
    }
}

/// Errors on each material, the means over its folds, dB; none of those that a fold does not have.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ByMaterial {
    /// Log-spectral distance.
    pub lsd_db: Vec<f64>,
    /// Log-spectral distance from 100 to 500 Hz.
    pub middle_lsd_db: Vec<f64>,
    /// Signed error from 20 to 40 Hz.
    pub low_db: Vec<f64>,
    /// Signed error of the total power.
    pub total_db: Vec<f64>,
}

/// Error of one third octave over all materials.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BandMean {
    /// The centre, Hz.
    pub centre_hz: f64,
    /// Signed error of its power, dB.
    pub signed_db: f64,
    /// Mean size of the error in each fold, dB.
    pub absolute_db: f64,
}

/// The means of a method over all materials.
#[derive(Debug, Clone, PartialEq)]
pub struct MethodMean {
    /// The method.
    pub method: Method,
    /// Errors by material.
    pub by_material: ByMaterial,
    /// Log-spectral distance over materials, dB.
    pub lsd_db: Mean,
    /// Log-spectral distance minus that of the floor in the same fold, dB.
    pub above_floor_db: Mean,
    /// Log-spectral distance minus that of the better plain baseline over all materials, in the same folds,
    /// dB.
    pub above_baseline_db: Mean,
    /// Log-spectral distance from 100 to 500 Hz, dB.
    pub middle_lsd_db: Option<Mean>,
    /// The same minus that of the floor, dB.
    pub middle_above_floor_db: Option<Mean>,
    /// Log-spectral distance weighted by tactile sensitivity, dB.
    pub pacinian_lsd_db: Mean,
    /// Mean absolute error over bands, dB.
    pub absolute_db: Mean,
    /// Signed error from 20 to 40 Hz, dB.
    pub low_db: Option<Mean>,
    /// Signed error of the total power, dB.
    pub total_db: Mean,
    /// Energy in the wrong one of nine bands, 0 to 1.
    pub misplaced: Mean,
    /// Error of the excess kurtosis.
    pub kurtosis: Mean,
    /// Error of levels over 50 ms, dB.
    pub envelope_db: Option<Mean>,
    /// The same between seeds, dB.
    pub envelope_floor_db: Option<Mean>,
    /// Normalized spectral error.
    pub nse: Option<Mean>,
    /// Power error.
    pub pe: Option<Mean>,
    /// Errors by band, means over materials, where all materials have the same bands.
    pub by_band: Vec<BandMean>,
    /// True if this is not a plain baseline and its mean over materials is worse than that of one.
    pub loses: bool,
}

/// The result of one kind of split over all materials.
#[derive(Debug, Clone, PartialEq)]
pub struct SplitResult {
    /// The kind of split.
    pub split: Split,
    /// Methods, the floor first.
    pub methods: Vec<MethodMean>,
    /// The plain baseline with the smallest mean distance.
    pub best_baseline: Method,
    /// Part of the recorded levels that force and speed do not explain, dB.
    pub unexplained_level_db: Option<Mean>,
    /// Distance between two stationary takes with the lengths of the parts, dB, and between one of them and
    /// the mean over seeds.
    pub estimator_db: (f64, f64),
}

type Value = dyn Fn(&Measures) -> Option<f64>;

impl Holdout {
    /// The results of all kinds of splits that have folds.
    pub fn splits(&self) -> Vec<SplitResult> {
        Split::ALL.into_iter().filter_map(|split| self.split(split)).collect()
    }

    fn split(&self, split: Split) -> Option<SplitResult> {
        let folds: Vec<&FoldResult> = self.folds.iter().filter(|fold| fold.split == split).collect();
        if folds.is_empty() {
            return None;
        }
        let lsd = |method: Method| {
            mean(&self.over_materials(&folds, &|fold| Some(fold.of(method).bands.lsd_db)).unwrap_or_default())
        };
        let best_baseline = if lsd(BASELINES[1]) < lsd(BASELINES[0]) { BASELINES[1] } else { BASELINES[0] };
        let part = |value: fn(&FoldResult) -> Option<f64>| self.over_materials(&folds, &value);
        let estimator = |value: fn(&FoldResult) -> Option<f64>| mean(&part(value).unwrap_or_default());
        Some(SplitResult {
            split,
            methods: Method::ALL
                .into_iter()
                .map(|method| self.method(&folds, method, best_baseline))
                .collect(),
            best_baseline,
            unexplained_level_db: part(|fold| fold.unexplained_level_db).map(|values| Mean::of(&values)),
            estimator_db: (
                estimator(|fold| Some(fold.estimator_db.0)),
                estimator(|fold| Some(fold.estimator_db.1)),
            ),
        })
    }

    /// Means over a material's folds; `None` if a fold has no value. Materials without folds are omitted.
    fn over_materials(
        &self,
        folds: &[&FoldResult],
        value: &dyn Fn(&FoldResult) -> Option<f64>,
    ) -> Option<Vec<f64>> {
        let of = |material: usize| {
            let own = folds.iter().filter(move |fold| fold.material == material);
            own.map(|fold| value(fold)).collect::<Option<Vec<f64>>>()
        };
        let values = (0..self.materials.len()).map(of).collect::<Option<Vec<_>>>()?;
        Some(values.iter().filter(|values| !values.is_empty()).map(|values| mean(values)).collect())
    }

    fn method(&self, folds: &[&FoldResult], method: Method, best: Method) -> MethodMean {
        let over = |value: &dyn Fn(&FoldResult) -> Option<f64>| self.over_materials(folds, value);
        let maybe = |value: &Value| over(&|fold| value(fold.of(method))).map(|values| Mean::of(&values));
        let sure = |value: &Value| maybe(value).unwrap_or(Mean { mean: 0.0, error: None });
        // Differences within the same fold.
        let above = |other: Method, value: &Value| {
            over(&|fold| Some(value(fold.of(method))? - value(fold.of(other))?))
                .map(|values| Mean::of(&values))
        };
        let lsd: &Value = &|m| Some(m.bands.lsd_db);
        let middle: &Value = &|m| m.bands.middle_lsd_db;
        let low: &Value = &|m| m.bands.low_db;
        let total: &Value = &|m| Some(m.bands.total_db);
        let each = |value: &Value| over(&|fold| value(fold.of(method))).unwrap_or_default();
        let none = Mean { mean: 0.0, error: None };
        let above_baseline_db = above(best, lsd).unwrap_or(none);
        MethodMean {
            method,
            by_material: ByMaterial {
                lsd_db: each(lsd),
                middle_lsd_db: each(middle),
                low_db: each(low),
                total_db: each(total),
            },
            lsd_db: sure(lsd),
            above_floor_db: above(Method::Floor, lsd).unwrap_or(none),
            above_baseline_db,
            middle_lsd_db: maybe(middle),
            middle_above_floor_db: above(Method::Floor, middle),
            pacinian_lsd_db: sure(&|m| Some(m.bands.pacinian_lsd_db)),
            absolute_db: sure(&|m| Some(m.bands.absolute_db)),
            low_db: maybe(low),
            total_db: sure(total),
            misplaced: sure(&|m| Some(m.bands.misplaced)),
            kurtosis: sure(&|m| Some(m.kurtosis)),
            envelope_db: maybe(&|m| m.envelope_db),
            envelope_floor_db: maybe(&|m| m.envelope_floor_db),
            nse: maybe(&|m| m.nse_pe.map(|(nse, _)| nse)),
            pe: maybe(&|m| m.nse_pe.map(|(_, pe)| pe)),
            by_band: self.by_band(folds, method),
            loses: matches!(method, Method::Default | Method::Thesis) && above_baseline_db.mean > 0.0,
        }
    }

    fn by_band(&self, folds: &[&FoldResult], method: Method) -> Vec<BandMean> {
        let bands = &folds[0].of(method).bands.bands;
        if folds.iter().any(|fold| fold.of(method).bands.bands != *bands) {
            return vec![];
        }
        let of = |number: usize, size: fn(f64) -> f64| {
            let error = |fold: &FoldResult| Some(size(fold.of(method).bands.signed_db[number]));
            mean(&self.over_materials(folds, &error).unwrap_or_default())
        };
        let centres = bands.as_slice().iter().map(|band| band.centre_hz);
        centres
            .enumerate()
            .map(|(number, centre_hz)| BandMean {
                centre_hz,
                signed_db: of(number, |db| db),
                absolute_db: of(number, f64::abs),
            })
            .collect()
    }
}

impl FoldResult {
    fn of(&self, method: Method) -> &Measures {
        &self.measures[method as usize]
    }
}
