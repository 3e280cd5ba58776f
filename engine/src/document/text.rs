//! Parser of RON text into values with places.
//!
//! The ron crate keeps no places and stops at the first error. This parser has three linear passes: tokens, brackets
//! and values. It continues after an error at the next comma. String escapes are parsed by ron.

mod tokens;

use super::value::{Body, Name, Shape, Tagged, Value};
use crate::diagnostic::{Diagnostic, SourceId, Span};
use std::borrow::Cow;
pub(super) use tokens::is_name;
use tokens::{Lexeme, Token};

/// Deeper nesting of brackets is refused, so that no file can overflow the stack.
pub(super) const MAX_DEPTH: usize = 64;
/// Largest number of items for which memory is reserved before they are read: most of them may be wrong.
const MAX_RESERVED: usize = 1 << 16;
/// Number of syntax errors after which the parser stops.
const MAX_ERRORS: usize = 20;

/// Reads one value that is the whole of `text`.
///
/// If the text has an error, at least one diagnostic is added and the value must not be used.
pub(crate) fn read(source: SourceId, text: &str, diagnostics: &mut Vec<Diagnostic>) -> Option<Value> {
    let before = diagnostics.len();
    let lexemes = tokens::scan(source, text, diagnostics);
    if let Some(first) = beginning_of_prose(text, &lexemes) {
        // Every line of it would be wrong in its own way.
        diagnostics.truncate(before);
        let span = Span { source, start: first.start, end: first.end };
        let found = &text[first.start..first.end];
        let message = format!("this does not begin like a graph: found `{found}`");
        let help = "a graph file holds one `Graph(format: 1, nodes: { ... })`; is this the file you meant?";
        diagnostics
            .push(Diagnostic::error("E0110", span, message).label("not the beginning of a value").help(help));
        return None;
    }
    let partners = tokens::match_brackets(source, text, &lexemes, diagnostics)?;
    let mut reader = Reader { source, text, lexemes, partners, at: 0, diagnostics };
    reader.skip_extensions();
    if reader.token().is_none() {
        let diagnostic = Diagnostic::error("E0110", reader.span(), "the file is empty");
        let help = "begin with `Graph(format: 1, nodes: { ... })`";
        reader.diagnostics.push(diagnostic.label("nothing to read").help(help));
        return None;
    }
    let value = reader.value(0);
    if value.is_some() && reader.at < reader.lexemes.len() {
        reader.unexpected("the end of the file");
    }
    diagnostics.truncate(before + MAX_ERRORS);
    value.filter(|_| diagnostics.len() == before)
}

/// The first token of a text that is no value: of words, or of a sign that RON does not have.
fn beginning_of_prose<'l>(text: &str, lexemes: &'l [Lexeme]) -> Option<&'l Lexeme> {
    let mut rest = lexemes.iter().skip_while(|lexeme| lexeme.token == Token::Attribute);
    let first = rest.next()?;
    let is_prose = match (first.token, rest.next().map(|next| next.token)) {
        (Token::Mistaken, _) => !text[first.start..].starts_with(['\'', '-', '+', '\u{201c}']),
        (Token::Name, Some(next)) => next != Token::Open && next != Token::Close,
        _ => false,
    };
    is_prose.then_some(first)
}

struct Reader<'a> {
    source: SourceId,
    text: &'a str,
    lexemes: Vec<Lexeme>,
    /// Index of the closing bracket of each opening one.
    partners: Vec<usize>,
    at: usize,
    diagnostics: &'a mut Vec<Diagnostic>,
}

impl Reader<'_> {
    fn token(&self) -> Option<Token> {
        self.lexemes.get(self.at).map(|lexeme| lexeme.token)
    }

    fn next_token(&self) -> Option<Token> {
        self.lexemes.get(self.at + 1).map(|lexeme| lexeme.token)
    }

    /// The place of the present token; at the end, just past the last one.
    fn span(&self) -> Span {
        match self.lexemes.get(self.at) {
            Some(lexeme) => self.span_of(lexeme.start, lexeme.end),
            None => {
                let end = self.lexemes.last().map_or(0, |last| last.end);
                self.span_of(end, end)
            }
        }
    }

    fn span_of(&self, start: usize, end: usize) -> Span {
        Span { source: self.source, start, end }
    }

    fn slice(&self) -> &str {
        self.lexemes.get(self.at).map_or("", |lexeme| &self.text[lexeme.start..lexeme.end])
    }

    fn found(&self) -> String {
        match self.token() {
            None => "the end of the file".into(),
            Some(Token::String | Token::RawString) => "a string".into(),
            Some(_) => format!("`{}`", self.slice()),
        }
    }

    fn unexpected(&mut self, expected: &str) {
        if self.token() == Some(Token::Mistaken) {
            return; // Reported when it was scanned.
        }
        let name = self.name_before_bracket();
        let bracket = name.map(|name| format!("`(` after `{name}`"));
        let expected = bracket.as_deref().unwrap_or(expected);
        let message = format!("expected {expected}, found {}", self.found());
        let label = format!("expected {expected}");
        let mut diagnostic = Diagnostic::error("E0101", self.span(), message).label(label);
        if let Some(string) = self.string_over_lines() {
            diagnostic = diagnostic
                .also(string, "this string continues over the end of its line")
                .help("is the closing `\"` of that string missing?");
        }
        if let Some(name) = name {
            diagnostic = diagnostic.help(format!("put the fields in parentheses: `{name}(...)`"));
        }
        self.diagnostics.push(diagnostic);
    }

    /// The name before a bracket that is not round: `Graph {`.
    fn name_before_bracket(&self) -> Option<&str> {
        let name = self.lexemes.get(self.at.checked_sub(1)?)?;
        let follows = name.token == Token::Name && matches!(self.slice(), "{" | "[");
        follows.then(|| &self.text[name.start..name.end])
    }

    /// A string near by that holds a line break: the usual trace of a forgotten quote.
    fn string_over_lines(&self) -> Option<Span> {
        let near = self.at.saturating_sub(3)..(self.at + 1).min(self.lexemes.len());
        let strings = self.lexemes.get(near)?.iter().rev();
        let long = strings
            .filter(|lexeme| lexeme.token == Token::String)
            .find(|lexeme| self.text[lexeme.start..lexeme.end].contains('\n'))?;
        let line = self.text[long.start..long.end].find('\n').map_or(long.end, |i| long.start + i);
        Some(self.span_of(long.start, line))
    }

    /// Skips `#![enable(implicit_some)]` and other extensions of ron, which change nothing here.
    fn skip_extensions(&mut self) {
        while self.token() == Some(Token::Attribute) {
            self.at += 1;
        }
    }

    fn value(&mut self, depth: usize) -> Option<Value> {
        let span = self.span();
        let shape = match self.token() {
            Some(Token::String | Token::RawString) => Shape::String(self.string()?),
            Some(Token::Number) => self.number()?,
            Some(Token::Name) => return self.named(depth),
            Some(Token::Open) if depth >= MAX_DEPTH => {
                self.diagnostics.push(
                    Diagnostic::error("E0104", span, "brackets are nested too deeply")
                        .label(format!("this is level {}", depth + 1))
                        .help(format!("at most {MAX_DEPTH} levels are read")),
                );
                self.at = self.partners[self.at] + 1;
                return None;
            }
            Some(Token::Open) => {
                let close = self.partners[self.at];
                let shape = match self.slice() {
                    "[" => Shape::List(self.items(close, |reader| reader.value(depth + 1))),
                    "{" => Shape::Map(self.items(close, |reader| reader.pair(depth + 1))),
                    _ => match self.body(depth) {
                        Body::Tuple(values) if values.is_empty() => Shape::Unit,
                        body => Shape::Tagged(Tagged { name: None, body }),
                    },
                };
                let end = self.lexemes[close].end;
                return Some(Value { span: self.span_of(span.start, end), shape });
            }
            _ => {
                self.unexpected("a value");
                return None;
            }
        };
        self.at += 1;
        Some(Value { span, shape })
    }

    fn named(&mut self, depth: usize) -> Option<Value> {
        let span = self.span();
        let text = self.slice().to_owned();
        let plain = match text.as_str() {
            "true" => Some(Shape::Bool(true)),
            "false" => Some(Shape::Bool(false)),
            "inf" => Some(Shape::Number(f64::INFINITY, text.clone())),
            "NaN" => Some(Shape::Number(f64::NAN, text.clone())),
            _ => None,
        };
        if let Some(shape) = plain {
            self.at += 1;
            return Some(Value { span, shape });
        }
        let name = Some(Name { span, text });
        self.at += 1;
        if self.token() != Some(Token::Open) || self.slice() != "(" {
            let body = Body::Bare;
            return Some(Value { span, shape: Shape::Tagged(Tagged { name, body }) });
        }
        let inner = self.value(depth)?;
        let body = match inner.shape {
            Shape::Tagged(Tagged { body, .. }) => body,
            _ => Body::Tuple(Vec::new()),
        };
        let shape = Shape::Tagged(Tagged { name, body });
        let span = self.span_of(span.start, inner.span.end);
        Some(Value { span, shape })
    }

    /// The content of the present round brackets.
    fn body(&mut self, depth: usize) -> Body {
        let close = self.partners[self.at];
        if self.holds_fields(close) {
            Body::Fields(self.items(close, |reader| reader.field(depth + 1)).into())
        } else {
            Body::Tuple(self.items(close, |reader| reader.value(depth + 1)))
        }
    }

    /// True if any item of these round brackets is a field.
    fn holds_fields(&self, close: usize) -> bool {
        let mut at = self.at + 1;
        let mut begins = true;
        while at < close {
            let token = self.lexemes[at].token;
            let is_name = matches!(token, Token::Name | Token::String);
            if begins && is_name && self.lexemes[at + 1].token == Token::Colon {
                return true;
            }
            begins = token == Token::Comma;
            at = match token {
                Token::Open => self.partners[at] + 1,
                _ => at + 1,
            };
        }
        false
    }

    /// The number of items in the present brackets, if nothing is wrong in them.
    fn count(&self, close: usize) -> usize {
        let mut at = self.at + 1;
        let mut count = usize::from(at < close && self.lexemes[close - 1].token != Token::Comma);
        while at < close {
            let token = self.lexemes[at].token;
            count += usize::from(token == Token::Comma);
            at = if token == Token::Open { self.partners[at] + 1 } else { at + 1 };
        }
        count
    }

    /// Items separated by commas, from the opening bracket at hand to just past its closing one.
    fn items<T>(&mut self, close: usize, mut item: impl FnMut(&mut Self) -> Option<T>) -> Vec<T> {
        let closing = &self.text[self.lexemes[close].start..self.lexemes[close].end];
        let mut items = Vec::with_capacity(self.count(close).min(MAX_RESERVED));
        self.at += 1;
        while self.at < close {
            if self.diagnostics.len() >= MAX_ERRORS {
                break;
            }
            match item(self) {
                Some(item) => items.push(item),
                None => self.skip_to_comma(close),
            }
            if self.at >= close {
                break;
            }
            if self.token() == Some(Token::Comma) {
                self.at += 1;
                continue;
            }
            self.expected_comma(closing);
            // A value that follows is most likely the next item; anything else would only repeat the error.
            if matches!(self.token(), Some(Token::Colon | Token::Mistaken)) {
                self.skip_to_comma(close);
                self.at += usize::from(self.at < close);
            }
        }
        self.at = close + 1;
        items
    }

    fn expected_comma(&mut self, closing: &str) {
        let errors = self.diagnostics.len();
        self.unexpected(&format!("`,` or `{closing}`"));
        let Some(before) = self.at.checked_sub(1).and_then(|i| self.lexemes.get(i)) else {
            return;
        };
        let end = self.span_of(before.end, before.end);
        let starts_an_item = !matches!(self.token(), Some(Token::Open | Token::Colon));
        if let Some(diagnostic) = self.diagnostics.get_mut(errors)
            && diagnostic.secondary.is_empty()
            && starts_an_item
        {
            *diagnostic = diagnostic.clone().also(end, "a comma may be missing here");
        }
    }

    fn skip_to_comma(&mut self, close: usize) {
        while self.at < close && self.token() != Some(Token::Comma) {
            self.at = match self.token() {
                Some(Token::Open) => self.partners[self.at] + 1,
                _ => self.at + 1,
            };
        }
    }

    /// `name: value`
    fn field(&mut self, depth: usize) -> Option<(Name, Value)> {
        let name = Name { span: self.span(), text: self.slice().trim_matches('"').to_owned() };
        match (self.token(), self.next_token()) {
            (Some(Token::Name), Some(Token::Colon)) => {}
            (Some(Token::String), Some(Token::Colon)) => self.diagnostics.push(
                Diagnostic::error("E0101", name.span, "a field's name is written without quotes")
                    .label("quoted name in round brackets")
                    .help(format!("write `{}: ...`, or use {{ }} for a map", name.text)),
            ),
            (Some(Token::Name), _) => {
                self.at += 1;
                self.unexpected("`:` and a value");
                return None;
            }
            (Some(Token::String), _) => {
                let help = format!("inputs are named: `input: {}`", self.slice());
                let message = "expected `name: value`, found a string";
                let diagnostic = Diagnostic::error("E0101", name.span, message);
                self.diagnostics.push(diagnostic.label("expected `name: value`").help(help));
                return None;
            }
            _ if self.refuse_decimal_comma() => return None,
            _ => {
                self.unexpected("`name: value`");
                return None;
            }
        }
        self.at += 2;
        Some((name, self.value(depth)?))
    }

    /// `key: value`
    fn pair(&mut self, depth: usize) -> Option<(Value, Value)> {
        if self.next_token() != Some(Token::Colon) && self.refuse_decimal_comma() {
            return None;
        }
        let key = self.value(depth)?;
        if self.token() != Some(Token::Colon) {
            self.unexpected("`:` and a value");
            return None;
        }
        self.at += 1;
        Some((key, self.value(depth)?))
    }

    /// Reports `80,5`, where the number at hand follows a comma that follows a number.
    fn refuse_decimal_comma(&mut self) -> bool {
        let Some([whole, comma, part]) =
            self.at.checked_sub(2).and_then(|start| self.lexemes.get(start..=self.at))
        else {
            return false;
        };
        let is_written_so = (whole.token, comma.token, part.token)
            == (Token::Number, Token::Comma, Token::Number)
            && (whole.end, comma.end) == (comma.start, part.start);
        let (start, end) = (whole.start, part.end);
        let written = &self.text[start..end];
        let with_point = written.replacen(',', ".", 1);
        if !is_written_so || with_point.parse::<f64>().is_err() {
            return false;
        }
        let message = format!("`{written}` is not a number");
        let diagnostic = Diagnostic::error("E0106", self.span_of(start, end), message)
            .label("not a number")
            .help(format!("a decimal point is `.`: write `{with_point}`"));
        self.diagnostics.push(diagnostic);
        self.at += 1;
        true
    }

    /// A word behind the number at hand, where it stands as its unit: `80 Hz`.
    fn unit(&self) -> Option<&str> {
        let [number, unit, after] = self.lexemes.get(self.at..self.at + 3)? else {
            return None;
        };
        let is_unit = unit.token == Token::Name && matches!(after.token, Token::Comma | Token::Close);
        let is_beside = !self.text[number.end..unit.start].contains('\n');
        (is_unit && is_beside).then(|| &self.text[unit.start..unit.end])
    }

    fn string(&mut self) -> Option<String> {
        let raw = self.slice();
        if self.token() == Some(Token::RawString) {
            let inner = raw.trim_start_matches('r');
            let hashes = inner.bytes().take_while(|b| *b == b'#').count();
            let inner = inner.get(hashes + 1..inner.len().checked_sub(hashes + 1)?)?;
            return Some(inner.to_owned());
        }
        let inner = raw.get(1..raw.len().checked_sub(1)?)?;
        if !inner.contains('\\') {
            return Some(inner.to_owned());
        }
        match ron::from_str::<String>(raw) {
            Ok(text) => Some(text),
            Err(error) => {
                let diagnostic = Diagnostic::error("E0106", self.span(), "invalid escape in this string")
                    .label(error.code.to_string())
                    .help("write `\\\\` for a backslash, or use a raw string r\"...\"");
                self.diagnostics.push(diagnostic);
                self.at += 1;
                None
            }
        }
    }

    fn number(&mut self) -> Option<Shape> {
        let written = self.slice();
        let plain = match written.contains('_') {
            true => Cow::from(written.replace('_', "")),
            false => written.into(),
        };
        let (sign, digits) = match plain.strip_prefix('-') {
            Some(digits) => ("-", digits),
            None => ("", plain.strip_prefix('+').unwrap_or(&plain)),
        };
        let radix = match digits.get(..2) {
            Some("0x") => 16,
            Some("0o") => 8,
            Some("0b") => 2,
            _ => 10,
        };
        let text = if radix == 10 {
            Some(plain.strip_prefix('+').unwrap_or(&plain).to_owned())
        } else {
            u64::from_str_radix(&digits[2..], radix).ok().map(|n| format!("{sign}{n}"))
        };
        // RON has no `_` right after a point, none in or right after `0x`, and none in `NaN` and `inf`.
        let unsigned = written.trim_start_matches(['+', '-']);
        let is_split = radix != 10 && (unsigned[..2] != digits[..2] || unsigned[2..].starts_with('_'));
        let is_word = unsigned.contains('_') && unsigned.starts_with(char::is_alphabetic);
        if !(is_split || is_word || written.contains("._"))
            && let Some(text) = text
            && let Ok(number) = text.parse::<f64>()
        {
            let Some(unit) = self.unit() else {
                return Some(Shape::Number(number, text));
            };
            let help = without_unit(written, unit);
            let end = self.lexemes[self.at + 1].end;
            let span = self.span_of(self.span().start, end);
            let message = format!("`{}` is not a number", &self.text[span.start..span.end]);
            let diagnostic = Diagnostic::error("E0106", span, message);
            self.diagnostics.push(diagnostic.label("not a number").help(help));
            self.at += 2;
            return None;
        }
        let message = format!("`{written}` is not a number");
        let mut diagnostic = Diagnostic::error("E0106", self.span(), message).label("not a number");
        let number = written.trim_end_matches(char::is_alphabetic);
        if radix == 10 && number != written && number.parse::<f64>().is_ok() {
            diagnostic = diagnostic.help(without_unit(number, &written[number.len()..]));
        }
        self.diagnostics.push(diagnostic);
        self.at += 1;
        None
    }
}

/// Help for a number that was written with a unit.
fn without_unit(number: &str, unit: &str) -> String {
    let general = format!("units are in the setting's name; write `{number}`");
    match (unit, number.parse::<f64>()) {
        ("dB", Ok(db)) => {
            let factor = 10_f64.powf(db / 20.0);
            format!("{general}, or where a factor is set, `{factor:.4}`")
        }
        _ => general,
    }
}

#[cfg(test)]
mod tests;
