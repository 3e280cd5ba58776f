//! The one way to a graph: every check, in an order in which later ones can rely on earlier ones.

use super::draft::Context;
use super::values::Parameters;
use super::{Graph, bridges, build, clocks, cycles, devices, expand, left_out, types, unused, wires};
use crate::diagnostic::{Diagnostic, Diagnostics, Severity, Span};
use crate::document::Document;
use crate::registry::Registry;
use std::collections::HashSet;

/// What a check is given besides the document.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CheckOptions {
    /// Parameters by name, in place of their defaults: RON, or bare text where the default is a string.
    pub set: Vec<(String, String)>,
    /// Which set of endpoints the nodes are bound to.
    pub endpoints: String,
    /// Which endpoints the calling program feeds and hears, whatever the set says they are.
    pub hosted: Hosted,
    /// In place of the graph's own seed.
    pub seed: Option<u64>,
}

/// The endpoints of a calling program.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub enum Hosted {
    /// Those that are of kind `Host` in the graph.
    #[default]
    AsWritten,
    /// These too, by name.
    Also(Vec<String>),
    /// Every one.
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
    /// The graph as it is, all of its endpoints the calling program's.
    pub fn hosted() -> Self {
        let hosted = Hosted::All;
        Self {
            hosted,
            ..Self::default()
        }
    }
}

impl Default for CheckOptions {
    /// The graph as it is, bound to simulated devices.
    fn default() -> Self {
        Self {
            set: Vec::new(),
            endpoints: "simulated".into(),
            hosted: Hosted::AsWritten,
            seed: None,
        }
    }
}

/// Proves a document sound.
///
/// # Errors
/// All that is wrong with it, and the warnings, in the order of the files.
pub fn check(document: &Document, registry: &Registry, options: &CheckOptions) -> Result<Graph, Diagnostics> {
    let document = document.with_library(registry.library());
    let document = &*document;
    let seed = options.seed.unwrap_or(document.seed);
    let mut cx = Context {
        document,
        registry,
        sources: document.sources.clone(),
        diagnostics: twice(registry).chain(document.findings.clone()).collect(),
        files: Vec::new(),
    };
    let mut parameters = Parameters::read(&mut cx, &options.endpoints, &options.set);
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
        // With errors about, what seems unused may be what an error hides.
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

/// An error for each name that two kinds have: it has no place in the graph.
fn twice(registry: &Registry) -> impl Iterator<Item = Diagnostic> {
    registry.twice().map(|name| {
        let message = format!("two kinds are registered as `{name}`");
        let help = "rename one where this program registers it, or take the place of the other by `Registry::replace` or `replace_device`";
        Diagnostic::error("E0212", Span::default(), message)
            .of_no_place()
            .help(help)
    })
}

/// In the order of the files; what a template does wrong in every use is said once.
fn put_in_order(list: &mut Vec<Diagnostic>) {
    let place = |d: &Diagnostic| {
        d.primary
            .as_ref()
            .map(|label| (label.span.source, label.span.start))
    };
    list.sort_by_key(place);
    let mut seen = HashSet::new();
    // Fields that are missing are missing at one place: their labels name them.
    list.retain(|d| match &d.primary {
        Some(label) => seen.insert((
            d.code,
            label.span,
            label.text.clone(),
            d.severity == Severity::Error,
        )),
        None => true,
    });
}
