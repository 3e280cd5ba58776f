//! `haptograph segment`: divides a signal into stationary segments (thesis 2.3.2).

use super::import::{Choices, choice};
use super::progress::Progress;
use super::result::{CommandResult, show};
use super::table::{facts, significant, table};
use super::{Failure, eprint, recording};
use crate::engine::registry::Registry;
use crate::learning::learn::segmentation::{
    GeneticSettings, Segmentation, SegmentationMethod, SegmentationSettings, VarianceEstimate, segment,
};
use crate::learning::recording::load_column;
use clap::ValueEnum;
use clap::error::ErrorKind;
use serde::Serialize;
use std::path::PathBuf;
use std::time::Duration;

/// Find the breaks between the stationary segments of a signal, by minimum description length
///
/// The values of one column are used as they are, one sample per row: units and times are ignored, nothing is
/// repaired or filtered, and every cell must hold a number. The printed samples therefore are rows of the
/// table. `learn --method thesis` repairs and processes a logger's table before it segments it.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    /// A table with a header: CSV, a spreadsheet, or a MATLAB file up to -v7
    file: PathBuf,
    /// The column to segment, by its name in the header
    #[arg(long, value_name = "NAME")]
    column: String,
    /// The search for the minimum: exact, or by the thesis's island genetic algorithm
    #[arg(long, value_enum, default_value_t = Method::Exact)]
    method: Method,
    /// The fewest samples a segment may have
    #[arg(long, value_name = "N", default_value_t = 50)]
    min_span: usize,
    /// The highest order of a segment's model
    #[arg(long, value_name = "P", default_value_t = 20)]
    max_order: usize,
    /// The estimator of a segment's innovation variance
    #[arg(long, value_parser = choice(VARIANCES), default_value = "least-squares")]
    variance: VarianceEstimate,
    /// Seed of the genetic algorithm; default: 1
    #[arg(long, value_parser = super::seed)]
    seed: Option<u64>,
    /// Time limit of the genetic algorithm; its result then depends on the machine
    #[arg(long, value_name = "SECONDS", value_parser = super::run::seconds)]
    time_limit: Option<f64>,
    /// Print {"breaks":[...],"orders":[...],"mdl":...}; breaks are the 0-based first samples of the second and later segments
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum Method {
    /// Dynamic programming over a grid, then refinement of the breaks sample by sample
    Exact,
    /// 25 islands, as in the thesis; slower, and never better than exact
    Genetic,
}

/// Estimators of a segment's innovation variance.
pub(super) const VARIANCES: Choices<VarianceEstimate> = &[
    (
        "least-squares",
        VarianceEstimate::ConditionalLeastSquares,
        "Conditional least squares, which estimates the number of breaks consistently",
    ),
    ("yule-walker", VarianceEstimate::YuleWalker, "From the autocovariance, as in the thesis"),
    ("burg", VarianceEstimate::Burg, "Burg's lattice"),
];

#[derive(Serialize)]
struct Segments {
    #[serde(flatten)]
    found: Segmentation,
    /// Present only if the signal is known to come from simulated devices.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    simulated: bool,
    #[serde(skip)]
    samples: usize,
}

pub(super) fn run(arguments: &Arguments, _: &Registry) -> Result<(), Failure> {
    refuse_idle_flags(arguments)?;
    let signal =
        load_column(&arguments.file, &arguments.column).map_err(|error| recording::failure(&error))?;
    let simulated = recording::is_simulated(&arguments.file)?;
    warn_of_offset(&signal);
    let settings = SegmentationSettings {
        min_span: arguments.min_span,
        max_order: arguments.max_order,
        variance: arguments.variance,
        method: match arguments.method {
            Method::Exact => SegmentationMethod::Exact { grid: None },
            Method::Genetic => SegmentationMethod::Genetic(GeneticSettings {
                seed: arguments.seed.unwrap_or(1),
                time_limit: arguments.time_limit.map(Duration::from_secs_f64),
                ..GeneticSettings::default()
            }),
        },
    };
    let progress = (arguments.method == Method::Genetic).then(|| Progress::unknown("evolving"));
    let found = segment(&signal, &settings).map_err(Failure::doing("segment", &arguments.file))?;
    drop(progress);
    show(&Segments { found, simulated, samples: signal.len() }, arguments.json)
}

/// Refuses flags that have no effect on the exact search.
fn refuse_idle_flags(arguments: &Arguments) -> Result<(), Failure> {
    let given = [("--seed", arguments.seed.is_some()), ("--time-limit", arguments.time_limit.is_some())];
    let idle = given.into_iter().find(|(_, is_given)| *is_given && arguments.method == Method::Exact);
    let Some((flag, _)) = idle else { return Ok(()) };
    let message =
        format!("{flag} is for --method genetic; the exact search is not random and needs no limit\n");
    Err(Failure::Usage(clap::Error::raw(ErrorKind::ArgumentConflict, message)))
}

impl CommandResult for Segments {
    fn text(&self) -> String {
        let rows =
            self.found.segments(self.samples).zip(&self.found.orders).map(|(range, order)| {
                vec![range.start.to_string(), range.len().to_string(), order.to_string()]
            });
        let rows: Vec<_> = rows.collect();
        let mut head = vec![
            ("samples", self.samples.to_string()),
            ("segments", self.found.orders.len().to_string()),
            ("description length", significant(self.found.mdl, 8)),
        ];
        head.extend(self.simulated.then(|| ("simulated", "yes".to_owned())));
        format!("{}\n{}", facts(&head), table(&["first sample", "samples", "order"], &rows))
    }
}

/// Warns about an offset. An autoregressive process has zero mean, so an offset would be modelled as a
/// resonance at 0 Hz.
fn warn_of_offset(signal: &[f64]) {
    // Relative to the largest value, since squares of very large numbers overflow.
    let largest = signal.iter().fold(f64::MIN_POSITIVE, |most, x| most.max(x.abs()));
    let average = |value: &dyn Fn(f64) -> f64| {
        signal.iter().map(|x| value(x / largest)).sum::<f64>() / signal.len() as f64
    };
    let mean = average(&|x| x);
    let deviation = average(&|x| (x - mean) * (x - mean)).sqrt();
    if mean.abs() > deviation {
        eprint(&format!(
            "warning: the signal's mean of {} is larger than its deviation of {}; subtract the mean (or filter) first\n",
            significant(mean * largest, 3),
            significant(deviation * largest, 3)
        ));
    }
}
