//! Processors: what an author writes, and how the engine runs it.

use super::{Declared, Input, NodeKind, Output};
use crate::frame::FrameKind;
use crate::io::{Io, Ports, Wires};
use crate::settings::{Flag, LiveId, SettingId, Settings, count};
use haptograph_signal::elementwise;
use haptograph_signal::filter::SectionsState;
use haptograph_signal::laws::Law;
use std::any::Any;
use std::marker::PhantomData;

/// State of a running node of the kind `K`.
///
/// A processor of several kinds implements it for each, or for every `K` of a trait that has their handles.
///
/// # Life
/// 1. [`NodeKind::build`] makes it, outside the real-time threads: it may read files, allocate and block.
/// 2. A plan keeps it and runs copies of it, each in one run.
/// 3. If it replaces a processor of an older plan, that one gives it its state by
///    [`copy_state_into`](Self::copy_state_into).
/// 4. [`process`](Self::process) computes every frame of the run once, in order, in calls of one frame or more.
///    [`set`](Self::set) comes between two calls.
/// 5. It hands its state on as in step 3, and may run on while the two are cross-faded.
/// 6. It is dropped outside the real-time threads.
///
/// Steps 3 to 5 are real-time code: no allocation, no lock, no system call, no printing, no panic. The output must not
/// depend on the block size. There is no second form for single frames: from `process` the engine makes what computes one
/// frame of a scalar from one of a scalar without ports, for loops through a body and blocks of one frame.
///
/// # Ports and settings
/// A processor reads and writes its ports by the handles that [`node!`](crate::node!) declares ([`Input`], [`Output`]), and tells
/// its settings apart by those that [`settings!`](crate::settings!) declares ([`LiveId`]). A handle carries the kind of the node, or
/// the type of the settings, so that one of another node does not compile:
///
/// ```
/// use haptograph_engine::frame::Scalar;
/// use haptograph_engine::node::{BuildContext, BuildError, Built, Io, LiveId, NodeKind, Port, Processor, Tick};
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
/// haptograph_engine::node! {
///     /// Pulls the tool back to the origin.
///     pub struct Spring(SpringSettings) in "mine";
///     example: r#""spring": Spring(position: "hand")"#;
///     in POSITION: Scalar = Port::of(Quantity::LENGTH, "Where the tool is, m.");
///     out FORCE: Scalar = Port::of(Quantity::FORCE, "On the tool, N.");
/// }
///
/// impl NodeKind for Spring {
///     fn build(settings: SpringSettings, _: &BuildContext) -> Result<Built<Self>, BuildError> {
///         Ok(Built::new(Pull { stiffness_n_per_m: settings.stiffness_n_per_m }))
///     }
/// }
///
/// #[derive(Clone)]
/// struct Pull {
///     stiffness_n_per_m: f64,
/// }
///
/// impl Processor<Spring> for Pull {
///     fn process(&mut self, _: &Tick, io: &mut Io<'_, Spring>) {
///         let positions_m = io.read(Spring::POSITION);
///         for (force_n, position_m) in io.write(Spring::FORCE).iter_mut().zip(positions_m) {
///             *force_n = -self.stiffness_n_per_m * position_m;
///         }
///     }
///
///     fn set(&mut self, setting: LiveId<SpringSettings>, value: f64) {
///         if setting == SpringSettings::stiffness_n_per_m {
///             self.stiffness_n_per_m = value;
///         }
///     }
/// }
/// # use haptograph_engine::{frame::Kind, testing::Bench};
/// # let settings = SpringSettings { stiffness_n_per_m: 100.0 };
/// # let mut bench = Bench::new::<Spring>(settings, 1000.0, &[Kind::SCALAR]).unwrap();
/// # bench.set(SpringSettings::stiffness_n_per_m, 200.0);
/// # assert_eq!(bench.run(&[&[0.0, 0.25]]), [[0.0, -50.0]]);
/// ```
pub trait Processor<K: Declared>: Clone + Send + Sync + 'static {
    /// Computes `tick.frames` frames of every output.
    fn process(&mut self, tick: &Tick, io: &mut Io<'_, K>);

    /// Sets a live setting to a finite value within its range, in SI: for `radius_mm: Millimetres` that is
    /// `radius_mm.si()`. Real-time code like `process`.
    ///
    /// The engine calls it with the handles of the settings that are declared `[live]`, and at each frame of a ramp.
    fn set(&mut self, setting: LiveId<K::Settings>, value: f64) {
        let _ = (setting, value);
    }

    /// Sets one number of a live setting that is a list, as [`set`](Self::set) does. The length of the list does not change:
    /// another length is another node.
    fn set_item(&mut self, setting: LiveId<K::Settings>, item: usize, value: f64) {
        let _ = (setting, item, value);
    }

    /// The law by which it computes its only output from its inputs, if all are scalars, with its present numbers: the engine
    /// then computes whole chains of such nodes in registers and calls [`process`](Self::process) only where it has to. Both
    /// have to give the same bits. Whether there is a law, and which, must not change during the node's life.
    fn law(&self) -> Option<Law> {
        None
    }

    /// The filter by which it computes its only output from its only connected input, if both are scalars: the engine then runs
    /// chains of such nodes side by side and calls [`process`](Self::process) only where it has to. Both have to give the same
    /// bits. Whether there is such a filter must not change during the node's life.
    fn cascade(&mut self) -> Option<&mut SectionsState> {
        None
    }

    /// Copies the state into the processor that replaces this one in a new plan, if that has the same type. Both may run
    /// during a cross-fade.
    ///
    /// With the same settings the new processor must continue as this one would. Real-time code like `process`. A node
    /// without state need not implement it.
    fn copy_state_into(&self, new: &mut Self) {
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

/// A processor of the node kind `K`, its type erased: a kind may choose between several.
pub struct Built<K> {
    processor: Box<dyn AnyProcessor>,
    kind: PhantomData<fn() -> K>,
}

impl<K: Declared> Built<K> {
    /// Erases the type of a processor.
    pub fn new(processor: impl Processor<K>) -> Self {
        Self::erased(Of { processor, kind: PhantomData::<fn() -> K> })
    }

    fn erased(processor: impl AnyProcessor) -> Self {
        Self { processor: Box::new(processor), kind: PhantomData }
    }

    pub(crate) fn into_processor(self) -> Box<dyn AnyProcessor> {
        self.processor
    }
}

impl<K: NodeKind> Built<K> {
    /// A processor that computes the output from the input by [`Law::Scale`] or [`Law::Offset`], component by component. The
    /// kind's live setting, if it has one, is the law's number; with more of them it does not compile.
    ///
    /// # Panics
    /// With another law, which [`Processor::law`] is for.
    pub fn law<F: FrameKind>(law: Law, input: Input<K, F>, output: Output<K, F>) -> Self {
        const {
            assert!(
                count(K::Settings::FIELDS, Flag::live) <= 1,
                "a law has one number, and so at most one live setting"
            );
        }
        assert!(
            matches!(law, Law::Scale(_) | Law::Offset(_)),
            "a law of other numbers is that of a processor: `Processor::law`"
        );
        Self::erased(Lawful { law, input: input.index(), output: output.index() })
    }
}

/// What the engine runs: a processor of any type for any kind.
pub(crate) trait AnyProcessor: Any + Send + Sync {
    /// Computes the frames of a tick, behind `offset` frames in the buffers.
    fn process(&mut self, tick: &Tick, offset: usize, wires: &Wires, memory: &mut [f64]);

    /// The only output, a scalar, for one frame of the only connected input, a scalar; without inputs, for any `x`.
    fn frame(&mut self, tick: &Tick, x: f64) -> f64;

    /// As [`Processor::law`].
    fn law(&self) -> Option<Law>;

    /// As [`Processor::cascade`].
    fn cascade(&mut self) -> Option<&mut SectionsState> {
        None
    }

    fn set(&mut self, setting: SettingId, value: f64);

    fn copy_state_into(&self, new: &mut dyn AnyProcessor);

    fn latency(&self) -> Latency {
        Latency::default()
    }

    fn data_end(&self) -> Option<DataEnd> {
        None
    }

    /// A copy with the same state.
    fn boxed_clone(&self) -> Box<dyn AnyProcessor>;
}

/// A processor for the kind `K`.
pub(crate) struct Of<K, P> {
    pub(crate) processor: P,
    kind: PhantomData<fn() -> K>,
}

impl<K: Declared, P: Processor<K>> AnyProcessor for Of<K, P> {
    fn process(&mut self, tick: &Tick, offset: usize, wires: &Wires, memory: &mut [f64]) {
        let ports = Ports::new(tick.frames, offset, wires, memory);
        self.processor.process(tick, &mut Io::new(ports));
    }

    fn frame(&mut self, tick: &Tick, x: f64) -> f64 {
        if let Some(cascade) = self.processor.cascade() {
            return cascade.sample(x);
        }
        let (x, mut y) = ([x], [0.0]);
        let ports = Ports::one_frame(&x, &mut y);
        self.processor.process(tick, &mut Io::new(ports));
        y[0]
    }

    fn law(&self) -> Option<Law> {
        self.processor.law()
    }

    fn cascade(&mut self) -> Option<&mut SectionsState> {
        self.processor.cascade()
    }

    fn set(&mut self, setting: SettingId, value: f64) {
        match setting.item() {
            None => self.processor.set(LiveId::at(setting), value),
            Some(item) => self.processor.set_item(LiveId::at(setting), item, value),
        }
    }

    fn copy_state_into(&self, new: &mut dyn AnyProcessor) {
        if let Some(new) = (new as &mut dyn Any).downcast_mut::<Self>() {
            self.processor.copy_state_into(&mut new.processor);
        }
    }

    fn latency(&self) -> Latency {
        self.processor.latency()
    }

    fn data_end(&self) -> Option<DataEnd> {
        self.processor.data_end()
    }

    fn boxed_clone(&self) -> Box<dyn AnyProcessor> {
        Box::new(Self { processor: self.processor.clone(), kind: PhantomData })
    }
}

/// A law between the ports at these places of a spec.
#[derive(Clone)]
struct Lawful {
    law: Law,
    input: usize,
    output: usize,
}

impl AnyProcessor for Lawful {
    fn process(&mut self, tick: &Tick, offset: usize, wires: &Wires, memory: &mut [f64]) {
        let mut ports = Ports::new(tick.frames, offset, wires, memory);
        let x = ports.components(self.input);
        match self.law {
            Law::Scale(factor) => elementwise::scale(factor, x, ports.out(self.output)),
            Law::Offset(offset) => elementwise::offset(offset, x, ports.out(self.output)),
            law => ports.out(self.output).iter_mut().zip(x).for_each(|(y, x)| *y = law.of(*x, *x)),
        }
    }

    fn frame(&mut self, _: &Tick, x: f64) -> f64 {
        self.law.of(x, x)
    }

    fn law(&self) -> Option<Law> {
        Some(self.law)
    }

    fn set(&mut self, _: SettingId, value: f64) {
        self.law = match self.law {
            Law::Scale(_) => Law::Scale(value),
            Law::Offset(_) => Law::Offset(value),
            law => law,
        };
    }

    fn copy_state_into(&self, _: &mut dyn AnyProcessor) {}

    fn boxed_clone(&self) -> Box<dyn AnyProcessor> {
        Box::new(self.clone())
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
        Self { transport_s, group_delay_s: 0.0 }
    }

    /// A group delay, without transport delay.
    pub const fn of_group(group_delay_s: f64) -> Self {
        Self { transport_s: 0.0, group_delay_s }
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
