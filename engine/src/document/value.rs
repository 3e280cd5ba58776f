//! Values of a graph file: RON values with their places, before any check.

use super::text;
use super::write::Writer;
use crate::diagnostic::{Diagnostics, Sources, Span};
use std::sync::Arc;

/// A value and its place.
#[derive(Debug, Clone, PartialEq)]
pub struct Value {
    /// The place.
    pub span: Span,
    /// The content.
    pub shape: Shape,
}

/// The kinds of RON values.
#[derive(Debug, Clone, PartialEq)]
pub enum Shape {
    /// `()`
    Unit,
    /// `true`
    Bool(bool),
    /// A number, with its text (exact rates are read from it).
    Number(f64, String),
    /// `"text"`
    String(String),
    /// `[a, b]`
    List(Vec<Value>),
    /// `{ "a": b }`, repeated keys kept.
    Map(Vec<(Value, Value)>),
    /// `Name`, `Name(a, b)`, `Name(x: a)`, `(x: a)` or `(a, b)`; `None` and `Some(a)` are names like any other.
    Tagged(Tagged),
}

/// A possibly named structure.
#[derive(Debug, Clone, PartialEq)]
pub struct Tagged {
    /// The name before the bracket, with its place.
    pub name: Option<Name>,
    /// The content of the brackets.
    pub body: Body,
}

/// The content of the brackets of a structure.
#[derive(Debug, Clone, PartialEq)]
pub enum Body {
    /// No brackets: `Name`.
    Bare,
    /// `(a, b)`.
    Tuple(Vec<Value>),
    /// `(x: a, y: b)`, repeated names kept. Shared, so that a check copies no nodes.
    Fields(Arc<[(Name, Value)]>),
}

/// An identifier or key and its place.
#[derive(Debug, Clone, PartialEq)]
pub struct Name {
    /// The place.
    pub span: Span,
    /// The text.
    pub text: String,
}

fn changed(values: &[Value], change: &mut dyn FnMut(&Value) -> Option<Value>) -> Option<Vec<Value>> {
    let values: Vec<Option<Value>> = values.iter().map(change).collect();
    values.into_iter().collect()
}

fn entries_changed<N: Clone>(
    entries: &[(N, Value)],
    change: &mut dyn FnMut(&Value) -> Option<Value>,
) -> Option<Vec<(N, Value)>> {
    let values: Vec<Option<Value>> = entries.iter().map(|(_, value)| change(value)).collect();
    let names = entries.iter().map(|(name, _)| name.clone());
    names.zip(values).map(|(name, value)| Some((name, value?))).collect()
}

/// To four digits.
fn brief_number(number: f64) -> String {
    match format!("{number:.3e}").parse::<f64>() {
        Ok(rounded) if (1e-4..1e7).contains(&rounded.abs()) => rounded.to_string(),
        _ => format!("{number:.3e}"),
    }
}

/// The last part of the path of a file; any other text, such as a formula, is left whole.
fn brief_text(text: &str) -> &str {
    let last = text.rsplit('/').next().unwrap_or_default();
    let extension = last.rsplit_once('.').map_or("", |(_, extension)| extension);
    let is_file = extension.starts_with(|c: char| c.is_ascii_alphabetic())
        && extension.chars().all(|c| c.is_ascii_alphanumeric());
    if is_file { last } else { text }
}

/// A value without a place.
impl From<Shape> for Value {
    fn from(shape: Shape) -> Self {
        let span = Span::default();
        Self { span, shape }
    }
}

/// A name without a place.
impl From<&str> for Name {
    fn from(text: &str) -> Self {
        let (span, text) = (Span::default(), text.to_owned());
        Self { span, text }
    }
}

/// Values without places, as settings and builders make them.
impl Value {
    /// `"text"`
    pub fn text(text: &str) -> Self {
        Shape::String(text.to_owned()).into()
    }

    /// `Name`
    pub fn name(name: &str) -> Self {
        let (name, body) = (Some(name.into()), Body::Bare);
        Shape::Tagged(Tagged { name, body }).into()
    }

    /// `(x: a)`, or `()` without fields.
    pub(crate) fn structure<N: AsRef<str>>(fields: impl IntoIterator<Item = (N, Self)>) -> Self {
        let fields = fields.into_iter().map(|(name, value)| (Name::from(name.as_ref()), value));
        let (name, body) = (None, Body::Fields(fields.collect()));
        match &body {
            Body::Fields(fields) if fields.is_empty() => Shape::Unit.into(),
            _ => Shape::Tagged(Tagged { name, body }).into(),
        }
    }

    /// `Name(x: a)`, of a structure `(x: a)`; `Name()` of anything but a structure.
    #[must_use]
    pub fn named(self, name: &str) -> Self {
        let body = match self.shape {
            Shape::Tagged(tagged) => tagged.body,
            _ => Body::Tuple(Vec::new()),
        };
        let name = Some(name.into());
        Shape::Tagged(Tagged { name, body }).into()
    }

    /// `{ "a": b }`
    pub fn map<'n>(entries: impl IntoIterator<Item = (&'n str, Self)>) -> Self {
        let entries = entries.into_iter().map(|(name, value)| (Self::text(name), value));
        Shape::Map(entries.collect()).into()
    }

    /// The value in RON.
    pub(crate) fn into_text(mut self) -> String {
        let mut writer = Writer::default();
        writer.value(&mut self);
        writer.text
    }
}

/// How values are shown in one line.
struct Line {
    number: fn(f64, &str) -> String,
    text: fn(&str) -> String,
    /// Inside of the brackets of a map.
    margin: &'static str,
    /// True if entries and fields are sorted by name.
    is_sorted: bool,
}

impl Line {
    fn show(&self, value: &Value) -> String {
        match &value.shape {
            Shape::Unit => "()".to_owned(),
            Shape::Bool(flag) => flag.to_string(),
            Shape::Number(number, text) => (self.number)(*number, text),
            Shape::String(text) => (self.text)(text),
            Shape::List(values) => format!("[{}]", self.all(values)),
            Shape::Map(pairs) => {
                let entries = self.named(pairs.iter().map(|(key, value)| (self.show(key), value)));
                format!("{{{0}{entries}{0}}}", self.margin)
            }
            Shape::Tagged(Tagged { name, body }) => {
                let name = name.as_ref().map_or("", |name| &*name.text);
                match body {
                    Body::Bare => name.to_owned(),
                    Body::Tuple(values) => format!("{name}({})", self.all(values)),
                    Body::Fields(fields) => {
                        let fields = fields.iter().map(|(name, value)| (name.text.clone(), value));
                        format!("{name}({})", self.named(fields))
                    }
                }
            }
        }
    }

    fn all(&self, values: &[Value]) -> String {
        values.iter().map(|value| self.show(value)).collect::<Vec<_>>().join(", ")
    }

    fn named<'v>(&self, entries: impl Iterator<Item = (String, &'v Value)>) -> String {
        let entries = entries.map(|(name, value)| format!("{name}: {}", self.show(value)));
        let mut entries: Vec<String> = entries.collect();
        if self.is_sorted {
            entries.sort();
        }
        entries.join(", ")
    }
}

impl Value {
    /// Short form for display: numbers to four digits, the last part of a path.
    pub(crate) fn brief(&self) -> String {
        let number = |number: f64, text: &str| match text.len() {
            0..=7 => text.to_owned(),
            _ => brief_number(number),
        };
        let text = |text: &str| brief_text(text).to_owned();
        Line { number, text, margin: "", is_sorted: false }.show(self)
    }

    /// One line of RON, entries and fields sorted by name, so that equal values have equal lines.
    pub(crate) fn sorted(&self) -> String {
        let (number, text) = (|number: f64, _: &str| number.to_string(), |text: &str| format!("{text:?}"));
        Line { number, text, margin: " ", is_sorted: true }.show(self)
    }

    /// The values directly within: of a list, of a structure, and of the entries of a map.
    pub(crate) fn inner(&self) -> impl Iterator<Item = &Self> {
        let (values, pairs, fields) = match &self.shape {
            Shape::List(values) => (values.as_slice(), [].as_slice(), [].as_slice()),
            Shape::Map(pairs) => (&[][..], pairs.as_slice(), &[][..]),
            Shape::Tagged(Tagged { body: Body::Tuple(values), .. }) => (values.as_slice(), &[][..], &[][..]),
            Shape::Tagged(Tagged { body: Body::Fields(fields), .. }) => (&[][..], &[][..], &fields[..]),
            _ => (&[][..], &[][..], &[][..]),
        };
        let pairs = pairs.iter().map(|(_, value)| value);
        values.iter().chain(pairs).chain(fields.iter().map(|(_, value)| value))
    }

    /// The value with `change` applied to those directly within, all of them, so that all their errors are reported.
    pub(crate) fn map_inner(&self, change: &mut dyn FnMut(&Self) -> Option<Self>) -> Option<Self> {
        let shape = match &self.shape {
            Shape::List(values) => Shape::List(changed(values, change)?),
            Shape::Map(pairs) => Shape::Map(entries_changed(pairs, change)?),
            Shape::Tagged(Tagged { name, body }) => {
                let body = match body {
                    Body::Bare => Body::Bare,
                    Body::Tuple(values) => Body::Tuple(changed(values, change)?),
                    Body::Fields(fields) => Body::Fields(entries_changed(fields, change)?.into()),
                };
                Shape::Tagged(Tagged { name: name.clone(), body })
            }
            plain => plain.clone(),
        };
        Some(Self { span: self.span, shape })
    }

    /// Parses a text as one RON value.
    ///
    /// # Errors
    /// If it is not RON, or brackets are nested deeper than 64.
    #[doc(hidden)]
    pub fn parse(text: &str) -> Result<Self, Diagnostics> {
        let (mut sources, mut list) = (Sources::default(), Vec::new());
        let id = sources.add("text".into(), text.into());
        text::read(id, text, &mut list).ok_or(Diagnostics { sources, list })
    }

    /// The name, if the value is a name without brackets: `synth`.
    pub(crate) fn bare_name(&self) -> Option<&str> {
        match &self.shape {
            Shape::Tagged(Tagged { name: Some(name), body: Body::Bare }) => Some(&name.text),
            _ => None,
        }
    }

    /// Description for messages: `a number`, `a list`.
    pub(crate) fn describe(&self) -> &'static str {
        match &self.shape {
            Shape::Unit => "()",
            Shape::Bool(_) => "a boolean",
            Shape::Number(..) => "a number",
            Shape::String(_) => "a string",
            Shape::List(_) => "a list",
            Shape::Map(_) => "a map",
            Shape::Tagged(tagged) => match (&tagged.name, &tagged.body) {
                (Some(_), Body::Bare) => "a name",
                (Some(_), _) => "a named structure",
                (None, Body::Fields(_)) => "a structure",
                (None, _) => "a tuple",
            },
        }
    }
}
