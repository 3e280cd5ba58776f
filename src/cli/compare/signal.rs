//! One vibration from whatever file it is in.

use crate::cli::recording::{self as recordings, Loaded};
use crate::cli::{Failure, remark};
use crate::nodes::wav::{read_channel, read_layout};
use crate::signal::files;
use crate::signal::resample::{Quality, resample_whole};
use crate::signal::time::Rate;
use crate::surfaces::Origin;
use crate::surfaces::learning::processing::{combined, processed};
use crate::surfaces::recording::{ImportSettings, LoadError, ReadError, load_signal};
use std::io::{self, Read as _};
use std::path::{Path, PathBuf};

/// The most samples of a WAV file that are compared: two hours at 48 kHz, 3 GB of memory.
const MAX_SAMPLES: u64 = 400_000_000;

/// A vibration. Its rate is unknown where a CSV file does not say it.
#[derive(Debug)]
pub struct Signal {
    path: PathBuf,
    samples: Vec<f64>,
    rate_hz: Option<f64>,
    /// Of the samples, where the file says it.
    unit: Option<String>,
    is_wav: bool,
    /// Speed in m/s and force in N, sample by sample, where the file is a recording that has them.
    motion: Motion,
    /// Is it known to come from simulated devices?
    pub simulated: bool,
}

/// Samples, their rate, their unit, and whether they are known to be simulated.
type Read = (Vec<f64>, Option<f64>, Option<String>, bool);
/// Speed and force of a recording.
type Motion = Option<[Vec<f64>; 2]>;

impl Signal {
    /// The vibration in a file; `column` names the column of a table or the channel of a WAV file.
    pub fn read(path: &Path, column: Option<&str>, import: &ImportSettings) -> Result<Self, Failure> {
        let is_wav = is_wav(path)?;
        let ((samples, rate_hz, unit, simulated), motion) = match is_wav {
            true => (wav(path, column, import.full_scale_m_s2)?, None),
            false => other(path, column, import)?,
        };
        Ok(Self {
            path: path.to_owned(),
            samples,
            rate_hz,
            unit,
            is_wav,
            motion,
            simulated,
        })
    }

    /// The samples at this rate.
    pub fn at(&self, rate_hz: f64) -> Result<Vec<f64>, Failure> {
        self.resampled(&self.samples, rate_hz)
    }

    /// Speed and force at this rate, where there are any.
    pub fn motion_at(&self, rate_hz: f64) -> Result<Motion, Failure> {
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
            return Err(failed(&format!(
                "its rate is {own_hz} Hz; give a --rate of at most that"
            )));
        }
        let rate = |hz: f64| Rate::parse(&hz.to_string()).map_err(|error| failed(&error));
        resample_whole(samples, rate(own_hz)?, rate(rate_hz)?, Quality::FINE).map_err(|error| failed(&error))
    }
}

/// Says where two vibrations are not known to be alike.
pub fn warn_of_units(signals: [&Signal; 2]) {
    if let [(a, Some(one)), (b, Some(other))] = signals.map(|signal| (signal.path.display(), &signal.unit))
        && one != other
    {
        remark(&format!(
            "warning: {a} is in {one}, {b} in {other}: no level means anything, LSD included\n"
        ));
    }
    let known = signals.iter().find_map(|signal| signal.unit.as_deref());
    for signal in signals.into_iter().filter(|signal| signal.unit.is_none()) {
        let path = signal.path.display();
        let said = match (signal.is_wav, known) {
            (true, _) => {
                "all levels, LSD included, hold only if 1.0 is 1 m/s2; say it by --full-scale".to_owned()
            }
            (false, Some(unit)) => format!(
                "all levels, LSD included, hold only if it is {unit}, as the other's; say it by --unit accel=g"
            ),
            // Of two columns that are alike, levels hold in their own unit.
            (false, None) => continue,
        };
        remark(&format!("warning: {path} does not say its unit: {said}\n"));
    }
}

/// The rate that two vibrations are compared at.
pub fn common_rate_hz(signals: [&Signal; 2], asked_hz: Option<f64>) -> Result<f64, Failure> {
    match (asked_hz, signals.map(|signal| signal.rate_hz)) {
        (Some(asked_hz), _) => Ok(asked_hz),
        (None, [Some(a), Some(b)]) if a == b => Ok(a),
        (None, [Some(a), Some(b)]) => Err(Failure::Message(format!(
            "{} has {a} Hz, {} has {b} Hz; say by --rate what to compare at, {} at most",
            signals[0].path.display(),
            signals[1].path.display(),
            a.min(b)
        ))),
        (None, rates) => {
            let unknown = if rates[0].is_none() {
                signals[0]
            } else {
                signals[1]
            };
            let path = unknown.path.display();
            Err(Failure::Message(format!(
                "{path} does not say its rate; say which column is the time (--column time=… --unit time=ms), or give the rate by --sample-rate (of both files by --rate)"
            )))
        }
    }
}

/// What is in a file that is no WAV file: the acceleration of a recording, or the signal of a table that is none.
fn other(path: &Path, column: Option<&str>, import: &ImportSettings) -> Result<(Read, Motion), Failure> {
    if column.is_none() {
        match recordings::try_load(path, import) {
            Err(LoadError::Read {
                source: ReadError::Missing { .. },
                ..
            }) => {}
            Err(error) => return Err(recordings::failure(&error)),
            Ok(loaded) => return recording(path, loaded),
        }
    }
    let (signal, findings) =
        load_signal(path, column, import).map_err(|error| recordings::failure(&error))?;
    for finding in &findings {
        remark(&format!("warning: {}\n", recordings::said(path, finding)));
    }
    let unit = signal.unit.map(str::to_owned);
    let simulated = recordings::is_simulated(path)?;
    Ok(((signal.values, signal.rate_hz, unit, simulated), None))
}

fn recording(path: &Path, loaded: Loaded) -> Result<(Read, Motion), Failure> {
    for warning in &loaded.warnings {
        remark(&format!("warning: {warning}\n"));
    }
    let recording = loaded.recording;
    let processed =
        processed(&recording, &Default::default()).map_err(|error| Failure::file("process", path, &error))?;
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

/// The only channel, that of the given number, or three axes combined.
fn wav(path: &Path, channel: Option<&str>, full_scale_m_s2: Option<f64>) -> Result<Read, Failure> {
    let failed = |error: &dyn std::fmt::Display| Failure::file("read", path, error);
    // Files of more than 4 GiB are RF64; what is read of them is bounded by the samples.
    let opened = files::open(path, u64::MAX).map_err(|error| failed(&error))?;
    let mut file = opened.as_file();
    let layout = read_layout(&mut file).map_err(|error| failed(&error))?;
    if layout.frames() > MAX_SAMPLES {
        let frames = layout.frames();
        return Err(failed(&format!(
            "it has {frames} frames, and at most {MAX_SAMPLES} are compared; cut out a part"
        )));
    }
    let (channels, rate_hz) = (usize::from(layout.channels), f64::from(layout.rate_hz));
    let note = recordings::note(path)?;
    let full_scale = full_scale_m_s2.or(note.full_scale).unwrap_or(1.0);
    let unit = match full_scale_m_s2 {
        Some(_) => Some("m/s2".to_owned()),
        None => note.unit,
    };
    let mut one = |channel: usize| -> Result<Vec<f64>, Failure> {
        let mut samples = read_channel(&mut file, &layout, channel).map_err(|error| failed(&error))?;
        samples.iter_mut().for_each(|sample| *sample *= full_scale);
        Ok(samples)
    };
    let chosen = match (channel, channels) {
        (Some(number), _) => match number.parse::<usize>() {
            Ok(number) if number < channels => one(number)?,
            _ => {
                return Err(failed(&format!(
                    "there is no channel {number}; there are {channels}, counted from 0"
                )));
            }
        },
        (None, 1) => one(0)?,
        (None, 3) => {
            let (x, y, z) = (one(0)?, one(1)?, one(2)?);
            let axes: Vec<[f64; 3]> = { x.iter().zip(&y).zip(&z) }
                .map(|((x, y), z)| [*x, *y, *z])
                .collect();
            combined(&axes, rate_hz, &Default::default()).map_err(|error| failed(&error))?
        }
        (None, _) => {
            return Err(failed(&format!(
                "it has {channels} channels; choose one by --column, from 0"
            )));
        }
    };
    Ok((chosen, Some(rate_hz), unit, note.simulated))
}

fn is_wav(path: &Path) -> Result<bool, Failure> {
    let failed = |error: io::Error| Failure::file("read", path, &error);
    let mut start = Vec::new();
    let file = files::open(path, u64::MAX).map_err(failed)?;
    file.take(4).read_to_end(&mut start).map_err(failed)?;
    Ok(matches!(&start[..], b"RIFF" | b"RF64"))
}
