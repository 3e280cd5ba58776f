//! Recorded outputs of a run: taps and the writers of their frames.

use crate::graph::{Graph, NodeId, Work};
use crate::node::{FrameWriter, Stream};
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
    pub(super) graph: &'a Graph,
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
    pub fn apart(writer: Box<dyn FrameWriter>, what: PathBuf) -> Self {
        Self {
            writer: Some(writer),
            taps: Vec::new(),
            what,
            sink: None,
        }
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
    pub fn new(graph: &'a Graph) -> Self {
        let (taps, written) = (Vec::new(), Vec::new());
        Self { graph, taps, written }
    }

    /// Adds a probe.
    pub fn probe(&mut self, probe: Probe) {
        self.taps.push((probe.node, probe.output));
        self.written.push(WrittenFile {
            writer: Some(probe.writer),
            taps: vec![self.taps.len() - 1],
            what: PathBuf::from(stream(self.graph, (probe.node, probe.output)).name),
            sink: None,
        });
    }

    /// Adds an output whose frames the caller of a live run reads; returns its description.
    pub(crate) fn hand_over(&mut self, node: NodeId, output: usize) -> Stream {
        let carried = stream(self.graph, (node, output));
        self.taps.push((node, output));
        self.written.push(WrittenFile {
            writer: None,
            taps: vec![self.taps.len() - 1],
            what: PathBuf::from(&carried.name),
            sink: None,
        });
        carried
    }

    /// Opens the files of all file sinks in `folder`.
    ///
    /// # Errors
    /// [`WriteError`] for the first that cannot be opened.
    pub fn open_files(&mut self, folder: &Path) -> Result<(), WriteError> {
        for index in self.graph.nodes().ids() {
            self.open_file(index, folder)?;
        }
        Ok(())
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

    /// Opens the file of a node, if it is a file sink.
    pub(super) fn open_file(&mut self, index: NodeId, folder: &Path) -> Result<(), WriteError> {
        let Work::File(sink) = &self.graph.nodes()[index].work else {
            return Ok(());
        };
        let path = folder.join(sink.file_name());
        let ports = file_ports(self.graph, index);
        let streams: Vec<Stream> = ports.iter().map(|port| stream(self.graph, *port)).collect();
        let inside = sink
            .file_name()
            .parent()
            .filter(|parent| parent.components().next().is_some());
        let made = inside.map_or(Ok(()), |parent| std::fs::create_dir_all(folder.join(parent)));
        let writer = made.and_then(|()| sink.open(&path, &streams));
        let writer = writer.map_err(|error| WriteError {
            path: path.clone(),
            error,
        })?;
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

/// The outputs that a file sink writes, in the order of its inputs.
pub(super) fn file_ports(graph: &Graph, index: NodeId) -> Vec<(NodeId, usize)> {
    let connections = graph.nodes().incoming(index).into_iter();
    connections.map(|read| (read.from, read.edge.output)).collect()
}

/// Description of an output's signal.
pub(super) fn stream(graph: &Graph, (source, output): (NodeId, usize)) -> Stream {
    let node = &graph.nodes()[source];
    Stream {
        name: format!("{}.{}", node.path, node.outputs[output].name),
        kind: node.outputs[output].kind,
        quantity: node.outputs[output].quantity,
        rate: graph.clocks[node.clock.unwrap_or(0)].rate,
        simulated: node.simulated,
    }
}
