//! Positions in a text, as bytes and as the protocol's lines and UTF-16 units, and the syntactic context of a
//! position.

use serde_json::{Value, json};

/// Start bytes of the lines of a text.
pub(super) struct Positions<'t> {
    text: &'t str,
    lines: Vec<usize>,
}

impl<'t> Positions<'t> {
    pub(super) fn of(text: &'t str) -> Self {
        let after = text.match_indices('\n').map(|(at, _)| at + 1);
        Self { text, lines: std::iter::once(0).chain(after).collect() }
    }

    /// The protocol's `Range` of a range of bytes.
    pub(super) fn range(&self, start: usize, end: usize) -> Value {
        json!({ "start": self.position(start), "end": self.position(end.max(start)) })
    }

    fn position(&self, byte: usize) -> Value {
        let byte = floor_boundary(self.text, byte);
        let line = self.lines.partition_point(|start| *start <= byte) - 1;
        let before = &self.text[self.lines[line]..byte];
        json!({ "line": line, "character": before.encode_utf16().count() })
    }

    /// The byte at a line and a number of UTF-16 units, clamped to the text.
    pub(super) fn byte(&self, text: &str, line: usize, units: usize) -> usize {
        let Some(&start) = self.lines.get(line) else {
            return text.len();
        };
        let end = self.lines.get(line + 1).map_or(text.len(), |next| next - 1);
        let mut left = units;
        for (at, letter) in text[start..end].char_indices() {
            if left < letter.len_utf16() {
                return start + at;
            }
            left -= letter.len_utf16();
        }
        end
    }
}

fn floor_boundary(text: &str, byte: usize) -> usize {
    (0..=byte.min(text.len())).rev().find(|at| text.is_char_boundary(*at)).unwrap_or(0)
}

/// Syntactic context of a position.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Context {
    /// Inside quotes.
    Connection,
    /// Inside the parentheses of this kind.
    Fields(String),
    /// Anywhere else, where a kind may stand.
    Other,
}

/// The syntactic context of a byte of a text.
pub(super) fn context(text: &str, at: usize) -> Context {
    let before = &text[..floor_boundary(text, at)];
    // The names before the open brackets; the flag is true if the last one is after a field's colon.
    let mut open: Vec<(&str, bool)> = Vec::new();
    let (mut in_string, mut name_start, mut last_name) = (false, None, "");
    let mut letters = before.char_indices().peekable();
    while let Some((i, letter)) = letters.next() {
        if in_string {
            match letter {
                '\\' => drop(letters.next()),
                '"' => in_string = false,
                _ => {}
            }
            continue;
        }
        if letter == '/' && before[i..].starts_with("//") {
            while letters.next_if(|(_, letter)| *letter != '\n').is_some() {}
            continue;
        }
        if letter.is_alphanumeric() || letter == '_' {
            let start = *name_start.get_or_insert(i);
            last_name = &before[start..i + letter.len_utf8()];
            continue;
        }
        name_start = None;
        match letter {
            '"' => in_string = true,
            '(' | '[' | '{' => open.push((if letter == '(' { last_name } else { "" }, false)),
            ')' | ']' | '}' => drop(open.pop()),
            ':' => open.last_mut().into_iter().for_each(|(_, valued)| *valued = true),
            ',' => open.last_mut().into_iter().for_each(|(_, valued)| *valued = false),
            _ => {}
        }
        if !letter.is_whitespace() {
            last_name = "";
        }
    }
    match open.last() {
        _ if in_string => Context::Connection,
        Some((kind, false)) if kind.starts_with(char::is_uppercase) => Context::Fields((*kind).to_owned()),
        _ => Context::Other,
    }
}

/// The word around a byte of a text.
pub(super) fn word_at(text: &str, at: usize) -> Option<&str> {
    let at = floor_boundary(text, at);
    let is_word = |letter: char| letter.is_alphanumeric() || letter == '_';
    let start = text[..at]
        .rfind(|letter| !is_word(letter))
        .map_or(0, |before| before + text[before..].chars().next().map_or(1, char::len_utf8));
    let end = text[at..].find(|letter| !is_word(letter)).map_or(text.len(), |after| at + after);
    (start < end).then(|| &text[start..end])
}
