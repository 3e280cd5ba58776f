//! `haptograph compare`: the differences between two vibrations (thesis 2.5.1).

pub(super) mod signal;

use super::Failure;
use super::import::{NamedColumn, Tables, named_column};
use super::placing::{Force, Output};
use super::result::{CommandResult, look_at, show};
use super::table::{facts, significant};
use crate::engine::registry::Registry;
use crate::learning::metrics::level::{
    envelope_between_seeds_db, envelope_error_db, excess_kurtosis, levels_db, unexplained_level_db,
};
use crate::learning::metrics::{
    BandErrors, Bands, Deviations, Fluctuation, FluctuationErrors, WindowSettings, compare,
};
use crate::report::pair::Pair;
use serde::Serialize;
use signal::{Motion, Signal};
use std::collections::BTreeMap;
use std::path::PathBuf;

/// Compare two vibrations by third octaves and by windows
///
/// A vibration is a WAV file (in the unit of the note beside it or of --full-scale), a table with a header
/// (its acceleration or its only column; see --column), or any recording that `learn` reads, processed as
/// there. Both are compared over the time that both cover. Level errors are positive if the first is louder.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
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
    /// Also write a page into this folder: both to listen to with a switch, and how they fluctuate
    #[arg(long, value_name = "DIR")]
    report: Option<PathBuf>,
    #[command(flatten)]
    force: Force,
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

/// The measures of a pair: those of windows under their names in the thesis and, like all other fields, in lower case.
#[derive(Serialize)]
struct Measures {
    #[serde(flatten)]
    thesis: BTreeMap<&'static str, Option<f64>>,
    absolute_db: f64,
    bands: Vec<BandError>,
    /// Distance between the levels of two noises with the spectrum of a file.
    envelope_between_seeds_db: Option<f64>,
    /// Distance between the levels over 50 ms; `None` if neither file has force and speed.
    envelope_db: Option<f64>,
    envelope_reason: Option<&'static str>,
    error_20_40_db: Option<f64>,
    error_total_db: f64,
    /// Of both.
    excess_kurtosis: [f64; 2],
    /// Of how the levels fluctuate.
    fluctuation: Option<FluctuationErrors>,
    fluctuation_reason: Option<&'static str>,
    lsd_100_500_db: Option<f64>,
    lsd_db: f64,
    lsd_pacinian_db: f64,
    misplaced: f64,
    nse: f64,
    /// Levels of both in the first 100 ms of strokes from rest over their slides, from 20 to 60, 150 and 350 Hz, dB.
    onset_levels_db: Option<[[f64; 3]; 2]>,
    pe: f64,
    rate_hz: f64,
    reason: Option<&'static str>,
    sd: Option<f64>,
    simulated: bool,
    /// The part of a file's own levels that its force and speed do not explain.
    unexplained_level_db: Option<f64>,
    windows: usize,
    /// Samples of a window.
    #[serde(skip)]
    samples: usize,
    page: Option<PathBuf>,
    /// The files that are simulated.
    #[serde(skip)]
    simulated_files: Option<String>,
}

#[derive(Serialize)]
struct BandError {
    centre_hz: f64,
    error_db: f64,
}

pub(super) fn run(arguments: &Arguments, _: &Registry) -> Result<(), Failure> {
    let (column, import) = signal::chosen(&arguments.columns, &arguments.tables)?;
    let page = Output::claim_page(arguments.report.as_deref(), arguments.force)?;
    let (a, b) = (Signal::read(&arguments.a, column, &import)?, Signal::read(&arguments.b, column, &import)?);
    signal::warn_of_units([&a, &b]);
    let unit = signal::common_unit([&a, &b]);
    let rate_hz = signal::common_rate_hz([&a, &b], arguments.rate_hz)?;
    let simulated = [a.simulated, b.simulated];
    let simulated_files = match simulated {
        [false, false] => None,
        [true, true] => Some("both".to_owned()),
        [true, false] => Some(arguments.a.display().to_string()),
        [false, true] => Some(arguments.b.display().to_string()),
    };
    let motions = [a.motion_at(rate_hz)?, b.motion_at(rate_hz)?];
    let (a, b) = (a.at(rate_hz)?, b.at(rate_hz)?);
    let mut measures = measures(arguments, [&a, &b], &motions, rate_hz)?;
    measures.simulated = simulated_files.is_some();
    measures.simulated_files = simulated_files;
    if let Some(page) = page {
        let both = a.len().min(b.len());
        let paths = [&arguments.a, &arguments.b];
        let short = paths.map(|path| path.file_name().unwrap_or_default().to_string_lossy());
        let are_alike = short[0] == short[1];
        let names = if are_alike { paths.map(|path| path.to_string_lossy()) } else { short };
        let (names, samples) = ([&*names[0], &*names[1]], [&a[..both], &b[..both]]);
        let pair = Pair { names, samples, unit: &unit, rate_hz, simulated };
        let shown = measures.shown().into_iter().map(|(name, value)| (name.trim().to_owned(), value));
        measures.page = Some(page.write(pair.page(&shown.collect::<Vec<_>>()))?);
    }
    show(&measures, arguments.json)
}

fn windows(arguments: &Arguments, rate_hz: f64) -> WindowSettings {
    let usual = WindowSettings::comparison_at(rate_hz);
    let samples = arguments.window.unwrap_or(usual.samples);
    WindowSettings { samples, overlap: arguments.overlap.unwrap_or(samples / 2), ..usual }
}

fn measures(
    arguments: &Arguments,
    [a, b]: [&[f64]; 2],
    motions: &[Motion; 2],
    rate_hz: f64,
) -> Result<Measures, Failure> {
    let settings = windows(arguments, rate_hz);
    let windows = compare(a, b, rate_hz, &settings).map_err(|error| {
        let (a, b) = (arguments.a.display(), arguments.b.display());
        Failure::Message(format!("cannot compare {a} and {b}: {error}"))
    })?;
    let both = a.len().min(b.len());
    let (a, b) = (&a[..both], &b[..both]);
    let bands = Bands::counted(both as f64 / rate_hz, rate_hz);
    let errors = BandErrors::new(&bands.of_signal([a], rate_hz), &bands.of_signal([b], rate_hz));
    let by_band = errors.bands.as_slice().iter().zip(&errors.signed_db);
    let fluctuations = Fluctuation::of(a, rate_hz).zip(Fluctuation::of(b, rate_hz));
    let errors_of_fluctuation = fluctuations.map(|(a, b)| a.errors(&b));
    let references = level_references([a, b], motions, rate_hz);
    let sd = arguments.deviations.map(|by| windows.nse / by.nse + windows.pe / by.pe);
    Ok(Measures {
        thesis: [("NSE", Some(windows.nse)), ("PE", Some(windows.pe)), ("SD", sd)].into(),
        absolute_db: errors.absolute_db,
        bands: by_band.map(|(band, db)| BandError { centre_hz: band.centre_hz, error_db: *db }).collect(),
        envelope_between_seeds_db: references.map(|(_, between_seeds_db)| between_seeds_db),
        envelope_db: references.map(|_| envelope_error_db(&levels_db(a, rate_hz), &levels_db(b, rate_hz))),
        envelope_reason: references.is_none().then_some(NO_ENVELOPE),
        error_20_40_db: errors.low_db,
        error_total_db: errors.total_db,
        excess_kurtosis: [a, b].map(excess_kurtosis),
        fluctuation_reason: errors_of_fluctuation.is_none().then_some(NO_FLUCTUATION),
        fluctuation: errors_of_fluctuation,
        lsd_100_500_db: errors.middle_lsd_db,
        lsd_db: errors.lsd_db,
        lsd_pacinian_db: errors.pacinian_lsd_db,
        misplaced: errors.misplaced,
        nse: windows.nse,
        onset_levels_db: onset_levels_db([a, b], motions, rate_hz),
        pe: windows.pe,
        rate_hz,
        reason: sd.is_none().then_some(NO_SD),
        sd,
        simulated: false,
        unexplained_level_db: references.map(|(unexplained_db, _)| unexplained_db),
        windows: windows.windows,
        samples: settings.samples,
        page: None,
        simulated_files: None,
    })
}

/// Two references of the difference of levels, of the second vibration, or else of the first: the part of its levels that
/// force and speed do not explain, and the difference between two noises of its spectrum.
fn level_references([a, b]: [&[f64]; 2], motions: &[Motion; 2], rate_hz: f64) -> Option<(f64, f64)> {
    let of = |signal: &[f64], motion: &Motion| {
        let [speed_m_s, force_n] = motion.as_ref()?.each_ref().map(|values| &values[..signal.len()]);
        let unexplained_db = unexplained_level_db(signal, speed_m_s, force_n, rate_hz)?;
        Some((unexplained_db, envelope_between_seeds_db(signal, rate_hz)))
    };
    of(b, &motions[1]).or_else(|| of(a, &motions[0]))
}

/// The levels of both signals' onsets, where one has a motion with strokes from rest: the other's is its own, if it has one.
fn onset_levels_db(signals: [&[f64]; 2], motions: &[Motion; 2], rate_hz: f64) -> Option<[[f64; 3]; 2]> {
    let of = |own: usize| {
        let [speed_m_s, force_n] = motions[own].as_ref().or(motions[1 - own].as_ref())?;
        Some(crate::learning::metrics::onset_levels_db(signals[own], speed_m_s, force_n, rate_hz)?.1)
    };
    Some([of(0)?, of(1)?])
}

/// Errors of the fluctuation, as shown.
fn fluctuation(errors: Option<FluctuationErrors>) -> Vec<(&'static str, String)> {
    let Some(errors) = errors else {
        return vec![("modulation, 2 to 128 Hz", format!("none: {NO_FLUCTUATION}"))];
    };
    let db = |value: f64| format!("{value:.2} dB");
    let number = |value: f64| format!("{value:.2}");
    vec![
        ("modulation, 2 to 128 Hz", db(errors.modulation_db)),
        ("  autocorrelation of the envelope", number(errors.autocorrelation)),
        ("  levels over 5 ms, quantiles", db(errors.level_quantiles_db)),
        ("  levels over 5 and 50 ms, deviation", {
            format!("{:.2} and {:.2} dB", errors.level_deviation_5_ms_db, errors.level_deviation_50_ms_db)
        }),
        ("  kurtosis, octaves", number(errors.kurtosis_octaves)),
        ("  crest factor", db(errors.crest_db)),
        ("  correlation of bands", number(errors.band_correlation)),
    ]
}

const NO_ENVELOPE: &str =
    "neither file is a recording of 0.2 s or more with force and speed, beside which it could be read";
const NO_FLUCTUATION: &str =
    "the time that both cover is under 0.5 s, the rate below 1 kHz, or a file is constant";
const NO_SD: &str = "not computed: it needs the deviations of a study; give them by --deviations";

impl CommandResult for Measures {
    fn text(&self) -> String {
        facts(&self.shown()) + &look_at(self.page.as_ref())
    }
}

impl Measures {
    fn shown(&self) -> Vec<(&'static str, String)> {
        let db = |value: Option<f64>| {
            value.map_or_else(|| "none: no band to compare".to_owned(), |x| format!("{x:.2} dB"))
        };
        let any = |value: f64| db((!self.bands.is_empty()).then_some(value));
        let number = |value: f64| significant(value, 4);
        let levels = match (self.envelope_db, self.unexplained_level_db, self.envelope_between_seeds_db) {
            (Some(error), Some(left), Some(noises)) => {
                format!("{error:.2} dB (force and speed leave {left:.2}, two noises {noises:.2})")
            }
            _ => format!("none: {NO_ENVELOPE}"),
        };
        let [a, b] = self.excess_kurtosis;
        let windows = format!("{} of {} samples at {} Hz", self.windows, self.samples, self.rate_hz);
        let mut shown = vec![
            ("log-spectral distance, 20 to 1000 Hz", any(self.lsd_db)),
            ("  100 to 500 Hz", db(self.lsd_100_500_db)),
            ("  40 to 250 Hz (felt)", any(self.lsd_pacinian_db)),
            ("mean absolute error of bands", any(self.absolute_db)),
            ("error from 20 to 40 Hz", db(self.error_20_40_db)),
            ("error of the total power", any(self.error_total_db)),
            ("energy in the wrong of nine bands", format!("{:.1} %", 100.0 * self.misplaced)),
            ("excess kurtosis", format!("{a:.2} and {b:.2}")),
            ("levels over 50 ms", levels),
        ];
        shown.extend(fluctuation(self.fluctuation));
        if let Some([a, b]) = self.onset_levels_db {
            let levels = |levels: [f64; 3]| levels.map(|level| format!("{level:.1}")).join(", ");
            shown.push(("onsets over slides, three bands", format!("{} and {} dB", levels(a), levels(b))));
        }
        shown.extend([
            ("normalized spectral error (NSE)", number(self.nse)),
            ("power error (PE)", number(self.pe)),
            ("spectral difference (SD)", self.sd.map_or_else(|| format!("none: {NO_SD}"), number)),
            ("windows", windows),
        ]);
        shown.extend(self.simulated_files.clone().map(|which| ("simulated", which)));
        shown
    }
}
