//! Node kinds and processors.
//!
//! A **node kind** ([`NodeKind`]) declares ports and settings and builds a processor; a **processor** ([`Processor`]) is the
//! state that runs. These are two traits. The engine itself runs actuator sinks and file sinks, so that no node can bypass the limiter or do
//! input and output in a tick.

#[macro_use]
mod declare;
mod entry;
mod fallback;
mod port;
mod processor;
mod spec;

use crate::frame::{FrameKind, Kind};
use haptograph_signal::quantity::Quantity;
use haptograph_signal::time::Rate;
use std::path::Path;
use std::sync::Arc;

pub use crate::io::{Connections, Io, Runs};
pub use crate::limiter::Limit;
pub use crate::scripted::{OfflineOnly, ScriptBuild, Scripted, ScriptedKind};
pub use crate::settings::{LiveId, SettingId};
pub use declare::Declared;
#[doc(hidden)]
pub use declare::{first, lower, port_name};
pub use entry::NodeEntry;
pub(crate) use entry::{Advised, Build, Finish, Measured, Read, build};
pub use fallback::{Fallback, next_change};
pub use haptograph_signal::laws::Law;
pub use port::{
    Count, Family, Held, Input, Many, Mode, Named, One, OneSignal, Optional, Output, OutputFamily, Outputs,
    Sampled, Several,
};
pub(crate) use processor::AnyProcessor;
#[cfg(test)]
pub(crate) use processor::Of;
pub use processor::{AfterData, Built, DataEnd, Latency, Processor, Tick};
pub use spec::{
    Flow, InputSpec, KindRule, NodeSpec, OutputCount, OutputRole, OutputSpec, Port, Presence, QuantityRule,
};

/// The longest block, in driver frames.
pub const MAX_BLOCK: usize = 1024;

/// The most connections in a map.
pub(crate) const MAX_NAMED: usize = 1024;
/// The most members of a family of outputs.
pub(crate) const MAX_MEMBERS: usize = 64;
/// The most characters in the name of a connection, or of an output that a setting names.
pub const MAX_NAME: usize = 64;

/// Context in which a node is built.
#[derive(Debug, Clone)]
pub struct BuildContext {
    /// Path of the node in the graph: `texture/filter`.
    pub path: String,
    /// Rate of its clock.
    pub rate: Rate,
    /// Largest number of frames in one call of `process`.
    pub max_frames: usize,
    /// Seed of the node's random stream, derived from the graph's seed and the node's path.
    pub seed: u64,
    /// Kind of each input, `None` for an unconnected one, in the order of the spec, the connections of a `Many` input one
    /// after the other.
    pub(crate) inputs: Vec<Option<Kind>>,
    /// Names of the connections of a `Named` input; empty without names.
    pub(crate) names: Vec<String>,
}

impl BuildContext {
    /// The context of a node or device outside a graph, for tests: the longest block, seed 1, no input connected.
    ///
    /// ```
    /// use haptograph_engine::frame::Kind;
    /// use haptograph_engine::node::BuildContext;
    /// use haptograph_signal::time::Rate;
    ///
    /// let mut cx = BuildContext::new("knob", Rate::from_hz(1000)?).connected(&[Some(Kind::VECTOR), None]);
    /// cx.seed = 2;
    /// assert_eq!((&*cx.path, cx.rate.hz()), ("knob", 1000.0));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn new(path: impl Into<String>, rate: Rate) -> Self {
        Self {
            path: path.into(),
            rate,
            max_frames: MAX_BLOCK,
            seed: 1,
            inputs: Vec::new(),
            names: Vec::new(),
        }
    }

    /// Connects the inputs, in the order of the spec, to signals of these kinds; those of a `Many` input come last.
    #[must_use]
    pub fn connected(mut self, inputs: &[Option<Kind>]) -> Self {
        self.inputs = inputs.to_vec();
        self
    }

    /// Names the connections of the [`Named`] input, in their order.
    #[must_use]
    pub fn named(mut self, names: &[&str]) -> Self {
        self.names = names.iter().map(|name| (*name).to_owned()).collect();
        self
    }

    /// Kind of this input, of its first connection if it takes many; `None` if it is not connected.
    pub fn kind<K, F: FrameKind, M: Mode>(&self, input: Input<K, F, M>) -> Option<Kind> {
        self.inputs.get(input.index()).copied().flatten()
    }

    /// Components of a frame of this input, at least 1.
    pub fn width<K, F: FrameKind, M: Mode>(&self, input: Input<K, F, M>) -> usize {
        self.kind(input).map_or(1, Kind::width)
    }

    /// True if this input is connected.
    pub fn is_connected<K, F: FrameKind, M: OneSignal>(&self, input: Input<K, F, Optional<M>>) -> bool {
        self.kind(input).is_some()
    }

    /// How many connections this input has.
    pub fn connections<K, F: FrameKind, M: Several>(&self, input: Input<K, F, M>) -> usize {
        self.inputs.len().saturating_sub(input.index())
    }

    /// The names of the connections of this input, in their order; empty if the graph lists them without names. No two
    /// are equal; each has 1 to 64 characters, none of them `.`, `/` or a control character.
    pub fn names<K, F: FrameKind>(&self, input: Input<K, F, Named>) -> &[String] {
        let _ = input;
        &self.names
    }
}

/// Error or warning of a node or device with well-formed settings.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{message}")]
pub struct BuildError {
    /// The setting or input at fault; `None` for the whole node.
    pub field: Option<&'static str>,
    /// What is wrong.
    pub message: String,
    /// What to do.
    pub help: Option<String>,
    /// The characters at fault in a text setting, as a half-open range.
    pub part: Option<(usize, usize)>,
    /// The setting of the node that `field` is inside of, a structure or a list of structures, and the place in the list.
    pub inside: Option<(&'static str, usize)>,
    /// The connection at fault of the input that `field` names, counted from 0.
    pub connection: Option<u32>,
}

impl BuildError {
    /// An error about a whole node.
    pub fn of_node(message: impl Into<String>) -> Self {
        Self { field: None, message: message.into(), help: None, part: None, inside: None, connection: None }
    }

    /// An error about one setting, or one input.
    pub fn at(field: &'static str, message: impl Into<String>) -> Self {
        Self { field: Some(field), ..Self::of_node(message) }
    }

    /// Points at these characters of a text setting, a half-open range.
    #[must_use]
    pub fn part(mut self, first: usize, end: usize) -> Self {
        self.part = Some((first, end));
        self
    }

    /// Places the setting inside of another one of the node: a structure, or this one of a list of structures.
    #[must_use]
    pub fn inside(mut self, setting: &'static str, place: usize) -> Self {
        self.inside = Some((setting, place));
        self
    }

    /// Points at a connection of the input, counted from 0: at its name, if it has one.
    #[must_use]
    pub fn connection(mut self, connection: usize) -> Self {
        self.connection = u32::try_from(connection).ok();
        self
    }

    /// Adds what to do.
    #[must_use]
    pub fn help(mut self, help: impl Into<String>) -> Self {
        self.help = Some(help.into());
        self
    }
}

/// A kind of node that processes signals, which [`node!`](crate::node!) declares. The example of [`Processor`] implements one and runs it.
pub trait NodeKind: Declared + Sized {
    /// The names of the members of its family of outputs, in their order, if its last output is a family
    /// ([`Port::named_by`]); it depends on the settings alone. The engine refuses names that are repeated, those of
    /// other outputs, those with `.` or `/` in them, and more than 64.
    ///
    /// # Errors
    /// [`BuildError`] if the settings do not fit each other; then nothing is built.
    fn members(settings: &Self::Settings) -> Result<Vec<String>, BuildError> {
        let _ = settings;
        Ok(Vec::new())
    }
    /// Builds the processor. May read files, allocate and block.
    ///
    /// # Errors
    /// [`BuildError`] if the settings do not fit each other, the rate, or the files they name.
    fn build(settings: Self::Settings, cx: &BuildContext) -> Result<Built<Self>, BuildError>;
    /// Signal memory that depends on the settings, bytes. The check refuses a graph beyond the memory bound before it
    /// builds the node.
    fn memory_bytes(settings: &Self::Settings, cx: &BuildContext) -> u64 {
        let _ = (settings, cx);
        0
    }
    /// Warnings about valid but doubtful settings, shown when a graph is checked.
    fn advice(settings: &Self::Settings, cx: &BuildContext) -> Vec<BuildError> {
        let _ = (settings, cx);
        Vec::new()
    }
}

/// A kind of sink that drives a device. The engine runs its gain and its limiter.
///
/// Its one input has the name of the device's channel. Its output `delivered` is what the device received.
pub trait ActuatorKind: Declared {
    /// Gain from the input to the device, and the limit, in SI.
    ///
    /// # Errors
    /// [`BuildError`] if the limit is invalid.
    fn limit(settings: &Self::Settings) -> Result<(f64, Limit), BuildError>;
}

/// A kind of sink that writes a file. It has no clock: it writes every input at the input's rate.
pub trait FileKind: Declared {
    /// Checks the settings and returns the sink that opens the file when a run starts.
    ///
    /// # Errors
    /// [`BuildError`] if the settings are invalid.
    fn build(settings: Self::Settings, cx: &FileContext) -> Result<Box<dyn FileSink>, BuildError>;
}

/// Context in which a file sink is built.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct FileContext {
    /// The signals that it writes, in the order of its inputs.
    pub streams: Vec<Stream>,
    /// Seed of the graph, for files that state how to reproduce them.
    pub graph_seed: u64,
}

/// Description of a signal that a file sink or probe records.
#[derive(Debug, Clone, PartialEq)]
pub struct Stream {
    /// Output that it comes from: `node.port`.
    pub name: String,
    /// Shape of a frame.
    pub kind: Kind,
    /// What its numbers are.
    pub quantity: Quantity,
    /// Frames a second.
    pub rate: Rate,
    /// True if it depends on a simulated device.
    pub simulated: bool,
}

/// Opens the file of a file sink.
pub trait FileSink: Send + Sync {
    /// File name relative to the run's folder.
    fn file_name(&self) -> &Path;
    /// Opens `path` for writing.
    ///
    /// # Errors
    /// Errors of the file system.
    fn open(&self, path: &Path, streams: &[Stream]) -> std::io::Result<Box<dyn FrameWriter>>;
    /// Progress to show while the file is written, if any.
    fn progress(&self) -> Option<Arc<dyn FileProgress>> {
        None
    }
}

/// Progress of a file that is being written.
pub trait FileProgress: Send + Sync {
    /// Lines to show; the first is a summary.
    fn lines(&self) -> Vec<String>;
}

/// Writes frames to a file, outside the real-time threads.
pub trait FrameWriter: Send {
    /// Appends frames of one stream.
    ///
    /// # Errors
    /// Errors of the file system.
    fn write(&mut self, stream: usize, frames: &[f64]) -> std::io::Result<()>;
    /// Completes the file.
    ///
    /// # Errors
    /// Errors of the file system.
    fn finish(self: Box<Self>) -> std::io::Result<()>;
}
