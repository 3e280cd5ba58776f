//! Rust source files as text: lines that count, and code without comments, strings and tests.

use std::fs;
use std::path::{Path, PathBuf};

/// Folders without production code.
const SKIPPED: [&str; 7] = ["target", ".git", "tests", "benches", "examples", "fuzz", "testing"];

/// The source files below a folder, without tests.
pub fn files(folder: &Path) -> Vec<PathBuf> {
    let mut all = Vec::new();
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let (path, name) = (entry.path(), entry.file_name());
        let name = name.to_string_lossy();
        if path.is_dir() {
            if !SKIPPED.contains(&&*name) && name != "node_modules" {
                all.extend(files(&path));
            }
        } else if name.ends_with(".rs") && name != "tests.rs" && name != "testing.rs" {
            all.push(path);
        }
    }
    all.sort();
    all
}

/// The lines of a file that are neither blank nor comments nor inside a test module.
pub fn production_lines(text: &str) -> usize {
    let lines: Vec<&str> = text.lines().collect();
    let (mut count, mut at) = (0, 0);
    while let Some(line) = lines.get(at) {
        let line = line.trim();
        let next = lines.get(at + 1).map_or("", |next| next.trim());
        if line == "#[cfg(test)]" && begins_module(next) {
            at += 1;
            let mut depth = 0_i64;
            while let Some(line) = lines.get(at) {
                let number = |c: char| line.matches(c).count() as i64;
                depth += number('{') - number('}');
                at += 1;
                if depth <= 0 {
                    break;
                }
            }
            continue;
        }
        count += usize::from(!line.is_empty() && !line.starts_with("//"));
        at += 1;
    }
    count
}

fn begins_module(line: &str) -> bool {
    let line = line.strip_prefix("pub ").unwrap_or(line);
    line.starts_with("mod ") && line.ends_with('{')
}

/// The code of a file: comments, strings, characters and test modules are blank, lines stay.
pub fn code(text: &str) -> String {
    let mut code = masked(text);
    while let Some(start) = code.find("#[cfg(test)]") {
        let rest = &code[start..];
        let end = match (rest.find('{'), rest.find(';')) {
            (Some(open), semicolon) if semicolon.is_none_or(|semicolon| open < semicolon) => {
                start + open + body_length(&rest[open..])
            }
            (_, Some(semicolon)) => start + semicolon + 1,
            (_, None) => code.len(),
        };
        let blank: String = code[start..end].chars().map(|c| if c == '\n' { c } else { ' ' }).collect();
        code.replace_range(start..end, &blank);
    }
    code
}

/// Length of a block in braces at the start of `code`.
pub fn body_length(code: &str) -> usize {
    let mut depth = 0_usize;
    for (at, byte) in code.bytes().enumerate() {
        match byte {
            b'{' => depth += 1,
            b'}' if depth == 1 => return at + 1,
            b'}' => depth -= 1,
            _ => {}
        }
    }
    code.len()
}

/// Replaces comments and the contents of literals by blanks of the same number of bytes.
fn masked(text: &str) -> String {
    let bytes = text.as_bytes();
    let mut out = Vec::with_capacity(bytes.len());
    let mut at = 0;
    while at < bytes.len() {
        let length = blank_length(text, at).min(bytes.len() - at);
        if length == 0 {
            out.push(bytes[at]);
            at += 1;
            continue;
        }
        out.extend(bytes[at..at + length].iter().map(|byte| if *byte == b'\n' { b'\n' } else { b' ' }));
        at += length;
    }
    String::from_utf8(out).expect("whole literals and comments are replaced")
}

/// Length of the comment or literal that begins here; 0 if none does.
fn blank_length(text: &str, at: usize) -> usize {
    let rest = &text.as_bytes()[at..];
    let is_in_word =
        at > 0 && (text.as_bytes()[at - 1].is_ascii_alphanumeric() || text.as_bytes()[at - 1] == b'_');
    match rest {
        [b'/', b'/', ..] => rest.iter().position(|byte| *byte == b'\n').unwrap_or(rest.len()),
        [b'/', b'*', ..] => comment_length(rest),
        [b'"', ..] => string_length(rest),
        [b'r', b'"' | b'#', ..] if !is_in_word => raw_string_length(rest),
        [b'b', b'r', b'"' | b'#', ..] if !is_in_word => 1 + raw_string_length(&rest[1..]),
        [b'\'', ..] => character_length(rest),
        _ => 0,
    }
}

fn comment_length(rest: &[u8]) -> usize {
    let (mut depth, mut at) = (0_usize, 0);
    while at + 1 < rest.len() {
        match &rest[at..at + 2] {
            b"/*" => depth += 1,
            b"*/" => depth -= 1,
            _ => {
                at += 1;
                continue;
            }
        }
        at += 2;
        if depth == 0 {
            return at;
        }
    }
    rest.len()
}

fn string_length(rest: &[u8]) -> usize {
    let mut at = 1;
    while at < rest.len() && rest[at] != b'"' {
        at += 1 + usize::from(rest[at] == b'\\');
    }
    at + 1
}

/// 0 if it is a raw identifier.
fn raw_string_length(rest: &[u8]) -> usize {
    let hashes = rest[1..].iter().take_while(|byte| **byte == b'#').count();
    if rest.get(1 + hashes) != Some(&b'"') {
        return 0;
    }
    let closing = [&b"\""[..], &vec![b'#'; hashes]].concat();
    let inner = &rest[2 + hashes..];
    let end = inner.windows(closing.len()).position(|window| window == closing);
    end.map_or(rest.len(), |end| 2 + hashes + end + closing.len())
}

/// 0 if it is a lifetime.
fn character_length(rest: &[u8]) -> usize {
    let end =
        |from: usize| rest[from..].iter().take(12).position(|byte| *byte == b'\'').map(|end| from + end + 1);
    match rest.get(1..3) {
        Some([b'\\', _]) => end(3).unwrap_or(0),
        Some([first, b'\'']) if first.is_ascii() => 3,
        Some([first, _]) if !first.is_ascii() => end(1).unwrap_or(0),
        _ => 0,
    }
}

#[test]
fn comments_literals_and_tests_are_no_code() {
    let text = "fn a<'x>() { let c = '{'; } // {\n/* } /* */ */ let s = \"}\\\"{\";\nlet r = r#\"\"{\"#; let d = '\\'';\n\
                #[cfg(test)]\nmod tests {\n    fn b() {}\n}\n#[cfg(test)]\nmod more;\nfn c() {}\n";
    let code = code(text);
    assert_eq!((code.len(), code.lines().count()), (text.len(), text.lines().count()));
    assert_eq!((code.matches('{').count(), code.matches('}').count()), (2, 2), "{code}");
    assert!(
        code.contains("fn a<'x>")
            && code.contains("fn c()")
            && !code.contains("fn b")
            && !code.contains("more")
    );
    assert_eq!(production_lines(text), 6);
}
