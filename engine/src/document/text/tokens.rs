//! Text into tokens, and brackets to their partners.

use crate::diagnostic::{Diagnostic, SourceId, Span};
use crate::formula::{Formula, names};
use unicode_ident::{is_xid_continue, is_xid_start};

/// Characters that are white space in RON.
const WHITE: [char; 11] =
    [' ', '\t', '\n', '\r', '\u{b}', '\u{c}', '\u{85}', '\u{200e}', '\u{200f}', '\u{2028}', '\u{2029}'];

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
    let mut lexemes: Vec<Lexeme> = Vec::new();
    let (mut at, mut tried) = (0, 0);
    while let Some(c) = text[at..].chars().next() {
        let rest = &text[at..];
        let start = at;
        if tried < MAX_TRIED && is_arithmetic(rest, c, at, lexemes.last()) {
            tried += 1;
            if let Some(found) = arithmetic(text, start, c) {
                at = found.end;
                found.report(source, text, &mut lexemes, diagnostics);
                continue;
            }
        }
        let token = match c {
            '\u{feff}' if at == 0 => None,
            c if WHITE.contains(&c) => None,
            '/' if rest.starts_with("//") => {
                at += rest.find('\n').unwrap_or(rest.len());
                continue;
            }
            '/' if rest.starts_with("/*") => match comment_length(rest) {
                Some(length) => {
                    at += length;
                    continue;
                }
                None => {
                    let span = Span { source, start, end: start + 2 };
                    diagnostics.push(
                        Diagnostic::error("E0103", span, "this comment is never closed")
                            .label("opened here")
                            .help("close it with `*/`"),
                    );
                    break;
                }
            },
            '(' | '[' | '{' => Some((Token::Open, 1)),
            ')' | ']' | '}' => Some((Token::Close, 1)),
            ',' => Some((Token::Comma, 1)),
            ':' => Some((Token::Colon, 1)),
            '"' => match string_length(rest) {
                Some(length) => Some((Token::String, length)),
                None => {
                    diagnostics.push(unclosed_string(source, text, start, &lexemes));
                    break;
                }
            },
            'r' if rest[1..].starts_with(['"', '#']) => match raw_string_length(rest) {
                Some(length) => Some((Token::RawString, length)),
                None => {
                    diagnostics.push(unclosed_string(source, text, start, &lexemes));
                    break;
                }
            },
            '#' if rest.starts_with("#![") => {
                let length = rest.find(']').map_or(rest.len(), |i| i + 1);
                Some((Token::Attribute, length))
            }
            '#' | '%' if begins_comment(c, text, &lexemes, start) => {
                at += rest.find('\n').unwrap_or(rest.len());
                refuse_comment(Span { source, start, end: at }, diagnostics);
                continue;
            }
            c if is_xid_start(c) || c == '_' => {
                let length = rest.find(|c| !is_xid_continue(c));
                Some((Token::Name, length.unwrap_or(rest.len())))
            }
            c if c.is_ascii_digit() || (matches!(c, '+' | '-' | '.') && number_follows(rest)) => {
                Some((Token::Number, number_length(rest)))
            }
            _ => Some(mistaken(source, start, text, c, diagnostics)),
        };
        match token {
            None => at += c.len_utf8(),
            Some((token, length)) => {
                at += length;
                lexemes.push(Lexeme { token, start, end: at });
            }
        }
    }
    lexemes
}

/// True if a text is one name, and no other value.
pub(in crate::document) fn is_name(text: &str) -> bool {
    let begins = text.starts_with(|c| is_xid_start(c) || c == '_');
    begins && text.chars().all(is_xid_continue) && !["true", "false", "inf", "NaN"].contains(&text)
}

/// True if a sign begins a comment, as it does in other languages. A percent sign does where no value can be before it.
fn begins_comment(sign: char, text: &str, before: &[Lexeme], start: usize) -> bool {
    sign == '#'
        || match before.last() {
            None => false,
            Some(last) => {
                matches!(last.token, Token::Comma | Token::Open) || text[last.end..start].contains('\n')
            }
        }
}

/// Reports a comment of another language; all of them as one.
fn refuse_comment(span: Span, diagnostics: &mut Vec<Diagnostic>) {
    const CODE: &str = "E0111";
    // One that is not among the last findings is told again: no file may make this long.
    let known = diagnostics.iter_mut().rev().take(500).find(|known| {
        let place = known.primary.as_ref().map(|label| label.span.source);
        known.code == CODE && place == Some(span.source)
    });
    match known {
        Some(known) => {
            if known.secondary.len() < MORE_COMMENTS {
                *known = known.clone().also(span, "and this");
            }
        }
        None => diagnostics.push(
            Diagnostic::error(CODE, span, "comments begin with `//`")
                .label("not a comment in RON")
                .help("write `//` in its place"),
        ),
    }
}

/// Further comments of another language that are shown.
const MORE_COMMENTS: usize = 3;

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

/// The quote at `start` has no partner. Where a string before it holds a line break, that one is the likely culprit.
fn unclosed_string(source: SourceId, text: &str, start: usize, before: &[Lexeme]) -> Diagnostic {
    let over_lines = before
        .iter()
        .find(|lexeme| lexeme.token == Token::String && text[lexeme.start..lexeme.end].contains('\n'));
    let start = over_lines.map_or(start, |lexeme| lexeme.start);
    let end = text[start..].find('\n').map_or(text.len(), |i| start + i);
    let span = Span { source, start, end };
    Diagnostic::error("E0103", span, "this string is never closed")
        .label("opened here")
        .help("close it with `\"`")
}

/// Reports a character that begins no token, and returns the most likely token in its place.
fn mistaken(
    source: SourceId,
    start: usize,
    text: &str,
    c: char,
    diagnostics: &mut Vec<Diagnostic>,
) -> (Token, usize) {
    let rest = &text[start..];
    let until = |close: char| {
        let line = &rest[..rest.find('\n').unwrap_or(rest.len())];
        let inner = &line[c.len_utf8()..];
        inner.find(close).map_or(c.len_utf8(), |i| c.len_utf8() + i + close.len_utf8())
    };
    let (token, length, help) = match c {
        '\'' => (Token::Mistaken, until('\''), "strings are written in double quotes: \"...\""),
        '\u{201c}' | '\u{201d}' => (Token::Mistaken, until('\u{201d}'), "use straight quotes: \"...\""),
        '=' => (Token::Colon, 1, "a field is written `name: value`"),
        ';' => (Token::Comma, 1, "separate with `,`"),
        '-' | '+' => (Token::Mistaken, 1, "a sign stands right before its number: `-2`"),
        '\u{2212}' | '\u{2013}' => {
            (Token::Mistaken, c.len_utf8(), "write the minus sign of the keyboard: `-2`")
        }
        _ => (Token::Mistaken, c.len_utf8(), "remove it"),
    };
    let span = Span { source, start, end: start + length };
    let help = output_of(text, start).unwrap_or_else(|| help.to_owned());
    diagnostics.push(
        Diagnostic::error("E0101", span, format!("unexpected `{c}`")).label("not part of RON").help(help),
    );
    (token, length)
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

/// True if the character is a sign of arithmetic, and not that of a number or of a comment.
fn is_arithmetic(rest: &str, sign: char, at: usize, before: Option<&Lexeme>) -> bool {
    let ends_value = |token| matches!(token, Token::Number | Token::Name | Token::Close);
    let follows = before.is_some_and(|lexeme| lexeme.end == at && ends_value(lexeme.token));
    match sign {
        '/' => !rest.starts_with("//") && !rest.starts_with("/*"),
        '+' | '-' => follows || !number_follows(rest),
        _ => matches!(sign, '*' | '%' | '^'),
    }
}

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

impl Arithmetic {
    /// Reports how to write it, and uses its first number as the value, so that no missing value is reported too.
    fn report(
        &self,
        source: SourceId,
        text: &str,
        lexemes: &mut Vec<Lexeme>,
        diagnostics: &mut Vec<Diagnostic>,
    ) {
        let Self { start, end, result } = *self;
        let expression = &text[start..end];
        let help = match result {
            Some(result) => format!("write `Expr(\"{expression}\")`, or the result: `{result}`"),
            None => format!("write `Expr(\"{expression}\")`; names in it are parameters"),
        };
        let span = Span { source, start, end };
        // What was said of a part of it, `1 + 2` in `(1 + 2) * 3`, is said of the whole.
        let is_part = |at: Span| at.source == source && start <= at.start && at.end <= end;
        diagnostics.retain(|known| !known.primary.as_ref().is_some_and(|label| is_part(label.span)));
        diagnostics.push(
            Diagnostic::error("E0101", span, "arithmetic has to be written in `Expr(\"...\")`")
                .label("RON has no arithmetic")
                .help(help),
        );
        lexemes.truncate(lexemes.partition_point(|lexeme| lexeme.start < start));
        let digit = expression.find(|c: char| c.is_ascii_digit());
        let from = digit.map_or(start, |digit| {
            let first = start + digit;
            let length = number_length(&text[first..end]);
            lexemes.push(Lexeme { token: Token::Number, start: first, end: first + length });
            first + length
        });
        lexemes.push(Lexeme { token: Token::Mistaken, start: from, end });
    }
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
