//! Notes about soundcards and devices, and the history of settings, of a live run.

use super::super::eprint;
use super::supervisor::settings_text;
use crate::engine::run::Change;
use serde_json::{Value, json};

/// Counted notes about soundcards and devices.
#[derive(Debug, Default)]
pub struct Notes {
    list: Vec<(String, u64)>,
}

impl Notes {
    /// Adds a note about a device that was lost or found; it is printed each time.
    pub fn turn(&mut self, note: String) {
        eprint(&format!("note: {note}\n"));
        self.count(note);
    }

    /// Adds a complaint; it is printed once, since a failing card repeats it thousands of times.
    pub fn complaint(&mut self, note: String) {
        if self.list.iter().any(|(known, _)| *known == note) {
            self.count(note);
        } else {
            self.turn(note);
        }
    }

    fn count(&mut self, note: String) {
        match self.list.iter_mut().find(|(known, _)| *known == note) {
            Some((_, times)) => *times += 1,
            None => self.list.push((note, 1)),
        }
    }

    pub fn counted(self) -> Vec<String> {
        let counted = self.list.into_iter().map(|(note, times)| match times {
            1 => note,
            _ => format!("{note} ({times} times)"),
        });
        counted.collect()
    }
}

/// The settings changed during the run.
#[derive(Debug, Default)]
pub struct History {
    list: Vec<String>,
    more: u64,
}

impl History {
    /// Maximum number of entries.
    pub const MAX: usize = 200;

    pub fn note(&mut self, at_s: f64, name: &str, value: &str, by: &str) {
        self.push(format!("{at_s:.2} s {name}={value} ({by})"));
    }

    /// Adds the effect of a saved file.
    pub fn saved(&mut self, at_s: f64, change: Change, set: &[(String, f64)]) {
        let what = match change {
            Change::Settings(_) => settings_text(set),
            change => change.to_string(),
        };
        self.push(format!("{at_s:.2} s {what} (saved)"));
    }

    fn push(&mut self, line: String) {
        match self.list.len() < Self::MAX {
            true => self.list.push(line),
            false => self.more += 1,
        }
    }

    /// The last entry.
    pub fn last(&self) -> Option<&str> {
        self.list.last().map(String::as_str)
    }

    /// All entries, one per line.
    pub fn lines(&self) -> String {
        let more = match self.more {
            0 => String::new(),
            more => format!("and {more} more\n"),
        };
        match &self.list[..] {
            [] => "nothing has been set yet\n".to_owned(),
            list => list.join("\n") + "\n" + &more,
        }
    }

    pub fn into_json(mut self) -> Value {
        if self.more > 0 {
            self.list.push(format!("and {} more", self.more));
        }
        json!(self.list)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn turns_and_complaints_are_counted_by_their_words() {
        let mut notes = Notes::default();
        for _ in 0..2 {
            notes.complaint("broken pipe".to_owned());
            notes.turn("gone".to_owned());
            notes.turn("back".to_owned());
        }
        notes.turn("gone".to_owned());
        assert_eq!(
            notes.counted(),
            ["broken pipe (2 times)", "gone (3 times)", "back (2 times)"]
        );
    }
}
