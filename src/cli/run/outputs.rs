//! Signals written in addition to the graph's own sinks: probes and records.

use super::super::placing::RunFolder;
use super::super::{Failure, make_folder, recording};
use crate::engine::graph::{Graph, TemplateOutput};
use crate::engine::node::{FileContext, FileKind, FileSink, FrameWriter, Stream};
use crate::engine::run::{FileSinks, Probe};
use crate::engine::settings::closest;
use crate::live::soundcard::{CardOutputSink, output_sinks};
use crate::nodes::sinks::csv::{CsvSink, CsvSinkSettings};
use crate::nodes::sinks::wav::{WavSink, WavSinkSettings, open_to_fit};
use crate::report::record::{WatchedOutput, watch};
use std::path::{Path, PathBuf};

/// Subfolder for `--record`.
pub(super) const RECORD: &str = "record";

/// An argument `NODE.PORT=FILE`.
#[derive(Debug, Clone)]
pub(crate) struct ProbeArgument {
    output: String,
    pub file: PathBuf,
}

pub(super) fn probe_argument(text: &str) -> Result<ProbeArgument, String> {
    let (output, file) = text.split_once('=').ok_or("write it as NODE.PORT=FILE")?;
    let file = PathBuf::from(file);
    match file.extension().and_then(|e| e.to_str()) {
        Some("wav" | "csv") => Ok(ProbeArgument { output: output.to_owned(), file }),
        _ => Err("the file name must end in .wav or .csv".to_owned()),
    }
}

/// Opens the probes. Each writes into a folder of its own until the run is complete.
pub(super) fn open_probes(
    graph: &Graph,
    arguments: &[ProbeArgument],
    folder: &RunFolder,
    file_sinks: &mut FileSinks<'_>,
) -> Result<Vec<PathBuf>, Failure> {
    for (number, argument) in arguments.iter().enumerate() {
        let watch = find(graph, &argument.output)?;
        let name = argument.file.file_name().map(PathBuf::from).unwrap_or_default();
        let path = folder.probe(number)?.join(name);
        let writer = match is_wav(&path) {
            true => open_to_fit(&path, &watch.stream).map_err(Failure::doing("write", &argument.file))?,
            false => writer(&path, &watch.stream)?,
        };
        file_sinks.probe(Probe { node: watch.node, output: watch.output, writer });
    }
    Ok(arguments.iter().map(|argument| argument.file.clone()).collect())
}

/// Line with the paths of the probes' files, which are outside the run's folder; empty without probes.
pub(super) fn beside(files: &[PathBuf]) -> String {
    let names: Vec<String> = files.iter().map(|file| file.display().to_string()).collect();
    match names.is_empty() {
        true => String::new(),
        false => format!("probes in {}\n", names.join(", ")),
    }
}

/// Lines with the full scales of the probes' WAV files.
pub(super) fn full_scales(files: &[PathBuf]) -> Result<Vec<String>, Failure> {
    let wav = files.iter().filter(|file| is_wav(file));
    wav.map(|file| {
        let note = recording::note(file)?;
        let (full_scale, unit) =
            (note.full_scale.unwrap_or(1.0), note.unit.filter(|unit| unit != "1").unwrap_or_default());
        let space = if unit.is_empty() { "" } else { " " };
        Ok(format!("{}: a sample of 1.0 stands for {full_scale}{space}{unit}", file.display()))
    })
    .collect()
}

fn is_wav(path: &Path) -> bool {
    path.extension().is_some_and(|ending| ending == "wav")
}

/// Writes every output into `record/`: as WAV if that format can hold it, otherwise as CSV.
pub(super) fn record_all(
    graph: &Graph,
    folder: &RunFolder,
    file_sinks: &mut FileSinks<'_>,
) -> Result<(), Failure> {
    let place = folder.path().join(RECORD);
    make_folder(&place)?;
    let mut names = Vec::new();
    for watch in outputs(graph) {
        let name = unlike(&mut names, &watch.stream.name);
        let wav = writer(&place.join(format!("{name}.wav")), &watch.stream);
        let writer = match wav {
            Ok(writer) if watch.stream.kind.is_linear() => writer,
            _ => writer(&place.join(format!("{name}.csv")), &watch.stream)?,
        };
        file_sinks.probe(Probe { node: watch.node, output: watch.output, writer });
    }
    Ok(())
}

/// Writes the signals of soundcard outputs, in their full scale, as they would be played live.
pub(super) fn keep_played(
    graph: &Graph,
    folder: &Path,
    file_sinks: &mut FileSinks<'_>,
) -> Result<(), Failure> {
    for (played, name) in played_files(graph) {
        let Some(watch) = watch(graph, played.sink, 0) else {
            continue;
        };
        let writer = scaled_writer(&folder.join(name), &watch.stream, played.full_scale)?;
        file_sinks.probe(Probe { node: watch.node, output: watch.output, writer });
    }
    Ok(())
}

/// The soundcard outputs and the file of each.
pub(super) fn played_files(graph: &Graph) -> Vec<(CardOutputSink, String)> {
    let mut names = Vec::new();
    let file = |played: CardOutputSink| {
        let name = unlike(&mut names, &played.endpoint);
        (played, format!("{name}.soundcard.wav"))
    };
    output_sinks(graph).into_iter().map(file).collect()
}

/// A file name made of `name`, with a number if it is taken.
fn unlike(names: &mut Vec<String>, name: &str) -> String {
    let plain = name.replace('/', ".");
    let mut free = plain.clone();
    for number in 2.. {
        if !names.contains(&free) {
            break;
        }
        free = format!("{plain}-{number}");
    }
    names.push(free.clone());
    free
}

fn outputs(graph: &Graph) -> impl Iterator<Item = WatchedOutput> {
    let nodes = graph.nodes();
    nodes.ids().flat_map(move |node| {
        (0..nodes[node].outputs.len()).filter_map(move |output| watch(graph, node, output))
    })
}

fn writer(path: &Path, stream: &Stream) -> Result<Box<dyn FrameWriter>, Failure> {
    scaled_writer(path, stream, 1.0)
}

fn scaled_writer(path: &Path, stream: &Stream, full_scale: f64) -> Result<Box<dyn FrameWriter>, Failure> {
    let context = FileContext { streams: vec![stream.clone()], graph_seed: 0 };
    let file = |ending: &str| format!("probe.{ending}");
    let sink: Result<Box<dyn FileSink>, _> = match is_wav(path) {
        true => WavSink::build(WavSinkSettings { file: file("wav"), full_scale }, &context),
        false => CsvSink::build(CsvSinkSettings { file: file("csv") }, &context),
    };
    let sink = sink.map_err(|error| Failure::Message(format!("cannot probe {}: {error}", stream.name)))?;
    sink.open(path, &context.streams).map_err(Failure::doing("write", path))
}

/// The output with this name, as an input would state it.
fn find(graph: &Graph, name: &str) -> Result<WatchedOutput, Failure> {
    let found = graph.find_output(name).ok().and_then(|(node, output)| watch(graph, node, output));
    let no_such = || Failure::Message(format!("the graph has no output `{name}`; {}", meant(graph, name)));
    found.ok_or_else(no_such)
}

/// Advice about the name of an unknown output.
fn meant(graph: &Graph, name: &str) -> String {
    let mut names: Vec<String> = outputs(graph).map(|watch| watch.stream.name).collect();
    names.extend(graph.template_outputs().iter().map(TemplateOutput::name));
    names.sort_unstable();
    let begin = format!("{name}.");
    let own: Vec<&str> = names.iter().filter(|known| known.starts_with(&begin)).map(String::as_str).collect();
    if !own.is_empty() {
        return format!("name one of {}", own.join(", "));
    }
    // An output inside a template, named without the instance.
    let inside = format!("/{name}");
    let near = names.iter().find(|known| known.ends_with(&inside)).map(String::as_str);
    match near.or_else(|| closest(name, names.iter().map(String::as_str))) {
        Some(near) => format!("did you mean `{near}`?"),
        None => format!("its outputs are {}", names.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_two_signals_go_to_one_file() {
        let mut names = Vec::new();
        let files = ["a/b", "a.b", "a.b-2", "c", "a/b"].map(|name| unlike(&mut names, name));
        assert_eq!(files, ["a.b", "a.b-2", "a.b-2-2", "c", "a.b-3"]);
    }
}
