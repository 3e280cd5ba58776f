//! Rendering of an error at its place in a text.

use super::Failure;
use super::terminal::is_coloured;
use crate::signal::files;
use crate::surfaces::files::Place;
use annotate_snippets::renderer::DecorStyle;
use annotate_snippets::{AnnotationKind, Level, Renderer, Snippet};
use std::fmt::Display;
use std::path::Path;

/// Maximum number of characters shown on either side of the place; lines of surface files can be long.
const AROUND: usize = 60;

/// The failure to read a file, shown at its place if that is known and the file can be read.
pub(super) fn failure(path: &Path, place: Option<Place>, message: &str, otherwise: &dyn Display) -> Failure {
    let bytes = place.and_then(|place| Some((place, files::read(path, files::MAX_RECORDING_BYTES).ok()?)));
    let Some((place, bytes)) = bytes else {
        return Failure::Message(otherwise.to_string());
    };
    let text = String::from_utf8_lossy(&bytes);
    let line = text.lines().nth(place.line - 1).unwrap_or_default();
    Failure::Rendered(at(&path.display().to_string(), line, place.line, place.column, message))
}

/// Renders `message` and `line` with a marker. `number` and `column` count from 1, columns in characters.
pub(super) fn at(name: &str, line: &str, number: usize, column: usize, message: &str) -> String {
    let renderer = if is_coloured(&std::io::stderr()) { Renderer::styled() } else { Renderer::plain() };
    let place = format!("{name}:{number}:{column}");
    let first = column.saturating_sub(AROUND + 1);
    let shown: String = line.chars().skip(first).take(2 * AROUND).collect();
    let start = shown.char_indices().nth(column - 1 - first).map_or(shown.len(), |(index, _)| index);
    let word = shown[start..]
        .find(|c: char| c.is_whitespace() || c == ',' || c == ';')
        .unwrap_or(shown.len() - start);
    let annotation = AnnotationKind::Primary.span(start..start + word.max(usize::from(start < shown.len())));
    let snippet = Snippet::source(shown.as_str()).line_start(number).path(name).annotation(annotation);
    let report = Level::ERROR.primary_title(message).element(snippet);
    let text = renderer.decor_style(DecorStyle::Ascii).render(&[report]);
    // Columns of a shortened line count from its first shown character.
    let text = if first == 0 {
        text
    } else {
        text.replacen(&format!("{name}:{number}:{}", column - first), &place, 1)
    };
    text + "\n"
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_place_is_named_and_shown() {
        let text = at("stdin", "12 abc", 3, 4, "this is no number");
        assert!(
            text.contains("error: this is no number")
                && text.contains("stdin:3:4")
                && text.contains("12 abc"),
            "{text}"
        );
        let long = format!("{}x{}", "a ".repeat(500), "b".repeat(500));
        let text = at("file.xml", &long, 7, 1001, "what is this");
        assert!(text.contains("file.xml:7:1001") && text.len() < 600, "{text}");
        at("stdin", "", 1, 1, "nothing");
        at("stdin", "é", 1, 2, "behind the end");
        at("stdin", "ab", 1, 99, "far behind the end");
    }
}
