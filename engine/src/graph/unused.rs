//! Warnings about unused nodes.

use super::draft::{Context, Draft, Target};
use crate::diagnostic::{Diagnostic, Span};
use crate::document::Document;
use crate::document::value::{Body, Shape, Tagged, Value};
use std::collections::HashSet;

/// Reports nodes whose outputs no node reads; a use of a template counts as one node.
pub(super) fn warn(cx: &mut Context<'_>, draft: &Draft) {
    let readers = draft.readers(|_| true);
    let is_sink = |node: usize| draft.nodes[node].entry.is_actuator() || draft.nodes[node].entry.is_file();
    let mut reported: HashSet<Span> = HashSet::new();
    for (scope_index, scope) in draft.scopes.iter().enumerate() {
        let exported = exported(cx.document, draft, scope_index);
        let mut names: Vec<(&String, &Target)> = scope.names.iter().collect();
        names.sort_by_key(|(name, _)| name.as_str());
        for (name, target) in names {
            let (span, what) = match target {
                Target::Node(node) => {
                    if !readers[*node].is_empty() || is_sink(*node) || exported.contains(name.as_str()) {
                        continue;
                    }
                    (draft.nodes[*node].name, "node")
                }
                Target::Instance(inner) => {
                    let inside = within(draft, *inner);
                    let useful = |node: &usize| {
                        is_sink(*node) || readers[*node].iter().any(|reader| !inside.contains(reader))
                    };
                    if inside.iter().any(useful) || exported.contains(name.as_str()) {
                        continue;
                    }
                    match draft.scopes[*inner].template {
                        Some((_, span)) => (span, "template"),
                        None => continue,
                    }
                }
                Target::Broken => continue,
            };
            if reported.insert(span) {
                let path = format!("{}{name}", scope.prefix);
                let message = match what {
                    "node" => format!("node `{path}` is never used"),
                    _ => format!("`{path}` is never used"),
                };
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
fn exported<'a>(document: &'a Document, draft: &Draft, scope: usize) -> HashSet<&'a str> {
    let Some((template, _)) = draft.scopes[scope].template else {
        return HashSet::new();
    };
    let outputs = &document.templates[template].outputs;
    let mut names = HashSet::new();
    for (_, value) in outputs {
        strings(value, &mut |text| {
            names.insert(text.split('.').next().unwrap_or(text));
        });
    }
    names
}

/// All nodes of a use of a template, those of templates in it too.
fn within(draft: &Draft, scope: usize) -> HashSet<usize> {
    let mut nodes = HashSet::new();
    let mut scopes = vec![scope];
    while let Some(scope) = scopes.pop() {
        for target in draft.scopes[scope].names.values() {
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

fn strings<'v>(value: &'v Value, each: &mut impl FnMut(&'v str)) {
    match &value.shape {
        Shape::String(text) => each(text),
        Shape::List(values) => values.iter().for_each(|value| strings(value, each)),
        Shape::Tagged(Tagged { body, .. }) => match body {
            Body::Bare => {}
            Body::Tuple(values) => values.iter().for_each(|value| strings(value, each)),
            Body::Fields(fields) => fields.iter().for_each(|(_, value)| strings(value, each)),
        },
        _ => {}
    }
}
