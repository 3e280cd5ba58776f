//! Summary of a hold-out evaluation: means by material, and means over materials with standard errors.

use super::FoldResult;
use super::folds::Split;
use super::measures::{Measures, SeedErrors};
use super::methods::{BASELINES, Method};
use haptograph_signal::statistics::{mean, standard_deviation};
use serde::Serialize;

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
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Mean {
    /// The mean.
    pub mean: f64,
    /// The standard error.
    #[serde(rename = "standard_error")]
    pub error: Option<f64>,
    /// The mean standard deviation over seeds, of a measure of single seeds; `None` for the floor, which has none.
    #[serde(rename = "standard_deviation_over_seeds", skip_serializing_if = "Option::is_none")]
    pub spread: Option<f64>,
}

impl Mean {
    pub(crate) fn of(values: &[f64]) -> Self {
        Self {
            mean: mean(values),
            error: (values.len() > 1).then(|| standard_deviation(values) / (values.len() as f64).sqrt()),
            spread: None,
        }
    }
}

/// A measure of a method over all materials.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[allow(missing_docs)] // see the table
pub enum Measure {
    Lsd,
    AboveFloor,
    AboveBaseline,
    MiddleLsd,
    MiddleAboveFloor,
    PacinianLsd,
    Absolute,
    Low,
    Total,
    Misplaced,
    Kurtosis,
    Envelope,
    EnvelopeFloor,
    Nse,
    Pe,
    SeedLsd,
    Modulation,
    Autocorrelation,
    Levels,
    KurtosisRatio,
    Crest,
    BandCorrelation,
    Deviation5,
    Deviation50,
}

/// What is subtracted from a measure, in the same fold.
#[derive(Clone, Copy)]
enum Less {
    Nothing,
    /// The same measure of the floor.
    Floor,
    /// The same measure of the best plain baseline.
    Baseline,
}

/// The value of a measure on a test part.
enum Value {
    /// Of all seeds together.
    Together(fn(&Measures) -> Option<f64>),
    /// Of each seed by itself.
    Seed(fn(&SeedErrors) -> Option<f64>),
}

impl Value {
    /// The value, or its mean over seeds; `None` if the part has none.
    fn of(&self, part: &Measures) -> Option<f64> {
        match self {
            Self::Together(value) => value(part),
            Self::Seed(_) => {
                Some(self.of_seeds(part)).filter(|seeds| !seeds.is_empty()).map(|seeds| mean(&seeds))
            }
        }
    }

    /// The standard deviation over seeds; `None` for fewer than two.
    fn spread(&self, part: &Measures) -> Option<f64> {
        Some(self.of_seeds(part)).filter(|seeds| seeds.len() > 1).map(|seeds| standard_deviation(&seeds))
    }

    fn of_seeds(&self, part: &Measures) -> Vec<f64> {
        match self {
            Self::Together(_) => vec![],
            Self::Seed(value) => part.seeds.iter().filter_map(value).collect(),
        }
    }
}

/// Key in files, what is subtracted, and the value on a test part.
type Row = (Measure, &'static str, Less, Value);

use Value::{Seed, Together};

/// The measures in the order of [`Measure`].
const MEASURES: [Row; 24] = [
    // Log-spectral distance, dB.
    (Measure::Lsd, "lsd_db", Less::Nothing, Together(|m| Some(m.bands.lsd_db))),
    (Measure::AboveFloor, "above_floor_db", Less::Floor, Together(|m| Some(m.bands.lsd_db))),
    (Measure::AboveBaseline, "above_baseline_db", Less::Baseline, Together(|m| Some(m.bands.lsd_db))),
    // The same from 100 to 500 Hz.
    (Measure::MiddleLsd, "lsd_100_500_db", Less::Nothing, Together(|m| m.bands.middle_lsd_db)),
    (Measure::MiddleAboveFloor, "above_floor_100_500_db", Less::Floor, Together(|m| m.bands.middle_lsd_db)),
    // The same weighted by tactile sensitivity.
    (Measure::PacinianLsd, "lsd_pacinian_db", Less::Nothing, Together(|m| Some(m.bands.pacinian_lsd_db))),
    // Mean absolute error over bands, dB.
    (Measure::Absolute, "absolute_db", Less::Nothing, Together(|m| Some(m.bands.absolute_db))),
    // Signed error from 20 to 40 Hz, and of the total power, dB.
    (Measure::Low, "error_20_40_db", Less::Nothing, Together(|m| m.bands.low_db)),
    (Measure::Total, "error_total_db", Less::Nothing, Together(|m| Some(m.bands.total_db))),
    // Energy in the wrong one of nine bands, 0 to 1.
    (Measure::Misplaced, "misplaced", Less::Nothing, Together(|m| Some(m.bands.misplaced))),
    // Error of the excess kurtosis.
    (Measure::Kurtosis, "kurtosis_error", Less::Nothing, Together(|m| Some(m.kurtosis))),
    // Error of levels over 50 ms, and the same between seeds, dB.
    (Measure::Envelope, "envelope_db", Less::Nothing, Together(|m| m.envelope_db)),
    (Measure::EnvelopeFloor, "envelope_between_seeds_db", Less::Nothing, Together(|m| m.envelope_floor_db)),
    // Normalized spectral error, and power error.
    (Measure::Nse, "nse", Less::Nothing, Together(|m| m.nse_pe.map(|(nse, _)| nse))),
    (Measure::Pe, "pe", Less::Nothing, Together(|m| m.nse_pe.map(|(_, pe)| pe))),
    // Single seeds: log-spectral distance, and errors of the fluctuation, each in its unit.
    (Measure::SeedLsd, "seed_lsd_db", Less::Nothing, Seed(|s| Some(s.lsd_db))),
    (Measure::Modulation, "modulation_db", Less::Nothing, Seed(|s| s.mean(|f| f.modulation_db))),
    (Measure::Autocorrelation, "autocorrelation", Less::Nothing, Seed(|s| s.mean(|f| f.autocorrelation))),
    (Measure::Levels, "level_quantiles_db", Less::Nothing, Seed(|s| s.mean(|f| f.level_quantiles_db))),
    (Measure::KurtosisRatio, "kurtosis_octaves", Less::Nothing, Seed(|s| s.mean(|f| f.kurtosis_octaves))),
    (Measure::Crest, "crest_db", Less::Nothing, Seed(|s| s.mean(|f| f.crest_db))),
    (Measure::BandCorrelation, "band_correlation", Less::Nothing, Seed(|s| s.mean(|f| f.band_correlation))),
    (
        Measure::Deviation5,
        "level_deviation_5_ms_db",
        Less::Nothing,
        Seed(|s| s.mean(|f| f.level_deviation_5_ms_db)),
    ),
    (
        Measure::Deviation50,
        "level_deviation_50_ms_db",
        Less::Nothing,
        Seed(|s| s.mean(|f| f.level_deviation_50_ms_db)),
    ),
];

impl Measure {
    /// All measures.
    pub fn all() -> impl Iterator<Item = Self> {
        MEASURES.iter().map(|row| row.0)
    }

    /// Name in files; it ends in the unit.
    pub fn as_str(self) -> &'static str {
        MEASURES[self as usize].1
    }
}

/// Error of one third octave over all materials.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct BandMean {
    /// The centre, Hz.
    pub centre_hz: f64,
    /// Signed error of its power, dB.
    #[serde(rename = "db")]
    pub signed_db: f64,
    /// Mean size of the error in each fold, dB.
    pub absolute_db: f64,
}

/// The errors of a method over all materials.
#[derive(Debug, Clone, PartialEq)]
pub struct MethodMean {
    /// The method.
    pub method: Method,
    /// By measure: means over the folds of each material, where all folds have a value.
    measures: Vec<Option<Vec<f64>>>,
    /// By measure: mean standard deviation over seeds.
    spreads: Vec<Option<f64>>,
    /// Errors by band, means over materials, where all materials have the same bands.
    pub by_band: Vec<BandMean>,
    /// True if this is not a plain baseline and its mean over materials is worse than that of one.
    pub loses: bool,
}

impl MethodMean {
    /// The values of a measure on each material; empty if a fold has none.
    pub fn by_material(&self, measure: Measure) -> &[f64] {
        self.measures[measure as usize].as_deref().unwrap_or_default()
    }

    /// The mean of a measure over materials; `None` if a fold has no value.
    pub fn mean(&self, measure: Measure) -> Option<Mean> {
        let values = self.measures[measure as usize].as_deref()?;
        Some(Mean { spread: self.spreads[measure as usize], ..Mean::of(values) })
    }
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
        let best_baseline =
            BASELINES.into_iter().min_by(|a, b| lsd(*a).total_cmp(&lsd(*b))).unwrap_or(BASELINES[0]);
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
        let measure = |(_, _, less, value): &Row| {
            let other = match less {
                Less::Nothing => None,
                Less::Floor => Some(Method::Floor),
                Less::Baseline => Some(best),
            };
            self.over_materials(folds, &|fold| {
                let own = value.of(fold.of(method))?;
                other.map_or(Some(own), |other| Some(own - value.of(fold.of(other))?))
            })
        };
        // The stretches of the floor are no seeds.
        let seeded = method != Method::Floor;
        let spread = |(.., value): &Row| {
            let over = |fold: &FoldResult| value.spread(fold.of(method)).filter(|_| seeded);
            self.over_materials(folds, &over).map(|spreads| mean(&spreads))
        };
        let mut found = MethodMean {
            method,
            measures: MEASURES.iter().map(measure).collect(),
            spreads: MEASURES.iter().map(spread).collect(),
            by_band: self.by_band(folds, method),
            loses: false,
        };
        found.loses = matches!(method, Method::Default | Method::Thesis)
            && found.mean(Measure::AboveBaseline).is_some_and(|above| above.mean > 0.0);
        found
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
