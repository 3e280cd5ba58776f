//! Vibrations as files of phones and controllers, which hold curves of amplitude and frequency in place of samples. Each file is decoded
//! again, and the result compared with the vibration: [`Loss`].
//!
//! A curve gets its points where it errs most, and then the values with the least squares. A tap is a short burst, which is taken out of
//! the curves.

mod ahap;
mod analysis;
mod curves;
mod haptic;
mod hjif;

use crate::metrics::level::{envelope_error_db, levels_db};
use crate::metrics::{BandErrors, Bands};
use analysis::{Analysis, Written};
use haptograph_surfaces::bounds::shown;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::path::Path;

/// Points of a curve per second, on average: as many as where Meta analyses sound.
const POINTS_PER_S: f64 = 60.0;
/// Shortest vibration, s.
const SHORTEST_S: f64 = 0.05;
/// Most samples: 44 s at 48 kHz, 3.5 minutes at 10 kHz. With so many an export takes 0.4 GiB.
const MAX_SAMPLES: usize = 1 << 21;
/// Rates, Hz: a lower one does not hold the frequencies of taps, a higher one none that is felt.
const RATES_HZ: std::ops::RangeInclusive<f64> = 500.0..=100_000.0;

/// A file format.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Format {
    /// Apple's Core Haptics.
    Ahap,
    /// Meta Haptics Studio, and Lofelt's before it.
    Haptic,
    /// ISO/IEC 23090-31.
    Hjif,
}

impl Format {
    /// All formats.
    pub const ALL: [Self; 3] = [Self::Ahap, Self::Haptic, Self::Hjif];

    /// The extension of its files.
    pub fn extension(self) -> &'static str {
        match self {
            Self::Ahap => "ahap",
            Self::Haptic => "haptic",
            Self::Hjif => "hjif",
        }
    }

    /// The format of a file by its extension.
    ///
    /// # Errors
    /// [`PatternError::Extension`].
    pub fn of(path: &Path) -> Result<Self, PatternError> {
        let is = |format: &Self| {
            path.extension().is_some_and(|found| found.eq_ignore_ascii_case(format.extension()))
        };
        Self::ALL.into_iter().find(is).ok_or(PatternError::Extension)
    }

    /// What no file of this format holds, whatever the vibration.
    fn lost(self) -> &'static str {
        match self {
            Self::Ahap => {
                "the waveform: one sine at a time, from 65 to 300 Hz where a sharpness from 0 to 1 is that, and taps of one shape; the unit"
            }
            Self::Haptic => {
                "the waveform: one sine at a time, from 30 to 600 Hz where a frequency from 0 to 1 is that, and taps of one shape; the unit"
            }
            Self::Hjif => {
                "the waveform from 72.5 Hz on: a sine in each of five bands up to 1000 Hz, and taps of one shape; the unit"
            }
        }
    }
}

/// A file and what is lost in it.
#[derive(Debug, Clone, PartialEq)]
pub struct Pattern {
    /// The content of the file.
    pub text: String,
    /// What is lost.
    pub loss: Loss,
}

/// What is lost in a file: differences between the vibration and what the file is decoded to.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Loss {
    /// The extension of the format.
    pub format: &'static str,
    /// Bytes of the file.
    pub bytes: usize,
    /// Points of its curves.
    pub points: usize,
    /// Number of taps.
    pub taps: usize,
    /// Physical value of an amplitude of 1.
    pub full_scale: f64,
    /// Unit of that.
    pub unit: String,
    /// RMS difference of the levels over 50 ms, dB.
    pub envelope_db: f64,
    /// Root mean square of the differences of the third octaves, dB; `None` without any.
    pub lsd_db: Option<f64>,
    /// Levels in third octaves.
    pub bands: Vec<BandLevels>,
    /// What no file of the format holds.
    pub lost: &'static str,
}

/// Levels in a third octave, dB relative to the unit; `None` where it is empty.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct BandLevels {
    /// Centre, Hz.
    pub centre_hz: f64,
    /// Level of the vibration.
    pub before_db: Option<f64>,
    /// Level of the decoded file.
    pub after_db: Option<f64>,
}

/// Reason why a vibration has no file.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs)] // see the messages
#[non_exhaustive]
pub enum PatternError {
    #[error("its extension is none of .ahap, .haptic and .hjif; give one of them")]
    Extension,
    #[error("its rate is {} Hz; it must be from 500 to 100000 Hz: resample it", shown(*rate_hz))]
    Rate { rate_hz: f64 },
    #[error("it is {} s long; at its rate it must be from {SHORTEST_S} to {} s: give another part", shown(*seconds), shown(*longest_s))]
    Length { seconds: f64, longest_s: f64 },
    #[error("sample {sample} (from 0) is not a finite number: repair it or leave it out")]
    NotFinite { sample: usize },
    #[error("it is silent; give a part that is not")]
    Silent,
}

/// Writes a vibration, samples in `unit`, as a file.
///
/// # Errors
/// [`PatternError`] for samples that are none, or too many.
pub fn encode(samples: &[f64], rate_hz: f64, unit: &str, format: Format) -> Result<Pattern, PatternError> {
    if !RATES_HZ.contains(&rate_hz) {
        return Err(PatternError::Rate { rate_hz });
    }
    let seconds = samples.len() as f64 / rate_hz;
    if seconds < SHORTEST_S || samples.len() > MAX_SAMPLES {
        return Err(PatternError::Length { seconds, longest_s: MAX_SAMPLES as f64 / rate_hz });
    }
    if let Some(sample) = samples.iter().position(|x| !x.is_finite()) {
        return Err(PatternError::NotFinite { sample });
    }
    let peak = samples.iter().fold(0.0, |peak: f64, x| peak.max(x.abs()));
    if peak == 0.0 {
        return Err(PatternError::Silent);
    }
    let before: Vec<f64> = samples.iter().map(|x| x / peak).collect();
    let analysis = Analysis::of(&before, rate_hz, (peak, unit.to_owned()));
    let most = (POINTS_PER_S * seconds).ceil() as usize + 2;
    let written = match format {
        Format::Ahap => ahap::write(&analysis, most),
        Format::Haptic => haptic::write(&analysis, most),
        Format::Hjif => hjif::write(&analysis, most),
    };
    let Written { file, full_scale, points } = written;
    let text = file.to_string();
    let mut after = decode(&text, format, rate_hz, samples.len());
    after.iter_mut().for_each(|y| *y *= full_scale);
    let (lsd_db, bands) = third_octaves([&before, &after], rate_hz, peak);
    let loss = Loss {
        format: format.extension(),
        bytes: text.len(),
        points,
        taps: analysis.taps.len(),
        full_scale: full_scale * peak,
        unit: unit.to_owned(),
        envelope_db: envelope_error_db(&levels_db(&after, rate_hz), &levels_db(&before, rate_hz)),
        lsd_db,
        bands,
        lost: format.lost(),
    };
    Ok(Pattern { text, loss })
}

/// The distance between two signals relative to a peak in third octaves, dB, and their levels.
fn third_octaves(signals: [&[f64]; 2], rate_hz: f64, peak: f64) -> (Option<f64>, Vec<BandLevels>) {
    let bands = Bands::counted(signals[0].len() as f64 / rate_hz, rate_hz);
    let [before, after] = signals.map(|signal| bands.of_signal([signal], rate_hz));
    let level = |power: &f64| Some(10.0 * power.log10() + 20.0 * peak.log10()).filter(|db| db.is_finite());
    let powers = before.powers().iter().zip(after.powers());
    let levels = bands.as_slice().iter().zip(powers).map(|(band, (before, after))| BandLevels {
        centre_hz: band.centre_hz,
        before_db: level(before),
        after_db: level(after),
    });
    let lsd_db = (!bands.is_empty()).then(|| BandErrors::new(&after, &before).lsd_db);
    (lsd_db, levels.collect())
}

/// The vibration that a file stands for, relative to its full scale. What is missing or wrong in it is zero.
fn decode(text: &str, format: Format, rate_hz: f64, samples: usize) -> Vec<f64> {
    let file: Value = serde_json::from_str(text).unwrap_or_default();
    match format {
        Format::Ahap => ahap::read(&file, rate_hz, samples),
        Format::Haptic => haptic::read(&file, rate_hz, samples),
        Format::Hjif => hjif::read(&file, rate_hz, samples),
    }
}

#[cfg(test)]
mod tests;
