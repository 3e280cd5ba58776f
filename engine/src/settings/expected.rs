//! The accepted values of a setting: one description for the reference, for messages and for their corrections.

use std::borrow::Cow;
use std::fmt;

/// The accepted values of a setting. Displayed as in the reference of nodes: `a number`, `one of Direct, Lattice`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Expected {
    /// A finite number.
    Number,
    /// A whole number.
    Whole {
        /// The largest that its type holds.
        most: u64,
    },
    /// True or false.
    Flag,
    /// A string.
    Text,
    /// A path, relative to the file that it is written in.
    Path,
    /// One of these names.
    Choice(Vec<&'static str>),
    /// A structure of these fields.
    Structure(Vec<&'static str>),
    /// A value or `None`.
    Optional(Box<Expected>),
    /// Any number of values.
    List(Box<Expected>),
    /// This many values.
    Array(usize, Box<Expected>),
    /// Another value, described in words.
    Described(Form, Cow<'static, str>),
}

/// The form of an expected value, as far as the correction of a wrong one depends on it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Form {
    /// A number, or a fixed number of them.
    Number,
    /// A list of numbers of any length.
    NumberList,
    /// A list of something else.
    List,
    /// Text in quotes.
    Quoted,
    /// Anything else.
    Other,
}

impl Expected {
    /// A value that `words` describe, without a common correction.
    pub fn described(words: impl Into<Cow<'static, str>>) -> Self {
        Self::Described(Form::Other, words.into())
    }

    /// The form of such a value.
    pub fn form(&self) -> Form {
        match self {
            Self::Number | Self::Whole { .. } => Form::Number,
            Self::Text | Self::Path => Form::Quoted,
            Self::Flag | Self::Choice(_) | Self::Structure(_) => Form::Other,
            Self::Optional(inner) | Self::Array(_, inner) => inner.form(),
            Self::List(inner) => match inner.form() {
                Form::Number => Form::NumberList,
                _ => Form::List,
            },
            Self::Described(form, _) => *form,
        }
    }

    /// True if a number, or a list of numbers, is expected.
    pub fn is_numeric(&self) -> bool {
        matches!(self.form(), Form::Number | Form::NumberList)
    }

    /// True if a whole number, or `None`, is expected.
    pub fn is_whole(&self) -> bool {
        match self {
            Self::Whole { .. } => true,
            Self::Optional(inner) => inner.is_whole(),
            _ => false,
        }
    }

    /// True if the numbers of a list, or the only one, are whole.
    pub fn has_whole_numbers(&self) -> bool {
        match self {
            Self::Whole { .. } => true,
            Self::Optional(inner) | Self::List(inner) | Self::Array(_, inner) => inner.has_whole_numbers(),
            _ => false,
        }
    }

    /// The description for messages, with the bounds of the type.
    pub(super) fn in_message(&self) -> Cow<'_, str> {
        match self {
            Self::Number => "a finite number".into(),
            Self::Whole { most } => format!("a whole number from 0 to {most}").into(),
            Self::Text => "a string in quotes".into(),
            Self::Path => "a path in quotes".into(),
            Self::Described(_, words) => Cow::Borrowed(&**words),
            other => other.to_string().into(),
        }
    }
}

/// The form of a structure of these fields: `(peak_a: ..., continuous_a: ...)`.
pub(crate) fn written(fields: &[&str]) -> String {
    format!("({}: ...)", fields.join(": ..., "))
}

impl fmt::Display for Expected {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Number => f.write_str("a number"),
            Self::Whole { .. } => f.write_str("a whole number"),
            Self::Flag => f.write_str("true or false"),
            Self::Text => f.write_str("a string"),
            Self::Path => f.write_str("a path in quotes, relative to this file"),
            Self::Choice(names) => write!(f, "one of {}", names.join(", ")),
            Self::Structure(fields) => write!(f, "a structure {}", written(fields)),
            Self::Optional(inner) => write!(f, "{inner} or None"),
            Self::List(inner) => write!(f, "a list [...], each {inner}"),
            Self::Array(2, inner) => write!(f, "a pair [x, y], each {inner}"),
            Self::Array(3, inner) => write!(f, "three values [x, y, z], each {inner}"),
            Self::Array(count, inner) => write!(f, "a list of {count} values, each {inner}"),
            Self::Described(_, words) => f.write_str(words),
        }
    }
}
