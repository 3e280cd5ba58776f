//! Handles of ports. They are looked up by name where the program is compiled, so that a processor cannot read or write
//! a port that its kind does not declare.

use super::spec::{Flow, InputSpec, KindRule, NodeSpec, OutputSpec, Presence};
use crate::frame::{AnyKind, FrameKind, Kinds};
use crate::io::{Connections, Io, Runs};
use crate::settings::same;
use std::fmt;
use std::marker::PhantomData;

/// Handle of an input whose frames are of the kind `F`, read as `M` says: a frame a tick ([`Sampled`], the default),
/// [`Held`], [`Optional`] or [`Many`]. [`Io::read`] takes it.
///
/// [`NodeSpec::input`] looks it up by name. In a constant everything that does not fit the declaration is a compile
/// error:
///
/// ```
/// use haptograph_engine::frame::{Kind, Scalar, Vector};
/// use haptograph_engine::node::{Input, NodeSpec, Optional, Output, input, output};
/// use haptograph_signal::quantity::Quantity;
///
/// const SPEC: NodeSpec = NodeSpec {
///     name: "Viscous",
///     group: "mine",
///     doc: "A force against a velocity.",
///     source: "",
///     inputs: &[
///         input("velocity", Kind::VECTOR, Quantity::SPEED, "Of the tool, m/s."),
///         input("load", Kind::SCALAR, Quantity::FORCE, "Normal force, N.").optional(),
///     ],
///     outputs: &[output("force", Kind::VECTOR, Quantity::FORCE, "On the tool, N.")],
///     example: "",
/// };
///
/// const VELOCITY: Input<Vector> = SPEC.input("velocity");
/// const LOAD: Input<Scalar, Optional> = SPEC.input("load");
/// const FORCE: Output<Vector> = SPEC.output("force");
/// ```
///
/// A name that no input has:
/// ```compile_fail
/// # use haptograph_engine::frame::{Kind, Scalar, Vector};
/// # use haptograph_engine::node::{Input, NodeSpec, Optional, Output, input, output};
/// # use haptograph_signal::quantity::Quantity;
/// # const SPEC: NodeSpec = NodeSpec {
/// #     name: "Viscous", group: "mine", doc: "A force against a velocity.", source: "",
/// #     inputs: &[
/// #         input("velocity", Kind::VECTOR, Quantity::SPEED, "Of the tool, m/s."),
/// #         input("load", Kind::SCALAR, Quantity::FORCE, "Normal force, N.").optional(),
/// #     ],
/// #     outputs: &[output("force", Kind::VECTOR, Quantity::FORCE, "On the tool, N.")],
/// #     example: "",
/// # };
/// const VELOCITY: Input<Vector> = SPEC.input("speed");
/// ```
///
/// Frames of another width:
/// ```compile_fail
/// # use haptograph_engine::frame::{Kind, Scalar, Vector};
/// # use haptograph_engine::node::{Input, NodeSpec, Optional, Output, input, output};
/// # use haptograph_signal::quantity::Quantity;
/// # const SPEC: NodeSpec = NodeSpec {
/// #     name: "Viscous", group: "mine", doc: "A force against a velocity.", source: "",
/// #     inputs: &[
/// #         input("velocity", Kind::VECTOR, Quantity::SPEED, "Of the tool, m/s."),
/// #         input("load", Kind::SCALAR, Quantity::FORCE, "Normal force, N.").optional(),
/// #     ],
/// #     outputs: &[output("force", Kind::VECTOR, Quantity::FORCE, "On the tool, N.")],
/// #     example: "",
/// # };
/// const VELOCITY: Input<Scalar> = SPEC.input("velocity");
/// ```
///
/// An input that need not be connected, read as if it were:
/// ```compile_fail
/// # use haptograph_engine::frame::{Kind, Scalar, Vector};
/// # use haptograph_engine::node::{Input, NodeSpec, Optional, Output, input, output};
/// # use haptograph_signal::quantity::Quantity;
/// # const SPEC: NodeSpec = NodeSpec {
/// #     name: "Viscous", group: "mine", doc: "A force against a velocity.", source: "",
/// #     inputs: &[
/// #         input("velocity", Kind::VECTOR, Quantity::SPEED, "Of the tool, m/s."),
/// #         input("load", Kind::SCALAR, Quantity::FORCE, "Normal force, N.").optional(),
/// #     ],
/// #     outputs: &[output("force", Kind::VECTOR, Quantity::FORCE, "On the tool, N.")],
/// #     example: "",
/// # };
/// const LOAD: Input<Scalar> = SPEC.input("load");
/// ```
///
/// A sampled input, read as runs:
/// ```compile_fail
/// # use haptograph_engine::frame::{Kind, Scalar, Vector};
/// # use haptograph_engine::node::{Held, Input, NodeSpec, Optional, Output, input, output};
/// # use haptograph_signal::quantity::Quantity;
/// # const SPEC: NodeSpec = NodeSpec {
/// #     name: "Viscous", group: "mine", doc: "A force against a velocity.", source: "",
/// #     inputs: &[
/// #         input("velocity", Kind::VECTOR, Quantity::SPEED, "Of the tool, m/s."),
/// #         input("load", Kind::SCALAR, Quantity::FORCE, "Normal force, N.").optional(),
/// #     ],
/// #     outputs: &[output("force", Kind::VECTOR, Quantity::FORCE, "On the tool, N.")],
/// #     example: "",
/// # };
/// const VELOCITY: Input<Vector, Held> = SPEC.input("velocity");
/// ```
pub struct Input<F, M = Sampled> {
    index: usize,
    types: PhantomData<fn() -> (F, M)>,
}

/// Handle of an output whose frames are of the kind `F`. [`Io::write`] and [`Io::write_all`] take it.
///
/// [`NodeSpec::output`] looks it up by name, as [`NodeSpec::input`] does an [`Input`]:
///
/// ```compile_fail
/// # use haptograph_engine::frame::{Kind, Scalar};
/// # use haptograph_engine::node::{NodeSpec, Output, output};
/// # use haptograph_signal::quantity::Quantity;
/// # const SPEC: NodeSpec = NodeSpec {
/// #     name: "Weight", group: "mine", doc: "A force.", source: "", inputs: &[],
/// #     outputs: &[output("force", Kind::VECTOR, Quantity::FORCE, "On the tool, N.")],
/// #     example: "",
/// # };
/// // It is a 3-vector.
/// const FORCE: Output<Scalar> = SPEC.output("force");
/// ```
pub struct Output<F> {
    index: usize,
    types: PhantomData<fn() -> F>,
}

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

/// How an input is read: [`Sampled`], [`Held`], [`Optional`] or [`Many`].
pub trait Mode: sealed::Sealed + Sized + 'static {
    /// What [`Io::read`] gives.
    type Read<'a, F: FrameKind>;
    #[doc(hidden)]
    const PRESENCE: Presence;
    #[doc(hidden)]
    const FLOW: Flow;
    #[doc(hidden)]
    fn read<'a, F: FrameKind>(io: &Io<'a>, input: Input<F, Self>) -> Self::Read<'a, F>;
}

/// A mode of one signal: [`Sampled`] or [`Held`].
pub trait OneSignal: Mode {}

mod sealed {
    pub trait Sealed {}
    impl Sealed for super::Sampled {}
    impl Sealed for super::Held {}
    impl<M: super::OneSignal> Sealed for super::Optional<M> {}
    impl Sealed for super::Many {}
}

impl OneSignal for Sampled {}
impl OneSignal for Held {}

impl Mode for Sampled {
    type Read<'a, F: FrameKind> = F::Frames<'a>;
    const PRESENCE: Presence = Presence::Required;
    const FLOW: Flow = Flow::Sampled;

    #[inline]
    fn read<'a, F: FrameKind>(io: &Io<'a>, input: Input<F, Self>) -> F::Frames<'a> {
        io.sampled::<F>(input.index)
    }
}

impl Mode for Held {
    type Read<'a, F: FrameKind> = Runs<'a, F>;
    const PRESENCE: Presence = Presence::Required;
    const FLOW: Flow = Flow::Held;

    #[inline]
    fn read<'a, F: FrameKind>(io: &Io<'a>, input: Input<F, Self>) -> Runs<'a, F> {
        io.runs(input.index)
    }
}

impl<M: OneSignal> Mode for Optional<M> {
    type Read<'a, F: FrameKind> = Option<M::Read<'a, F>>;
    const PRESENCE: Presence = Presence::Optional;
    const FLOW: Flow = M::FLOW;

    #[inline]
    fn read<'a, F: FrameKind>(io: &Io<'a>, input: Input<F, Self>) -> Option<M::Read<'a, F>> {
        let is_connected = io.connected(input.index);
        is_connected.then(|| M::read(io, Input::at(input.index)))
    }
}

impl Mode for Many {
    type Read<'a, F: FrameKind> = Connections<'a, F>;
    const PRESENCE: Presence = Presence::Many;
    const FLOW: Flow = Flow::Sampled;

    #[inline]
    fn read<'a, F: FrameKind>(io: &Io<'a>, input: Input<F, Self>) -> Connections<'a, F> {
        io.connections(input.index)
    }
}

impl<F, M> Input<F, M> {
    pub(crate) const fn at(index: usize) -> Self {
        Self {
            index,
            types: PhantomData,
        }
    }

    pub(crate) const fn index(self) -> usize {
        self.index
    }

    /// The one handle that all of these are, for a processor of several kinds. In a constant a difference is a compile
    /// error.
    ///
    /// # Panics
    /// If they differ.
    pub const fn common<const N: usize>(handles: [Self; N]) -> Self {
        let mut other = 1;
        while other < N {
            assert!(
                handles[other].index == handles[0].index,
                "these inputs stand at different places of their specs"
            );
            other += 1;
        }
        handles[0]
    }
}

impl<F> Output<F> {
    pub(crate) const fn at(index: usize) -> Self {
        Self {
            index,
            types: PhantomData,
        }
    }

    pub(crate) const fn index(self) -> usize {
        self.index
    }

    /// The one handle that all of these are, for a processor of several kinds. In a constant a difference is a compile
    /// error.
    ///
    /// # Panics
    /// If they differ.
    pub const fn common<const N: usize>(handles: [Self; N]) -> Self {
        let mut other = 1;
        while other < N {
            assert!(
                handles[other].index == handles[0].index,
                "these outputs stand at different places of their specs"
            );
            other += 1;
        }
        handles[0]
    }
}

impl NodeSpec {
    /// The handle of the input `name`. In a constant everything that does not fit its declaration is a compile error.
    ///
    /// # Panics
    /// If no input has this name, or its frames, its presence or its flow are not those of the handle.
    pub const fn input<F: FrameKind, M: Mode>(&self, name: &str) -> Input<F, M> {
        let Some(index) = self.input_index(name) else {
            panic!("no input has this name")
        };
        let port = &self.inputs[index];
        assert!(
            F::KINDS.include(self.resolved(port.kind)),
            "the frames of this input are of another kind"
        );
        match port.presence {
            Presence::Required => assert!(
                matches!(M::PRESENCE, Presence::Required),
                "this input is always connected, once: its handle is an `Input<_>` or an `Input<_, Held>`"
            ),
            Presence::Optional => assert!(
                matches!(M::PRESENCE, Presence::Optional),
                "this input may be left out: its handle is an `Input<_, Optional>`"
            ),
            Presence::Many => assert!(
                matches!(M::PRESENCE, Presence::Many),
                "this input has any number of connections: its handle is an `Input<_, Many>`"
            ),
        }
        match port.flow {
            Flow::Sampled => assert!(
                matches!(M::FLOW, Flow::Sampled),
                "this input has a frame per tick: its handle is not `Held`"
            ),
            Flow::Held => assert!(
                matches!(M::FLOW, Flow::Held),
                "this input is read as runs: its handle is `Held`"
            ),
        }
        let mut before = 0;
        while before < index {
            assert!(
                !matches!(self.inputs[before].presence, Presence::Many),
                "an input of any number of connections comes last"
            );
            before += 1;
        }
        Input::at(index)
    }

    /// The handle of the output `name`. In a constant everything that does not fit its declaration is a compile error.
    ///
    /// # Panics
    /// If no output has this name, or its frames are not those of the handle.
    pub const fn output<F: FrameKind>(&self, name: &str) -> Output<F> {
        let mut index = 0;
        while index < self.outputs.len() {
            if same(self.outputs[index].name, name) {
                assert!(
                    F::KINDS.include(self.resolved(self.outputs[index].kind)),
                    "the frames of this output are of another kind"
                );
                return Output::at(index);
            }
            index += 1;
        }
        panic!("no output has this name")
    }

    /// The inputs with their handles, for a processor whose ports are known only when the program runs
    /// ([`ScriptedKind`](super::ScriptedKind)). Held inputs and those of many connections are left out.
    pub fn any_inputs(&self) -> impl Iterator<Item = (&InputSpec, Input<AnyKind, Optional>)> {
        let one = |port: &InputSpec| port.presence != Presence::Many && port.flow == Flow::Sampled;
        let inputs = self.inputs.iter().enumerate();
        inputs
            .filter(move |(_, port)| one(port))
            .map(|(index, port)| (port, Input::at(index)))
    }

    /// The outputs with their handles, as [`any_inputs`](Self::any_inputs).
    pub fn any_outputs(&self) -> impl Iterator<Item = (&OutputSpec, Output<AnyKind>)> {
        let outputs = self.outputs.iter().enumerate();
        outputs.map(|(index, port)| (port, Output::at(index)))
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
    /// Whether these include every kind that a port of this rule carries.
    const fn include(self, rule: KindRule) -> bool {
        match (self, rule) {
            (Self::Any, _) | (Self::Linear, KindRule::Linear) => true,
            (Self::Linear, KindRule::Is(kind)) => kind.is_linear(),
            (Self::One(wanted), KindRule::Is(kind)) => wanted.is(kind),
            _ => false,
        }
    }
}

/// Handles of several outputs, for [`Io::write_all`].
pub trait Outputs: tuples::Sealed {
    /// What [`Io::write_all`] gives.
    type Write<'a>;
    #[doc(hidden)]
    fn write<'a>(self, io: &'a mut Io<'_>) -> Self::Write<'a>;
}

mod tuples {
    pub trait Sealed {}
}

macro_rules! tuples {
    ($(($($kind:ident $place:tt $frames:ident),+))+) => { $(
        impl<$($kind: FrameKind),+> tuples::Sealed for ($(Output<$kind>,)+) {}

        impl<$($kind: FrameKind),+> Outputs for ($(Output<$kind>,)+) {
            type Write<'a> = ($($kind::FramesMut<'a>,)+);

            #[inline]
            fn write<'a>(self, io: &'a mut Io<'_>) -> Self::Write<'a> {
                let [$($frames),+] = io.outs([$((self.$place.index, $kind::KINDS)),+]);
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

impl<F, M> Clone for Input<F, M> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<F, M> Copy for Input<F, M> {}

impl<F, M> fmt::Debug for Input<F, M> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Input({})", self.index)
    }
}

impl<F> Clone for Output<F> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<F> Copy for Output<F> {}

impl<F> fmt::Debug for Output<F> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Output({})", self.index)
    }
}

#[cfg(test)]
mod tests;
