//! `haptograph compare`: the differences between two vibrations (thesis 2.5.1).

mod signal;

use super::import::{NamedColumn, Tables, named_column};
use super::table::{facts, significant};
use super::{Failure, print, print_json};
use crate::engine::registry::Registry;
use crate::learning::metrics::level::{
    envelope_between_seeds_db, envelope_error_db, excess_kurtosis, levels_db, unexplained_level_db,
};
use crate::learning::metrics::spectral::Comparison;
use crate::learning::metrics::{BandErrors, Bands, Deviations, WindowSettings, compare};
use crate::learning::recording::ImportSettings;
use serde_json::{Value, json};
use signal::Signal;
use std::path::PathBuf;

/// Compare two vibrations by third octaves and by windows
///
/// A vibration is a WAV file (in the unit of the note beside it or of --full-scale), a table with a header
/// (its acceleration or its only column; see --column), or any recording that `learn` reads, processed as
/// there. Both are compared over the time that both cover. Level errors are positive if the first is louder.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// One vibration
    a: PathBuf,
    /// The vibration to compare with
    b: PathBuf,
    /// The rate to compare at. Files without a rate are read at this rate; files with a higher rate are
    /// resampled down to it
    #[arg(long = "rate", value_name = "HZ")]
    rate_hz: Option<f64>,
    /// The column of a table, or the channel of a WAV file, from 0; or the column of a quantity, as for
    /// learn: accel=acc_z
    #[arg(long = "column", value_name = "NAME", value_parser = named_column, help_heading = "Reading tables")]
    columns: Vec<NamedColumn>,
    /// Samples in a window of NSE and PE; default: 25.6 ms
    #[arg(long, value_name = "N")]
    window: Option<usize>,
    /// Samples shared by successive windows; default: half a window
    #[arg(long, value_name = "N")]
    overlap: Option<usize>,
    /// The standard deviations of NSE and PE that scale SD, from a study of many pairs; without them SD is
    /// not computed
    #[arg(long, value_name = "NSE,PE", value_parser = deviations)]
    deviations: Option<Deviations>,
    /// Print all measures as JSON
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    tables: Tables,
}

fn deviations(text: &str) -> Result<Deviations, String> {
    let numbers: Option<Vec<f64>> = text.split(',').map(|part| part.trim().parse().ok()).collect();
    match numbers.as_deref() {
        Some(&[nse, pe]) if [nse, pe].iter().all(|x| x.is_finite() && *x > 0.0) => Ok(Deviations { nse, pe }),
        _ => Err("give two numbers above 0, such as 0.012,0.4".to_owned()),
    }
}

/// The measures of a pair of vibrations.
struct Found {
    windows: Comparison,
    bands: BandErrors,
    /// Excess kurtosis of both.
    kurtosis: [f64; 2],
    /// `None` if neither file has force and speed.
    envelope: Option<Envelope>,
    sd: Option<f64>,
}

/// Distance between the levels over 50 ms, dB, with its references.
struct Envelope {
    error_db: f64,
    /// The part of a file's own levels that its force and speed do not explain.
    unexplained_db: f64,
    /// Distance between the levels of two noises with the spectrum of that file.
    between_seeds_db: f64,
}

pub fn run(arguments: &Arguments, _: &Registry) -> Result<(), Failure> {
    let (column, import) = import(arguments)?;
    let (a, b) = (Signal::read(&arguments.a, column, &import)?, Signal::read(&arguments.b, column, &import)?);
    signal::warn_of_units([&a, &b]);
    let rate_hz = signal::common_rate_hz([&a, &b], arguments.rate_hz)?;
    let simulated = match (a.simulated, b.simulated) {
        (false, false) => None,
        (true, true) => Some("both".to_owned()),
        (true, false) => Some(arguments.a.display().to_string()),
        (false, true) => Some(arguments.b.display().to_string()),
    };
    let motions = [a.motion_at(rate_hz)?, b.motion_at(rate_hz)?];
    let (a, b) = (a.at(rate_hz)?, b.at(rate_hz)?);
    let windows = windows(arguments, rate_hz);
    let mut found = found(arguments, &a, &b, rate_hz, &windows)?;
    found.envelope = envelope([&a, &b], &motions, rate_hz);
    if arguments.json {
        return print_json(&to_json(&found, rate_hz, simulated.is_some()));
    }
    let mut shown = describe(&found);
    shown.push((
        "windows",
        format!("{} of {} samples at {rate_hz} Hz", found.windows.windows, windows.samples),
    ));
    shown.extend(simulated.map(|which| ("simulated", which)));
    print(&facts(&shown))
}

/// The named column, if any, and the import settings of tables.
fn import(arguments: &Arguments) -> Result<(Option<&str>, ImportSettings), Failure> {
    let (mut plain, mut quantities) = (None, vec![]);
    for column in &arguments.columns {
        match column {
            NamedColumn::Plain(name) if plain.is_none() => plain = Some(name.as_str()),
            NamedColumn::Plain(name) => {
                return Err(Failure::Message(format!(
                    "--column names two signals; give one, or name the quantity of {name}: --column QUANTITY={name}"
                )));
            }
            NamedColumn::Quantity(quantity, name) => quantities.push((quantity.clone(), name.clone())),
        }
    }
    let import = arguments.tables.settings(&quantities).map_err(Failure::Message)?;
    Ok((plain, import))
}

fn windows(arguments: &Arguments, rate_hz: f64) -> WindowSettings {
    let usual = WindowSettings::comparison_at(rate_hz);
    let samples = arguments.window.unwrap_or(usual.samples);
    WindowSettings { samples, overlap: arguments.overlap.unwrap_or(samples / 2), ..usual }
}

fn found(
    arguments: &Arguments,
    a: &[f64],
    b: &[f64],
    rate_hz: f64,
    windows: &WindowSettings,
) -> Result<Found, Failure> {
    let compared = compare(a, b, rate_hz, windows).map_err(|error| {
        let (a, b) = (arguments.a.display(), arguments.b.display());
        Failure::Message(format!("cannot compare {a} and {b}: {error}"))
    })?;
    let both = a.len().min(b.len());
    let (a, b) = (&a[..both], &b[..both]);
    let bands = Bands::counted(both as f64 / rate_hz, rate_hz);
    Ok(Found {
        windows: compared,
        bands: BandErrors::new(&bands.of_signal([a], rate_hz), &bands.of_signal([b], rate_hz)),
        kurtosis: [a, b].map(excess_kurtosis),
        envelope: None,
        sd: arguments.deviations.map(|by| compared.nse / by.nse + compared.pe / by.pe),
    })
}

/// The difference of levels beside its references, which are those of the second vibration, or else of the first.
fn envelope(signals: [&[f64]; 2], motions: &[Option<[Vec<f64>; 2]>; 2], rate_hz: f64) -> Option<Envelope> {
    let both = signals[0].len().min(signals[1].len());
    let [a, b] = signals.map(|signal| &signal[..both]);
    let of = |signal: &[f64], motion: &Option<[Vec<f64>; 2]>| {
        let [speed_m_s, force_n] = motion.as_ref()?;
        let unexplained_db = unexplained_level_db(signal, &speed_m_s[..both], &force_n[..both], rate_hz)?;
        Some((unexplained_db, envelope_between_seeds_db(signal, rate_hz)))
    };
    let (unexplained_db, between_seeds_db) = of(b, &motions[1]).or_else(|| of(a, &motions[0]))?;
    Some(Envelope {
        error_db: envelope_error_db(&levels_db(a, rate_hz), &levels_db(b, rate_hz)),
        unexplained_db,
        between_seeds_db,
    })
}

const NO_ENVELOPE: &str =
    "neither file is a recording of 0.2 s or more with force and speed, beside which it could be read";
const NO_SD: &str = "not computed: it needs the deviations of a study; give them by --deviations";

fn describe(found: &Found) -> Vec<(&'static str, String)> {
    let db = |value: Option<f64>| {
        value.map_or_else(|| "none: no band to compare".to_owned(), |x| format!("{x:.2} dB"))
    };
    let any = |value: f64| (!found.bands.bands.is_empty()).then_some(value);
    let bands = &found.bands;
    vec![
        ("log-spectral distance, 20 to 1000 Hz", db(any(bands.lsd_db))),
        ("  100 to 500 Hz", db(bands.middle_lsd_db)),
        ("  40 to 250 Hz (felt)", db(any(bands.pacinian_lsd_db))),
        ("mean absolute error of bands", db(any(bands.absolute_db))),
        ("error from 20 to 40 Hz", db(bands.low_db)),
        ("error of the total power", db(any(bands.total_db))),
        ("energy in the wrong of nine bands", format!("{:.1} %", 100.0 * bands.misplaced)),
        ("excess kurtosis", format!("{:.2} and {:.2}", found.kurtosis[0], found.kurtosis[1])),
        (
            "levels over 50 ms",
            found.envelope.as_ref().map_or_else(
                || format!("none: {NO_ENVELOPE}"),
                |levels| {
                    format!(
                        "{:.2} dB (force and speed leave {:.2}, two noises {:.2})",
                        levels.error_db, levels.unexplained_db, levels.between_seeds_db
                    )
                },
            ),
        ),
        ("normalized spectral error (NSE)", significant(found.windows.nse, 4)),
        ("power error (PE)", significant(found.windows.pe, 4)),
        (
            "spectral difference (SD)",
            found.sd.map_or_else(|| format!("none: {NO_SD}"), |sd| significant(sd, 4)),
        ),
    ]
}

/// The measures: those of windows under their names in the thesis and, like all other fields, in lower case.
fn to_json(found: &Found, rate_hz: f64, simulated: bool) -> Value {
    let bands = &found.bands;
    let by_band = bands.bands.as_slice().iter().zip(&bands.signed_db);
    let levels = |value: fn(&Envelope) -> f64| found.envelope.as_ref().map(value);
    json!({
        "NSE": found.windows.nse, "PE": found.windows.pe, "SD": found.sd,
        "nse": found.windows.nse, "pe": found.windows.pe, "sd": found.sd,
        "reason": if found.sd.is_none() { Some(NO_SD) } else { None },
        "lsd_db": bands.lsd_db,
        "lsd_100_500_db": bands.middle_lsd_db,
        "lsd_pacinian_db": bands.pacinian_lsd_db,
        "absolute_db": bands.absolute_db,
        "error_20_40_db": bands.low_db,
        "error_total_db": bands.total_db,
        "misplaced": bands.misplaced,
        "bands": by_band.map(|(band, db)| json!({ "centre_hz": band.centre_hz, "error_db": db })).collect::<Vec<_>>(),
        "excess_kurtosis": found.kurtosis,
        "envelope_db": levels(|levels| levels.error_db),
        "unexplained_level_db": levels(|levels| levels.unexplained_db),
        "envelope_between_seeds_db": levels(|levels| levels.between_seeds_db),
        "envelope_reason": if found.envelope.is_none() { Some(NO_ENVELOPE) } else { None },
        "rate_hz": rate_hz,
        "windows": found.windows.windows,
        "simulated": simulated,
    })
}
