//! What probes write to: CSV or WAV, by the file's extension, through the shipped file sinks' own writers.

use super::Failure;
use haptograph_engine::node::{FileKind, FrameWriter, Stream};
use haptograph_nodes::sinks::csv::{CsvSink, CsvSinkSettings};
use haptograph_nodes::sinks::wav::{WavSink, WavSinkSettings};
use std::path::Path;

/// A writer of one signal to `path`.
pub(crate) fn probe_writer(path: &Path, stream: &Stream) -> Result<Box<dyn FrameWriter>, Failure> {
    let extension = path
        .extension()
        .and_then(|extension| extension.to_str())
        .unwrap_or("")
        .to_ascii_lowercase();
    let streams = std::slice::from_ref(stream);
    let file = path
        .file_name()
        .map_or_else(|| "probe".into(), |name| name.to_string_lossy().into_owned());
    let sink = match extension.as_str() {
        "csv" => CsvSink::build(CsvSinkSettings { file }, streams),
        "wav" => WavSink::build(
            WavSinkSettings {
                file,
                full_scale: 1.0,
            },
            streams,
        ),
        _ => {
            return Err(Failure::new(format!(
                "cannot tell the format of the probe's file {}; name it .csv or .wav",
                path.display()
            )));
        }
    };
    let sink =
        sink.map_err(|error| Failure::new(format!("{} to {}: {error}", stream.name, path.display())))?;
    sink.open(path, streams)
        .map_err(|error| Failure::new(format!("cannot write {}: {error}", path.display())))
}
