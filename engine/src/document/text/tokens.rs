//! Text into tokens, and brackets to their partners.

use crate::diagnostic::{Diagnostic, SourceId, Span};
use crate::formula::{Formula, names};
use unicode_ident::{is_xid_continue, is_xid_start};

/// Characters that are white space in RON.
const WHITE: [char; 11] =
    [' ', '\t', '\n', '\r', '\u{b}', '\u{c}', '\u{85}', '\u{200e}', '\u{200f}', '\u{2028}', '\u{2029}'];

/// Bytes of a token and the white space behind it in most files.
const BYTES_A_TOKEN: usize = 6;

/// Kind of a token. Its text is a slice of the source.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Token {
    /// `(`, `[` or `{`
    Open,
    /// `)`, `]` or `}`
    Close,
    Comma,
    Colon,
    Name,
    Number,
    String,
    /// `r"..."`, `r#"..."#`
    RawString,
    /// `#![...]`
    Attribute,
    /// Text that is no token and has been reported.
    Mistaken,
}

#[derive(Debug, Clone, Copy)]
pub(super) struct Lexeme {
    pub token: Token,
    pub start: usize,
    pub end: usize,
}

/// All tokens of `text`. Text that is not a token is reported, and replaced by the most likely token.
pub(super) fn scan(source: SourceId, text: &str, diagnostics: &mut Vec<Diagnostic>) -> Vec<Lexeme> {
    let lexemes = Vec::with_capacity(text.len() / BYTES_A_TOKEN);
    let most = diagnostics.len() + MAX_FINDINGS;
    let mut scanner = Scanner { source, text, at: 0, lexemes, diagnostics, most };
    let mut tried = 0;
    while let Some(c) = scanner.rest().chars().next() {
        if "+-*/%^".contains(c) && tried < MAX_TRIED && scanner.is_arithmetic(c) {
            tried += 1;
            if let Some(found) = arithmetic(text, scanner.at, c) {
                scanner.at = found.end;
                scanner.refuse_arithmetic(&found);
                continue;
            }
        }
        let Some((token, length)) = scanner.next(c) else { break };
        let start = scanner.at;
        scanner.at += length;
        scanner.lexemes.extend(token.map(|token| Lexeme { token, start, end: start + length }));
    }
    scanner.lexemes
}

struct Scanner<'a> {
    source: SourceId,
    text: &'a str,
    at: usize,
    lexemes: Vec<Lexeme>,
    diagnostics: &'a mut Vec<Diagnostic>,
    /// Findings after which no more characters are reported.
    most: usize,
}

impl<'a> Scanner<'a> {
    fn rest(&self) -> &'a str {
        &self.text[self.at..]
    }

    /// The place of the next `length` bytes.
    fn span(&self, length: usize) -> Span {
        Span { source: self.source, start: self.at, end: self.at + length }
    }

    /// The token at hand, which begins with `c`, none for white space and comments, and its length; `None` if it never ends,
    /// which is reported.
    fn next(&mut self, c: char) -> Option<(Option<Token>, usize)> {
        let rest = self.rest();
        let token = |token, length| Some((Some(token), length));
        let line = || rest.find('\n').unwrap_or(rest.len());
        match c {
            '\u{feff}' if self.at == 0 => Some((None, c.len_utf8())),
            c if WHITE.contains(&c) => {
                let more = rest.bytes().skip(1).take_while(|byte| matches!(byte, b' ' | b'\n')).count();
                Some((None, c.len_utf8() + if c.is_ascii() { more } else { 0 }))
            }
            '/' if rest.starts_with("//") => Some((None, line())),
            '/' if rest.starts_with("/*") => {
                let length = comment_length(rest);
                if length.is_none() {
                    let error = Diagnostic::error("E0103", self.span(2), "this comment is never closed");
                    self.diagnostics.push(error.label("opened here").help("close it with `*/`"));
                }
                Some((None, length?))
            }
            '(' | '[' | '{' => token(Token::Open, 1),
            ')' | ']' | '}' => token(Token::Close, 1),
            ',' => token(Token::Comma, 1),
            ':' => token(Token::Colon, 1),
            '"' => self.closed(Token::String, string_length(rest)),
            'r' if rest[1..].starts_with(['"', '#']) => {
                self.closed(Token::RawString, raw_string_length(rest))
            }
            '#' if rest.starts_with("#![") => {
                token(Token::Attribute, rest.find(']').map_or(rest.len(), |i| i + 1))
            }
            '#' | '%' if self.begins_comment(c) => {
                self.refuse_comment(line());
                Some((None, line()))
            }
            c if is_xid_start(c) || c == '_' => token(Token::Name, name_length(rest)),
            c if c.is_ascii_digit() || (matches!(c, '+' | '-' | '.') && number_follows(rest)) => {
                token(Token::Number, number_length(rest))
            }
            _ => {
                let (mistaken, length) = self.mistaken(c);
                token(mistaken, length)
            }
        }
    }

    /// A string; one without an end is reported.
    fn closed(&mut self, token: Token, length: Option<usize>) -> Option<(Option<Token>, usize)> {
        if length.is_none() {
            self.refuse_unclosed_string();
        }
        Some((Some(token), length?))
    }

    /// True if a sign begins a comment, as it does in other languages. A percent sign does where no value can be before it.
    fn begins_comment(&self, sign: char) -> bool {
        let is_between = |last: &Lexeme| {
            matches!(last.token, Token::Comma | Token::Open) || self.text[last.end..self.at].contains('\n')
        };
        sign == '#' || self.lexemes.last().is_some_and(is_between)
    }

    /// Reports a comment of another language; all of them as one.
    fn refuse_comment(&mut self, length: usize) {
        const CODE: &str = "E0111";
        let span = self.span(length);
        // One that is not among the last findings is told again: no file may make this long.
        let known = self.diagnostics.iter_mut().rev().take(500).find(|known| {
            let place = known.primary.as_ref().map(|label| label.span.source);
            known.code == CODE && place == Some(span.source)
        });
        match known {
            Some(known) if known.secondary.len() >= MORE_COMMENTS => {}
            Some(known) => *known = known.clone().also(span, "and this"),
            None => self.diagnostics.push(
                Diagnostic::error(CODE, span, "comments begin with `//`")
                    .label("not a comment in RON")
                    .help("write `//` in its place"),
            ),
        }
    }

    /// The quote at hand has no partner. Where a string before it holds a line break, that one is the likely culprit.
    fn refuse_unclosed_string(&mut self) {
        let over_lines = self.lexemes.iter().find(|lexeme| {
            lexeme.token == Token::String && self.text[lexeme.start..lexeme.end].contains('\n')
        });
        let start = over_lines.map_or(self.at, |lexeme| lexeme.start);
        let end = self.text[start..].find('\n').map_or(self.text.len(), |i| start + i);
        let span = Span { source: self.source, start, end };
        let error = Diagnostic::error("E0103", span, "this string is never closed");
        self.diagnostics.push(error.label("opened here").help("close it with `\"`"));
    }

    /// Reports a character that begins no token, and returns the most likely token in its place.
    fn mistaken(&mut self, c: char) -> (Token, usize) {
        let (rest, own) = (self.rest(), c.len_utf8());
        let until = |close: char| {
            let end = rest[own..].find([close, '\n']).filter(|end| rest[own + end..].starts_with(close));
            end.map_or(own, |end| own + end + close.len_utf8())
        };
        let (token, length, help) = match c {
            '\'' => (Token::Mistaken, until('\''), "strings are written in double quotes: \"...\""),
            '\u{201c}' | '\u{201d}' => (Token::Mistaken, until('\u{201d}'), "use straight quotes: \"...\""),
            '=' => (Token::Colon, 1, "a field is written `name: value`"),
            ';' => (Token::Comma, 1, "separate with `,`"),
            '-' | '+' => (Token::Mistaken, 1, "a sign stands right before its number: `-2`"),
            '\u{2212}' | '\u{2013}' => (Token::Mistaken, own, "write the minus sign of the keyboard: `-2`"),
            _ => (Token::Mistaken, own, "remove it"),
        };
        if self.diagnostics.len() >= self.most {
            return (token, length);
        }
        let help = output_of(self.text, self.at).unwrap_or_else(|| help.to_owned());
        let error = Diagnostic::error("E0101", self.span(length), format!("unexpected `{c}`"));
        self.diagnostics.push(error.label("not part of RON").help(help));
        (token, length)
    }

    /// True if the character is a sign of arithmetic, and not that of a number or of a comment.
    fn is_arithmetic(&self, sign: char) -> bool {
        let ends_value = |token| matches!(token, Token::Number | Token::Name | Token::Close);
        let (rest, before) = (self.rest(), self.lexemes.last());
        let follows = before.is_some_and(|lexeme| lexeme.end == self.at && ends_value(lexeme.token));
        match sign {
            '/' => !rest.starts_with("//") && !rest.starts_with("/*"),
            '+' | '-' => follows || !number_follows(rest),
            _ => matches!(sign, '*' | '%' | '^'),
        }
    }

    /// Reports how to write arithmetic, and uses its first number as the value, so that no missing value is reported too.
    fn refuse_arithmetic(&mut self, &Arithmetic { start, end, result }: &Arithmetic) {
        let expression = &self.text[start..end];
        let help = match result {
            Some(result) => format!("write `Expr(\"{expression}\")`, or the result: `{result}`"),
            None => format!("write `Expr(\"{expression}\")`; names in it are parameters"),
        };
        let source = self.source;
        // What was said of a part of it, `1 + 2` in `(1 + 2) * 3`, is said of the whole.
        let is_part = |at: Span| at.source == source && start <= at.start && at.end <= end;
        self.diagnostics.retain(|known| !known.primary.as_ref().is_some_and(|label| is_part(label.span)));
        let message = "arithmetic has to be written in `Expr(\"...\")`";
        let error = Diagnostic::error("E0101", Span { source, start, end }, message);
        self.diagnostics.push(error.label("RON has no arithmetic").help(help));
        self.lexemes.truncate(self.lexemes.partition_point(|lexeme| lexeme.start < start));
        let first = expression.find(|c: char| c.is_ascii_digit()).map(|digit| start + digit);
        let number = first.map(|first| (first, first + number_length(&self.text[first..end])));
        let from = number.map_or(start, |(_, end)| end);
        self.lexemes.extend(number.map(|(start, end)| Lexeme { token: Token::Number, start, end }));
        self.lexemes.push(Lexeme { token: Token::Mistaken, start: from, end });
    }
}

/// True if a text is one name, and no other value.
pub(in crate::document) fn is_name(text: &str) -> bool {
    let begins = text.starts_with(|c| is_xid_start(c) || c == '_');
    begins && text.chars().all(is_xid_continue) && !["true", "false", "inf", "NaN"].contains(&text)
}

/// Findings of a file after which no more characters are reported: no file may make this long.
const MAX_FINDINGS: usize = 1000;
/// Further comments of another language that are shown.
const MORE_COMMENTS: usize = 3;

fn name_length(rest: &str) -> usize {
    let is_plain = |byte: &u8| byte.is_ascii_alphanumeric() || *byte == b'_';
    let plain = rest.bytes().take_while(is_plain).count();
    plain + rest[plain..].find(|c| !is_xid_continue(c)).unwrap_or(rest.len() - plain)
}

/// Length of a block comment; they nest, as in RON.
fn comment_length(rest: &str) -> Option<usize> {
    let bytes = rest.as_bytes();
    let mut depth = 0_usize;
    let mut at = 0;
    while at + 1 < bytes.len() {
        match &bytes[at..at + 2] {
            b"/*" => depth += 1,
            b"*/" => depth -= 1,
            _ => {
                at += 1;
                continue;
            }
        }
        at += 2;
        if depth == 0 {
            return Some(at);
        }
    }
    None
}

fn string_length(rest: &str) -> Option<usize> {
    let mut escaped = false;
    for (i, byte) in rest.bytes().enumerate().skip(1) {
        match byte {
            _ if escaped => escaped = false,
            b'\\' => escaped = true,
            b'"' => return Some(i + 1),
            _ => {}
        }
    }
    None
}

fn raw_string_length(rest: &str) -> Option<usize> {
    let hashes = rest[1..].bytes().take_while(|b| *b == b'#').count();
    let opening = 1 + hashes + 1;
    if rest.as_bytes().get(opening - 1) != Some(&b'"') {
        return None;
    }
    let closing = format!("\"{}", "#".repeat(hashes));
    Some(opening + rest[opening..].find(&closing)? + closing.len())
}

fn number_follows(rest: &str) -> bool {
    let after = rest[1..].strip_prefix('.').unwrap_or(&rest[1..]);
    after.starts_with(|c: char| c.is_ascii_digit()) || after.starts_with("inf") || after.starts_with("NaN")
}

fn number_length(rest: &str) -> usize {
    let mut before = ' ';
    let hex = rest.trim_start_matches(['+', '-']).starts_with("0x");
    for (i, c) in rest.char_indices() {
        let sign = matches!(c, '+' | '-') && (i == 0 || (matches!(before, 'e' | 'E') && !hex));
        if !(sign || c.is_alphanumeric() || c == '_' || c == '.') {
            return i;
        }
        if c != '_' {
            before = c;
        }
    }
    rest.len()
}

/// Help for `tone.out` without quotes, whose dot is at `start`.
fn output_of(text: &str, start: usize) -> Option<String> {
    let port = text[start..].strip_prefix('.')?;
    let port = &port[..port.find(|c| !is_xid_continue(c)).unwrap_or(port.len())];
    let before = &text[..start];
    let node = before
        .rfind(|c| !is_xid_continue(c))
        .map_or(before, |at| &before[at + before[at..].chars().next().map_or(0, char::len_utf8)..]);
    let is_name = |name: &str| name.starts_with(|c| is_xid_start(c) || c == '_');
    (is_name(node) && is_name(port))
        .then(|| format!("a connection is written in quotes: `\"{node}.{port}\"`"))
}

/// Arithmetic in place of a value, like `2*40`.
struct Arithmetic {
    start: usize,
    end: usize,
    /// The result, if it contains numbers only.
    result: Option<f64>,
}

/// Largest number of signs in a file that are checked for arithmetic around them, and of bytes on each side.
const MAX_TRIED: usize = 200;
const MAX_BYTES: usize = 4096;

/// The arithmetic around its sign at `at`, if what stands there can be computed or named.
fn arithmetic(text: &str, at: usize, sign: char) -> Option<Arithmetic> {
    let (start, end) = (expression_start(&text[..at])?, at + expression_end(&text[at..])?);
    let whole = &text[start..end];
    let expression = whole.trim();
    let names = names(expression);
    let formula = Formula::parse(expression, &names).ok()?;
    if matches!(sign, '+' | '-') && !expression.contains(|c: char| c.is_ascii_digit()) {
        return None; // Most likely a name without quotes.
    }
    let result = names.is_empty().then(|| formula.value(&[]));
    let start = start + whole.len() - whole.trim_start().len();
    Some(Arithmetic {
        start,
        end: start + expression.len(),
        result: result.filter(|result| result.is_finite()),
    })
}

/// Start of the value that ends with `before`: behind the last character that cannot be in a formula.
fn expression_start(before: &str) -> Option<usize> {
    let mut closed = 0_usize;
    for (i, c) in before.char_indices().rev() {
        match c {
            _ if before.len() - i > MAX_BYTES => return None,
            ')' => closed += 1,
            '(' if closed > 0 => closed -= 1,
            '(' | '[' | ']' | '{' | '}' | ':' | '"' | '\n' => return Some(i + 1),
            ',' if closed == 0 => return Some(i + 1),
            _ => {}
        }
    }
    Some(0)
}

/// End of the value that begins with `rest`.
fn expression_end(rest: &str) -> Option<usize> {
    let mut open = 0_usize;
    for (i, c) in rest.char_indices() {
        match c {
            _ if i > MAX_BYTES => return None,
            '(' => open += 1,
            ')' if open > 0 => open -= 1,
            ')' | '[' | ']' | '{' | '}' | ':' | '"' | '\n' => return Some(i),
            ',' if open == 0 => return Some(i),
            '/' if i > 0 && rest[i..].starts_with("//") => return Some(i),
            _ => {}
        }
    }
    Some(rest.len())
}

/// For each opening bracket the index of its closing one; `None` where they do not match, which is reported.
pub(super) fn match_brackets(
    source: SourceId,
    text: &str,
    lexemes: &[Lexeme],
    diagnostics: &mut Vec<Diagnostic>,
) -> Option<Vec<usize>> {
    let span = |lexeme: &Lexeme| Span { source, start: lexeme.start, end: lexeme.end };
    let slice = |lexeme: &Lexeme| &text[lexeme.start..lexeme.end];
    let mut partners = vec![0; lexemes.len()];
    let mut open: Vec<usize> = Vec::new();
    for (i, lexeme) in lexemes.iter().enumerate() {
        match lexeme.token {
            Token::Open => open.push(i),
            Token::Close => {
                let Some(opening) = open.pop() else {
                    let message = format!("unmatched `{}`", slice(lexeme));
                    diagnostics.push(
                        Diagnostic::error("E0102", span(lexeme), message)
                            .label("no bracket is open here")
                            .help("remove it, or look for a bracket that was closed too early"),
                    );
                    return None;
                };
                let needed = closing(slice(&lexemes[opening]));
                if slice(lexeme) != needed {
                    let message = format!("`{}` is never closed", slice(&lexemes[opening]));
                    let mut diagnostic = Diagnostic::error("E0102", span(&lexemes[opening]), message)
                        .label("opened here")
                        .also(span(lexeme), format!("expected `{needed}` before this"));
                    if let Some(outer) = open.last()
                        && closing(slice(&lexemes[*outer])) == slice(lexeme)
                    {
                        diagnostic = diagnostic.also(span(&lexemes[*outer]), "which closes this");
                    }
                    diagnostics.push(diagnostic);
                    return None;
                }
                partners[opening] = i;
            }
            _ => {}
        }
    }
    let Some(&innermost) = open.last() else {
        return Some(partners);
    };
    if diagnostics.iter().any(|known| known.code == "E0103") {
        return None; // A string or comment without an end has swallowed the closing brackets.
    }
    let end = text.trim_end().len();
    let message = format!("`{}` is never closed", slice(&lexemes[innermost]));
    diagnostics.push(
        Diagnostic::error("E0102", span(&lexemes[innermost]), message)
            .label("opened here")
            .also(Span { source, start: end, end }, "the file ends here")
            .help(format!("close it with `{}`", closing(slice(&lexemes[innermost])))),
    );
    None
}

fn closing(open: &str) -> &'static str {
    match open {
        "(" => ")",
        "[" => "]",
        _ => "}",
    }
}
