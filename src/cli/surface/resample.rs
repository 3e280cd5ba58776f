//! `haptograph surface resample`: reduces the sampling rate of a texture.

use super::{Failure, claim, load, save};
use crate::cli::import::{Choices, choice};
use crate::cli::placing::Force;
use crate::cli::refuse_overwrite;
use crate::cli::result::{CommandResult, show};
use crate::cli::table::significant;
use crate::surfaces::resampling::{Method, resample_surface};
use serde::Serialize;
use std::path::PathBuf;

/// Reduce the sampling rate of a surface's texture
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    /// The surface file
    #[arg(value_name = "IN")]
    input: PathBuf,
    /// The new rate
    #[arg(long = "rate", value_name = "HZ")]
    rate_hz: f64,
    /// Resampling method
    #[arg(long, value_parser = choice(METHODS))]
    method: Method,
    /// The file to write, .ron or .xml
    #[arg(short, long, value_name = "OUT")]
    output: PathBuf,
    #[command(flatten)]
    force: Force,
    /// Print the deviation as JSON
    #[arg(long)]
    json: bool,
}

const METHODS: Choices<Method> = &[
    ("zoh", Method::Zoh, "Exact zero-order hold, zeros outside the unit circle reflected (thesis 4.2)"),
    ("hatt", Method::Hatt, "The toolkit's method; for comparison"),
    (
        "spectral",
        Method::Spectral,
        "Fit to the band-limited spectrum: the most accurate, AR models only, any lower rate",
    ),
];

#[derive(Serialize)]
struct Resampled {
    rate_hz: f64,
    method: &'static str,
    worst_db: f64,
    worst_at_hz: f64,
    worst_vertex: usize,
    #[serde(skip)]
    output: PathBuf,
}

impl CommandResult for Resampled {
    fn text(&self) -> String {
        let Self { rate_hz, method, worst_vertex, output, .. } = self;
        let (to_hz, at_hz) = (significant(0.4 * rate_hz, 4), significant(self.worst_at_hz, 4));
        let (db, output) = (significant(self.worst_db, 3), output.display());
        format!(
            "wrote {output}: {rate_hz} Hz by {method}\nworst spectral deviation from 20 Hz to {to_hz} Hz: {db} dB at {at_hz} Hz, model {worst_vertex} (from 0)\n"
        )
    }
}

pub(super) fn run(arguments: &Arguments) -> Result<(), Failure> {
    refuse_overwrite([&arguments.input], &arguments.output)?;
    let output = claim(&arguments.output, arguments.force)?;
    let surface = load(&arguments.input)?;
    let (surface, resampled) = resample_surface(&surface, arguments.rate_hz, arguments.method)
        .map_err(Failure::doing("resample", &arguments.input))?;
    let output = save(&surface, &output)?;
    let resampled = Resampled {
        rate_hz: arguments.rate_hz,
        method: arguments.method.name(),
        worst_db: resampled.worst.db,
        worst_at_hz: resampled.worst.frequency_hz,
        worst_vertex: resampled.worst_vertex,
        output,
    };
    show(&resampled, arguments.json)
}
