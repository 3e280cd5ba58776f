//! Handles of ports, which [`node!`](crate::node!) declares. They carry the kind of their node, so that a processor cannot read or
//! write a port that its kind does not declare.

use super::Declared;
use super::spec::{Flow, InputSpec, KindRule, NodeSpec, OutputCount, OutputSpec, Presence};
use crate::frame::{AnyKind, FrameKind, Kinds};
use crate::io::{Connections, Ports, Runs};
use crate::scripted::Scripted;
use crate::settings::same;
use std::fmt;
use std::marker::PhantomData;

/// Handle of an input of the node kind `K` whose frames are of the kind `F`, read as `M` says: a frame a tick
/// ([`Sampled`], the default), [`Held`], [`Optional`], [`Many`] or [`Named`]. [`Io::read`](crate::node::Io::read) takes it.
///
/// [`node!`](crate::node!) declares it. What does not fit the declaration does not compile:
///
/// ```
/// use haptograph_engine::frame::{Scalar, Vector};
/// use haptograph_engine::node::{Io, Optional, Port};
/// use haptograph_engine::settings::NoSettings;
/// use haptograph_signal::quantity::Quantity;
///
/// haptograph_engine::node! {
///     /// A force against a velocity.
///     pub struct Viscous(NoSettings) in "mine";
///     example: r#""drag": Viscous(velocity: "hand.velocity")"#;
///     in VELOCITY: Vector = Port::of(Quantity::SPEED, "Of the tool, m/s.");
///     in LOAD: Scalar, Optional = Port::of(Quantity::FORCE, "Normal force, N.");
///     out FORCE: Vector = Port::of(Quantity::FORCE, "On the tool, N.");
/// }
///
/// fn loads<'a>(io: &Io<'a, Viscous>) -> Option<&'a [f64]> {
///     io.read(Viscous::LOAD)
/// }
/// ```
///
/// A name that no input has:
/// ```compile_fail,E0599
/// # use haptograph_engine::{frame::*, node::*, settings::NoSettings};
/// # use haptograph_signal::quantity::Quantity;
/// # haptograph_engine::node! {
/// #     /// A force against a velocity.
/// #     pub struct Viscous(NoSettings) in "mine";
/// #     example: "";
/// #     in VELOCITY: Vector = Port::of(Quantity::SPEED, "");
/// #     in LOAD: Scalar, Optional = Port::of(Quantity::FORCE, "");
/// #     out FORCE: Vector = Port::of(Quantity::FORCE, "");
/// # }
/// fn speeds<'a>(io: &Io<'a, Viscous>) -> &'a [[f64; 3]] {
///     io.read(Viscous::SPEED)
/// }
/// ```
///
/// Frames of another width:
/// ```compile_fail,E0308
/// # use haptograph_engine::{frame::*, node::*, settings::NoSettings};
/// # use haptograph_signal::quantity::Quantity;
/// # haptograph_engine::node! {
/// #     /// A force against a velocity.
/// #     pub struct Viscous(NoSettings) in "mine";
/// #     example: "";
/// #     in VELOCITY: Vector = Port::of(Quantity::SPEED, "");
/// #     in LOAD: Scalar, Optional = Port::of(Quantity::FORCE, "");
/// #     out FORCE: Vector = Port::of(Quantity::FORCE, "");
/// # }
/// fn velocities<'a>(io: &Io<'a, Viscous>) -> &'a [f64] {
///     io.read(Viscous::VELOCITY)
/// }
/// ```
///
/// An input that need not be connected, read as if it were:
/// ```compile_fail,E0308
/// # use haptograph_engine::{frame::*, node::*, settings::NoSettings};
/// # use haptograph_signal::quantity::Quantity;
/// # haptograph_engine::node! {
/// #     /// A force against a velocity.
/// #     pub struct Viscous(NoSettings) in "mine";
/// #     example: "";
/// #     in VELOCITY: Vector = Port::of(Quantity::SPEED, "");
/// #     in LOAD: Scalar, Optional = Port::of(Quantity::FORCE, "");
/// #     out FORCE: Vector = Port::of(Quantity::FORCE, "");
/// # }
/// fn loads<'a>(io: &Io<'a, Viscous>) -> &'a [f64] {
///     io.read(Viscous::LOAD)
/// }
/// ```
///
/// A sampled input, read as runs:
/// ```compile_fail,E0308
/// # use haptograph_engine::{frame::*, node::*, settings::NoSettings};
/// # use haptograph_signal::quantity::Quantity;
/// # haptograph_engine::node! {
/// #     /// A force against a velocity.
/// #     pub struct Viscous(NoSettings) in "mine";
/// #     example: "";
/// #     in VELOCITY: Vector = Port::of(Quantity::SPEED, "");
/// #     in LOAD: Scalar, Optional = Port::of(Quantity::FORCE, "");
/// #     out FORCE: Vector = Port::of(Quantity::FORCE, "");
/// # }
/// fn velocities<'a>(io: &Io<'a, Viscous>) -> Runs<'a, Vector> {
///     io.read(Viscous::VELOCITY)
/// }
/// ```
///
/// Names of connections that have none:
/// ```compile_fail,E0308
/// # use haptograph_engine::{frame::*, node::*, settings::NoSettings};
/// # haptograph_engine::node! {
/// #     /// Adds.
/// #     pub struct Mix(NoSettings) in "mine";
/// #     example: "";
/// #     in TERMS: Linear, Many = Port::any("");
/// #     out SUM: Linear = Port::like("terms", "");
/// # }
/// fn names(cx: &BuildContext) -> &[String] {
///     cx.names(Mix::TERMS)
/// }
/// ```
///
/// A port of another node:
/// ```compile_fail,E0308
/// # use haptograph_engine::{frame::*, node::*, settings::NoSettings};
/// # use haptograph_signal::quantity::Quantity;
/// # haptograph_engine::node! {
/// #     /// A force against a velocity.
/// #     pub struct Viscous(NoSettings) in "mine";
/// #     example: "";
/// #     in VELOCITY: Vector = Port::of(Quantity::SPEED, "");
/// #     in LOAD: Scalar, Optional = Port::of(Quantity::FORCE, "");
/// #     out FORCE: Vector = Port::of(Quantity::FORCE, "");
/// # }
/// # enum Other {}
/// fn velocities<'a>(io: &Io<'a, Other>) -> &'a [[f64; 3]] {
///     io.read(Viscous::VELOCITY)
/// }
/// ```
///
/// An input of any number of connections before another one:
/// ```compile_fail,E0080
/// # use haptograph_engine::{frame::*, node::*, settings::NoSettings};
/// haptograph_engine::node! {
///     /// Adds.
///     pub struct Mix(NoSettings) in "mine";
///     example: "";
///     in TERMS: Linear, Many = Port::any("");
///     in OFFSET: Linear = Port::like("terms", "");
/// }
/// ```
///
/// A role of an output at an input:
/// ```compile_fail,E0080
/// # use haptograph_engine::{frame::*, node::*, settings::NoSettings};
/// haptograph_engine::node! {
///     /// Adds.
///     pub struct Mix(NoSettings) in "mine";
///     example: "";
///     in TERM: Linear = Port::any("").with_role(OutputRole::FrictionCoefficient);
///     out SUM: Linear = Port::like("term", "");
/// }
/// ```
pub struct Input<K, F, M = Sampled> {
    index: usize,
    name: &'static str,
    types: Types<(K, F, M)>,
}

/// Handle of an output of the node kind `K` whose frames are of the kind `F`: one output, which
/// [`Io::write`](crate::node::Io::write) and [`Io::write_all`](crate::node::Io::write_all) take, or a [`Family`] of them, which
/// [`Io::write_member`](crate::node::Io::write_member) takes.
///
/// [`node!`](crate::node!) declares it. Frames of another kind than the input that it is like:
///
/// ```compile_fail,E0080
/// # use haptograph_engine::{frame::*, node::*, settings::NoSettings};
/// # use haptograph_signal::quantity::Quantity;
/// haptograph_engine::node! {
///     /// A copy.
///     pub struct Copier(NoSettings) in "mine";
///     example: "";
///     in INPUT: Scalar = Port::of(Quantity::FORCE, "");
///     out COPY: Vector = Port::like("input", "");
/// }
/// ```
///
/// A port of another node:
///
/// ```compile_fail,E0308
/// # use haptograph_engine::{frame::*, node::*, settings::NoSettings};
/// # use haptograph_signal::quantity::Quantity;
/// # haptograph_engine::node! {
/// #     /// A force against a velocity.
/// #     pub struct Viscous(NoSettings) in "mine";
/// #     example: "";
/// #     in VELOCITY: Vector = Port::of(Quantity::SPEED, "");
/// #     in LOAD: Scalar, Optional = Port::of(Quantity::FORCE, "");
/// #     out FORCE: Vector = Port::of(Quantity::FORCE, "");
/// # }
/// # enum Other {}
/// fn push(io: &mut Io<'_, Other>) {
///     io.write(Viscous::FORCE).fill([0.0; 3]);
/// }
/// ```
///
/// A family, written as one output:
///
/// ```compile_fail,E0308
/// # use haptograph_engine::{frame::*, node::*, settings::NoSettings};
/// # haptograph_engine::node! {
/// #     /// Copies.
/// #     pub struct Fan(NoSettings) in "mine";
/// #     example: "";
/// #     in INPUT: Linear = Port::any("");
/// #     out COPIES: Linear, Family = Port::like("input", "").named_by("names");
/// # }
/// fn clear(io: &mut Io<'_, Fan>) {
///     io.write(Fan::COPIES).fill(0.0);
/// }
/// ```
///
/// A family whose members no setting names:
///
/// ```compile_fail,E0080
/// # use haptograph_engine::{frame::*, node::*, settings::NoSettings};
/// haptograph_engine::node! {
///     /// Copies.
///     pub struct Fan(NoSettings) in "mine";
///     example: "";
///     in INPUT: Linear = Port::any("");
///     out COPIES: Linear, Family = Port::like("input", "");
/// }
/// ```
///
/// A family of another node:
///
/// ```compile_fail,E0308
/// # use haptograph_engine::{frame::*, node::*, settings::NoSettings};
/// # haptograph_engine::node! {
/// #     /// Copies.
/// #     pub struct Fan(NoSettings) in "mine";
/// #     example: "";
/// #     in INPUT: Linear = Port::any("");
/// #     out COPIES: Linear, Family = Port::like("input", "").named_by("names");
/// # }
/// # enum Other {}
/// fn clear(io: &mut Io<'_, Other>) {
///     io.write_member(Fan::COPIES, 0).fill(0.0);
/// }
/// ```
pub struct Output<K, F, C = One> {
    index: usize,
    name: &'static str,
    types: Types<(K, F, C)>,
}

/// Handle of the family of outputs of a node kind: see [`Output`].
pub type OutputFamily<K, F> = Output<K, F, Family>;

/// Types that a handle carries.
type Types<T> = PhantomData<fn() -> T>;

/// An input that has to be connected and has a frame per tick: `io.read` gives its frames.
#[derive(Debug, Clone, Copy)]
pub enum Sampled {}

/// An input that has to be connected and is read as runs of held frames: `io.read` gives [`Runs`].
#[derive(Debug, Clone, Copy)]
pub enum Held {}

/// An input that may be left out: `io.read` gives an [`Option`]. `Optional<Held>` is read as runs.
#[derive(Debug, Clone, Copy)]
pub struct Optional<M = Sampled>(PhantomData<M>);

/// An input of one or more connections: `io.read` gives [`Connections`].
#[derive(Debug, Clone, Copy)]
pub enum Many {}

/// An input of one or more connections that may have names: `io.read` gives [`Connections`], and
/// [`BuildContext::names`](crate::node::BuildContext::names) their names.
#[derive(Debug, Clone, Copy)]
pub enum Named {}

/// How an input is read: [`Sampled`], [`Held`], [`Optional`], [`Many`] or [`Named`].
pub trait Mode: sealed::Sealed + Sized + 'static {
    /// What [`Io::read`](crate::node::Io::read) gives.
    type Read<'a, F: FrameKind>;
    #[doc(hidden)]
    const PRESENCE: Presence;
    #[doc(hidden)]
    const FLOW: Flow;
    #[doc(hidden)]
    fn read<'a, F: FrameKind>(ports: &Ports<'a>, input: usize) -> Self::Read<'a, F>;
}

/// A mode of one signal: [`Sampled`] or [`Held`].
pub trait OneSignal: Mode {}

/// A mode of any number of signals: [`Many`] or [`Named`].
pub trait Several: Mode {}

mod sealed {
    pub trait Sealed {}
    impl Sealed for super::Sampled {}
    impl Sealed for super::Held {}
    impl<M: super::OneSignal> Sealed for super::Optional<M> {}
    impl Sealed for super::Many {}
    impl Sealed for super::Named {}
    impl Sealed for super::One {}
    impl Sealed for super::Family {}
}

impl OneSignal for Sampled {}
impl OneSignal for Held {}
impl Several for Many {}
impl Several for Named {}

impl Mode for Sampled {
    type Read<'a, F: FrameKind> = F::Frames<'a>;
    const PRESENCE: Presence = Presence::Required;
    const FLOW: Flow = Flow::Sampled;

    #[inline]
    fn read<'a, F: FrameKind>(ports: &Ports<'a>, input: usize) -> F::Frames<'a> {
        ports.sampled::<F>(input)
    }
}

impl Mode for Held {
    type Read<'a, F: FrameKind> = Runs<'a, F>;
    const PRESENCE: Presence = Presence::Required;
    const FLOW: Flow = Flow::Held;

    #[inline]
    fn read<'a, F: FrameKind>(ports: &Ports<'a>, input: usize) -> Runs<'a, F> {
        ports.runs(input)
    }
}

impl<M: OneSignal> Mode for Optional<M> {
    type Read<'a, F: FrameKind> = Option<M::Read<'a, F>>;
    const PRESENCE: Presence = Presence::Optional;
    const FLOW: Flow = M::FLOW;

    #[inline]
    fn read<'a, F: FrameKind>(ports: &Ports<'a>, input: usize) -> Option<M::Read<'a, F>> {
        ports.connected(input).then(|| M::read(ports, input))
    }
}

impl Mode for Many {
    type Read<'a, F: FrameKind> = Connections<'a, F>;
    const PRESENCE: Presence = Presence::Many;
    const FLOW: Flow = Flow::Sampled;

    #[inline]
    fn read<'a, F: FrameKind>(ports: &Ports<'a>, input: usize) -> Connections<'a, F> {
        ports.connections(input)
    }
}

impl Mode for Named {
    type Read<'a, F: FrameKind> = Connections<'a, F>;
    const PRESENCE: Presence = Presence::Named;
    const FLOW: Flow = Flow::Sampled;

    #[inline]
    fn read<'a, F: FrameKind>(ports: &Ports<'a>, input: usize) -> Connections<'a, F> {
        ports.connections(input)
    }
}

/// One output.
#[derive(Debug, Clone, Copy)]
pub enum One {}

/// Any number of outputs, whose names a setting gives ([`Port::named_by`](super::Port::named_by)).
#[derive(Debug, Clone, Copy)]
pub enum Family {}

/// How many outputs a handle stands for: [`One`] or [`Family`].
pub trait Count: sealed::Sealed + 'static {
    #[doc(hidden)]
    const IS_FAMILY: bool;
}

impl Count for One {
    const IS_FAMILY: bool = false;
}

impl Count for Family {
    const IS_FAMILY: bool = true;
}

impl<K, F, M> Input<K, F, M> {
    /// The input at this place of the spec. For [`node!`](crate::node!).
    #[doc(hidden)]
    pub const fn declared(index: usize, name: &'static str) -> Self {
        Self { index, name, types: PhantomData }
    }

    /// Name in graph files.
    pub const fn name(self) -> &'static str {
        self.name
    }

    pub(crate) const fn index(self) -> usize {
        self.index
    }
}

impl<K: Declared, F: FrameKind, M: Mode> Input<K, F, M> {
    /// Checks the declaration. For [`node!`](crate::node!).
    #[doc(hidden)]
    pub const fn check(self) {
        let spec = const { &K::SPEC };
        let kind = spec.resolved(spec.inputs[self.index].kind);
        assert!(F::KINDS.include(kind), "the frames of this input are of another kind");
        let is_last = self.index + 1 == spec.inputs.len();
        assert!(is_last || !M::PRESENCE.is_several(), "an input of any number of connections comes last");
    }
}

impl<K, F, C> Output<K, F, C> {
    /// The output at this place of the spec. For [`node!`](crate::node!).
    #[doc(hidden)]
    pub const fn declared(index: usize, name: &'static str) -> Self {
        Self { index, name, types: PhantomData }
    }

    /// Name in graph files.
    pub const fn name(self) -> &'static str {
        self.name
    }

    /// The same output, written as components, whatever its kind.
    pub const fn any(self) -> Output<K, AnyKind, C> {
        Output { index: self.index, name: self.name, types: PhantomData }
    }

    pub(crate) const fn index(self) -> usize {
        self.index
    }
}

impl<K: Declared, F: FrameKind, C: Count> Output<K, F, C> {
    /// Checks the declaration. For [`node!`](crate::node!).
    #[doc(hidden)]
    pub const fn check(self) {
        let spec = const { &K::SPEC };
        let port = &spec.outputs[self.index];
        assert!(F::KINDS.include(spec.resolved(port.kind)), "the frames of this output are of another kind");
        assert!(
            C::IS_FAMILY == matches!(port.count, OutputCount::NamedBy(_)),
            "a `Family`, and nothing else, has members that a setting names: `.named_by(\"setting\")`"
        );
        assert!(!C::IS_FAMILY || self.index + 1 == spec.outputs.len(), "a family of outputs comes last");
    }
}

impl NodeSpec {
    /// The inputs with their handles, for a processor whose ports are known only when the program runs
    /// ([`ScriptedKind`](super::ScriptedKind)). Held inputs and those of many connections are left out.
    pub fn any_inputs(&self) -> impl Iterator<Item = (&InputSpec, Input<Scripted, AnyKind, Optional>)> {
        let one = |port: &InputSpec| !port.presence.is_several() && port.flow == Flow::Sampled;
        let inputs = self.inputs.iter().enumerate();
        inputs
            .filter(move |(_, port)| one(port))
            .map(|(index, port)| (port, Input::declared(index, port.name)))
    }

    /// The outputs with their handles, as [`any_inputs`](Self::any_inputs).
    pub fn any_outputs(&self) -> impl Iterator<Item = (&OutputSpec, Output<Scripted, AnyKind>)> {
        let outputs = self.outputs.iter().enumerate();
        outputs.map(|(index, port)| (port, Output::declared(index, port.name)))
    }

    const fn input_index(&self, name: &str) -> Option<usize> {
        let mut index = 0;
        while index < self.inputs.len() {
            if same(self.inputs[index].name, name) {
                return Some(index);
            }
            index += 1;
        }
        None
    }

    /// The rule at the end of a chain of [`KindRule::Same`].
    const fn resolved(&self, rule: KindRule) -> KindRule {
        let mut rule = rule;
        let mut steps = 0;
        while let KindRule::Same(name) = rule {
            assert!(steps <= self.inputs.len(), "these kinds are given by each other");
            let Some(index) = self.input_index(name) else {
                panic!("the kind is that of an input that does not exist")
            };
            rule = self.inputs[index].kind;
            steps += 1;
        }
        rule
    }
}

impl Kinds {
    /// True if these include every kind that a port of this rule carries.
    const fn include(self, rule: KindRule) -> bool {
        match (self, rule) {
            (Self::Any, _) | (Self::Linear, KindRule::Linear) => true,
            (Self::Linear, KindRule::Is(kind)) => kind.is_linear(),
            (Self::One(wanted), KindRule::Is(kind)) => wanted.is(kind),
            _ => false,
        }
    }

    /// The rule of a port whose handle stands for these kinds.
    pub(crate) const fn rule(self) -> KindRule {
        match self {
            Self::One(kind) => KindRule::Is(kind),
            Self::Linear => KindRule::Linear,
            Self::Any => KindRule::Any,
        }
    }
}

/// Handles of several outputs of the node kind `K`, for [`Io::write_all`](crate::node::Io::write_all).
pub trait Outputs<K>: tuples::Sealed {
    /// What [`Io::write_all`](crate::node::Io::write_all) gives.
    type Write<'a>;
    #[doc(hidden)]
    fn write<'a>(self, ports: &'a mut Ports<'_>) -> Self::Write<'a>;
}

mod tuples {
    pub trait Sealed {}
}

macro_rules! tuples {
    ($(($($kind:ident $place:tt $frames:ident),+))+) => { $(
        impl<K, $($kind: FrameKind),+> tuples::Sealed for ($(Output<K, $kind>,)+) {}

        impl<K, $($kind: FrameKind),+> Outputs<K> for ($(Output<K, $kind>,)+) {
            type Write<'a> = ($($kind::FramesMut<'a>,)+);

            #[inline]
            fn write<'a>(self, ports: &'a mut Ports<'_>) -> Self::Write<'a> {
                let [$($frames),+] = ports.outs([$((self.$place.index, $kind::KINDS)),+]);
                ($($kind::frames_mut($frames),)+)
            }
        }
    )+ };
}

tuples! {
    (A 0 a, B 1 b)
    (A 0 a, B 1 b, C 2 c)
    (A 0 a, B 1 b, C 2 c, D 3 d)
    (A 0 a, B 1 b, C 2 c, D 3 d, E 4 e)
    (A 0 a, B 1 b, C 2 c, D 3 d, E 4 e, F 5 f)
    (A 0 a, B 1 b, C 2 c, D 3 d, E 4 e, F 5 f, G 6 g)
    (A 0 a, B 1 b, C 2 c, D 3 d, E 4 e, F 5 f, G 6 g, H 7 h)
}

impl<K, F, M> Clone for Input<K, F, M> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<K, F, M> Copy for Input<K, F, M> {}

impl<K, F, M> fmt::Debug for Input<K, F, M> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Input({})", self.name)
    }
}

impl<K, F, C> Clone for Output<K, F, C> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<K, F, C> Copy for Output<K, F, C> {}

impl<K, F, C> fmt::Debug for Output<K, F, C> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Output({})", self.name)
    }
}

#[cfg(test)]
mod tests;
