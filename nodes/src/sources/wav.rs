//! A source that plays a WAV file.

use haptograph_engine::frame::Scalar;
use haptograph_engine::node::{
    BuildContext, BuildError, Built, DataEnd, Io, LiveId, NodeKind, Port, Processor, Tick,
};
use haptograph_signal::files::{self, MAX_RECORDING_BYTES};
use std::io::BufReader;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::AtEnd;
use super::csv::CsvSource;
use crate::wav::{Layout, WavError, read_channel, read_layout};

haptograph_engine::settings! {
    /// Settings of [`WavSource`].
    pub struct WavSourceSettings {
        /// The WAV file, relative to the graph file.
        file: PathBuf;
        /// Channel of the file, counted from 0.
        channel: u32 = 0;
        /// Value of a full-scale sample (1.0), in the SI unit of `quantity`.
        [live] full_scale: f64 = 1.0;
        /// Quantity of the output, by name.
        quantity: String = "number".into();
        /// Output after the last sample.
        at_end: AtEnd = AtEnd::Stop;
        /// Older form of `at_end: Loop`.
        repeat: bool = false;
    }
}

haptograph_engine::node! {
    /// Plays one channel of a WAV file from the start. The file's rate has to be that of the node's clock. The run ends
    /// with the file, unless `at_end` states otherwise.
    /// Elsewhere: DiskIn, readsf~, audioread.
    pub struct WavSource(WavSourceSettings) in "sources";
    example: r#""felt": WavSource(clock: "audio", file: "recordings/felt.wav", full_scale: 20.0, quantity: "acceleration")"#;
    out OUTPUT: Scalar = Port::of_setting("quantity", "The recording.");
}

impl NodeKind for WavSource {
    fn build(settings: WavSourceSettings, cx: &BuildContext) -> Result<Built<Self>, BuildError> {
        let samples = read(&settings.file, settings.channel, cx.rate.hz())?;
        Ok(Built::new(WavPlayback {
            playback: Playback { samples: samples.into(), at_end: settings.at_end.or_loop(settings.repeat) },
            full_scale: settings.full_scale,
        }))
    }
}

/// All samples of one channel (counted from 0) of a WAV file, in full scale. The file's rate has to be `rate_hz`.
pub(super) fn read(file: &Path, channel: u32, rate_hz: f64) -> Result<Vec<f64>, BuildError> {
    let check = |layout: &Layout| check_rate(layout, rate_hz);
    read_at_any_rate(file, channel, MAX_RECORDING_BYTES, check).map(|(samples, _)| samples)
}

fn check_rate(layout: &Layout, rate_hz: f64) -> Result<(), BuildError> {
    if f64::from(layout.rate_hz) != rate_hz {
        let message =
            format!("the file's rate is {} Hz, but the node's clock ticks at {rate_hz} Hz", layout.rate_hz);
        let help = format!("put the node on a clock of {} Hz and bridge from there", layout.rate_hz);
        return Err(BuildError::at("file", message).help(help));
    }
    Ok(())
}

/// All samples of one channel, and the file's rate in Hz. `check` and a bound on the file's bytes apply first.
pub(super) fn read_at_any_rate(
    path: &Path,
    channel: u32,
    max_bytes: u64,
    check: impl FnOnce(&Layout) -> Result<(), BuildError>,
) -> Result<(Vec<f64>, f64), BuildError> {
    let failed = |error: WavError| unreadable(path, &error);
    let file = files::open(path, max_bytes).map_err(|error| failed(error.into()))?;
    // The file has to be regular: the layout is checked against its length.
    let mut file = BufReader::new(file.as_file());
    let layout = read_layout(&mut file).map_err(failed)?;
    check(&layout)?;
    if layout.frames() == 0 {
        let message = format!("cannot read {}: it has a header, but no frames", path.display());
        return Err(BuildError::at("file", message).help("record or export the sound again"));
    }
    let (channel, channels) = (channel as usize, usize::from(layout.channels));
    if channel >= channels {
        let message = format!("the file has {channels} channels; channels are counted from 0");
        return Err(BuildError::at("channel", message));
    }
    let samples = read_channel(&mut file, &layout, channel).map_err(failed)?;
    Ok((samples, f64::from(layout.rate_hz)))
}

fn unreadable(file: &Path, error: &WavError) -> BuildError {
    let message = format!("cannot read {}: {error}", file.display());
    let help = match error {
        WavError::NotFinite { .. } => "replace NaN and infinity in the file, for example by 0",
        WavError::Cut { .. } => "run `haptograph recover`: it makes a truncated file readable up to its end",
        _ => "give the path of a WAV file, relative to the graph file",
    };
    BuildError::at("file", message).help(help)
}

/// Samples in memory, one per tick, for [`CsvSource`] and, times the value of full scale, [`WavSource`].
#[derive(Debug, Clone)]
pub(super) struct Playback {
    pub samples: Arc<[f64]>,
    pub at_end: AtEnd,
}

impl Playback {
    /// The sample of a tick; none in the silence after the last sample.
    fn at(&self, tick: u64) -> Option<f64> {
        let length = self.samples.len() as u64;
        let sample = match self.at_end {
            AtEnd::Loop if length > 0 => tick % length,
            // Frames after the end reach only actuators that fade out.
            AtEnd::Stop | AtEnd::Hold => tick.min(length.saturating_sub(1)),
            _ => tick,
        };
        let sample = usize::try_from(sample).ok().and_then(|at| self.samples.get(at));
        sample.copied()
    }
}

impl Processor<CsvSource> for Playback {
    fn process(&mut self, tick: &Tick, io: &mut Io<'_, CsvSource>) {
        for (y, now) in io.write(CsvSource::OUTPUT).iter_mut().zip(tick.first..) {
            *y = self.at(now).unwrap_or(0.0);
        }
    }

    fn data_end(&self) -> Option<DataEnd> {
        self.at_end.after(self.samples.len() as u64)
    }
}

/// Samples times the value of full scale.
#[derive(Debug, Clone)]
struct WavPlayback {
    playback: Playback,
    full_scale: f64,
}

impl Processor<WavSource> for WavPlayback {
    fn process(&mut self, tick: &Tick, io: &mut Io<'_, WavSource>) {
        for (y, now) in io.write(WavSource::OUTPUT).iter_mut().zip(tick.first..) {
            let sample = self.playback.at(now);
            *y = sample.map_or(0.0, |sample| sample * self.full_scale);
        }
    }

    fn set(&mut self, setting: LiveId<WavSourceSettings>, value: f64) {
        if setting == WavSourceSettings::full_scale {
            self.full_scale = value;
        }
    }

    fn data_end(&self) -> Option<DataEnd> {
        self.playback.data_end()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wav::{Format, WavWriter};
    use haptograph_engine::testing::Bench;
    use hound::SampleFormat;
    use std::fs::File;

    fn written(folder: &Path, format: SampleFormat, bits: u16) -> PathBuf {
        let path = folder.join("x.wav");
        let spec =
            hound::WavSpec { channels: 2, sample_rate: 1000, bits_per_sample: bits, sample_format: format };
        let mut writer = hound::WavWriter::create(&path, spec).unwrap();
        for k in 0..4_i16 {
            match format {
                SampleFormat::Float => {
                    writer.write_sample(0.0_f32).unwrap();
                    writer.write_sample(f32::from(k) * 0.25).unwrap();
                }
                SampleFormat::Int => {
                    writer.write_sample(0_i16).unwrap();
                    writer.write_sample(k * 8192).unwrap();
                }
            }
        }
        writer.finalize().unwrap();
        path
    }

    fn settings(file: PathBuf, channel: u32, repeat: bool) -> WavSourceSettings {
        WavSourceSettings {
            file,
            channel,
            full_scale: 8.0,
            quantity: "number".into(),
            at_end: AtEnd::Silence,
            repeat,
        }
    }

    #[test]
    fn samples_come_in_physical_units_and_then_silence() {
        let folder = tempfile::tempdir().unwrap();
        for (format, bits) in [(SampleFormat::Float, 32), (SampleFormat::Int, 16)] {
            let file = written(folder.path(), format, bits);
            let mut bench = Bench::new::<WavSource>(settings(file.clone(), 1, false), 1000.0, &[]).unwrap();
            assert_eq!(bench.run_frames(6, &[], &[1, 2]), [[0.0, 2.0, 4.0, 6.0, 0.0, 0.0]]);
            let mut bench = Bench::new::<WavSource>(settings(file, 1, true), 1000.0, &[]).unwrap();
            assert_eq!(bench.run_frames(6, &[], &[5]), [[0.0, 2.0, 4.0, 6.0, 0.0, 2.0]]);
        }
    }

    #[test]
    fn a_file_that_does_not_fit_is_refused_at_its_field() {
        let folder = tempfile::tempdir().unwrap();
        let file = written(folder.path(), SampleFormat::Float, 32);
        let field = |settings, rate| Bench::new::<WavSource>(settings, rate, &[]).err().and_then(|e| e.field);
        assert_eq!(field(settings(file.clone(), 0, false), 999.0), Some("file"));
        assert_eq!(field(settings(file, 2, false), 1000.0), Some("channel"));
        assert_eq!(field(settings("none.wav".into(), 0, false), 1000.0), Some("file"));
    }

    #[test]
    fn a_sample_that_is_no_number_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("x.wav");
        let format = Format { channels: 2, rate_hz: 1000 };
        for bad in [f32::NAN, f32::INFINITY] {
            let mut writer = WavWriter::new(File::create(&file).unwrap(), format).unwrap();
            writer.write(&[0.0, 1.0, 0.0, 2.0, 0.0, bad]).unwrap();
            writer.finish().unwrap();
            let refused = |channel| {
                let settings = settings(file.clone(), channel, false);
                Bench::new::<WavSource>(settings, 1000.0, &[]).err()
            };
            assert_eq!(refused(0), None);
            let error = refused(1).unwrap();
            assert_eq!(error.field, Some("file"));
            assert!(error.message.contains("x.wav") && error.message.contains("frame 2"), "{error}");
        }
    }
}
