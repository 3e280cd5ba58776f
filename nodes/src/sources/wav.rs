//! A recording from a WAV file.

use haptograph_engine::node::{BuildContext, BuildError, Io, NodeKind, NodeSpec, Processor, Tick};
use haptograph_signal::files::{self, MAX_RECORDING_BYTES};
use hound::{SampleFormat, WavReader};
use std::io::BufReader;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::made;

haptograph_engine::settings! {
    /// Settings of [`WavSource`].
    pub struct WavSourceSettings {
        /// The WAV file, relative to the graph file.
        file: PathBuf;
        /// Which channel, from 0.
        channel: u32 = 0;
        /// What a sample of 1.0 (full scale) stands for, in the SI unit of `quantity`.
        full_scale: f64 = 1.0;
        /// What it is, by name.
        quantity: String = "number".into();
        /// Start again at the end; otherwise silence follows.
        repeat: bool = false;
    }
}

/// Plays one channel of a WAV file.
pub struct WavSource;

impl NodeKind for WavSource {
    type Settings = WavSourceSettings;
    const SPEC: NodeSpec = NodeSpec {
        name: "WavSource",
        group: "sources",
        doc: "Plays one channel of a WAV file from the start. Its rate has to be that of the node's clock.",
        source: "",
        inputs: &[],
        outputs: &[made("The recording.")],
        example: r#""felt": WavSource(clock: "audio", file: "recordings/felt.wav", full_scale: 20.0, quantity: "acceleration")"#,
    };

    fn build(settings: WavSourceSettings, cx: &BuildContext) -> Result<Box<dyn Processor>, BuildError> {
        let channel = Channel {
            file: &settings.file,
            channel: settings.channel,
            full_scale: settings.full_scale,
        };
        let samples = read(&channel, cx.rate.hz())?;
        Ok(Box::new(Playback {
            samples: samples.into(),
            repeat: settings.repeat,
        }))
    }
}

/// One channel of a WAV file, from 0, and what a sample of 1.0 stands for.
pub(super) struct Channel<'a> {
    pub file: &'a Path,
    pub channel: u32,
    pub full_scale: f64,
}

/// All its samples.
pub(super) fn read(wanted: &Channel<'_>, rate_hz: f64) -> Result<Vec<f64>, BuildError> {
    let failed = |error: hound::Error| unreadable(wanted.file, &error);
    let file =
        files::open(wanted.file, MAX_RECORDING_BYTES).map_err(|error| unreadable(wanted.file, &error))?;
    let mut reader = WavReader::new(BufReader::new(file)).map_err(failed)?;
    let spec = reader.spec();
    if f64::from(spec.sample_rate) != rate_hz {
        let message = format!(
            "the file has {} Hz, the node's clock {rate_hz} Hz",
            spec.sample_rate
        );
        let help = format!(
            "put the node on a clock of {} Hz and bridge from there",
            spec.sample_rate
        );
        return Err(BuildError::at("file", message).help(help));
    }
    let (channel, channels) = (wanted.channel as usize, usize::from(spec.channels));
    if channel >= channels {
        let message = format!("the file has {channels} channels, counted from 0");
        return Err(BuildError::at("channel", message));
    }
    let all: Result<Vec<f64>, hound::Error> = match spec.sample_format {
        SampleFormat::Float => reader.samples::<f32>().map(|s| s.map(f64::from)).collect(),
        SampleFormat::Int => {
            let most = f64::from(spec.bits_per_sample - 1).exp2();
            reader
                .samples::<i32>()
                .map(|s| s.map(|s| f64::from(s) / most))
                .collect()
        }
    };
    let picked = all.map_err(failed)?.into_iter().skip(channel).step_by(channels);
    Ok(picked.map(|sample| sample * wanted.full_scale).collect())
}

fn unreadable(file: &Path, error: &dyn std::error::Error) -> BuildError {
    let message = format!("{} cannot be read: {error}", file.display());
    BuildError::at("file", message).help("give a WAV file, by its path from the graph file")
}

/// Samples that are all there, one a tick.
#[derive(Debug, Clone)]
pub(super) struct Playback {
    pub samples: Arc<[f64]>,
    pub repeat: bool,
}

impl Processor for Playback {
    fn process(&mut self, tick: &Tick, io: &mut Io<'_>) {
        let length = self.samples.len() as u64;
        for (y, now) in io.out(0).iter_mut().zip(tick.first..) {
            let at = if self.repeat && length > 0 {
                now % length
            } else {
                now
            };
            *y = usize::try_from(at)
                .ok()
                .and_then(|at| self.samples.get(at))
                .copied()
                .unwrap_or(0.0);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptograph_engine::testing::Bench;

    fn written(folder: &Path, format: SampleFormat, bits: u16) -> PathBuf {
        let path = folder.join("x.wav");
        let spec = hound::WavSpec {
            channels: 2,
            sample_rate: 1000,
            bits_per_sample: bits,
            sample_format: format,
        };
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
            repeat,
        }
    }

    #[test]
    fn samples_come_in_physical_units_and_then_silence() {
        let folder = tempfile::tempdir().unwrap();
        for (format, bits) in [(SampleFormat::Float, 32), (SampleFormat::Int, 16)] {
            let file = written(folder.path(), format, bits);
            let mut bench = Bench::new::<WavSource>(settings(file.clone(), 1, false), 1000.0, &[]).unwrap();
            assert_eq!(
                bench.run_frames(6, &[], &[1, 2]),
                [[0.0, 2.0, 4.0, 6.0, 0.0, 0.0]]
            );
            let mut bench = Bench::new::<WavSource>(settings(file, 1, true), 1000.0, &[]).unwrap();
            assert_eq!(bench.run_frames(6, &[], &[5]), [[0.0, 2.0, 4.0, 6.0, 0.0, 2.0]]);
        }
    }

    #[test]
    fn a_file_that_does_not_fit_is_refused_at_its_field() {
        let folder = tempfile::tempdir().unwrap();
        let file = written(folder.path(), SampleFormat::Float, 32);
        let field = |settings, rate| {
            Bench::new::<WavSource>(settings, rate, &[])
                .err()
                .and_then(|e| e.field)
        };
        assert_eq!(field(settings(file.clone(), 0, false), 999.0), Some("file"));
        assert_eq!(field(settings(file, 2, false), 1000.0), Some("channel"));
        assert_eq!(field(settings("none.wav".into(), 0, false), 1000.0), Some("file"));
    }
}
