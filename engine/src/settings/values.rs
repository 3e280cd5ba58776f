//! The types that settings can have.

use super::{Expected, Form, Part, Reading, Scale, Setting};
use crate::diagnostic::{Diagnostic, Span};
use crate::document::value::{Body, Name, Shape, Tagged, Value};
use haptograph_signal::files::{self, Roots};
use std::collections::{HashMap, HashSet};
use std::path::PathBuf;

impl Setting for f64 {
    const SCALE: Scale = Scale::Plain;
    fn expected() -> Expected {
        Expected::Number
    }
    fn read(value: &Value, reading: &mut Reading<'_>) -> Option<Self> {
        match value.shape {
            Shape::Number(number, _) if number.is_finite() => Some(number),
            _ => {
                reading.mismatch(value, &Self::expected());
                None
            }
        }
    }
    fn value(&self) -> Value {
        Shape::Number(*self, format!("{self:?}")).into()
    }
    fn numbers(&self) -> Vec<f64> {
        vec![*self]
    }
}

macro_rules! whole_number {
    ($($type:ty),*) => {$(
        impl Setting for $type {
            const SCALE: Scale = Scale::Plain;
            fn expected() -> Expected {
                Expected::Whole { most: <$type>::MAX as u64 }
            }
            fn read(value: &Value, reading: &mut Reading<'_>) -> Option<Self> {
                if let Shape::Number(_, text) = &value.shape
                    && let Ok(number) = text.replace('_', "").parse()
                {
                    return Some(number);
                }
                reading.mismatch(value, &Self::expected());
                None
            }
            fn value(&self) -> Value {
                Shape::Number(*self as f64, self.to_string()).into()
            }
            fn numbers(&self) -> Vec<f64> {
                vec![*self as f64]
            }
        }
    )*};
}
whole_number!(u32, u64, usize);

impl Setting for bool {
    fn expected() -> Expected {
        Expected::Flag
    }
    fn read(value: &Value, reading: &mut Reading<'_>) -> Option<Self> {
        if let Shape::Bool(flag) = value.shape {
            return Some(flag);
        }
        reading.mismatch(value, &Self::expected());
        None
    }
    fn value(&self) -> Value {
        Shape::Bool(*self).into()
    }
}

impl Setting for String {
    fn expected() -> Expected {
        Expected::Text
    }
    fn read(value: &Value, reading: &mut Reading<'_>) -> Option<Self> {
        if let Shape::String(text) = &value.shape {
            return Some(text.clone());
        }
        reading.mismatch(value, &Self::expected());
        None
    }
    fn value(&self) -> Value {
        Value::text(self)
    }
}

impl Setting for PathBuf {
    fn expected() -> Expected {
        Expected::Path
    }
    fn read(value: &Value, reading: &mut Reading<'_>) -> Option<Self> {
        if let Shape::String(text) = &value.shape {
            if text.is_empty() {
                let empty = Diagnostic::error("E0301", value.span, "the path is empty");
                reading.diagnostics.push(empty.label("expected a path"));
                return None;
            }
            let path = reading.resolve(value.span, text);
            if let Some(roots) = files::refused(&path) {
                reading.diagnostics.push(outside(value.span, text, &roots));
                return None;
            }
            reading.files.push(path.clone());
            return Some(path);
        }
        reading.mismatch(value, &Self::expected());
        None
    }
    fn value(&self) -> Value {
        Value::text(&self.to_string_lossy())
    }
}

/// Error of a file outside the folders that may be read, whether it exists or not.
fn outside(span: Span, written: &str, roots: &Roots) -> Diagnostic {
    let folders: Vec<String> = roots.folders().iter().map(|folder| folder.display().to_string()).collect();
    let message = format!("`{written}` is outside the folders that may be read here");
    Diagnostic::error("E0112", span, message)
        .label("not read")
        .help(format!("name a file in {}, or move it there", folders.join(" or ")))
}

impl<T: Setting> Setting for Option<T> {
    const SCALE: Scale = T::SCALE;
    fn expected() -> Expected {
        Expected::Optional(Box::new(T::expected()))
    }
    fn parts() -> Vec<Part> {
        T::parts()
    }
    fn read(value: &Value, reading: &mut Reading<'_>) -> Option<Self> {
        if let Shape::Tagged(Tagged { name: Some(name), body }) = &value.shape {
            match (name.text.as_str(), body) {
                ("None", Body::Bare) => return Some(None),
                ("Some", Body::Tuple(inner)) if inner.len() == 1 => {
                    return T::read(&inner[0], reading).map(Some);
                }
                _ => {}
            }
        }
        T::read(value, reading).map(Some)
    }
    fn value(&self) -> Value {
        self.as_ref().map_or_else(|| Value::name("None"), T::value)
    }
    fn numbers(&self) -> Vec<f64> {
        self.as_ref().map_or_else(Vec::new, T::numbers)
    }
}

impl<T: Setting> Setting for Vec<T> {
    const SCALE: Scale = T::SCALE;
    fn expected() -> Expected {
        Expected::List(Box::new(T::expected()))
    }
    fn parts() -> Vec<Part> {
        T::parts()
    }
    fn read(value: &Value, reading: &mut Reading<'_>) -> Option<Self> {
        let Shape::List(values) = &value.shape else {
            reading.mismatch(value, &Self::expected());
            return None;
        };
        // Every element is read, so that all errors are seen at once.
        let read: Vec<Option<T>> = values.iter().map(|value| T::read(value, reading)).collect();
        read.into_iter().collect()
    }
    fn value(&self) -> Value {
        Shape::List(self.iter().map(T::value).collect()).into()
    }
    fn numbers(&self) -> Vec<f64> {
        self.iter().flat_map(T::numbers).collect()
    }
}

/// A map from names, in the order of the file.
#[derive(Debug, Clone, PartialEq)]
pub struct Named<T>(pub Vec<(Name, T)>);

impl<T> Default for Named<T> {
    fn default() -> Self {
        Self(Vec::new())
    }
}

impl<T> Named<T> {
    /// The number of an entry.
    pub fn find(&self, name: &str) -> Option<usize> {
        self.0.iter().position(|(known, _)| known.text == name)
    }
}

impl<T: Setting> Setting for Named<T> {
    fn expected() -> Expected {
        Expected::described("a map from names, { \"name\": ... }".to_owned())
    }
    fn parts() -> Vec<Part> {
        T::parts()
    }
    fn read(value: &Value, reading: &mut Reading<'_>) -> Option<Self> {
        let before = reading.diagnostics.len();
        let entries = named_values(value.clone(), "name", reading);
        let read = entries.into_iter().map(|(name, value)| Some((name, T::read(&value, reading)?)));
        // Every entry is read, so that all errors are seen at once.
        let read: Vec<_> = read.collect();
        let read: Option<Vec<_>> = read.into_iter().collect();
        read.filter(|_| reading.diagnostics.len() == before).map(Self)
    }
    fn value(&self) -> Value {
        Value::map(self.0.iter().map(|(name, value)| (name.text.as_str(), value.value())))
    }
}

/// The entries of a map from names; reports any other value, and names given twice.
pub(crate) fn named_values(value: Value, what: &str, reading: &mut Reading<'_>) -> Vec<(Name, Value)> {
    let pairs = match value.shape {
        Shape::Map(pairs) => pairs,
        shape => {
            let expected = Expected::described(format!("a map from names, {{ \"{what}\": ... }}"));
            reading.mismatch(&Value { span: value.span, shape }, &expected);
            return Vec::new();
        }
    };
    if are_distinct_names(&pairs) {
        let mut entries = Vec::with_capacity(pairs.len());
        entries.extend(pairs.into_iter().filter_map(|(key, value)| match key.shape {
            Shape::String(text) => Some((Name { span: key.span, text }, value)),
            _ => None,
        }));
        return entries;
    }
    let mut seen: HashMap<String, Span> = HashMap::with_capacity(pairs.len());
    let mut entries = Vec::with_capacity(pairs.len());
    for (key, value) in pairs {
        let span = key.span;
        let text = match key.shape {
            Shape::String(text) => text,
            shape => {
                let words = format!("the name of a {what} in quotes");
                let key = Value { span, shape };
                reading.mismatch(&key, &Expected::Described(Form::Quoted, words.into()));
                // What was meant is known: others may refer to it.
                match key.bare_name() {
                    Some(name) => name.to_owned(),
                    None => continue,
                }
            }
        };
        if let Some(first) = seen.get(&text) {
            reading.diagnostics.push(twice(span, what, &text, *first));
            continue;
        }
        seen.insert(text.clone(), span);
        entries.push((Name { span, text }, value));
    }
    entries
}

/// True if nothing is to be said of the keys of a map from names.
fn are_distinct_names(pairs: &[(Value, Value)]) -> bool {
    let mut seen = HashSet::with_capacity(pairs.len());
    pairs.iter().all(|(key, _)| matches!(&key.shape, Shape::String(text) if seen.insert(text.as_str())))
}

/// The error of a name that is declared again.
pub(crate) fn twice(span: Span, what: &str, name: &str, first: Span) -> Diagnostic {
    let message = format!("there are two {what}s `{name}`");
    Diagnostic::declared_twice(span, message, first).help("rename or remove one of them")
}

/// Any value, for what only a graph can check.
impl Setting for Value {
    fn expected() -> Expected {
        Expected::described("a value".to_owned())
    }
    fn read(value: &Value, _: &mut Reading<'_>) -> Option<Self> {
        Some(value.clone())
    }
    fn value(&self) -> Value {
        self.clone()
    }
}

/// A text with its place, for messages.
impl Setting for Name {
    fn expected() -> Expected {
        Expected::Text
    }
    fn read(value: &Value, reading: &mut Reading<'_>) -> Option<Self> {
        String::read(value, reading).map(|text| Self { span: value.span, text })
    }
    fn value(&self) -> Value {
        Value::text(&self.text)
    }
}

impl<T: Setting + Copy + Default, const N: usize> Setting for [T; N] {
    const SCALE: Scale = T::SCALE;
    fn expected() -> Expected {
        Expected::Array(N, Box::new(T::expected()))
    }
    fn parts() -> Vec<Part> {
        T::parts()
    }
    fn read(value: &Value, reading: &mut Reading<'_>) -> Option<Self> {
        let values = match &value.shape {
            Shape::List(values) => values,
            Shape::Tagged(Tagged { name: None, body: Body::Tuple(values) }) => values,
            _ => {
                reading.mismatch(value, &Self::expected());
                return None;
            }
        };
        if values.len() != N {
            reading.miscounted(value, &format!("{N} values, each {}", T::expected()), values.len());
            return None;
        }
        let mut read = [T::default(); N];
        for (slot, value) in read.iter_mut().zip(values) {
            *slot = T::read(value, reading)?;
        }
        Some(read)
    }
    fn value(&self) -> Value {
        Shape::List(self.iter().map(T::value).collect()).into()
    }
    fn numbers(&self) -> Vec<f64> {
        self.iter().flat_map(T::numbers).collect()
    }
}
