//! Handles of ports. They are looked up by name where the program is compiled, and carry the kind of their node, so that a
//! processor cannot read or write a port that its kind does not declare.

use super::NodeKind;
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
/// [`named`](Self::named) looks it up. In a constant everything that does not fit the declaration is a compile error:
///
/// ```
/// use haptograph_engine::frame::{Kind, Scalar, Vector};
/// use haptograph_engine::node::{
///     BuildContext, BuildError, Built, Input, NodeKind, NodeSpec, Optional, Output, input, output,
/// };
/// use haptograph_engine::settings::NoSettings;
/// use haptograph_signal::quantity::Quantity;
///
/// struct Viscous;
/// impl NodeKind for Viscous {
///     type Settings = NoSettings;
///     const SPEC: NodeSpec = NodeSpec {
///         name: "Viscous",
///         group: "mine",
///         doc: "A force against a velocity.",
///         source: "",
///         inputs: &[
///             input("velocity", Kind::VECTOR, Quantity::SPEED, "Of the tool, m/s."),
///             input("load", Kind::SCALAR, Quantity::FORCE, "Normal force, N.").optional(),
///         ],
///         outputs: &[output("force", Kind::VECTOR, Quantity::FORCE, "On the tool, N.")],
///         example: "",
///     };
///     fn build(_: NoSettings, _: &BuildContext) -> Result<Built<Self>, BuildError> {
///         todo!()
///     }
/// }
///
/// const VELOCITY: Input<Viscous, Vector> = Input::named("velocity");
/// const LOAD: Input<Viscous, Scalar, Optional> = Input::named("load");
/// const FORCE: Output<Viscous, Vector> = Output::named("force");
/// ```
///
/// A name that no input has:
/// ```compile_fail,E0080
/// # use haptograph_engine::{frame::*, node::*, settings::NoSettings};
/// # use haptograph_signal::quantity::Quantity;
/// # struct Viscous;
/// # impl NodeKind for Viscous {
/// #     type Settings = NoSettings;
/// #     const SPEC: NodeSpec = NodeSpec { name: "Viscous", group: "", doc: "", source: "", example: "",
/// #         inputs: &[input("velocity", Kind::VECTOR, Quantity::SPEED, ""), input("load", Kind::SCALAR, Quantity::FORCE, "").optional()],
/// #         outputs: &[output("force", Kind::VECTOR, Quantity::FORCE, "")] };
/// #     fn build(_: NoSettings, _: &BuildContext) -> Result<Built<Self>, BuildError> { todo!() }
/// # }
/// const VELOCITY: Input<Viscous, Vector> = Input::named("speed");
/// ```
///
/// Frames of another width:
/// ```compile_fail,E0080
/// # use haptograph_engine::{frame::*, node::*, settings::NoSettings};
/// # use haptograph_signal::quantity::Quantity;
/// # struct Viscous;
/// # impl NodeKind for Viscous {
/// #     type Settings = NoSettings;
/// #     const SPEC: NodeSpec = NodeSpec { name: "Viscous", group: "", doc: "", source: "", example: "",
/// #         inputs: &[input("velocity", Kind::VECTOR, Quantity::SPEED, ""), input("load", Kind::SCALAR, Quantity::FORCE, "").optional()],
/// #         outputs: &[output("force", Kind::VECTOR, Quantity::FORCE, "")] };
/// #     fn build(_: NoSettings, _: &BuildContext) -> Result<Built<Self>, BuildError> { todo!() }
/// # }
/// const VELOCITY: Input<Viscous, Scalar> = Input::named("velocity");
/// ```
///
/// An input that need not be connected, read as if it were:
/// ```compile_fail,E0080
/// # use haptograph_engine::{frame::*, node::*, settings::NoSettings};
/// # use haptograph_signal::quantity::Quantity;
/// # struct Viscous;
/// # impl NodeKind for Viscous {
/// #     type Settings = NoSettings;
/// #     const SPEC: NodeSpec = NodeSpec { name: "Viscous", group: "", doc: "", source: "", example: "",
/// #         inputs: &[input("velocity", Kind::VECTOR, Quantity::SPEED, ""), input("load", Kind::SCALAR, Quantity::FORCE, "").optional()],
/// #         outputs: &[output("force", Kind::VECTOR, Quantity::FORCE, "")] };
/// #     fn build(_: NoSettings, _: &BuildContext) -> Result<Built<Self>, BuildError> { todo!() }
/// # }
/// const LOAD: Input<Viscous, Scalar> = Input::named("load");
/// ```
///
/// A sampled input, read as runs:
/// ```compile_fail,E0080
/// # use haptograph_engine::{frame::*, node::*, settings::NoSettings};
/// # use haptograph_signal::quantity::Quantity;
/// # struct Viscous;
/// # impl NodeKind for Viscous {
/// #     type Settings = NoSettings;
/// #     const SPEC: NodeSpec = NodeSpec { name: "Viscous", group: "", doc: "", source: "", example: "",
/// #         inputs: &[input("velocity", Kind::VECTOR, Quantity::SPEED, ""), input("load", Kind::SCALAR, Quantity::FORCE, "").optional()],
/// #         outputs: &[output("force", Kind::VECTOR, Quantity::FORCE, "")] };
/// #     fn build(_: NoSettings, _: &BuildContext) -> Result<Built<Self>, BuildError> { todo!() }
/// # }
/// const VELOCITY: Input<Viscous, Vector, Held> = Input::named("velocity");
/// ```
///
/// An input whose connections have names, read as one whose connections have none:
/// ```compile_fail,E0080
/// # use haptograph_engine::{frame::*, node::*, settings::NoSettings};
/// # struct Mix;
/// # impl NodeKind for Mix {
/// #     type Settings = NoSettings;
/// #     const SPEC: NodeSpec = NodeSpec { name: "Mix", group: "", doc: "", source: "", example: "",
/// #         inputs: &[any_input("terms", "").named()], outputs: &[output_like("sum", "terms", "")] };
/// #     fn build(_: NoSettings, _: &BuildContext) -> Result<Built<Self>, BuildError> { todo!() }
/// # }
/// const TERMS: Input<Mix, Linear, Many> = Input::named("terms");
/// ```
///
/// Names of connections that have none:
/// ```compile_fail,E0308
/// # use haptograph_engine::{frame::*, node::*, settings::NoSettings};
/// # struct Mix;
/// # impl NodeKind for Mix {
/// #     type Settings = NoSettings;
/// #     const SPEC: NodeSpec = NodeSpec { name: "Mix", group: "", doc: "", source: "", example: "",
/// #         inputs: &[InputSpec { presence: Presence::Many, ..any_input("terms", "") }], outputs: &[output_like("sum", "terms", "")] };
/// #     fn build(_: NoSettings, _: &BuildContext) -> Result<Built<Self>, BuildError> { todo!() }
/// # }
/// const TERMS: Input<Mix, Linear, Many> = Input::named("terms");
///
/// fn names(cx: &BuildContext) -> &[String] {
///     cx.names(TERMS)
/// }
/// ```
///
/// A port of another node:
/// ```compile_fail,E0308
/// # use haptograph_engine::{frame::*, node::*, settings::NoSettings};
/// # use haptograph_signal::quantity::Quantity;
/// # struct Viscous;
/// # impl NodeKind for Viscous {
/// #     type Settings = NoSettings;
/// #     const SPEC: NodeSpec = NodeSpec { name: "Viscous", group: "", doc: "", source: "", example: "",
/// #         inputs: &[input("velocity", Kind::VECTOR, Quantity::SPEED, ""), input("load", Kind::SCALAR, Quantity::FORCE, "").optional()],
/// #         outputs: &[output("force", Kind::VECTOR, Quantity::FORCE, "")] };
/// #     fn build(_: NoSettings, _: &BuildContext) -> Result<Built<Self>, BuildError> { todo!() }
/// # }
/// # enum Other {}
/// const VELOCITY: Input<Viscous, Vector> = Input::named("velocity");
///
/// fn velocities<'a>(io: &Io<'a, Other>) -> &'a [[f64; 3]] {
///     io.read(VELOCITY)
/// }
/// ```
pub struct Input<K, F, M = Sampled> {
    index: usize,
    types: Types<(K, F, M)>,
}

/// Handle of an output of the node kind `K` whose frames are of the kind `F`. [`Io::write`](crate::node::Io::write) and
/// [`Io::write_all`](crate::node::Io::write_all) take it.
///
/// [`named`](Self::named) looks it up as [`Input::named`] does an input. Frames of another width:
///
/// ```compile_fail,E0080
/// # use haptograph_engine::{frame::*, node::*, settings::NoSettings};
/// # use haptograph_signal::quantity::Quantity;
/// # struct Viscous;
/// # impl NodeKind for Viscous {
/// #     type Settings = NoSettings;
/// #     const SPEC: NodeSpec = NodeSpec { name: "Viscous", group: "", doc: "", source: "", example: "",
/// #         inputs: &[input("velocity", Kind::VECTOR, Quantity::SPEED, ""), input("load", Kind::SCALAR, Quantity::FORCE, "").optional()],
/// #         outputs: &[output("force", Kind::VECTOR, Quantity::FORCE, "")] };
/// #     fn build(_: NoSettings, _: &BuildContext) -> Result<Built<Self>, BuildError> { todo!() }
/// # }
/// const FORCE: Output<Viscous, Scalar> = Output::named("force");
/// ```
///
/// A port of another node:
/// ```compile_fail,E0308
/// # use haptograph_engine::{frame::*, node::*, settings::NoSettings};
/// # use haptograph_signal::quantity::Quantity;
/// # struct Viscous;
/// # impl NodeKind for Viscous {
/// #     type Settings = NoSettings;
/// #     const SPEC: NodeSpec = NodeSpec { name: "Viscous", group: "", doc: "", source: "", example: "",
/// #         inputs: &[input("velocity", Kind::VECTOR, Quantity::SPEED, ""), input("load", Kind::SCALAR, Quantity::FORCE, "").optional()],
/// #         outputs: &[output("force", Kind::VECTOR, Quantity::FORCE, "")] };
/// #     fn build(_: NoSettings, _: &BuildContext) -> Result<Built<Self>, BuildError> { todo!() }
/// # }
/// # enum Other {}
/// const FORCE: Output<Viscous, Vector> = Output::named("force");
///
/// fn push(io: &mut Io<'_, Other>) {
///     io.write(FORCE).fill([0.0; 3]);
/// }
/// ```
pub struct Output<K, F> {
    index: usize,
    types: Types<(K, F)>,
}

/// Handle of the family of outputs of the node kind `K`, whose members' frames are of the kind `F`.
/// [`Io::write_member`](crate::node::Io::write_member) takes it.
///
/// [`named`](Self::named) looks the family up by its name in the declaration. As a single output:
///
/// ```compile_fail,E0080
/// # use haptograph_engine::{frame::*, node::*, settings::NoSettings};
/// # struct Fan;
/// # impl NodeKind for Fan {
/// #     type Settings = NoSettings;
/// #     const SPEC: NodeSpec = NodeSpec { name: "Fan", group: "", doc: "", source: "", example: "",
/// #         inputs: &[any_input("input", "")], outputs: &[output_like("copies", "input", "").named_by("names")] };
/// #     fn build(_: NoSettings, _: &BuildContext) -> Result<Built<Self>, BuildError> { todo!() }
/// # }
/// const COPIES: Output<Fan, Linear> = Output::named("copies");
/// ```
///
/// Frames of another width:
///
/// ```compile_fail,E0080
/// # use haptograph_engine::{frame::*, node::*, settings::NoSettings};
/// # struct Fan;
/// # impl NodeKind for Fan {
/// #     type Settings = NoSettings;
/// #     const SPEC: NodeSpec = NodeSpec { name: "Fan", group: "", doc: "", source: "", example: "",
/// #         inputs: &[any_input("input", "")], outputs: &[output_like("copies", "input", "").named_by("names")] };
/// #     fn build(_: NoSettings, _: &BuildContext) -> Result<Built<Self>, BuildError> { todo!() }
/// # }
/// const COPIES: OutputFamily<Fan, Scalar> = OutputFamily::named("copies");
/// ```
///
/// A family of another node:
///
/// ```compile_fail,E0308
/// # use haptograph_engine::{frame::*, node::*, settings::NoSettings};
/// # struct Fan;
/// # impl NodeKind for Fan {
/// #     type Settings = NoSettings;
/// #     const SPEC: NodeSpec = NodeSpec { name: "Fan", group: "", doc: "", source: "", example: "",
/// #         inputs: &[any_input("input", "")], outputs: &[output_like("copies", "input", "").named_by("names")] };
/// #     fn build(_: NoSettings, _: &BuildContext) -> Result<Built<Self>, BuildError> { todo!() }
/// # }
/// # enum Other {}
/// const COPIES: OutputFamily<Fan, Linear> = OutputFamily::named("copies");
///
/// fn clear(io: &mut Io<'_, Other>) {
///     io.write_member(COPIES, 0).fill(0.0);
/// }
/// ```
pub struct OutputFamily<K, F> {
    first: usize,
    types: Types<(K, F)>,
}

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

impl<K, F, M> Input<K, F, M> {
    const fn at(index: usize) -> Self {
        Self { index, types: PhantomData }
    }

    pub(crate) const fn index(self) -> usize {
        self.index
    }
}

impl<K: NodeKind, F: FrameKind, M: Mode> Input<K, F, M> {
    /// The handle of the input `name` of `K`. In a constant everything that does not fit its declaration is a compile
    /// error.
    ///
    /// # Panics
    /// If no input has this name, or its frames, its presence or its flow are not those of the handle.
    pub const fn named(name: &str) -> Self {
        let spec = const { &K::SPEC };
        let Some(index) = spec.input_index(name) else { panic!("no input has this name") };
        let port = &spec.inputs[index];
        assert!(F::KINDS.include(spec.resolved(port.kind)), "the frames of this input are of another kind");
        match port.presence {
            Presence::Required => assert!(
                matches!(M::PRESENCE, Presence::Required),
                "this input is always connected, once: its handle is an `Input<_, _>` or an `Input<_, _, Held>`"
            ),
            Presence::Optional => assert!(
                matches!(M::PRESENCE, Presence::Optional),
                "this input may be left out: its handle is an `Input<_, _, Optional>`"
            ),
            Presence::Many => assert!(
                matches!(M::PRESENCE, Presence::Many),
                "this input has any number of connections: its handle is an `Input<_, _, Many>`"
            ),
            Presence::Named => assert!(
                matches!(M::PRESENCE, Presence::Named),
                "the connections of this input may have names: its handle is an `Input<_, _, Named>`"
            ),
        }
        match port.flow {
            Flow::Sampled => assert!(
                matches!(M::FLOW, Flow::Sampled),
                "this input has a frame per tick: its handle is not `Held`"
            ),
            Flow::Held => {
                assert!(matches!(M::FLOW, Flow::Held), "this input is read as runs: its handle is `Held`")
            }
        }
        let mut before = 0;
        while before < index {
            assert!(
                !spec.inputs[before].presence.is_several(),
                "an input of any number of connections comes last"
            );
            before += 1;
        }
        Self::at(index)
    }
}

impl<K, F> Output<K, F> {
    const fn at(index: usize) -> Self {
        Self { index, types: PhantomData }
    }

    pub(crate) const fn index(self) -> usize {
        self.index
    }
}

impl<K: NodeKind, F: FrameKind> Output<K, F> {
    /// The handle of the output `name` of `K`. In a constant everything that does not fit its declaration is a compile
    /// error.
    ///
    /// # Panics
    /// If no output has this name, or its frames are not those of the handle.
    pub const fn named(name: &str) -> Self {
        let spec = const { &K::SPEC };
        let index = spec.output_index(name, F::KINDS);
        assert!(
            matches!(spec.outputs[index].count, OutputCount::One),
            "this output is a family: its handle is an `OutputFamily`"
        );
        Self::at(index)
    }
}

impl<K, F> OutputFamily<K, F> {
    pub(crate) const fn first(self) -> usize {
        self.first
    }
}

impl<K: NodeKind, F: FrameKind> OutputFamily<K, F> {
    /// The handle of the family of outputs that `K` declares under this name. In a constant everything that does not fit
    /// its declaration is a compile error.
    ///
    /// # Panics
    /// If no family has this name, or its frames are not those of the handle.
    pub const fn named(name: &str) -> Self {
        let spec = const { &K::SPEC };
        let first = spec.output_index(name, F::KINDS);
        assert!(
            matches!(spec.outputs[first].count, OutputCount::NamedBy(_)),
            "this is one output: its handle is an `Output`"
        );
        assert!(first + 1 == spec.outputs.len(), "a family of outputs comes last");
        Self { first, types: PhantomData }
    }
}

impl NodeSpec {
    /// The inputs with their handles, for a processor whose ports are known only when the program runs
    /// ([`ScriptedKind`](super::ScriptedKind)). Held inputs and those of many connections are left out.
    pub fn any_inputs(&self) -> impl Iterator<Item = (&InputSpec, Input<Scripted, AnyKind, Optional>)> {
        let one = |port: &InputSpec| !port.presence.is_several() && port.flow == Flow::Sampled;
        let inputs = self.inputs.iter().enumerate();
        inputs.filter(move |(_, port)| one(port)).map(|(index, port)| (port, Input::at(index)))
    }

    /// The outputs with their handles, as [`any_inputs`](Self::any_inputs).
    pub fn any_outputs(&self) -> impl Iterator<Item = (&OutputSpec, Output<Scripted, AnyKind>)> {
        let outputs = self.outputs.iter().enumerate();
        outputs.map(|(index, port)| (port, Output::at(index)))
    }

    /// The place of the output of this name, whose frames have to be of these kinds.
    const fn output_index(&self, name: &str, kinds: Kinds) -> usize {
        let mut index = 0;
        while index < self.outputs.len() {
            if same(self.outputs[index].name, name) {
                assert!(
                    kinds.include(self.resolved(self.outputs[index].kind)),
                    "the frames of this output are of another kind"
                );
                return index;
            }
            index += 1;
        }
        panic!("no output has this name")
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
        write!(f, "Input({})", self.index)
    }
}

impl<K, F> Clone for OutputFamily<K, F> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<K, F> Copy for OutputFamily<K, F> {}

impl<K, F> fmt::Debug for OutputFamily<K, F> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "OutputFamily({}..)", self.first)
    }
}

impl<K, F> Clone for Output<K, F> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<K, F> Copy for Output<K, F> {}

impl<K, F> fmt::Debug for Output<K, F> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Output({})", self.index)
    }
}

#[cfg(test)]
mod tests;
