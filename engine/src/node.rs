//! Node kinds and processors.
//!
//! A **node kind** declares ports and settings and builds a processor; a **processor** is the state that runs. These
//! are two traits. The engine itself runs actuator sinks and file sinks, so that no node can bypass the limiter or do
//! input and output in a tick.

mod entry;
mod port;
mod spec;

use crate::frame::{FrameKind, Kind};
use crate::settings::Settings;
use haptograph_signal::quantity::Quantity;
use haptograph_signal::time::Rate;
use std::any::Any;
use std::path::Path;
use std::sync::Arc;

pub use crate::io::{Connections, Io, Runs};
pub use crate::limiter::Limit;
pub use crate::scripted::{OfflineOnly, ScriptBuild, ScriptedKind, raised};
pub use crate::settings::SettingId;
pub use entry::NodeEntry;
pub(crate) use entry::{Advised, Build, Finish, Measured, Read};
pub use port::{Held, Input, Many, Mode, OneSignal, Optional, Output, Outputs, Sampled};
pub use spec::{
    Flow, InputSpec, KindRule, NodeSpec, OutputRole, OutputSpec, Presence, QuantityRule, any_input, input,
    output, output_like,
};

/// The longest block, in driver frames.
pub const MAX_BLOCK: usize = 1024;

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
        }
    }

    /// Connects the inputs, in the order of the spec, to signals of these kinds; those of a `Many` input come last.
    #[must_use]
    pub fn connected(mut self, inputs: &[Option<Kind>]) -> Self {
        self.inputs = inputs.to_vec();
        self
    }

    /// Kind of this input, of its first connection if it takes many; `None` if it is not connected.
    pub fn kind<F: FrameKind, M: Mode>(&self, input: Input<F, M>) -> Option<Kind> {
        self.inputs.get(input.index()).copied().flatten()
    }

    /// Components of a frame of this input, at least 1.
    pub fn width<F: FrameKind, M: Mode>(&self, input: Input<F, M>) -> usize {
        self.kind(input).map_or(1, Kind::width)
    }

    /// Whether this input is connected.
    pub fn is_connected<F: FrameKind, M: OneSignal>(&self, input: Input<F, Optional<M>>) -> bool {
        self.kind(input).is_some()
    }

    /// How many connections this input has.
    pub fn connections<F: FrameKind>(&self, input: Input<F, Many>) -> usize {
        self.inputs.len().saturating_sub(input.index())
    }
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
    /// The setting of the node that `field` is inside of, a structure or a list of structures, and the place in the list.
    pub inside: Option<(&'static str, usize)>,
}

impl BuildError {
    /// An error about a whole node.
    pub fn of_node(message: impl Into<String>) -> Self {
        Self {
            field: None,
            message: message.into(),
            help: None,
            part: None,
            inside: None,
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

    /// Places the setting inside of another one of the node: a structure, or this one of a list of structures.
    #[must_use]
    pub fn inside(mut self, setting: &'static str, place: usize) -> Self {
        self.inside = Some((setting, place));
        self
    }

    /// Adds what to do.
    #[must_use]
    pub fn help(mut self, help: impl Into<String>) -> Self {
        self.help = Some(help.into());
        self
    }
}

/// A kind of node that processes signals. The example of [`Processor`] implements one and runs it.
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
/// # Life
/// 1. [`NodeKind::build`] makes it, outside the real-time threads: it may read files, allocate and block.
/// 2. A plan keeps it and runs copies of it ([`CloneProcessor`]), each in one run.
/// 3. If it replaces a processor of an older plan, that one gives it its state by
///    [`copy_state_into`](Self::copy_state_into).
/// 4. [`process`](Self::process), or [`frame`](Self::frame) where [`single`](Self::single) allows it, computes every
///    frame of the run once, in order. [`set`](Self::set) comes between two calls.
/// 5. It hands its state on as in step 3, and may run on while the two are cross-faded.
/// 6. It is dropped outside the real-time threads.
///
/// Steps 3 to 5 are real-time code: no allocation, no lock, no system call, no printing, no panic. The output must not
/// depend on the block size.
///
/// # Ports and settings
/// A processor reads and writes its ports, and tells its settings apart, by handles that are looked up by name where the
/// program is compiled ([`Input`], [`Output`], [`SettingId`]):
///
/// ```
/// use haptograph_engine::frame::{Kind, Scalar};
/// use haptograph_engine::node::{
///     BuildContext, BuildError, Input, Io, NodeKind, NodeSpec, Output, Processor, SettingId, Tick,
///     input, output,
/// };
/// use haptograph_signal::quantity::Quantity;
///
/// haptograph_engine::settings! {
///     /// Settings of [`Spring`].
///     pub struct SpringSettings {
///         /// Of the spring, N/m.
///         [live] stiffness_n_per_m: f64 = 100.0, in 0.0..=1e6;
///     }
/// }
///
/// /// Pulls back to the origin.
/// pub struct Spring;
///
/// impl NodeKind for Spring {
///     type Settings = SpringSettings;
///     const SPEC: NodeSpec = NodeSpec {
///         name: "Spring",
///         group: "mine",
///         doc: "Pulls the tool back to the origin.",
///         source: "",
///         inputs: &[input("position", Kind::SCALAR, Quantity::LENGTH, "Where the tool is, m.")],
///         outputs: &[output("force", Kind::SCALAR, Quantity::FORCE, "On the tool, N.")],
///         example: r#""spring": Spring(position: "hand")"#,
///     };
///
///     fn build(settings: SpringSettings, _: &BuildContext) -> Result<Box<dyn Processor>, BuildError> {
///         Ok(Box::new(Pull { stiffness_n_per_m: settings.stiffness_n_per_m }))
///     }
/// }
///
/// const POSITION: Input<Scalar> = Spring::SPEC.input("position");
/// const FORCE: Output<Scalar> = Spring::SPEC.output("force");
/// const STIFFNESS_N_PER_M: SettingId = SpringSettings::live("stiffness_n_per_m");
///
/// #[derive(Clone)]
/// struct Pull {
///     stiffness_n_per_m: f64,
/// }
///
/// impl Processor for Pull {
///     fn process(&mut self, _: &Tick, io: &mut Io<'_>) {
///         let positions_m = io.read(POSITION);
///         for (force_n, position_m) in io.write(FORCE).iter_mut().zip(positions_m) {
///             *force_n = -self.stiffness_n_per_m * position_m;
///         }
///     }
///
///     fn set(&mut self, setting: SettingId, value: f64) {
///         if setting == STIFFNESS_N_PER_M {
///             self.stiffness_n_per_m = value;
///         }
///     }
/// }
/// # use haptograph_engine::testing::Bench;
/// # let settings = SpringSettings { stiffness_n_per_m: 100.0 };
/// # let mut bench = Bench::new::<Spring>(settings, 1000.0, &[Kind::SCALAR]).unwrap();
/// # bench.processor().set(STIFFNESS_N_PER_M, 200.0);
/// # assert_eq!(bench.run(&[&[0.0, 0.25]]), [[0.0, -50.0]]);
/// ```
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

    /// Sets a live setting to a finite value within its range. Real-time code like `process`.
    ///
    /// The engine calls it with the handles of the settings that are declared `[live]`, and at each frame of a ramp.
    fn set(&mut self, setting: SettingId, value: f64) {
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

impl Latency {
    /// A transport delay, without group delay.
    pub const fn of_transport(transport_s: f64) -> Self {
        Self {
            transport_s,
            group_delay_s: 0.0,
        }
    }

    /// A group delay, without transport delay.
    pub const fn of_group(group_delay_s: f64) -> Self {
        Self {
            transport_s: 0.0,
            group_delay_s,
        }
    }
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
