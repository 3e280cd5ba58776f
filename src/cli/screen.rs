//! Terminal display of a live run: a block of status lines and an input line at the lower end; other messages
//! scroll above it.

use console::{Term, truncate_str};
use std::io::Write;
use std::sync::{Mutex, PoisonError};

/// Prompt of the input line.
const PROMPT: &str = "> ";

/// The input line.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub(super) struct Prompt {
    /// The line.
    pub text: String,
    /// Cursor position, characters.
    pub cursor: usize,
}

static TYPED: Mutex<Option<Prompt>> = Mutex::new(None);

/// Sets the input line; `None` removes it.
pub(super) fn type_in(prompt: Option<Prompt>) {
    *TYPED.lock().unwrap_or_else(PoisonError::into_inner) = prompt;
}

/// The block on the terminal.
#[derive(Debug, Default)]
pub(super) struct Screen {
    block: Vec<String>,
    /// Number of lines between the first drawn line and the cursor; `None` if nothing is drawn.
    drawn: Option<usize>,
}

impl Screen {
    /// Draws the block with new lines.
    pub(super) fn show(&mut self, block: Vec<String>, out: &mut impl Write) -> std::io::Result<()> {
        self.block = block;
        self.redraw(out)
    }

    /// Redraws after a change of the input line.
    pub(super) fn redraw(&mut self, out: &mut impl Write) -> std::io::Result<()> {
        let text = self.erase() + &self.draw(width());
        out.write_all(text.as_bytes())
    }

    /// Writes lines above the block.
    pub(super) fn above(&mut self, text: &str, out: &mut impl Write) -> std::io::Result<()> {
        let text = self.erase() + text + if text.ends_with('\n') { "" } else { "\n" } + &self.draw(width());
        out.write_all(text.as_bytes())
    }

    /// Removes the block.
    pub(super) fn close(&mut self, out: &mut impl Write) -> std::io::Result<()> {
        self.block.clear();
        let text = self.erase();
        out.write_all(text.as_bytes())
    }

    /// Escape sequence that removes the drawn lines.
    fn erase(&mut self) -> String {
        match self.drawn.take() {
            None => String::new(),
            Some(0) => "\r\x1b[J".to_owned(),
            Some(up) => format!("\r\x1b[{up}A\x1b[J"),
        }
    }

    /// Escape sequence that draws the block and the input line, cut to the width of the terminal.
    fn draw(&mut self, width: usize) -> String {
        let width = width.saturating_sub(1).max(PROMPT.len() + 1);
        let mut text = String::new();
        for line in &self.block {
            text += &truncate_str(line, width, "~");
            text += "\n";
        }
        let prompt = TYPED.lock().unwrap_or_else(PoisonError::into_inner).clone();
        let Some(prompt) = prompt else {
            self.drawn = Some(self.block.len());
            return text;
        };
        let room = width - PROMPT.len();
        // Only the part of a long line around the cursor is drawn.
        let first = prompt.cursor.saturating_sub(room);
        let shown: String = prompt.text.chars().skip(first).take(room).collect();
        let column = PROMPT.len() + prompt.cursor - first;
        text += &format!("{PROMPT}{shown}\r\x1b[{column}C");
        self.drawn = Some(self.block.len());
        text
    }
}

/// Width of the terminal, columns.
pub(super) fn width() -> usize {
    usize::from(Term::stderr().size().1)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Interprets the bytes as a terminal does: lines and cursor position.
    fn shown(bytes: &str) -> (Vec<String>, (usize, usize)) {
        let (mut lines, mut row, mut column) = (vec![Vec::<char>::new()], 0, 0);
        let mut rest = bytes.chars();
        while let Some(letter) = rest.next() {
            match letter {
                '\n' => (row, column) = (row + 1, 0),
                '\r' => column = 0,
                '\x1b' => {
                    let code: String = rest.by_ref().skip(1).take_while_inclusive(char::is_ascii_digit);
                    let count = code.trim_end_matches(|c: char| !c.is_ascii_digit()).parse().unwrap_or(0);
                    match code.chars().last() {
                        Some('A') => row -= count,
                        Some('C') => column += count,
                        _ => {
                            lines.truncate(row + 1);
                            lines[row].truncate(column);
                        }
                    }
                }
                letter => {
                    lines[row].resize(column, ' ');
                    lines[row].push(letter);
                    column += 1;
                }
            }
            lines.resize(lines.len().max(row + 1), Vec::new());
        }
        (lines.iter().map(|line| line.iter().collect()).collect(), (row, column))
    }

    trait TakeWhileInclusive {
        fn take_while_inclusive(self, holds: fn(&char) -> bool) -> String;
    }

    impl<I: Iterator<Item = char>> TakeWhileInclusive for I {
        fn take_while_inclusive(mut self, holds: fn(&char) -> bool) -> String {
            let mut text = String::new();
            for letter in &mut self {
                text.push(letter);
                if !holds(&letter) {
                    break;
                }
            }
            text
        }
    }

    #[test]
    fn a_block_stays_below_what_is_said_and_what_is_typed_below_it() {
        let (mut screen, mut out) = (Screen::default(), Vec::new());
        type_in(Some(Prompt { text: "set ga".to_owned(), cursor: 6 }));
        screen.show(vec!["1 s".to_owned(), "out".to_owned()], &mut out).unwrap();
        screen.above("note: a card is gone\n", &mut out).unwrap();
        screen.show(vec!["2 s".to_owned(), "out".to_owned()], &mut out).unwrap();
        let (lines, cursor) = shown(std::str::from_utf8(&out).unwrap());
        assert_eq!(lines, ["note: a card is gone", "2 s", "out", "> set ga"]);
        assert_eq!(cursor, (3, 8));
        type_in(None);
        screen.close(&mut out).unwrap();
        let (lines, _) = shown(std::str::from_utf8(&out).unwrap());
        assert_eq!(lines, ["note: a card is gone", ""]);
    }

    #[test]
    fn no_line_is_wider_than_the_terminal() {
        let mut screen = Screen { block: vec!["x".repeat(200)], drawn: None };
        let text = screen.draw(40);
        assert!(text.lines().all(|line| line.chars().count() < 40), "{text}");
    }
}
