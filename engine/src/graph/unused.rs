//! Warnings about unused nodes.

use super::context::Context;
use super::declared::Target;
use super::types::Typed;
use super::wires::Wired;
use crate::diagnostic::{Diagnostic, Span};
use crate::document::Document;
use crate::document::value::{Shape, Value};
use std::collections::HashSet;

/// Reports nodes whose outputs no node reads; a use of a template counts as one node.
pub(super) fn warn(cx: &mut Context<'_>, graph: &Typed) {
    let readers = &graph.readers;
    let is_sink = |node: usize| graph.nodes[node].entry.is_actuator() || graph.nodes[node].entry.is_file();
    let mut reported: HashSet<Span> = HashSet::new();
    for (scope_index, scope) in graph.scopes.iter().enumerate() {
        let exported = exported(cx.document, graph, scope_index);
        let may_be_unused = |target: &Target| match target {
            Target::Node(node) => readers[*node].is_empty() && !is_sink(*node),
            Target::Instance(_) => true,
            Target::Broken => false,
        };
        let mut names: Vec<(&String, &Target)> =
            scope.names.iter().filter(|(_, target)| may_be_unused(target)).collect();
        names.sort_by_key(|(name, _)| name.as_str());
        for (name, target) in names.into_iter().filter(|(name, _)| !exported.contains(name.as_str())) {
            let unused = match target {
                Target::Node(node) => Some((graph.nodes[*node].name, "node ")),
                Target::Instance(inner) => {
                    let inside = within(graph, *inner);
                    let is_used = |node: &usize| {
                        is_sink(*node) || readers[*node].iter().any(|reader| !inside.contains(reader))
                    };
                    let place = graph.scopes[*inner].template.filter(|_| !inside.iter().any(is_used));
                    place.map(|(_, span)| (span, ""))
                }
                Target::Broken => None,
            };
            if let Some((span, what)) = unused.filter(|(span, _)| reported.insert(*span)) {
                let message = format!("{what}`{}{name}` is never used", scope.prefix);
                cx.report(
                    Diagnostic::warning("W0101", span, message)
                        .label("nothing reads its outputs")
                        .help("connect it to a sink, or remove it"),
                );
            }
        }
    }
}

/// Names of nodes inside a template that its outputs name.
fn exported<'a>(document: &'a Document, graph: &Wired, scope: usize) -> HashSet<&'a str> {
    let mut names = HashSet::new();
    if let Some((template, _)) = graph.scopes[scope].template {
        let mut open: Vec<&Value> =
            document.templates[template].outputs.iter().map(|(_, value)| value).collect();
        while let Some(value) = open.pop() {
            if let Shape::String(text) = &value.shape {
                names.insert(text.split('.').next().unwrap_or(text));
            }
            open.extend(value.inner());
        }
    }
    names
}

/// All nodes of a use of a template, those of templates in it too.
fn within(graph: &Wired, scope: usize) -> HashSet<usize> {
    let mut nodes = HashSet::new();
    let mut scopes = vec![scope];
    while let Some(scope) = scopes.pop() {
        for target in graph.scopes[scope].names.values() {
            match target {
                Target::Node(node) => {
                    nodes.insert(*node);
                }
                Target::Instance(inner) => scopes.push(*inner),
                Target::Broken => {}
            }
        }
    }
    nodes
}
