//! `haptograph compare`: how far two vibrations are from one another (thesis 2.5.1).

mod signal;

use super::table::{facts, significant};
use super::{Failure, say, say_json};
use haptograph::surfaces::metrics::spectral::Comparison;
use haptograph::surfaces::metrics::{WindowSettings, compare};
use serde::Serialize;
use signal::Signal;
use std::path::PathBuf;

/// Compare two vibrations: normalized spectral error, power error, spectral difference
///
/// A vibration is a WAV file (in the unit that the note beside it says, if a run wrote it), a CSV file with a header (its acceleration or its
/// only column; see --column), or any recording that `learn` takes, whose acceleration is processed as there. Both are compared over the time
/// that both cover.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// One vibration
    a: PathBuf,
    /// The other
    b: PathBuf,
    /// The rate to compare at: files that do not say their rate have this one, files with a higher one are brought down to it
    #[arg(long = "rate", value_name = "HZ")]
    rate_hz: Option<f64>,
    /// The column of CSV files, or the channel of WAV files, from 0
    #[arg(long, value_name = "NAME")]
    column: Option<String>,
    /// Samples in a window
    #[arg(long, value_name = "N", default_value_t = WindowSettings::COMPARISON.samples)]
    window: usize,
    /// Samples that a window shares with the next
    #[arg(long, value_name = "N", default_value_t = WindowSettings::COMPARISON.overlap)]
    overlap: usize,
    /// Print NSE, PE and SD as JSON
    #[arg(long)]
    json: bool,
}

/// The measures under the names of the thesis, and once more in lower case, as all other fields of the program are.
#[derive(Serialize)]
#[allow(non_snake_case)]
struct Json {
    NSE: f64,
    PE: f64,
    SD: f64,
    nse: f64,
    pe: f64,
    sd: f64,
    rate_hz: f64,
    windows: usize,
    /// Is one of the two known to come from simulated devices?
    simulated: bool,
    /// Why the spectral difference is no number, if it is none.
    #[serde(skip_serializing_if = "Option::is_none")]
    reason: Option<String>,
}

pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let column = arguments.column.as_deref();
    let (a, b) = (
        Signal::read(&arguments.a, column)?,
        Signal::read(&arguments.b, column)?,
    );
    signal::warn_of_units([&a, &b]);
    let rate_hz = signal::common_rate_hz([&a, &b], arguments.rate_hz)?;
    let simulated = match (a.simulated, b.simulated) {
        (false, false) => None,
        (true, true) => Some("both".to_owned()),
        (true, false) => Some(arguments.a.display().to_string()),
        (false, true) => Some(arguments.b.display().to_string()),
    };
    let (a, b) = (a.at(rate_hz)?, b.at(rate_hz)?);
    let windows = WindowSettings {
        samples: arguments.window,
        overlap: arguments.overlap,
        ..WindowSettings::COMPARISON
    };
    let found = compare(&a, &b, rate_hz, &windows).map_err(|error| {
        let (a, b) = (arguments.a.display(), arguments.b.display());
        Failure::Message(format!("cannot compare {a} and {b}: {error}"))
    })?;
    if arguments.json {
        return say_json(&Json {
            NSE: found.nse,
            PE: found.pe,
            SD: found.sd,
            nse: found.nse,
            pe: found.pe,
            sd: found.sd,
            rate_hz,
            windows: found.windows,
            simulated: simulated.is_some(),
            reason: unvarying(&found),
        });
    }
    let mut shown = vec![
        ("normalized spectral error (NSE)", significant(found.nse, 4)),
        ("power error (PE)", significant(found.pe, 4)),
        (
            "spectral difference (SD)",
            unvarying(&found).unwrap_or_else(|| significant(found.sd, 4)),
        ),
        (
            "windows",
            format!(
                "{} of {} samples at {rate_hz} Hz",
                found.windows, arguments.window
            ),
        ),
    ];
    shown.extend(simulated.map(|which| ("simulated", which)));
    say(&facts(&shown))
}

/// Why the spectral difference is infinite, if it is.
fn unvarying(found: &Comparison) -> Option<String> {
    let error = match found.unvarying {
        (false, false) => return None,
        (true, false) => "spectral error is",
        (false, true) => "power error is",
        (true, true) => "spectral and the power error are",
    };
    Some(format!(
        "infinite: the {error} the same in all {} windows, so it has no deviation to be measured by",
        found.windows
    ))
}
