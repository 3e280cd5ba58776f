//! What is wrong with a text that is not the RON of a file: its parser's message misleads where a file is empty, cut off or
//! of another kind.

use super::Place;
use ron::error::SpannedError;

/// Reason why a text is not the RON of a file.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Malformed {
    /// Nothing but blanks and comments.
    #[error("the file is empty; it has to begin with `{root}(`")]
    Empty {
        /// The name that the file begins with.
        root: &'static str,
    },
    /// A file of another kind.
    #[error("the file begins with `{found}`; it has to begin with `{root}(`")]
    OtherKind {
        /// The name that the file begins with.
        root: &'static str,
        /// Its first word.
        found: String,
    },
    /// The file ends early.
    #[error("the file is incomplete: it ends inside {inside}; copy it again, or make it again")]
    Incomplete {
        /// What is open at its end.
        inside: &'static str,
    },
    /// Any other error.
    #[error("{message}")]
    Syntax {
        /// The parser's message.
        message: String,
    },
}

/// Longest first word in a message, characters.
const MAX_WORD: usize = 24;

impl Malformed {
    /// The place and the reason of a parser's error in a text that has to begin with `root`.
    pub fn of(text: &str, root: &'static str, error: SpannedError) -> (Place, Self) {
        let start = error.span.start;
        let place = Place { line: start.line, column: start.col };
        let scanned = scan(text);
        let Some(begin) = scanned.begin else {
            return (place, Self::Empty { root });
        };
        let content = &text[begin..];
        if ![root, "(", "#!["].iter().any(|own| content.starts_with(own)) {
            let is_end = |c: char| c.is_whitespace() || c == '(';
            let word = content.split(is_end).next().unwrap_or_default();
            let found = word.chars().take(MAX_WORD).collect();
            return (Place::after(&text[..begin]), Self::OtherKind { root, found });
        }
        // Of a lone sign the parser names what comes before the blanks.
        let last = Place::after(text[..scanned.last].trim_end());
        let message = error.code.to_string();
        let reason = match scanned.inside {
            Some(inside) if (place.line, place.column) >= (last.line, last.column) => {
                Self::Incomplete { inside }
            }
            _ => Self::Syntax { message },
        };
        (place, reason)
    }
}

/// Where a text begins, its last token, and what is open at its end.
struct Scanned {
    begin: Option<usize>,
    last: usize,
    inside: Option<&'static str>,
}

/// Scans the tokens of a text. Raw strings are not known: no program writes them into these files.
fn scan(text: &str) -> Scanned {
    // A byte each, as a text may open as many as it is long.
    let (mut begin, mut last, mut open) = (None, 0, Vec::<u8>::new());
    let mut rest = text;
    while let Some(first) = rest.chars().next() {
        let at = text.len() - rest.len();
        let past = |end: Option<usize>, marks: usize| end.map_or(rest.len(), |end| end + marks);
        let length = match first {
            _ if first.is_whitespace() => first.len_utf8(),
            _ if rest.starts_with("//") => past(rest.find('\n'), 0),
            _ if rest.starts_with("/*") => past(rest.find("*/"), 2),
            _ => {
                begin = begin.or(Some(at));
                last = at;
                match first {
                    '"' => match end_of_string(rest) {
                        Some(end) => end,
                        None => {
                            open.push(b'"');
                            rest.len()
                        }
                    },
                    '(' | '[' | '{' => {
                        open.push(first as u8);
                        1
                    }
                    ')' | ']' | '}' => {
                        open.pop();
                        1
                    }
                    ',' | ':' => 1,
                    _ => {
                        let is_end = |c: char| c.is_whitespace() || "()[]{},:\"".contains(c);
                        past(rest.find(is_end), 0)
                    }
                }
            }
        };
        rest = &rest[length..];
    }
    Scanned {
        begin,
        last,
        inside: open.pop().map(|opener| match opener {
            b'(' => "round brackets",
            b'[' => "a list",
            b'{' => "a map",
            _ => "a text",
        }),
    }
}

/// Length of the string that a text begins with, quotes included.
fn end_of_string(text: &str) -> Option<usize> {
    let mut is_escaped = false;
    let mut letters = text.char_indices().skip(1);
    let (end, _) = letters.find(|(_, letter)| {
        let ends = *letter == '"' && !is_escaped;
        is_escaped = *letter == '\\' && !is_escaped;
        ends
    })?;
    Some(end + 1)
}
