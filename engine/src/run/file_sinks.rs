//! Recorded outputs of a run: taps and the writers of their frames.

use crate::node::{FileSink, FrameWriter, Stream};
use crate::node_id::NodeId;
use crate::plan::Planner;
use std::path::{Path, PathBuf};

/// An output to record, and its writer.
pub struct Probe {
    /// The node.
    pub node: NodeId,
    /// Index of the output at the node.
    pub output: usize,
    /// Writer of the frames, as stream 0.
    pub writer: Box<dyn FrameWriter>,
}

/// The tapped outputs of a graph and their writers.
pub struct FileSinks<'a> {
    pub(super) planner: Planner<'a>,
    pub(super) taps: Vec<(NodeId, usize)>,
    pub(super) written: Vec<WrittenFile>,
}

/// A writer and the taps of its streams.
pub(super) struct WrittenFile {
    /// `None`: the caller reads the ring.
    pub writer: Option<Box<dyn FrameWriter>>,
    pub taps: Vec<usize>,
    pub what: PathBuf,
    /// File name of the file sink that it belongs to; `None` for probes.
    pub sink: Option<PathBuf>,
}

impl WrittenFile {
    /// Makes a writer without taps.
    pub(super) fn apart(writer: Box<dyn FrameWriter>, what: PathBuf) -> Self {
        Self { writer: Some(writer), taps: Vec::new(), what, sink: None }
    }
}

/// A file that could not be written.
#[derive(Debug, thiserror::Error)]
#[error("cannot write {}: {error}", path.display())]
pub struct WriteError {
    /// Path of the file.
    pub path: PathBuf,
    /// Error of the file system.
    pub error: std::io::Error,
}

impl<'a> FileSinks<'a> {
    /// Makes an empty list.
    pub fn new(graph: impl Into<Planner<'a>>) -> Self {
        Self { planner: graph.into(), taps: Vec::new(), written: Vec::new() }
    }

    /// Adds a probe.
    pub fn probe(&mut self, probe: Probe) {
        self.taps.push((probe.node, probe.output));
        self.written.push(WrittenFile {
            writer: Some(probe.writer),
            taps: vec![self.taps.len() - 1],
            what: PathBuf::from(self.planner.stream((probe.node, probe.output)).name),
            sink: None,
        });
    }

    /// Adds an output whose frames the caller reads, by the name of the probe.
    pub(crate) fn hand_over(&mut self, name: &str, port: (NodeId, usize)) {
        self.taps.push(port);
        self.written.push(WrittenFile {
            writer: None,
            taps: vec![self.taps.len() - 1],
            what: PathBuf::from(name),
            sink: None,
        });
    }

    /// Opens the files of all file sinks in `folder`.
    ///
    /// # Errors
    /// [`WriteError`] for the first that cannot be opened.
    pub fn open_files(&mut self, folder: &Path) -> Result<(), WriteError> {
        let mut sinks = self.planner.file_sinks();
        sinks.try_for_each(|(node, sink)| self.open_file(node, sink, folder))
    }

    /// True if the frames of a tap are for a file.
    pub(super) fn is_written(&self, tap: usize) -> bool {
        self.written.iter().any(|written| written.writer.is_some() && written.taps.contains(&tap))
    }

    /// Removes the opened files: the change of graph failed.
    pub(super) fn take_back(self) {
        for written in self.written {
            drop(written.writer);
            if written.sink.is_some() {
                // The file may not exist.
                let _ = std::fs::remove_file(&written.what);
            }
        }
    }

    /// Opens the file of a file sink.
    pub(super) fn open_file(
        &mut self,
        node: NodeId,
        sink: &dyn FileSink,
        folder: &Path,
    ) -> Result<(), WriteError> {
        let path = folder.join(sink.file_name());
        let ports = self.planner.read_by(node);
        let streams: Vec<Stream> = ports.iter().map(|port| self.planner.stream(*port)).collect();
        let inside = sink.file_name().parent().filter(|parent| parent.components().next().is_some());
        let made = inside.map_or(Ok(()), |parent| std::fs::create_dir_all(folder.join(parent)));
        let writer = made.and_then(|()| sink.open(&path, &streams));
        let writer = writer.map_err(|error| WriteError { path: path.clone(), error })?;
        let first = self.taps.len();
        self.taps.extend(ports);
        self.written.push(WrittenFile {
            writer: Some(writer),
            taps: (first..self.taps.len()).collect(),
            what: path,
            sink: Some(sink.file_name().to_owned()),
        });
        Ok(())
    }
}
