//! The check: makes a graph from a document, one form after the other.

use super::context::Context;
use super::options::CheckOptions;
use super::values::Parameters;
use super::{
    Graph, assemble, attach, bridges, build, clocks, cycles, devices, expand, left_out, mismatch, registered,
    types, unused, wires,
};
use crate::diagnostic::Diagnostics;
use crate::document::Document;
use crate::registry::Registry;

/// Checks a document and makes a graph from it.
///
/// # Errors
/// All errors and warnings, in the order of the files.
pub fn check(document: &Document, registry: &Registry, options: &CheckOptions) -> Result<Graph, Diagnostics> {
    let document = document.with_library(registry.library());
    let mut cx = Context::new(&document, registry);
    cx.diagnostics = registered::findings(registry).chain(document.findings.clone()).collect();
    let seed = options.seed.unwrap_or(document.seed);
    let built = forms(&mut cx, options, seed);
    cx.put_in_order();
    let sound = built.filter(|_| !cx.has_errors());
    match sound.and_then(|built| assemble::assemble(&mut cx, built, seed)) {
        Some(graph) => Ok(graph),
        None => Err(cx.into_diagnostics()),
    }
}

/// Expands, connects, binds to devices, clocks, types, bridges and builds; `None` if there are too many nodes.
fn forms(cx: &mut Context<'_>, options: &CheckOptions, seed: u64) -> Option<build::Built> {
    let mut parameters = Parameters::read(cx, options);
    let clocks = clocks::read(cx, &mut parameters);
    let expanded = expand::expand(cx, &mut parameters, &options.endpoints)?;
    let wired = wires::connect(cx, expanded);
    let wired = left_out::remove(cx, wired);
    let devices = devices::read(cx, &mut parameters, options);
    let bound = devices::bind(cx, wired, devices);
    cycles::check(cx, &bound);
    let clocked = clocks::assign(cx, bound, clocks);
    let typed = types::infer(cx, clocked);
    mismatch::check(cx, &typed);
    let crossed = bridges::check(cx, typed);
    let attached = attach::attach(cx, crossed);
    let built = build::build(cx, attached, seed);
    if !cx.has_errors() {
        // Nodes without a clock were reported one by one.
        clocks::refuse_none(cx, &built.clocks);
    }
    if !cx.has_errors() {
        // Only without errors: an error can hide a use.
        unused::warn(cx, &built);
        clocks::warn_unused(cx, &built);
        parameters.warn_unused(cx);
        expand::warn_unused(cx, &built.scopes);
        devices::warn_unused(cx, &built);
    }
    Some(built)
}
