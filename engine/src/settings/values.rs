//! The types that settings can have.

use super::{Expected, Part, Reading, Scale, Setting};
use crate::diagnostic::{Diagnostic, Span};
use crate::document::value::{Body, Shape, Tagged, Value};
use haptograph_signal::files::{self, Roots};
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
