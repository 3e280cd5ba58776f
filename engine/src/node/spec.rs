//! What a node kind says of itself: documentation and ports.

use super::{Count, Input, Mode, Output};
use crate::frame::{FrameKind, Kind};
use haptograph_signal::quantity::Quantity;

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
    /// Inputs; one that takes any number of connections comes last.
    pub inputs: &'static [InputSpec],
    /// Outputs; one whose settings name its members comes last.
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
    /// The form of its frames: one a tick, or runs of held frames.
    pub flow: Flow,
    /// The number of connections that it takes.
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
    /// What reports take it for, beyond its quantity.
    pub role: OutputRole,
    /// How many outputs it stands for.
    pub count: OutputCount,
    /// What it is.
    pub doc: &'static str,
}

/// What reports take an output for, beyond its kind and quantity.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum OutputRole {
    /// What its quantity says.
    #[default]
    Plain,
    /// A measured coefficient of friction, which is a plain number.
    FrictionCoefficient,
    /// 0 while the node does what is asked of it, n while it cannot for the n-th of these reasons. The report of a run warns of
    /// the ticks of each.
    Shortfall(&'static [&'static str]),
}

/// How many outputs of a node a specification stands for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum OutputCount {
    /// One, of its name.
    #[default]
    One,
    /// A family: any number up to 64, of the names that [`NodeKind::members`](crate::node::NodeKind::members) takes from
    /// this setting.
    NamedBy(&'static str),
}

impl OutputCount {
    /// The setting that names the members of a family.
    pub const fn named_by(self) -> Option<&'static str> {
        match self {
            Self::One => None,
            Self::NamedBy(setting) => Some(setting),
        }
    }
}

impl NodeSpec {
    /// The place of the family of outputs, if there is one.
    pub const fn family(&self) -> Option<usize> {
        let mut index = 0;
        while index < self.outputs.len() {
            if let OutputCount::NamedBy(_) = self.outputs[index].count {
                assert!(index + 1 == self.outputs.len(), "a family of outputs comes last");
                return Some(index);
            }
            index += 1;
        }
        None
    }

    /// The specification of an output of a node of this kind, by its place among the node's: the members of a family
    /// follow one another at its place.
    pub fn output(&self, output: usize) -> Option<&'static OutputSpec> {
        match self.family() {
            Some(family) => self.outputs.get(output.min(family)),
            None => self.outputs.get(output),
        }
    }
}

/// How an input reads its signal.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Flow {
    /// One frame per tick.
    Sampled,
    /// Runs of (ticks, frame): a slow signal read by a fast clock costs time at its changes only.
    Held,
}

/// The number of connections of an input.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Presence {
    /// It has to be connected.
    Required,
    /// It may be left out; the processor reads an [`Option`].
    Optional,
    /// It takes a list of at least one connection.
    Many,
    /// It takes at least one connection: a list, or a map from names to connections. The node sees the names.
    Named,
}

impl Presence {
    /// True if the input takes any number of connections.
    pub const fn is_several(self) -> bool {
        matches!(self, Self::Many | Self::Named)
    }

    /// What stands before and after a connection in a graph file.
    pub(crate) const fn brackets(self) -> (&'static str, &'static str) {
        match self {
            Self::Required | Self::Optional => ("", ""),
            Self::Many => ("[", "]"),
            Self::Named => ("{\"name\": ", "}"),
        }
    }
}

/// Which kind of frames a port carries.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum KindRule {
    /// This kind.
    Is(Kind),
    /// A linear kind, treated component by component: scalar, 3-vector, wrench, and those that a program registers.
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

/// What a port of [`node!`](crate::node!) carries and what it is for. Its name, the kind of its frames and the number of its
/// connections are those of its handle.
#[derive(Debug, Clone, Copy)]
pub struct Port {
    like: Option<&'static str>,
    quantity: QuantityRule,
    role: OutputRole,
    count: OutputCount,
    doc: &'static str,
}

impl Port {
    /// A port of any quantity.
    pub const fn any(doc: &'static str) -> Self {
        let (role, count) = (OutputRole::Plain, OutputCount::One);
        Self { like: None, quantity: QuantityRule::Any, role, count, doc }
    }

    /// A port of this quantity.
    pub const fn of(quantity: Quantity, doc: &'static str) -> Self {
        Self::any(doc).carrying(QuantityRule::Is(quantity))
    }

    /// A port of the quantity that this setting names.
    pub const fn of_setting(setting: &'static str, doc: &'static str) -> Self {
        Self::any(doc).carrying(QuantityRule::Setting(setting))
    }

    /// A port with the kind and quantity of the input of this name.
    pub const fn like(input: &'static str, doc: &'static str) -> Self {
        Self { like: Some(input), ..Self::any(doc).carrying(QuantityRule::Same(input)) }
    }

    /// The same with another rule of its quantity.
    #[must_use]
    pub const fn carrying(self, quantity: QuantityRule) -> Self {
        Self { quantity, ..self }
    }

    /// Makes it a family whose members this setting names.
    #[must_use]
    pub const fn named_by(self, setting: &'static str) -> Self {
        Self { count: OutputCount::NamedBy(setting), ..self }
    }

    /// The same with a role.
    #[must_use]
    pub const fn with_role(self, role: OutputRole) -> Self {
        Self { role, ..self }
    }

    /// The input of this handle. For [`node!`](crate::node!).
    #[doc(hidden)]
    pub const fn input<K, F: FrameKind, M: Mode>(self, handle: Input<K, F, M>) -> InputSpec {
        let Self { quantity, role, count, doc, .. } = self;
        assert!(
            matches!((role, count), (OutputRole::Plain, OutputCount::One)),
            "an input has neither a role nor members"
        );
        let (flow, presence) = (M::FLOW, M::PRESENCE);
        InputSpec { name: handle.name(), kind: self.kind::<F>(), quantity, flow, presence, doc }
    }

    /// The output of this handle. For [`node!`](crate::node!).
    #[doc(hidden)]
    pub const fn output<K, F: FrameKind, C: Count>(self, handle: Output<K, F, C>) -> OutputSpec {
        let Self { quantity, role, count, doc, .. } = self;
        OutputSpec { name: handle.name(), kind: self.kind::<F>(), quantity, role, count, doc }
    }

    const fn kind<F: FrameKind>(self) -> KindRule {
        match self.like {
            Some(input) => KindRule::Same(input),
            None => F::KINDS.rule(),
        }
    }
}
