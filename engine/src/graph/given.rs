//! What a graph file gives an input: one connection, a list, or a map from names to connections.

use super::context::Context;
use super::declared::Declared;
use crate::diagnostic::{Diagnostic, Span};
use crate::document::refused_name;
use crate::document::value::{Name, Shape, Value};
use crate::node::{InputSpec, MAX_NAME, MAX_NAMED, Presence};
use crate::settings::{Expected, Form};
use std::collections::HashMap;

/// Connections that a message about a map shows as a list.
const SHOWN: usize = 4;

/// A connection as written; without a value after a reported error.
#[derive(Default)]
pub(super) struct Given {
    pub name: Option<Name>,
    pub value: Option<Value>,
}

impl Given {
    fn unnamed(value: Value) -> Self {
        let (name, value) = (None, Some(value));
        Self { name, value }
    }
}

/// The connections of an input, at least one.
pub(super) fn connections(
    cx: &mut Context<'_>,
    node: &Declared,
    input: &InputSpec,
    value: Value,
) -> Vec<Given> {
    let refused = match (value.shape, input.presence) {
        (Shape::List(values), presence) if presence.is_several() && !values.is_empty() => {
            return values.into_iter().map(Given::unnamed).collect();
        }
        (Shape::Map(pairs), Presence::Named) if (1..=MAX_NAMED).contains(&pairs.len()) => {
            return named(cx, node, pairs);
        }
        (Shape::List(values), presence) if !presence.is_several() => {
            doubled(cx, node, input, value.span, &format!("a list of {}", values.len()))
        }
        (Shape::Map(pairs), presence) if !presence.is_several() => {
            doubled(cx, node, input, value.span, &format!("a map of {}", pairs.len()))
        }
        (Shape::Map(pairs), Presence::Named) if pairs.len() > MAX_NAMED => {
            let message = format!("a map has at most {MAX_NAMED} connections, found {}", pairs.len());
            let diagnostic = Diagnostic::error("E0415", value.span, message);
            diagnostic.help("combine some of them by another node first")
        }
        (Shape::Map(pairs), _) if !pairs.is_empty() => nameless(node, input, value.span, pairs),
        (Shape::List(_) | Shape::Map(_), _) => {
            let kind = node.entry.spec.name;
            let message = format!("input `{}` of `{kind}` is connected to nothing", input.name);
            Diagnostic::error("E0401", value.span, message).label("at least one connection is needed")
        }
        (shape, _) => {
            let span = value.span;
            return vec![Given::unnamed(Value { span, shape })];
        }
    };
    cx.report_of(node, refused);
    vec![Given::default()]
}

/// The connections of a map. Those whose name is reported have no value.
fn named(cx: &mut Context<'_>, node: &Declared, pairs: Vec<(Value, Value)>) -> Vec<Given> {
    let mut known: HashMap<String, Span> = HashMap::with_capacity(pairs.len());
    let mut found = Vec::with_capacity(pairs.len());
    for (key, value) in pairs {
        let span = key.span;
        let Shape::String(text) = key.shape else {
            let expected = Expected::Described(Form::Quoted, "the name of a connection in quotes".into());
            cx.reading(|reading| reading.mismatch(&key, &expected));
            found.push(Given::default());
            continue;
        };
        let name = Name { span, text };
        let refused = match known.get(&name.text) {
            Some(first) => {
                let message = format!("there are two connections `{}`", name.text);
                let diagnostic = Diagnostic::error("E0105", span, message).label("named again here");
                Some(diagnostic.also(*first, "first named here").help("rename or remove one of them"))
            }
            None => refused_port_name(&name, "connection"),
        };
        known.entry(name.text.clone()).or_insert(span);
        found.push(Given { value: refused.is_none().then_some(value), name: Some(name) });
        if let Some(refused) = refused {
            cx.report_of(node, refused);
        }
    }
    found
}

/// The error of a name that a connection or output cannot have.
pub(super) fn refused_port_name(name: &Name, what: &str) -> Option<Diagnostic> {
    let letters = name.text.chars().count();
    if letters > MAX_NAME {
        let message = format!("the name of this {what} has at most {MAX_NAME} characters, found {letters}");
        return Some(Diagnostic::error("E0211", name.span, message).label("too long"));
    }
    refused_name(name, what)
}

/// The error of a map at an input whose connections have no names.
fn nameless(node: &Declared, input: &InputSpec, span: Span, pairs: Vec<(Value, Value)>) -> Diagnostic {
    let kind = node.entry.spec.name;
    let message = format!("the connections of input `{}` of `{kind}` have no names", input.name);
    let list = match pairs.len() {
        0..=SHOWN => {
            let values = pairs.into_iter().map(|(_, value)| value).collect();
            Value::from(Shape::List(values)).into_text()
        }
        _ => "[\"node.output\", ...]".to_owned(),
    };
    Diagnostic::error("E0414", span, message)
        .label("a map is given here")
        .help(format!("write a list: `{}: {list}`", input.name))
}

/// The error of a list or map at an input that takes one connection.
fn doubled(cx: &Context<'_>, node: &Declared, input: &InputSpec, span: Span, found: &str) -> Diagnostic {
    let kind = node.entry.spec.name;
    let message = format!("input `{}` of `{kind}` takes one connection, found {found}", input.name);
    let diagnostic = Diagnostic::error("E0402", span, message).label("one connection is expected here");
    let mixers = cx.registry.nodes().iter().filter(|entry| {
        let mut inputs = entry.spec.inputs.iter();
        inputs.any(|input| input.presence.is_several()) && !entry.is_file()
    });
    let mixers: Vec<&str> = mixers.map(|entry| entry.spec.name).collect();
    match mixers.is_empty() {
        true => diagnostic.help("remove all but one"),
        false => diagnostic.help(format!("combine them first, for example with `{}`", mixers.join("` or `"))),
    }
}
