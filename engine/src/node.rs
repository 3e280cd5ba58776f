//! What a node is: its specification, how it is built, and the processor that runs.
//!
//! A **node kind** says what can be written in a graph file and how to build it; a **processor** is the state that
//! runs. Two traits, never one. Actuator sinks and file sinks are built by the engine itself, so that no author of
//! a node can leave out a limiter or do input and output in a tick.

use crate::frame::Kind;
use crate::settings::{Fields, Reading, SettingSpec, Settings};
use haptograph_signal::quantity::Quantity;
use haptograph_signal::time::Rate;
use std::any::Any;
use std::path::Path;
use std::sync::Arc;

pub use crate::io::{Held, Io};
pub use crate::limiter::Limit;

/// Everything that is known of a node kind before one is built; documentation, messages and checks come from it.
#[derive(Debug, Clone, Copy)]
pub struct NodeSpec {
    /// As written in a graph file.
    pub name: &'static str,
    /// The folder it belongs to: `math`, `filters`, `texture`.
    pub group: &'static str,
    /// What it does; the first sentence is its summary.
    pub doc: &'static str,
    /// Where it comes from: a section or equation of the thesis, a paper; empty for plain blocks.
    pub source: &'static str,
    /// Inputs; a [`Presence::Many`] port comes last.
    pub inputs: &'static [InputSpec],
    /// Outputs.
    pub outputs: &'static [OutputSpec],
    /// A line of RON that uses it.
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
    /// A frame a tick, or runs of held frames.
    pub flow: Flow,
    /// Must it be connected?
    pub presence: Presence,
    /// What it is for.
    pub doc: &'static str,
}

/// An output port. Outputs are always sampled: a frame a tick of the node's clock.
#[derive(Debug, Clone, Copy)]
pub struct OutputSpec {
    /// `node.name` in the graph file.
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
    /// One frame a tick.
    Sampled,
    /// Runs of (ticks, frame): a slow signal under a fast clock costs only its changes.
    Held,
}

/// Whether an input has to be connected.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Presence {
    /// It has to.
    Required,
    /// It need not; the processor asks [`Io::connected`].
    Optional,
    /// A list of any number of connections, at least one.
    Many,
}

/// Which frames a port carries.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum KindRule {
    /// This kind.
    Is(Kind),
    /// Scalar, 3-vector or wrench, treated lane by lane.
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
    /// The named input a second: its derivative.
    PerSecond(&'static str),
    /// The named input times seconds: its integral.
    TimesSeconds(&'static str),
    /// The named setting says it by name: `quantity: "force"`.
    Setting(&'static str),
}

/// An input of one fixed kind and quantity that has to be connected.
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
    /// The same input, reading runs.
    #[must_use]
    pub const fn held(mut self) -> Self {
        self.flow = Flow::Held;
        self
    }

    /// The same input, not required.
    #[must_use]
    pub const fn optional(mut self) -> Self {
        self.presence = Presence::Optional;
        self
    }
}

/// An input that takes scalars, vectors and wrenches of any quantity.
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

/// An output of one fixed kind and quantity.
pub const fn output(name: &'static str, kind: Kind, quantity: Quantity, doc: &'static str) -> OutputSpec {
    OutputSpec {
        name,
        kind: KindRule::Is(kind),
        quantity: QuantityRule::Is(quantity),
        doc,
    }
}

/// An output of the kind and quantity of the named input.
pub const fn output_like(name: &'static str, like: &'static str, doc: &'static str) -> OutputSpec {
    OutputSpec {
        name,
        kind: KindRule::Same(like),
        quantity: QuantityRule::Same(like),
        doc,
    }
}

/// What a node is told when it is built.
#[derive(Debug, Clone)]
pub struct BuildContext {
    /// Path of the node in the graph: `texture/filter`.
    pub path: String,
    /// Rate of its clock.
    pub rate: Rate,
    /// The most frames one call of `process` can get.
    pub max_frames: usize,
    /// Seed of the node's own random stream, from the graph's seed and the node's path.
    pub seed: u64,
    /// Lanes of each input as connected (0 for one that is not), in the order of [`Io`].
    pub input_widths: Vec<usize>,
}

/// Why a node or device cannot be built from settings that are well-formed.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{message}")]
pub struct BuildError {
    /// The setting to point at, or the whole node.
    pub field: Option<&'static str>,
    /// What is wrong.
    pub message: String,
    /// What to do.
    pub help: Option<String>,
    /// Characters of the setting, a text, to point at: the first and the one after the last.
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

    /// About these characters of the setting, which is a text: the first and the one after the last.
    #[must_use]
    pub fn part(mut self, first: usize, end: usize) -> Self {
        self.part = Some((first, end));
        self
    }

    /// What to do about it.
    #[must_use]
    pub fn help(mut self, help: impl Into<String>) -> Self {
        self.help = Some(help.into());
        self
    }
}

/// A kind of node that processes signals.
pub trait NodeKind: 'static {
    /// What can be set.
    type Settings: Settings;
    /// Ports and documentation.
    const SPEC: NodeSpec;
    /// Builds the state that runs. May read files, allocate and take its time.
    ///
    /// # Errors
    /// [`BuildError`] where the settings do not fit each other, the rate, or the files they name.
    fn build(settings: Self::Settings, cx: &BuildContext) -> Result<Box<dyn Processor>, BuildError>;
    /// What it will keep of its signals, bytes, where that depends on the settings: a graph that asks for more than there
    /// may be is refused before this is built.
    fn memory_bytes(settings: &Self::Settings, cx: &BuildContext) -> u64 {
        let _ = (settings, cx);
        0
    }
    /// What can be built but is probably not meant; shown as warnings when a graph is checked.
    fn advice(settings: &Self::Settings, cx: &BuildContext) -> Vec<BuildError> {
        let _ = (settings, cx);
        Vec::new()
    }
}

/// A kind of sink that drives a device. The engine itself runs its gain and its limiter.
///
/// The one input is named as the device's channel, and its output `delivered` is what the device was given.
pub trait ActuatorKind: 'static {
    /// What can be set; the limit is among it.
    type Settings: Settings;
    /// Ports and documentation; one input, one output `delivered`.
    const SPEC: NodeSpec;
    /// Gain from the input to the device and the limit that is never exceeded, in SI.
    ///
    /// # Errors
    /// [`BuildError`] where the limit is not one.
    fn limit(settings: &Self::Settings) -> Result<(f64, Limit), BuildError>;
}

/// A kind of sink that writes to a file. It has no clock: every input is written at its own rate.
pub trait FileKind: 'static {
    /// What can be set.
    type Settings: Settings;
    /// Ports and documentation.
    const SPEC: NodeSpec;
    /// Checks the settings and returns what will open the file when a run starts.
    ///
    /// # Errors
    /// [`BuildError`] where the settings do not fit.
    fn build(settings: Self::Settings, cx: &FileContext) -> Result<Box<dyn FileSink>, BuildError>;
}

/// What a file sink is told when it is built.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct FileContext {
    /// What it will write, in the order of its inputs.
    pub streams: Vec<Stream>,
    /// The seed of the whole graph, for files that say how they can be made again.
    pub graph_seed: u64,
}

/// One signal as a file sink or probe sees it.
#[derive(Debug, Clone, PartialEq)]
pub struct Stream {
    /// `node.port` it comes from.
    pub name: String,
    /// Shape of a frame.
    pub kind: Kind,
    /// What its numbers are.
    pub quantity: Quantity,
    /// Frames a second.
    pub rate: Rate,
    /// Was it produced, directly or not, by a simulated device?
    pub simulated: bool,
}

/// Opens the file of a file sink.
pub trait FileSink: Send + Sync {
    /// File name relative to the run's folder.
    fn file_name(&self) -> &Path;
    /// Starts writing `path`.
    ///
    /// # Errors
    /// What the file system says.
    fn open(&self, path: &Path, streams: &[Stream]) -> std::io::Result<Box<dyn FrameWriter>>;
    /// What there is to be shown of the file while it is written, if anything.
    fn progress(&self) -> Option<Arc<dyn FileProgress>> {
        None
    }
}

/// How a file that is being written is getting on.
pub trait FileProgress: Send + Sync {
    /// Lines to show: the first says it all, others show it.
    fn lines(&self) -> Vec<String>;
}

/// Writes frames to a file, away from the real-time threads.
pub trait FrameWriter: Send {
    /// Appends frames of one stream.
    ///
    /// # Errors
    /// What the file system says.
    fn write(&mut self, stream: usize, frames: &[f64]) -> std::io::Result<()>;
    /// Completes the file.
    ///
    /// # Errors
    /// What the file system says.
    fn finish(self: Box<Self>) -> std::io::Result<()>;
}

/// The state of a node that runs.
///
/// `process` runs on real-time threads: it does not allocate, lock, call the system, print or panic. Its output
/// does not depend on how time is cut into blocks.
pub trait Processor: CloneProcessor + Send + Sync {
    /// Computes `tick.frames` frames of every output.
    fn process(&mut self, tick: &Tick, io: &mut Io<'_>);

    /// How a single frame can be computed without ports, where at most one sampled scalar is read and one is put out.
    /// Loops through a body and blocks of one frame are run so: the ports of `process` cost several times as much as
    /// a multiplication. Whether there is a way does not change while the node lives.
    fn single(&self) -> Option<Single> {
        None
    }

    /// The output for one frame of the input, bit for bit as from `process`; called where [`single`](Self::single)
    /// says so. For a node without inputs `x` means nothing.
    fn frame(&mut self, x: f64) -> f64 {
        x
    }

    /// Sets a live setting, by its place among the settings. Real-time like `process`.
    fn set(&mut self, setting: usize, value: f64) {
        let _ = (setting, value);
    }

    /// Carries state over to the processor that replaces this one in a new plan; for a while both may run, one fading
    /// into the other. With the same settings, the other has to go on as this one would. Real-time like `process`. A
    /// node without state needs none of it.
    fn copy_state_into(&self, new: &mut dyn Processor) {
        let _ = new;
    }

    /// Delay from input to output, in seconds.
    fn latency(&self) -> Latency {
        Latency::default()
    }

    /// Where the data that it plays end; nothing where they do not. Does not change while the node lives.
    fn data_end(&self) -> Option<DataEnd> {
        None
    }
}

/// Where the data of a source end.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct DataEnd {
    /// Frames on the node's clock that the data fill.
    pub frames: u64,
    /// What follows them.
    pub then: AfterData,
}

/// What follows where the data of a source end.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AfterData {
    /// The run ends.
    Stop,
    /// The last value holds.
    Hold,
    /// Zero.
    Silence,
}

/// How a node computes one frame of its output from one frame of its input, bit for bit as `process` does.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Single {
    /// By [`Processor::frame`].
    Call,
    /// This factor times the input. The engine multiplies by itself: a call costs more than the product.
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

/// What a node adds to the delay of what passes through it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Latency {
    /// Whole samples held back.
    pub transport_s: f64,
    /// Group delay in the middle of its pass band.
    pub group_delay_s: f64,
}

/// The processor that takes over, if it is of the same type.
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

/// When a call of `process` happens.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tick {
    /// Index of the first frame since the start, on the node's clock.
    pub first: u64,
    /// Number of frames.
    pub frames: usize,
    /// Seconds a frame.
    pub period_s: f64,
}

impl Tick {
    /// Time of a frame since the start.
    pub fn time_s(&self, frame: usize) -> f64 {
        (self.first + frame as u64) as f64 * self.period_s
    }
}

/// A node kind as registered, its types erased.
#[derive(Clone, Copy)]
pub struct NodeEntry {
    /// Ports and documentation.
    pub spec: &'static NodeSpec,
    settings: fn() -> Vec<SettingSpec>,
    pub(crate) build: Build,
}

/// How a registered node is built from its fields. Each reports what is wrong and returns `None`.
#[derive(Clone, Copy)]
pub(crate) enum Build {
    Processor(Read<BuildContext, Measured>),
    Actuator(Read<(), (f64, Limit)>),
    File(Read<FileContext, Box<dyn FileSink>>),
    /// Reads a device; its outputs are the device's channels of the same names. What it is given reads its settings.
    Source(fn(&mut Fields, &mut Reading<'_>) -> bool),
}

/// The first half of building: fields to settings.
pub(crate) type Read<Context, Built> = fn(&mut Fields, &mut Reading<'_>) -> Option<Finish<Context, Built>>;

/// The bytes that a processor will keep ([`NodeKind::memory_bytes`]), and how it is built.
pub(crate) type Measured = (u64, Finish<BuildContext, Advised>);

/// A processor and the warnings that came up while it was built.
pub(crate) type Advised = (Box<dyn Processor>, Vec<BuildError>);

/// The second half of building, when clock and connections are known; it can be repeated.
pub(crate) type Finish<Context, Built> = Box<dyn FnOnce(&Context) -> Result<Built, BuildError>>;

impl NodeEntry {
    /// A node that processes.
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

    /// A sink that drives a device through the engine's limiter.
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

    /// A sink that writes a file.
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

    /// A source that reads a device.
    pub const fn source(spec: &'static NodeSpec) -> Self {
        Self {
            spec,
            settings: Vec::new,
            build: Build::Source(|_, _| true),
        }
    }

    /// A source that reads a device and has settings, such as the quantity of what it reads.
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

    /// Is it bound to a device by an `endpoint` field?
    pub fn has_endpoint(&self) -> bool {
        matches!(self.build, Build::Actuator(_) | Build::Source(_))
    }

    /// Is it an actuator sink?
    pub fn is_actuator(&self) -> bool {
        matches!(self.build, Build::Actuator(_))
    }

    /// Is it a sink that writes a file, and so without a clock?
    pub fn is_file(&self) -> bool {
        matches!(self.build, Build::File(_))
    }
}

impl std::fmt::Debug for NodeEntry {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "NodeEntry({})", self.spec.name)
    }
}
