//! The check: makes a graph from a document. Later stages rely on earlier ones.

use super::draft::Context;
use super::values::Parameters;
use super::{Graph, bridges, build, clocks, cycles, devices, expand, left_out, types, unused, wires};
use crate::diagnostic::{Diagnostic, Diagnostics, Severity, Span};
use crate::document::Document;
use crate::registry::{Namespace, RESERVED, Registry};
use std::collections::HashSet;

/// Options of a check.
///
/// ```
/// use haptograph_engine::graph::CheckOptions;
///
/// let options = CheckOptions::default().set("stiffness", "0.25").endpoints("live").seed(7);
/// assert_eq!((options.set.len(), options.seed), (1, Some(7)));
/// ```
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct CheckOptions {
    /// Parameter values by name: RON, or plain text if the default is a string.
    pub set: Vec<(String, String)>,
    /// The caller's term for such a value, which errors name in place of a file.
    pub set_as: &'static str,
    /// The set of endpoints to which nodes are bound.
    pub endpoints: String,
    /// The endpoints that belong to the calling program, whatever the set declares.
    pub hosted: Hosted,
    /// Seed that replaces the graph's.
    pub seed: Option<u64>,
}

/// The endpoints of a calling program.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
#[non_exhaustive]
pub enum Hosted {
    /// Endpoints of kind `Host` in the graph.
    #[default]
    AsWritten,
    /// Those of kind `Host`, and these by name.
    Also(Vec<String>),
    /// All endpoints.
    All,
}

impl Hosted {
    pub(super) fn has(&self, name: &str) -> bool {
        match self {
            Self::AsWritten => false,
            Self::Also(names) => names.iter().any(|known| known == name),
            Self::All => true,
        }
    }
}

impl CheckOptions {
    /// Gives a parameter a value, as RON or, if its default is a string, as plain text.
    #[must_use]
    pub fn set(mut self, name: impl Into<String>, value: impl Into<String>) -> Self {
        self.set.push((name.into(), value.into()));
        self
    }

    /// Binds the graph to this set of endpoints.
    #[must_use]
    pub fn endpoints(mut self, set: impl Into<String>) -> Self {
        self.endpoints = set.into();
        self
    }

    /// Gives the graph another seed.
    #[must_use]
    pub fn seed(mut self, seed: u64) -> Self {
        self.seed = Some(seed);
        self
    }

    /// Options that give all endpoints to the calling program.
    pub fn hosted() -> Self {
        let hosted = Hosted::All;
        Self { hosted, ..Self::default() }
    }
}

impl Default for CheckOptions {
    /// Options that bind the graph to its simulated endpoints.
    fn default() -> Self {
        Self {
            set: Vec::new(),
            set_as: "parameter",
            endpoints: "simulated".into(),
            hosted: Hosted::AsWritten,
            seed: None,
        }
    }
}

/// Checks a document and makes a graph from it.
///
/// # Errors
/// All errors and warnings, in the order of the files.
pub fn check(document: &Document, registry: &Registry, options: &CheckOptions) -> Result<Graph, Diagnostics> {
    let document = document.with_library(registry.library());
    let document = &*document;
    let seed = options.seed.unwrap_or(document.seed);
    let mut cx = Context {
        document,
        registry,
        sources: document.sources.clone(),
        diagnostics: twice(registry)
            .chain(unregistered_kinds(registry))
            .chain(unlimited(registry))
            .chain(document.findings.clone())
            .collect(),
        files: Vec::new(),
    };
    let mut parameters = Parameters::read(&mut cx, options);
    let clocks = clocks::read(&mut cx, &mut parameters);
    let mut draft = expand::expand(&mut cx, &mut parameters, &options.endpoints);
    if draft.cut {
        put_in_order(&mut cx.diagnostics);
        let (sources, list) = (cx.sources, cx.diagnostics);
        return Err(Diagnostics { sources, list });
    }
    wires::connect(&mut cx, &mut draft);
    left_out::remove(&mut cx, &mut draft);
    let mut devices = devices::read(&mut cx, &mut parameters, &draft, options);
    devices::bind(&mut cx, &mut draft, &mut devices);
    cycles::check(&mut cx, &mut draft);
    clocks::assign(&mut cx, &mut draft, &clocks);
    types::check(&mut cx, &mut draft);
    bridges::check(&mut cx, &mut draft, &clocks);
    if let Some(devices) = &mut devices {
        devices::check(&mut cx, &mut draft, &clocks, devices);
    }
    let built = build::build(&mut cx, &draft, &clocks, devices.as_ref(), seed);

    let has_errors = |cx: &Context<'_>| cx.diagnostics.iter().any(|d| d.severity == Severity::Error);
    if !has_errors(&cx) {
        // Nodes without a clock were reported one by one.
        clocks::refuse_none(&mut cx, &clocks);
    }
    if !has_errors(&cx) {
        // Only without errors: an error can hide a use.
        unused::warn(&mut cx, &draft);
        clocks::warn_unused(&mut cx, &draft, &clocks);
        parameters.warn_unused(&mut cx);
        expand::warn_unused(&mut cx, &draft);
        if let Some(devices) = &devices {
            devices::warn_unused(&mut cx, devices);
        }
    }
    put_in_order(&mut cx.diagnostics);
    let failed = |sources, list| Err(Diagnostics { sources, list });
    if has_errors(&cx) {
        return failed(cx.sources, cx.diagnostics);
    }
    let (sources, list) = (cx.sources.clone(), cx.diagnostics.clone());
    build::assemble(cx, draft, clocks, devices, built, seed).map_or_else(|| failed(sources, list), Ok)
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
                    format!("{rename}; taken are {}", quoted(unique(kinds))),
                )
            }
            Namespace::Bridges if RESERVED.contains(&name) => (
                format!("a bridge is registered as `{name}`, which is another form of a connection"),
                format!(
                    "rename it where this program registers it; taken are {}",
                    quoted(bridge_names(registry))
                ),
            ),
            Namespace::Bridges => (
                format!("two types of bridges are registered as `{name}`"),
                format!("{rename}; taken are {}", quoted(bridge_names(registry))),
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
                format!("`{port}` of `{entry}` has frames of another kind `{name}` than the registered one"),
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

/// Sorts by place and removes duplicates: an error in a template is found in each of its uses.
fn put_in_order(list: &mut Vec<Diagnostic>) {
    let place = |d: &Diagnostic| d.primary.as_ref().map(|label| (label.span.source, label.span.start));
    list.sort_by_key(place);
    let mut seen = HashSet::new();
    // Missing fields share a place; their labels differ.
    list.retain(|d| match &d.primary {
        Some(label) => seen.insert((d.code, label.span, label.text.clone(), d.severity == Severity::Error)),
        None => true,
    });
}
