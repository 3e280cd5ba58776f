//! Reads a vibration from a WAV file, a table or a recording.

use crate::cli::import::{NamedColumn, Tables};
use crate::cli::recording::{self as recordings, Loaded};
use crate::cli::{Failure, eprint};
use crate::learning::processing::{combined, processed};
use crate::learning::recording::{ImportSettings, LoadError, ReadError, load_signal, remove_offset};
use crate::nodes::wav::{read_channel, read_layout};
use crate::signal::files;
use crate::signal::resample::{Quality, resample_whole};
use crate::signal::time::Rate;
use crate::surfaces::Origin;
use std::io::{self, Read as _};
use std::path::{Path, PathBuf};

/// Maximum number of samples of a WAV file: two hours at 48 kHz, 3 GB of memory.
const MAX_SAMPLES: u64 = 400_000_000;

/// A vibration. Its rate is `None` if the file does not state it.
#[derive(Debug)]
pub(in crate::cli) struct Signal {
    path: PathBuf,
    samples: Vec<f64>,
    rate_hz: Option<f64>,
    /// Unit of the samples, if the file states it.
    unit: Option<String>,
    is_wav: bool,
    /// Speed in m/s and force in N of each sample, if the file is a recording that has them.
    motion: Motion,
    /// True if the file is known to come from simulated devices.
    pub simulated: bool,
}

/// Samples, rate, unit, and whether the file is known to be simulated.
type Read = (Vec<f64>, Option<f64>, Option<String>, bool);
/// Speed and force of a recording.
pub(super) type Motion = Option<[Vec<f64>; 2]>;

impl Signal {
    /// Reads the vibration in a file; `column` names a column of a table or a channel of a WAV file.
    pub(in crate::cli) fn read(
        path: &Path,
        column: Option<&str>,
        import: &ImportSettings,
    ) -> Result<Self, Failure> {
        let is_wav = is_wav(path)?;
        let ((samples, rate_hz, unit, simulated), motion) = match is_wav {
            true => (wav(path, column, import)?, None),
            false => other(path, column, import)?,
        };
        Ok(Self { path: path.to_owned(), samples, rate_hz, unit, is_wav, motion, simulated })
    }

    /// The samples, their rate and their unit.
    pub(in crate::cli) fn with_rate(self) -> Result<(Vec<f64>, f64, String), Failure> {
        let unit = self.unit.unwrap_or_else(|| "of full scale".to_owned());
        let rate_hz = self.rate_hz.ok_or_else(|| Failure::Message(rateless(&self.path, "--sample-rate")))?;
        Ok((self.samples, rate_hz, unit))
    }

    /// The samples at `rate_hz`.
    pub(super) fn at(&self, rate_hz: f64) -> Result<Vec<f64>, Failure> {
        self.resampled(&self.samples, rate_hz)
    }

    /// Speed and force at this rate, where there are any.
    pub(super) fn motion_at(&self, rate_hz: f64) -> Result<Motion, Failure> {
        let Some([speed_m_s, force_n]) = &self.motion else {
            return Ok(None);
        };
        let at = |values| self.resampled(values, rate_hz);
        Ok(Some([at(speed_m_s)?, at(force_n)?]))
    }

    fn resampled(&self, samples: &[f64], rate_hz: f64) -> Result<Vec<f64>, Failure> {
        let Some(own_hz) = self.rate_hz.filter(|own| *own != rate_hz) else {
            return Ok(samples.to_vec());
        };
        let failed = |error: &dyn std::fmt::Display| Failure::file("resample", &self.path, error);
        if own_hz < rate_hz {
            return Err(failed(&format!("its rate is {own_hz} Hz; give a --rate of at most {own_hz}")));
        }
        let rate = |hz: f64| Rate::parse(&hz.to_string()).map_err(|error| failed(&error));
        resample_whole(samples, rate(own_hz)?, rate(rate_hz)?, Quality::FINE).map_err(|error| failed(&error))
    }
}

/// The unit of both, as it is shown; acceleration's if neither states one.
pub(super) fn common_unit(signals: [&Signal; 2]) -> String {
    match signals.map(|signal| signal.unit.as_deref()) {
        [Some(one), Some(other)] if one != other => format!("{one}, {other}"),
        [Some(unit), _] | [None, Some(unit)] => unit.replace("s2", "s²"),
        [None, None] => "m/s²".to_owned(),
    }
}

/// Warns if the units of two vibrations differ or are unknown.
pub(super) fn warn_of_units(signals: [&Signal; 2]) {
    if let [(a, Some(one)), (b, Some(other))] = signals.map(|signal| (signal.path.display(), &signal.unit))
        && one != other
    {
        eprint(&format!(
            "warning: {a} is in {one}, {b} in {other}: levels are not comparable, LSD included\n"
        ));
    }
    let known = signals.iter().find_map(|signal| signal.unit.as_deref());
    for signal in signals.into_iter().filter(|signal| signal.unit.is_none()) {
        let path = signal.path.display();
        let said = match (signal.is_wav, known) {
            (true, _) => {
                "levels, LSD included, assume that 1.0 is 1 m/s2; state the full scale by --full-scale"
                    .to_owned()
            }
            (false, Some(unit)) => format!(
                "levels, LSD included, assume {unit}, the unit of the other file; state the unit by --unit, for example --unit accel=g"
            ),
            // Two columns without units have comparable levels.
            (false, None) => continue,
        };
        eprint(&format!("warning: {path} does not state its unit: {said}\n"));
    }
}

/// The rate at which two vibrations are compared.
pub(super) fn common_rate_hz(signals: [&Signal; 2], asked_hz: Option<f64>) -> Result<f64, Failure> {
    match (asked_hz, signals.map(|signal| signal.rate_hz)) {
        (Some(asked_hz), _) => Ok(asked_hz),
        (None, [Some(a), Some(b)]) if a == b => Ok(a),
        (None, [Some(a), Some(b)]) => {
            let ([one, other], least) = (signals.map(|signal| signal.path.display()), a.min(b));
            Err(Failure::Message(format!(
                "the rate of {one} is {a} Hz, that of {other} is {b} Hz; give the rate to compare at by --rate, at most {least}"
            )))
        }
        (None, rates) => {
            let unknown = if rates[0].is_none() { signals[0] } else { signals[1] };
            Err(Failure::Message(rateless(&unknown.path, "--sample-rate (of both files by --rate)")))
        }
    }
}

fn rateless(path: &Path, flag: &str) -> String {
    let path = path.display();
    format!(
        "{path} does not state its rate; name the column of the time (--column time=… --unit time=ms), or give the rate by {flag}"
    )
}

/// The named column, if any, and the import settings of tables.
pub(in crate::cli) fn chosen<'a>(
    columns: &'a [NamedColumn],
    tables: &Tables,
) -> Result<(Option<&'a str>, ImportSettings), Failure> {
    let (mut plain, mut quantities) = (None, vec![]);
    for column in columns {
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
    let import = tables.settings(&quantities).map_err(Failure::Message)?;
    Ok((plain, import))
}

/// Reads a file that is not a WAV file: the acceleration of a recording, or the signal of a plain table.
fn other(path: &Path, column: Option<&str>, import: &ImportSettings) -> Result<(Read, Motion), Failure> {
    if column.is_none() {
        match recordings::try_load(path, import) {
            Err(LoadError::Read { source: ReadError::Missing { .. }, .. }) => {}
            Err(error) => return Err(recordings::failure(&error)),
            Ok(loaded) => return recording(path, loaded),
        }
    }
    let (signal, findings) =
        load_signal(path, column, import).map_err(|error| recordings::failure(&error))?;
    for finding in &findings {
        eprint(&format!("warning: {}\n", recordings::said(path, finding)));
    }
    let unit = signal.unit.map(str::to_owned);
    let simulated = recordings::is_simulated(path)?;
    Ok(((signal.values, signal.rate_hz, unit, simulated), None))
}

fn recording(path: &Path, loaded: Loaded) -> Result<(Read, Motion), Failure> {
    loaded.warn();
    let recording = loaded.recording;
    let processed = processed(&recording, &Default::default()).map_err(Failure::doing("process", path))?;
    let signals = processed.signals();
    let read = (
        signals.acceleration_m_s2.clone(),
        Some(signals.rate_hz),
        Some("m/s2".to_owned()),
        recording.provenance().origin == Origin::Simulated,
    );
    let motion = [signals.speed_m_s.clone(), signals.force_normal_n.clone()];
    Ok((read, Some(motion)))
}

/// The only channel, the numbered one, or three axes combined.
fn wav(path: &Path, channel: Option<&str>, import: &ImportSettings) -> Result<Read, Failure> {
    let failed = |error: &dyn std::fmt::Display| Failure::file("read", path, error);
    // Files above 4 GiB are RF64; the number of samples bounds what is read.
    let opened = files::open(path, u64::MAX).map_err(|error| failed(&error))?;
    let mut file = opened.as_file();
    let layout = read_layout(&mut file).map_err(|error| failed(&error))?;
    if layout.frames() > MAX_SAMPLES {
        let frames = layout.frames();
        return Err(failed(&format!("it has {frames} frames, the limit is {MAX_SAMPLES}; cut out a part")));
    }
    let (channels, rate_hz) = (usize::from(layout.channels), f64::from(layout.rate_hz));
    let note = recordings::note(path)?;
    let full_scale = import.full_scale_m_s2.or(note.full_scale).unwrap_or(1.0);
    let unit = match import.full_scale_m_s2 {
        Some(_) => Some("m/s2".to_owned()),
        None => note.unit,
    };
    let mut one = |channel: usize| -> Result<Vec<f64>, Failure> {
        let mut samples = read_channel(&mut file, &layout, channel).map_err(|error| failed(&error))?;
        samples.iter_mut().for_each(|sample| *sample *= full_scale);
        Ok(samples)
    };
    let mut chosen = match (channel, channels) {
        (Some(number), _) => match number.parse::<usize>() {
            Ok(number) if number < channels => one(number)?,
            _ => {
                return Err(failed(&format!(
                    "it has no channel {number}; it has {channels} channels, counted from 0"
                )));
            }
        },
        (None, 1) => one(0)?,
        (None, 3) => {
            let (x, y, z) = (one(0)?, one(1)?, one(2)?);
            let axes: Vec<[f64; 3]> = { x.iter().zip(&y).zip(&z) }.map(|((x, y), z)| [*x, *y, *z]).collect();
            combined(&axes, rate_hz, &Default::default()).map_err(|error| failed(&error))?
        }
        (None, _) => {
            return Err(failed(&format!("it has {channels} channels; choose one by --column, from 0")));
        }
    };
    if unit.as_deref().is_none_or(|unit| unit == "m/s2")
        && let Some(found) = remove_offset("the vibration", unit.is_some(), &mut chosen, rate_hz)
    {
        match import.strict {
            true => {
                return Err(failed(&format!("{found}; --strict does not allow this")));
            }
            false => eprint(&format!("warning: {}: {found}\n", path.display())),
        }
    }
    Ok((chosen, Some(rate_hz), unit, note.simulated))
}

fn is_wav(path: &Path) -> Result<bool, Failure> {
    let failed = |error: io::Error| Failure::file("read", path, &error);
    let mut start = Vec::new();
    let file = files::open(path, u64::MAX).map_err(failed)?;
    file.take(4).read_to_end(&mut start).map_err(failed)?;
    Ok(matches!(&start[..], b"RIFF" | b"RF64"))
}
