//! Writing a signal to a WAV file of 32-bit floats.

use haptograph_engine::node::{
    BuildError, FileContext, FileKind, FileSink, FrameWriter, NodeSpec, Stream, any_input,
};
use hound::{SampleFormat, WavSpec, WavWriter};
use std::fs::File;
use std::io::{self, BufWriter};
use std::path::{Path, PathBuf};

use super::{inside_the_run, note};

haptograph_engine::settings! {
    /// Settings of [`WavSink`].
    pub struct WavSinkSettings {
        /// Name of the file in the run's folder.
        file: String;
        /// What a sample of 1.0 stands for, in the SI unit of the signal. Larger signals are kept, as floats can.
        full_scale: f64 = 1.0, in 1e-12..=1e12;
    }
}

/// Writes a signal to a WAV file.
pub struct WavSink;

impl FileKind for WavSink {
    type Settings = WavSinkSettings;
    const SPEC: NodeSpec = NodeSpec {
        name: "WavSink",
        group: "sinks",
        doc: "Writes a signal at its own rate to a WAV file of 32-bit floats, a lane a channel. Beside it, \
              `<file>.ron` says what a sample of 1.0 stands for and whether the signal was simulated.",
        source: "",
        inputs: &[any_input("input", "The signal.")],
        outputs: &[],
        example: r#""record": WavSink(input: "texture.acceleration", file: "texture.wav", full_scale: 20.0)"#,
    };

    fn build(settings: WavSinkSettings, cx: &FileContext) -> Result<Box<dyn FileSink>, BuildError> {
        for stream in &cx.streams {
            whole_rate(stream)?;
        }
        Ok(Box::new(Recording {
            file: inside_the_run(&settings.file)?,
            full_scale: settings.full_scale,
        }))
    }
}

/// The rate of a stream, which a WAV file keeps as a whole number of hertz.
fn whole_rate(stream: &Stream) -> Result<u32, BuildError> {
    let (hz, per) = stream.rate.parts();
    u32::try_from(hz).ok().filter(|_| per == 1).ok_or_else(|| {
        let message = format!(
            "{} has {}; a WAV file keeps whole hertz only",
            stream.name, stream.rate
        );
        BuildError::at("input", message).help("write it with a CsvSink")
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
        let spec = WavSpec {
            channels: stream.kind.width() as u16,
            sample_rate: whole_rate(stream).map_err(io::Error::other)?,
            bits_per_sample: 32,
            sample_format: SampleFormat::Float,
        };
        let writer = WavWriter::create(path, spec).map_err(io::Error::other)?;
        let [quantity, unit] = note::meaning(stream);
        let [rate, simulated] = note::origin(streams);
        let signal = format!("signal: {:?}", stream.name);
        let full_scale = format!("full_scale: {:?}", self.full_scale);
        note::write(
            path,
            "What the samples of the WAV file of this name stand for.",
            &[signal, quantity, unit, full_scale, rate, simulated],
        )?;
        Ok(Box::new(Writing {
            writer,
            scale: 1.0 / self.full_scale,
        }))
    }
}

struct Writing {
    writer: WavWriter<BufWriter<File>>,
    scale: f64,
}

impl FrameWriter for Writing {
    fn write(&mut self, _: usize, frames: &[f64]) -> io::Result<()> {
        for lane in frames {
            let sample = (lane * self.scale) as f32;
            self.writer.write_sample(sample).map_err(io::Error::other)?;
        }
        Ok(())
    }

    fn finish(self: Box<Self>) -> io::Result<()> {
        self.writer.finalize().map_err(io::Error::other)
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
            kind: Kind::Vector,
            quantity: Quantity::FORCE,
            rate: Rate::parse(rate).unwrap(),
            simulated: true,
        }
    }

    fn context(rate: &str) -> FileContext {
        FileContext {
            streams: vec![stream(rate)],
            graph_seed: 1,
        }
    }

    fn settings(file: &str) -> WavSinkSettings {
        WavSinkSettings {
            file: file.into(),
            full_scale: 4.0,
        }
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
    fn odd_rates_and_wandering_names_are_refused() {
        let field = |settings, rate| {
            WavSink::build(settings, &context(rate))
                .err()
                .and_then(|e| e.field)
        };
        assert_eq!(field(settings("x.wav"), "59.94"), Some("input"));
        for name in ["../x.wav", "/tmp/x.wav", "", "."] {
            assert_eq!(field(settings(name), "1000"), Some("file"), "{name}");
        }
    }
}
