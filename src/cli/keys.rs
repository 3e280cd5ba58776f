//! Line editor with a history, for the prompt below a live display.

use super::screen::Prompt;

/// Maximum length of a line, characters.
const MAX_CHARACTERS: usize = 4096;
/// Maximum number of lines in the history.
const MAX_LINES: usize = 1000;

/// A line being edited.
#[derive(Debug, Default)]
pub(super) struct Editor {
    line: Vec<char>,
    cursor: usize,
    history: Vec<String>,
    /// The index of the recalled history line, and the line typed before.
    recalled: Option<(usize, Vec<char>)>,
    /// The bytes received so far of an escape sequence or of a multi-byte character.
    begun: Vec<u8>,
}

impl Editor {
    /// Processes a byte from the keyboard; returns the line that it completes.
    pub(super) fn feed(&mut self, byte: u8) -> Option<String> {
        if !self.begun.is_empty() || byte == 0x1b || byte >= 0x80 {
            self.begun.push(byte);
            self.go_on();
            return None;
        }
        match byte {
            b'\r' | b'\n' => return Some(self.enter()),
            0x7f | 0x08 => self.delete(self.cursor.checked_sub(1)),
            0x01 => self.cursor = 0,
            0x05 => self.cursor = self.line.len(),
            0x0b => self.line.truncate(self.cursor),
            0x15 => self.cut(0),
            0x17 => self.cut(self.word()),
            b' '..=b'~' => self.insert(char::from(byte)),
            _ => {}
        }
        None
    }

    /// The text to display.
    pub(super) fn prompt(&self) -> Prompt {
        Prompt { text: self.line.iter().collect(), cursor: self.cursor }
    }

    /// Continues an escape sequence or a multi-byte character, both bounded in length.
    fn go_on(&mut self) {
        match self.begun[..] {
            [0x1b] | [0x1b, b'[' | b'O'] | [0x1b, b'[', b'0'..=b'9'] => return,
            [0x1b, b'[' | b'O', key] => self.arrow(key),
            [0x1b, b'[', digit, b'~'] => match digit {
                b'1' | b'7' => self.cursor = 0,
                b'4' | b'8' => self.cursor = self.line.len(),
                b'3' => self.delete((self.cursor < self.line.len()).then_some(self.cursor)),
                _ => {}
            },
            [0x1b, ..] => {}
            _ => match std::str::from_utf8(&self.begun) {
                Ok(text) => text.to_owned().chars().for_each(|letter| self.insert(letter)),
                Err(error) if error.error_len().is_none() => return,
                Err(_) => {}
            },
        }
        self.begun.clear();
    }

    fn arrow(&mut self, key: u8) {
        match key {
            b'A' => self.recall(-1),
            b'B' => self.recall(1),
            b'C' => self.cursor = (self.cursor + 1).min(self.line.len()),
            b'D' => self.cursor = self.cursor.saturating_sub(1),
            b'H' => self.cursor = 0,
            b'F' => self.cursor = self.line.len(),
            _ => {}
        }
    }

    /// Recalls a history line, `by` lines from the present one.
    fn recall(&mut self, by: isize) {
        let (at, typed) = match self.recalled.take() {
            Some((at, typed)) => (at, typed),
            None => (self.history.len(), self.line.clone()),
        };
        let wanted = at.saturating_add_signed(by).min(self.history.len());
        self.line = match self.history.get(wanted) {
            Some(line) => line.chars().collect(),
            None => typed.clone(),
        };
        self.recalled = (wanted < self.history.len()).then_some((wanted, typed));
        self.cursor = self.line.len();
    }

    fn enter(&mut self) -> String {
        let line: String = std::mem::take(&mut self.line).into_iter().collect();
        (self.cursor, self.recalled) = (0, None);
        if !line.trim().is_empty() && self.history.last() != Some(&line) {
            self.history.push(line.clone());
        }
        if self.history.len() > MAX_LINES {
            self.history.remove(0);
        }
        line
    }

    fn insert(&mut self, letter: char) {
        if self.line.len() < MAX_CHARACTERS && !letter.is_control() {
            self.line.insert(self.cursor, letter);
            self.cursor += 1;
        }
    }

    fn delete(&mut self, at: Option<usize>) {
        if let Some(at) = at {
            self.line.remove(at);
            self.cursor = at;
        }
    }

    /// Removes the text between `from` and the cursor.
    fn cut(&mut self, from: usize) {
        self.line.drain(from..self.cursor);
        self.cursor = from;
    }

    /// Start of the word before the cursor.
    fn word(&self) -> usize {
        let before = &self.line[..self.cursor];
        let end = before.iter().rposition(|letter| *letter != ' ').map_or(0, |last| last + 1);
        before[..end].iter().rposition(|letter| *letter == ' ').map_or(0, |space| space + 1)
    }
}

#[cfg(unix)]
pub(super) use raw::{RawMode, is_in_front, restore};

/// Terminal input without line buffering.
#[cfg(unix)]
mod raw {
    use nix::sys::termios::{LocalFlags, SetArg, SpecialCharacterIndices, Termios, tcgetattr, tcsetattr};
    use std::io::{IsTerminal, stderr, stdin};
    use std::sync::Mutex;

    /// Terminal settings before raw mode.
    static BEFORE: Mutex<Option<Termios>> = Mutex::new(None);

    /// Delivers every key until it is dropped. Ctrl-C still raises its signal.
    #[derive(Debug)]
    pub(crate) struct RawMode(());

    impl RawMode {
        /// `None` without a terminal, or if the terminal does not support raw mode.
        pub(crate) fn begin() -> Option<Self> {
            let is_dumb = std::env::var_os("TERM").is_none_or(|term| term == "dumb");
            if is_dumb || !stdin().is_terminal() || !stderr().is_terminal() || !is_in_front() {
                return None;
            }
            let before = tcgetattr(stdin()).ok()?;
            let mut keys = before.clone();
            keys.local_flags.remove(LocalFlags::ICANON | LocalFlags::ECHO);
            keys.control_chars[SpecialCharacterIndices::VMIN as usize] = 1;
            keys.control_chars[SpecialCharacterIndices::VTIME as usize] = 0;
            *BEFORE.lock().ok()? = Some(before);
            tcsetattr(stdin(), SetArg::TCSANOW, &keys).ok()?;
            Some(Self(()))
        }
    }

    impl Drop for RawMode {
        fn drop(&mut self) {
            restore();
        }
    }

    /// True if this process group is in the foreground of the terminal; a background process would be stopped for
    /// reading from it or changing its settings.
    pub(crate) fn is_in_front() -> bool {
        nix::unistd::tcgetpgrp(stdin()).is_ok_and(|front| front == nix::unistd::getpgrp())
    }

    /// Restores the terminal settings.
    pub(crate) fn restore() {
        let before = BEFORE.lock().ok().and_then(|mut before| before.take());
        if let Some(before) = before {
            // A closed terminal needs no settings.
            let _ = tcsetattr(stdin(), SetArg::TCSANOW, &before);
        }
    }
}

/// Other systems stop no process for reading from its terminal.
#[cfg(not(unix))]
pub fn is_in_front() -> bool {
    true
}

/// On other systems the terminal keeps its line buffering.
#[cfg(not(unix))]
#[derive(Debug)]
pub struct RawMode(());

#[cfg(not(unix))]
impl RawMode {
    /// Always `None`.
    pub fn begin() -> Option<Self> {
        None
    }
}

#[cfg(not(unix))]
pub fn restore() {}

#[cfg(test)]
mod tests {
    use super::*;

    fn typed(editor: &mut Editor, keys: &str) -> Vec<String> {
        keys.bytes().filter_map(|byte| editor.feed(byte)).collect()
    }

    #[test]
    fn lines_are_edited_and_recalled() {
        let mut editor = Editor::default();
        assert_eq!(typed(&mut editor, "set gain=0.5\rlisd\x7ft\r"), ["set gain=0.5", "list"]);
        let up = "\x1b[A";
        assert_eq!(typed(&mut editor, &format!("st{up}{up}")), [""; 0]);
        assert_eq!(editor.prompt(), Prompt { text: "set gain=0.5".to_owned(), cursor: 12 });
        assert_eq!(typed(&mut editor, "\x1b[B\x1b[B"), [""; 0]);
        assert_eq!(editor.prompt().text, "st", "what was typed comes back");
        assert_eq!(typed(&mut editor, &format!("{up}{up}{up}{up}\x7f7\r")), ["set gain=0.7"]);
    }

    #[test]
    fn the_cursor_moves_and_words_are_cut() {
        let mut editor = Editor::default();
        typed(&mut editor, "stop now");
        typed(&mut editor, "\x17");
        assert_eq!(editor.prompt().text, "stop ");
        typed(&mut editor, "\x1b[D\x1b[D\x1b[3~\x01x");
        assert_eq!(editor.prompt(), Prompt { text: "xsto ".to_owned(), cursor: 1 });
        typed(&mut editor, "\x05\x15é\x1bOHü");
        assert_eq!(editor.prompt(), Prompt { text: "üé".to_owned(), cursor: 1 });
    }

    #[test]
    fn any_bytes_are_survived_and_no_line_grows_without_bound() {
        let mut editor = Editor::default();
        for round in 0..20_000_u32 {
            let byte = (round.wrapping_mul(2_654_435_761) >> 13) as u8;
            let _ = editor.feed(byte);
        }
        typed(&mut editor, "\x15");
        (0..2 * MAX_CHARACTERS).for_each(|_| assert_eq!(editor.feed(b'a'), None));
        assert!(editor.prompt().text.chars().count() <= MAX_CHARACTERS);
    }
}
