//! Node kinds and processors.
//!
//! A **node kind** declares ports and settings and builds a processor; a **processor** is the state that runs. These
//! are two traits. The engine itself runs actuator sinks and file sinks, so that no node can bypass the limiter or do
//! input and output in a tick.

use crate::frame::Kind;
use crate::settings::{Fields, Reading, SettingSpec, Settings};
use haptograph_signal::quantity::Quantity;
use haptograph_signal::time::Rate;
use std::any::Any;
use std::path::Path;
use std::sync::Arc;

pub use crate::io::{Held, Io};
pub use crate::limiter::Limit;

/// Specification of a node kind; the source of its documentation, messages and checks.
#[derive(Debug, Clone, Copy)]
pub struct NodeSpec {
    /// Name in graph files.
    pub name: &'static str,
    /// Group it belongs to: `math`, `filters`, `texture`.
    pub group: &'static str,
    /// What it does; the first sentence is its summary.
    pub doc: &'static str,
    /// Reference: a section or equation of the thesis, or a paper; empty for plain blocks.
    pub source: &'static str,
    /// Inputs; a [`Presence::Many`] port comes last.
    pub inputs: &'static [InputSpec],
    /// Outputs.
    pub outputs: &'static [OutputSpec],
    /// Example of its use, one line of RON.
    pub example: &'static str,
}

/// An input port.
#[derive(Debug, Clone, Copy)]
pub struct InputSpec {
    /// Field name in the graph file.
    pub name: &'static str,
    /// Shape of a frame.
    pub kind: KindRule,
    /// What its numbers are.
    pub quantity: QuantityRule,
    /// Whether it reads a frame a tick or runs of held frames.
    pub flow: Flow,
    /// Whether it has to be connected.
    pub presence: Presence,
    /// What it is for.
    pub doc: &'static str,
}

/// An output port. Outputs are always sampled: one frame per tick of the node's clock.
#[derive(Debug, Clone, Copy)]
pub struct OutputSpec {
    /// Name in graph files: `node.name`.
    pub name: &'static str,
    /// Shape of a frame.
    pub kind: KindRule,
    /// What its numbers are.
    pub quantity: QuantityRule,
    /// What it is.
    pub doc: &'static str,
}

/// How an input reads its signal.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Flow {
    /// One frame per tick.
    Sampled,
    /// Runs of (ticks, frame): a slow signal read by a fast clock costs time at its changes only.
    Held,
}

/// Whether an input has to be connected.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Presence {
    /// It has to be connected.
    Required,
    /// It may be left out; [`Io::connected`] gives which.
    Optional,
    /// It takes a list of at least one connection.
    Many,
}

/// Which kind of frames a port carries.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum KindRule {
    /// This kind.
    Is(Kind),
    /// Scalar, 3-vector or wrench, treated component by component.
    Linear,
    /// Any kind.
    Any,
    /// The kind of the named input.
    Same(&'static str),
}

/// Which quantity a port carries.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum QuantityRule {
    /// This quantity.
    Is(Quantity),
    /// Any quantity.
    Any,
    /// The quantity of the named input.
    Same(&'static str),
    /// The product of two inputs.
    Product(&'static str, &'static str),
    /// The first input divided by the second.
    Quotient(&'static str, &'static str),
    /// The named input per second: its derivative.
    PerSecond(&'static str),
    /// The named input times seconds: its integral.
    TimesSeconds(&'static str),
    /// The quantity that the named setting gives: `quantity: "force"`.
    Setting(&'static str),
}

/// A required input of one kind and quantity.
pub const fn input(name: &'static str, kind: Kind, quantity: Quantity, doc: &'static str) -> InputSpec {
    InputSpec {
        name,
        kind: KindRule::Is(kind),
        quantity: QuantityRule::Is(quantity),
        flow: Flow::Sampled,
        presence: Presence::Required,
        doc,
    }
}

impl InputSpec {
    /// Makes the input read runs of held frames.
    #[must_use]
    pub const fn held(mut self) -> Self {
        self.flow = Flow::Held;
        self
    }

    /// Makes the input optional.
    #[must_use]
    pub const fn optional(mut self) -> Self {
        self.presence = Presence::Optional;
        self
    }
}

/// A required input that takes scalars, vectors and wrenches of any quantity.
pub const fn any_input(name: &'static str, doc: &'static str) -> InputSpec {
    InputSpec {
        name,
        kind: KindRule::Linear,
        quantity: QuantityRule::Any,
        flow: Flow::Sampled,
        presence: Presence::Required,
        doc,
    }
}

/// An output of one kind and quantity.
pub const fn output(name: &'static str, kind: Kind, quantity: Quantity, doc: &'static str) -> OutputSpec {
    OutputSpec {
        name,
        kind: KindRule::Is(kind),
        quantity: QuantityRule::Is(quantity),
        doc,
    }
}

/// An output with the kind and quantity of the named input.
pub const fn output_like(name: &'static str, like: &'static str, doc: &'static str) -> OutputSpec {
    OutputSpec {
        name,
        kind: KindRule::Same(like),
        quantity: QuantityRule::Same(like),
        doc,
    }
}

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
    /// Components of each connected input, 0 for an unconnected one, in the order of [`Io`].
    pub input_widths: Vec<usize>,
}

/// Error or warning of a node or device with well-formed settings.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{message}")]
pub struct BuildError {
    /// The setting at fault; `None` for the whole node.
    pub field: Option<&'static str>,
    /// What is wrong.
    pub message: String,
    /// What to do.
    pub help: Option<String>,
    /// The characters at fault in a text setting, as a half-open range.
    pub part: Option<(usize, usize)>,
}

impl BuildError {
    /// An error about a whole node.
    pub fn of_node(message: impl Into<String>) -> Self {
        Self {
            field: None,
            message: message.into(),
            help: None,
            part: None,
        }
    }

    /// An error about one setting.
    pub fn at(field: &'static str, message: impl Into<String>) -> Self {
        Self {
            field: Some(field),
            ..Self::of_node(message)
        }
    }

    /// Points at these characters of a text setting, a half-open range.
    #[must_use]
    pub fn part(mut self, first: usize, end: usize) -> Self {
        self.part = Some((first, end));
        self
    }

    /// Adds what to do.
    #[must_use]
    pub fn help(mut self, help: impl Into<String>) -> Self {
        self.help = Some(help.into());
        self
    }
}

/// A kind of node that processes signals.
pub trait NodeKind: 'static {
    /// Settings of the kind.
    type Settings: Settings;
    /// Ports and documentation.
    const SPEC: NodeSpec;
    /// Builds the processor. May read files, allocate and block.
    ///
    /// # Errors
    /// [`BuildError`] if the settings do not fit each other, the rate, or the files they name.
    fn build(settings: Self::Settings, cx: &BuildContext) -> Result<Box<dyn Processor>, BuildError>;
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
pub trait ActuatorKind: 'static {
    /// Settings of the kind, the limit included.
    type Settings: Settings;
    /// Ports and documentation; one input, one output `delivered`.
    const SPEC: NodeSpec;
    /// Gain from the input to the device, and the limit, in SI.
    ///
    /// # Errors
    /// [`BuildError`] if the limit is invalid.
    fn limit(settings: &Self::Settings) -> Result<(f64, Limit), BuildError>;
}

/// A kind of sink that writes a file. It has no clock: it writes every input at the input's rate.
pub trait FileKind: 'static {
    /// Settings of the kind.
    type Settings: Settings;
    /// Ports and documentation.
    const SPEC: NodeSpec;
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
    /// Whether it depends on a simulated device.
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

/// State of a running node.
///
/// `process` runs on real-time threads: it must not allocate, lock, make system calls, print or panic. Its output
/// must not depend on the block size.
pub trait Processor: CloneProcessor + Send + Sync {
    /// Computes `tick.frames` frames of every output.
    fn process(&mut self, tick: &Tick, io: &mut Io<'_>);

    /// How to compute a single frame without ports, for nodes with at most one scalar input and one scalar output.
    ///
    /// The engine uses it in loops through a body and in blocks of one frame: the ports of `process` cost several times
    /// as much as a multiplication. Whether the result is `Some` must not change during the node's life.
    fn single(&self) -> Option<Single> {
        None
    }

    /// Output for one frame of the input, bit-identical to `process`. Called if [`single`](Self::single) returns
    /// [`Single::Call`]. A node without inputs ignores `x`.
    fn frame(&mut self, x: f64) -> f64 {
        x
    }

    /// Sets a live setting by its index in the list of settings. Real-time code like `process`.
    fn set(&mut self, setting: usize, value: f64) {
        let _ = (setting, value);
    }

    /// Copies the state into the processor that replaces this one in a new plan. Both may run during a cross-fade.
    ///
    /// With the same settings the new processor must continue as this one would. Real-time code like `process`. A node
    /// without state need not implement it.
    fn copy_state_into(&self, new: &mut dyn Processor) {
        let _ = new;
    }

    /// Delay from input to output, in seconds.
    fn latency(&self) -> Latency {
        Latency::default()
    }

    /// End of the data that it plays; `None` if they do not end. Must not change during the node's life.
    fn data_end(&self) -> Option<DataEnd> {
        None
    }
}

/// End of the data of a source.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct DataEnd {
    /// Length of the data in frames of the node's clock.
    pub frames: u64,
    /// What follows the data.
    pub then: AfterData,
}

/// What follows the end of a source's data.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AfterData {
    /// The run ends.
    Stop,
    /// The source holds its last value.
    Hold,
    /// The source gives zero.
    Silence,
}

/// How a node computes one frame of its output from one frame of its input, bit-identical to `process`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Single {
    /// Call [`Processor::frame`].
    Call,
    /// This factor times the input. The engine multiplies inline: a call costs more than the product.
    Scale(f64),
    /// The input plus this offset.
    Offset(f64),
}

impl Single {
    /// The output for the input `x`.
    #[inline]
    pub(crate) fn of(self, x: f64, processor: &mut dyn Processor) -> f64 {
        match self {
            Self::Scale(factor) => factor * x,
            Self::Offset(offset) => x + offset,
            Self::Call => processor.frame(x),
        }
    }
}

/// Delay of a node.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Latency {
    /// Transport delay, s.
    pub transport_s: f64,
    /// Group delay in the middle of the pass band, s.
    pub group_delay_s: f64,
}

/// Downcasts the replacing processor, if it has this type.
pub fn successor<T: Processor + 'static>(new: &mut dyn Processor) -> Option<&mut T> {
    new.as_any_mut().downcast_mut()
}

/// Cloning and downcasting of processors; implemented for every `Clone` processor.
pub trait CloneProcessor {
    /// A copy with the same state.
    fn clone_box(&self) -> Box<dyn Processor>;
    /// For [`Processor::copy_state_into`].
    fn as_any_mut(&mut self) -> &mut dyn Any;
}

impl<T: Processor + Clone + 'static> CloneProcessor for T {
    fn clone_box(&self) -> Box<dyn Processor> {
        Box::new(self.clone())
    }
    fn as_any_mut(&mut self) -> &mut dyn Any {
        self
    }
}

/// Time of a call of `process`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tick {
    /// Index of the first frame since the start, on the node's clock.
    pub first: u64,
    /// Number of frames.
    pub frames: usize,
    /// Period of a frame, s.
    pub period_s: f64,
}

impl Tick {
    /// Time of a frame since the start, s.
    pub fn time_s(&self, frame: usize) -> f64 {
        (self.first + frame as u64) as f64 * self.period_s
    }
}

/// A registered node kind, its types erased.
#[derive(Clone, Copy)]
pub struct NodeEntry {
    /// Ports and documentation.
    pub spec: &'static NodeSpec,
    settings: fn() -> Vec<SettingSpec>,
    pub(crate) build: Build,
}

/// How a registered node is built from its fields. Each variant reports errors and returns `None`.
#[derive(Clone, Copy)]
pub(crate) enum Build {
    Processor(Read<BuildContext, Measured>),
    Actuator(Read<(), (f64, Limit)>),
    File(Read<FileContext, Box<dyn FileSink>>),
    /// Reads a device; its outputs are the device's channels of the same names. The function reads its settings.
    Source(fn(&mut Fields, &mut Reading<'_>) -> bool),
}

/// The first half of building: fields to settings.
pub(crate) type Read<Context, Built> = fn(&mut Fields, &mut Reading<'_>) -> Option<Finish<Context, Built>>;

/// Memory of a processor, bytes ([`NodeKind::memory_bytes`]), and the function that builds it.
pub(crate) type Measured = (u64, Finish<BuildContext, Advised>);

/// A processor and the warnings about its settings.
pub(crate) type Advised = (Box<dyn Processor>, Vec<BuildError>);

/// The second half of building, after clock and connections are known.
pub(crate) type Finish<Context, Built> = Box<dyn FnOnce(&Context) -> Result<Built, BuildError>>;

impl NodeEntry {
    /// Erases the types of a node that processes.
    pub fn processor<K: NodeKind>() -> Self {
        Self {
            spec: &const { K::SPEC },
            settings: K::Settings::specs,
            build: Build::Processor(|fields, reading| {
                let settings = K::Settings::take_from(fields, reading)?;
                Some(Box::new(|cx| {
                    let bytes = K::memory_bytes(&settings, cx);
                    let finish: Finish<BuildContext, Advised> = Box::new(|cx| {
                        let advice = K::advice(&settings, cx);
                        Ok((K::build(settings, cx)?, advice))
                    });
                    Ok((bytes, finish))
                }))
            }),
        }
    }

    /// Erases the types of a sink that drives a device through the engine's limiter.
    pub fn actuator<K: ActuatorKind>() -> Self {
        Self {
            spec: &const { K::SPEC },
            settings: K::Settings::specs,
            build: Build::Actuator(|fields, reading| {
                let settings = K::Settings::take_from(fields, reading)?;
                Some(Box::new(move |()| K::limit(&settings)))
            }),
        }
    }

    /// Erases the types of a sink that writes a file.
    pub fn file<K: FileKind>() -> Self {
        Self {
            spec: &const { K::SPEC },
            settings: K::Settings::specs,
            build: Build::File(|fields, reading| {
                let settings = K::Settings::take_from(fields, reading)?;
                Some(Box::new(|cx| K::build(settings, cx)))
            }),
        }
    }

    /// Makes the entry of a source that reads a device.
    pub const fn source(spec: &'static NodeSpec) -> Self {
        Self {
            spec,
            settings: Vec::new,
            build: Build::Source(|_, _| true),
        }
    }

    /// Makes the entry of a source that reads a device and has settings, such as the quantity it reads.
    pub fn source_with<S: Settings>(spec: &'static NodeSpec) -> Self {
        Self {
            spec,
            settings: S::specs,
            build: Build::Source(|fields, reading| S::take_from(fields, reading).is_some()),
        }
    }

    /// Its settings.
    pub fn settings(&self) -> Vec<SettingSpec> {
        (self.settings)()
    }

    /// Whether an `endpoint` field binds it to a device.
    pub fn has_endpoint(&self) -> bool {
        matches!(self.build, Build::Actuator(_) | Build::Source(_))
    }

    /// Whether it is an actuator sink.
    pub fn is_actuator(&self) -> bool {
        matches!(self.build, Build::Actuator(_))
    }

    /// Whether it is a file sink. A file sink has no clock.
    pub fn is_file(&self) -> bool {
        matches!(self.build, Build::File(_))
    }
}

impl std::fmt::Debug for NodeEntry {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "NodeEntry({})", self.spec.name)
    }
}
