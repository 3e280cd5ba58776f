//! Values of a graph file: RON values with their places, before any check.

use super::text;
use super::write::Writer;
use crate::diagnostic::{Diagnostics, Sources, Span};

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
    /// `(x: a, y: b)`, repeated names kept.
    Fields(Vec<(Name, Value)>),
}

/// An identifier or key and its place.
#[derive(Debug, Clone, PartialEq)]
pub struct Name {
    /// The place.
    pub span: Span,
    /// The text.
    pub text: String,
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
    pub fn structure<N: AsRef<str>>(fields: impl IntoIterator<Item = (N, Self)>) -> Self {
        let fields = fields.into_iter().map(|(name, value)| (Name::from(name.as_ref()), value));
        let fields: Vec<(Name, Self)> = fields.collect();
        let (name, body) = (None, Body::Fields(fields));
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
    pub fn into_text(mut self) -> String {
        let mut writer = Writer::default();
        writer.value(&mut self);
        writer.text
    }
}

impl Value {
    /// Short form for display: numbers to four digits, the last part of a path.
    pub fn brief(&self) -> String {
        let all = |values: &[Self]| values.iter().map(Self::brief).collect::<Vec<_>>().join(", ");
        match &self.shape {
            Shape::Unit => "()".into(),
            Shape::Bool(is_so) => is_so.to_string(),
            Shape::Number(number, text) if text.len() > 7 => brief_number(*number),
            Shape::Number(_, text) => text.clone(),
            Shape::String(text) => brief_text(text).into(),
            Shape::List(values) => format!("[{}]", all(values)),
            Shape::Map(pairs) => {
                let pairs = pairs.iter().map(|(key, value)| format!("{}: {}", key.brief(), value.brief()));
                format!("{{{}}}", pairs.collect::<Vec<_>>().join(", "))
            }
            Shape::Tagged(Tagged { name, body }) => {
                let name = name.as_ref().map_or("", |name| &*name.text);
                match body {
                    Body::Bare => name.into(),
                    Body::Tuple(values) => format!("{name}({})", all(values)),
                    Body::Fields(fields) => {
                        let fields =
                            fields.iter().map(|(name, value)| format!("{}: {}", name.text, value.brief()));
                        format!("{name}({})", fields.collect::<Vec<_>>().join(", "))
                    }
                }
            }
        }
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
    pub fn describe(&self) -> &'static str {
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
