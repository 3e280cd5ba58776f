//! Check of a registry, which a program fills: errors that have no place in the graph.

use crate::diagnostic::{Diagnostic, Span};
use crate::registry::{Namespace, RESERVED, Registry};
use std::collections::HashSet;

/// The errors of a registry.
pub(super) fn findings(registry: &Registry) -> impl Iterator<Item = Diagnostic> {
    twice(registry).chain(unregistered_kinds(registry)).chain(unlimited(registry))
}

/// Reports names registered more than once; these and the following errors have no place in the graph.
fn twice(registry: &Registry) -> impl Iterator<Item = Diagnostic> {
    let quoted =
        |names: Vec<&str>| names.iter().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ");
    registry.twice().map(move |(name, of)| {
        let rename = "rename one where this program registers it";
        let (message, help) = match of {
            Namespace::Nodes => (
                format!("two kinds of nodes are registered as `{name}`"),
                format!("{rename}, or put it in the place of the other by `Registry::replace`"),
            ),
            Namespace::Devices => (
                format!("two kinds of devices are registered as `{name}`"),
                format!("{rename}, or put it in the place of the other by `Registry::replace_device`"),
            ),
            Namespace::Kinds => {
                let kinds = registry.kinds().iter().map(|kind| kind.spec().name);
                (
                    format!("two kinds of frames are registered as `{name}`"),
                    format!("{rename}; names already in use: {}", quoted(unique(kinds))),
                )
            }
            Namespace::Bridges if RESERVED.contains(&name) => (
                format!("a bridge is registered as `{name}`, which is another form of a connection"),
                format!(
                    "rename it where this program registers it; names already in use: {}",
                    quoted(bridge_names(registry))
                ),
            ),
            Namespace::Bridges => (
                format!("two types of bridges are registered as `{name}`"),
                format!("{rename}; names already in use: {}", quoted(bridge_names(registry))),
            ),
        };
        Diagnostic::error("E0212", Span::default(), message).of_no_place().help(help)
    })
}

/// The names that no other bridge can have.
fn bridge_names(registry: &Registry) -> Vec<&'static str> {
    unique(registry.bridges().iter().map(|entry| entry.spec.name).chain(RESERVED))
}

/// Each name once, in the order of their first places.
fn unique(names: impl Iterator<Item = &'static str>) -> Vec<&'static str> {
    let mut seen = HashSet::new();
    names.filter(|name| seen.insert(*name)).collect()
}

/// Reports ports whose kind of frames is not registered.
fn unregistered_kinds(registry: &Registry) -> impl Iterator<Item = Diagnostic> {
    registry.unregistered_kinds().map(|(entry, port, kind)| {
        let name = kind.spec().name;
        let (message, help) = match registry.kind(name) {
            None => (
                format!("`{port}` of `{entry}` has frames of the kind `{name}`, which is not registered"),
                "add the kind by `Registry::add_kind` where this program registers the other",
            ),
            Some(_) => (
                format!("`{port}` of `{entry}` uses a frame kind `{name}` that differs from the registered kind of that name"),
                "use one definition of the kind for both",
            ),
        };
        Diagnostic::error("E0213", Span::default(), message).of_no_place().help(help)
    })
}

/// Reports driven channels whose frames no limiter takes.
fn unlimited(registry: &Registry) -> impl Iterator<Item = Diagnostic> {
    registry.unlimited().map(|(entry, channel, kind)| {
        let message = format!("`{channel}` of `{entry}` cannot be driven by {}", kind.spec().one);
        Diagnostic::error("E0213", Span::default(), message)
            .of_no_place()
            .help("an actuator is driven by frames of 1, 3 or 6 components, which its limiter takes")
    })
}
