//! The macro that declares a kind of node.

use super::{MAX_NAME, NodeSpec};
use crate::settings::Settings;

/// The declaration of a kind of node, made by [`node!`](crate::node!).
pub trait Declared: 'static {
    /// Settings of the kind.
    type Settings: Settings;
    /// Ports and documentation.
    const SPEC: NodeSpec;
}

/// The first text. For [`node!`](crate::node!).
#[doc(hidden)]
pub const fn first(texts: &[&'static str]) -> &'static str {
    texts[0]
}

/// The name of a handle in lower case, filled up with zeros. For [`node!`](crate::node!).
#[doc(hidden)]
pub const fn lower(handle: &str) -> [u8; MAX_NAME] {
    let handle = handle.as_bytes();
    assert!(handle.len() <= MAX_NAME, "the name of a port has at most 64 characters");
    let (mut lower, mut at) = ([0; MAX_NAME], 0);
    while at < handle.len() {
        lower[at] = handle[at].to_ascii_lowercase();
        at += 1;
    }
    lower
}

/// The name of a port: the one that is given, or that of its handle. For [`node!`](crate::node!).
#[doc(hidden)]
pub const fn port_name(given: &[&'static str], lower: &'static [u8; MAX_NAME]) -> &'static str {
    if let [name] = given {
        return name;
    }
    let mut length = 0;
    while length < MAX_NAME && lower[length] != 0 {
        length += 1;
    }
    match std::str::from_utf8(lower.split_at(length).0) {
        Ok(name) => name,
        Err(_) => panic!("the name of a port is ASCII"),
    }
}

/// Declares a kind of node: its type, settings, documentation and ports, each of them once. The handle of a port is a constant of
/// the type with the name of the port in capitals, and types say what the port carries: the kind of its frames, then for an input
/// [`Optional`](super::Optional), [`Held`](super::Held), [`Many`](super::Many) or [`Named`](super::Named), for an output
/// [`Family`](super::Family). [`Port`](super::Port) has the quantity and the documentation. Inputs come before outputs.
///
/// ```
/// use haptograph_engine::frame::{Linear, Scalar};
/// use haptograph_engine::node::{Declared, Optional, Port};
/// use haptograph_engine::settings::NoSettings;
/// use haptograph_signal::quantity::Quantity;
///
/// haptograph_engine::node! {
///     /// A filter of one pole. A connected `cutoff` sweeps it.
///     pub struct OnePole(NoSettings) in "mine";
///     source: "Oppenheim and Schafer, 6.3";
///     example: r#""calm": OnePole(input: "noise.output")"#;
///     in INPUT: Linear = Port::any("The signal.");
///     in CUTOFF: Scalar, Optional = Port::of(Quantity::FREQUENCY, "Cut-off, Hz.");
///     out OUTPUT: Linear = Port::like("input", "The smoothed signal.");
/// }
/// assert_eq!(OnePole::SPEC.name, "OnePole");
/// assert_eq!(OnePole::SPEC.doc, "A filter of one pole. A connected `cutoff` sweeps it.");
/// assert_eq!(OnePole::CUTOFF.name(), "cutoff");
/// ```
///
/// `struct ContactNode as "Contact"` gives the kind another name in graph files, and `in READING as "force"` a port.
#[macro_export]
macro_rules! node {
    (
        $(#[doc = $doc:literal])+
        $vis:vis struct $kind:ident $(as $name:literal)? ($settings:ty) in $group:expr;
        $(source: $source:expr;)? example: $example:expr;
        $(in $input:ident $(as $input_name:literal)?: $read:ty $(, $mode:ty)? = $input_port:expr;)*
        $(out $output:ident $(as $output_name:literal)?: $written:ty $(, $count:ty)? = $output_port:expr;)*
    ) => {
        $(#[doc = $doc])+
        #[derive(Debug, Clone, Copy)]
        $vis struct $kind;

        #[allow(dead_code, non_camel_case_types, clippy::upper_case_acronyms)]
        const _: () = {
            enum Inputs { $($input),* }
            enum Outputs { $($output),* }
            impl $kind {
                $(pub(crate) const $input: $crate::node::Input<Self, $read $(, $mode)?> =
                    $crate::node::Input::declared(Inputs::$input as usize, $crate::node::port_name(
                        &[$($input_name)?], &const { $crate::node::lower(stringify!($input)) }));)*
                $(pub(crate) const $output: $crate::node::Output<Self, $written $(, $count)?> =
                    $crate::node::Output::declared(Outputs::$output as usize, $crate::node::port_name(
                        &[$($output_name)?], &const { $crate::node::lower(stringify!($output)) }));)*
            }
            impl $crate::node::Declared for $kind {
                type Settings = $settings;
                const SPEC: $crate::node::NodeSpec = $crate::node::NodeSpec {
                    name: $crate::node::first(&[$($name,)? stringify!($kind)]),
                    group: $group,
                    doc: concat!($($doc),+).trim_ascii(),
                    source: $crate::node::first(&[$($source,)? ""]),
                    inputs: &[$($input_port.input(Self::$input)),*],
                    outputs: &[$($output_port.output(Self::$output)),*],
                    example: $example,
                };
            }
            $($kind::$input.check();)* $($kind::$output.check();)*
        };
    };
}
