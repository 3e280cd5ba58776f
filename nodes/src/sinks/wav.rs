//! A sink that writes a signal to a WAV file of 32-bit floats.

use haptograph_engine::frame::Linear;
use haptograph_engine::node::{BuildError, FileContext, FileKind, FileSink, FrameWriter, Port, Stream};
use haptograph_signal::files::{self, write_atomically_by};
use std::fs::File;
use std::io::{self, BufReader, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use super::{inside_the_run, note, sync};
use crate::wav::{Format, WavWriter, read_layout};

haptograph_engine::settings! {
    /// Settings of [`WavSink`].
    pub struct WavSinkSettings {
        /// Name of the file in the run's folder.
        [output_file] file: String;
        /// Value of a full-scale sample (1.0), in the SI unit of the signal. Larger values are not clipped.
        full_scale: f64 = 1.0, in 1e-12..=1e12;
    }
}

haptograph_engine::node! {
    /// Writes a signal at its own rate to a WAV file of 32-bit floats, one channel per component. At least once a second
    /// its header is updated, so that the file is valid however the run ends; beyond 4 GiB it becomes RF64. Beside it,
    /// `<file>.ron` states the value of full scale and whether the signal was simulated.
    /// Elsewhere: DiskOut, writesf~, audiowrite.
    pub struct WavSink(WavSinkSettings) in "sinks";
    example: r#""record": WavSink(input: "texture.acceleration", file: "texture.wav", full_scale: 20.0)"#;
    in INPUT: Linear = Port::any("The signal.");
}

impl FileKind for WavSink {
    fn build(settings: WavSinkSettings, cx: &FileContext) -> Result<Box<dyn FileSink>, BuildError> {
        for stream in &cx.streams {
            whole_rate(stream)?;
        }
        Ok(Box::new(Recording {
            file: inside_the_run(&settings.file, &["wav"])?,
            full_scale: settings.full_scale,
        }))
    }
}

/// The rate of a stream in hertz; a WAV header holds whole numbers only.
fn whole_rate(stream: &Stream) -> Result<u32, BuildError> {
    let (hz, per) = stream.rate.parts();
    u32::try_from(hz).ok().filter(|_| per == 1).ok_or_else(|| {
        let message =
            format!("{} has {}; the rate of a WAV file is a whole number of hertz", stream.name, stream.rate);
        BuildError::at("input", message).help("use a `CsvSink`")
    })
}

#[derive(Debug)]
struct Recording {
    file: PathBuf,
    full_scale: f64,
}

impl FileSink for Recording {
    fn file_name(&self) -> &Path {
        &self.file
    }

    fn open(&self, path: &Path, streams: &[Stream]) -> io::Result<Box<dyn FrameWriter>> {
        let [stream] = streams else {
            return Err(io::Error::other("a WAV file takes one signal"));
        };
        Ok(Box::new(Writing::open(path, stream, self.full_scale)?))
    }
}

/// Writes a signal of any amplitude to a WAV file. Full scale is 1 in its SI unit, or the power of two
/// next to its peak, which keeps the mantissas of the samples. The note beside it states which.
///
/// # Errors
/// Errors of the file system, and signals that do not fit into a WAV file.
pub fn open_to_fit(path: &Path, stream: &Stream) -> io::Result<Box<dyn FrameWriter>> {
    Ok(Box::new(Fitting {
        writing: Writing::open(path, stream, 1.0)?,
        path: path.to_owned(),
        stream: stream.clone(),
        peak: 0.0,
    }))
}

struct Fitting {
    writing: Writing,
    path: PathBuf,
    stream: Stream,
    /// The largest finite sample.
    peak: f64,
}

impl FrameWriter for Fitting {
    fn write(&mut self, stream: usize, frames: &[f64]) -> io::Result<()> {
        let finite = frames.iter().filter(|lane| lane.is_finite());
        self.peak = finite.fold(self.peak, |peak, lane| peak.max(lane.abs()));
        self.writing.write(stream, frames)
    }

    fn finish(self: Box<Self>) -> io::Result<()> {
        let format = format_of(&self.stream)?;
        self.writing.writer.finish()?;
        if self.peak <= 1.0 {
            return Ok(());
        }
        let full_scale = self.peak.log2().ceil().exp2();
        write_atomically_by(&self.path, |scaled| scale_file(&self.path, scaled, format, full_scale))?;
        write_note(&self.path, &self.stream, full_scale)
    }
}

/// Rewrites a file of [`WavWriter`], divided by `full_scale`.
fn scale_file(from: &Path, to: &mut File, format: Format, full_scale: f64) -> io::Result<()> {
    let file = files::open(from, u64::MAX)?;
    let mut file = BufReader::new(file.as_file());
    let layout = read_layout(&mut file).map_err(io::Error::other)?;
    file.seek(SeekFrom::Start(layout.data_at))?;
    let mut writer = WavWriter::new(to, format)?;
    let mut bytes = [0; 4];
    for _ in 0..layout.data_bytes / 4 {
        file.read_exact(&mut bytes)?;
        let sample = f64::from(f32::from_le_bytes(bytes)) / full_scale;
        writer.write(&[sample as f32])?;
    }
    writer.finish()
}

fn format_of(stream: &Stream) -> io::Result<Format> {
    Ok(Format {
        channels: stream.kind.width() as u16,
        rate_hz: whole_rate(stream).map_err(io::Error::other)?,
    })
}

fn write_note(path: &Path, stream: &Stream, full_scale: f64) -> io::Result<()> {
    let [quantity, unit] = note::meaning(stream);
    let [rate, simulated] = note::origin(std::slice::from_ref(stream));
    let signal = format!("signal: {:?}", stream.name);
    let full_scale = format!("full_scale: {full_scale:?}");
    note::write(
        path,
        "The scale of the WAV file of this name.",
        &[signal, quantity, unit, full_scale, rate, simulated],
    )
}

struct Writing {
    writer: WavWriter<File>,
    /// Reader and writer of the same file.
    file: File,
    scale: f64,
    /// Samples of the present block.
    samples: Vec<f32>,
}

impl Writing {
    fn open(path: &Path, stream: &Stream, full_scale: f64) -> io::Result<Self> {
        let format = format_of(stream)?;
        let file = File::create(path)?;
        write_note(path, stream, full_scale)?;
        Ok(Self {
            writer: WavWriter::new(file.try_clone()?, format)?,
            file,
            scale: 1.0 / full_scale,
            samples: Vec::new(),
        })
    }
}

impl FrameWriter for Writing {
    fn write(&mut self, _: usize, frames: &[f64]) -> io::Result<()> {
        self.samples.clear();
        self.samples.extend(frames.iter().map(|lane| (lane * self.scale) as f32));
        if self.writer.write(&self.samples)? {
            sync::request(&self.file);
        }
        Ok(())
    }

    fn finish(self: Box<Self>) -> io::Result<()> {
        self.writer.finish()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptograph_engine::frame::Kind;
    use haptograph_signal::quantity::Quantity;
    use haptograph_signal::time::Rate;

    fn stream(rate: &str) -> Stream {
        Stream {
            name: "arm.force".into(),
            kind: Kind::VECTOR,
            quantity: Quantity::FORCE,
            rate: Rate::parse(rate).unwrap(),
            simulated: true,
        }
    }

    fn context(rate: &str) -> FileContext {
        FileContext { streams: vec![stream(rate)], graph_seed: 1 }
    }

    fn settings(file: &str) -> WavSinkSettings {
        WavSinkSettings { file: file.into(), full_scale: 4.0 }
    }

    #[test]
    fn what_is_written_is_read_back_in_its_unit() {
        let folder = tempfile::tempdir().unwrap();
        let sink = WavSink::build(settings("x.wav"), &context("1000")).unwrap();
        let path = folder.path().join(sink.file_name());
        let mut writer = sink.open(&path, &[stream("1000")]).unwrap();
        writer.write(0, &[1.0, 2.0, -8.0]).unwrap();
        writer.write(0, &[0.5, 0.0, 4.0]).unwrap();
        writer.finish().unwrap();
        let mut reader = hound::WavReader::open(&path).unwrap();
        assert_eq!((reader.spec().channels, reader.spec().sample_rate), (3, 1000));
        let samples: Vec<f32> = reader.samples::<f32>().map(Result::unwrap).collect();
        assert_eq!(samples, [0.25, 0.5, -2.0, 0.125, 0.0, 1.0]);
        let note = std::fs::read_to_string(folder.path().join("x.wav.ron")).unwrap();
        assert!(
            note.contains("full_scale: 4.0")
                && note.contains("unit: \"N\"")
                && note.contains("simulated: true")
        );
    }

    #[test]
    fn a_probe_gets_a_full_scale_that_holds_it() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.wav");
        for (peak, full_scale) in [(0.3, 1.0), (1.0, 1.0), (1.1, 2.0), (20.0, 32.0), (64.0, 64.0)] {
            let mut writer = open_to_fit(&path, &stream("1000")).unwrap();
            writer.write(0, &[0.1, -peak, 0.0]).unwrap();
            writer.write(0, &[0.1, 0.2, f64::INFINITY]).unwrap();
            writer.finish().unwrap();
            let mut reader = hound::WavReader::open(&path).unwrap();
            let samples: Vec<f32> = reader.samples::<f32>().map(Result::unwrap).collect();
            let wanted = [0.1, -peak, 0.0, 0.1, 0.2].map(|x| (x / full_scale) as f32);
            assert_eq!(samples[..5], wanted);
            let note = std::fs::read_to_string(folder.path().join("x.wav.ron")).unwrap();
            assert!(note.contains(&format!("full_scale: {full_scale:?},")), "{note}");
            assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 2);
        }
    }

    #[test]
    fn odd_rates_and_wandering_names_are_refused() {
        let field = |settings, rate| WavSink::build(settings, &context(rate)).err().and_then(|e| e.field);
        assert_eq!(field(settings("x.wav"), "59.94"), Some("input"));
        for name in ["../x.wav", "x.mp3"] {
            assert_eq!(field(settings(name), "1000"), Some("file"), "{name}");
        }
    }
}
