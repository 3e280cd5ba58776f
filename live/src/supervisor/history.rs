//! Notes about soundcards and devices, and the history of settings, of a live run.

use super::Origin;
use super::swap::settings_text;
use crate::SettingValue;
use crate::backend::BackendEvent;
use haptograph_engine::run::Change;
use std::fmt;
use std::sync::Arc;

/// Counted notes about soundcards and devices.
#[derive(Debug, Default)]
pub(super) struct Notes {
    list: Vec<(String, u64)>,
}

impl Notes {
    /// Adds an event. Returns its note if it is to be shown: that of a device that was lost or found each time, an error
    /// once, since a failing card repeats it thousands of times.
    pub(super) fn add(&mut self, event: BackendEvent) -> Option<String> {
        let (note, is_shown) = match event {
            BackendEvent::Changed(note) => (note, true),
            BackendEvent::Failed(note) => {
                let is_new = !self.list.iter().any(|(known, _)| *known == note);
                (note, is_new)
            }
        };
        self.count(note.clone());
        is_shown.then_some(note)
    }

    fn count(&mut self, note: String) {
        match self.list.iter_mut().find(|(known, _)| *known == note) {
            Some((_, times)) => *times += 1,
            None => self.list.push((note, 1)),
        }
    }

    /// All notes, each with how often it came.
    pub(super) fn counted(self) -> Vec<String> {
        let counted = self.list.into_iter().map(|(note, times)| match times {
            1 => note,
            _ => format!("{note} ({times} times)"),
        });
        counted.collect()
    }
}

/// The settings changed during the run.
#[derive(Debug, Default)]
pub(super) struct History {
    list: Vec<Entry>,
    more: u64,
}

/// A change of settings at a time of the run, s.
#[derive(Debug)]
enum Entry {
    Set(f64, Arc<str>, SettingValue, Origin),
    Saved(f64, String),
}

impl fmt::Display for Entry {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Set(at_s, name, value, origin) => {
                write!(f, "{at_s:.2} s {name}={value} ({})", origin.as_str())
            }
            Self::Saved(at_s, what) => write!(f, "{at_s:.2} s {what} (saved)"),
        }
    }
}

impl History {
    /// Maximum number of entries.
    pub(super) const MAX: usize = 200;

    /// Adds a setting.
    pub(super) fn set(&mut self, at_s: f64, name: Arc<str>, value: SettingValue, origin: Origin) {
        self.push(Entry::Set(at_s, name, value, origin));
    }

    /// Adds the effect of a saved file.
    pub(super) fn saved(&mut self, at_s: f64, change: Change, set: &[(String, f64)]) {
        let what = match change {
            Change::Settings(_) => settings_text(set),
            change => change.to_string(),
        };
        self.push(Entry::Saved(at_s, what));
    }

    fn push(&mut self, entry: Entry) {
        match self.list.len() < Self::MAX {
            true => self.list.push(entry),
            false => self.more += 1,
        }
    }

    /// The last entry.
    pub(super) fn last(&self) -> Option<String> {
        self.list.last().map(Entry::to_string)
    }

    /// All entries, one per line.
    pub(super) fn lines(&self) -> String {
        match self.list.is_empty() {
            true => "nothing has been set yet\n".to_owned(),
            false => self.all().join("\n") + "\n",
        }
    }

    /// All entries.
    pub(super) fn all(&self) -> Vec<String> {
        let more = (self.more > 0).then(|| format!("and {} more", self.more));
        self.list.iter().map(Entry::to_string).chain(more).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn turns_and_complaints_are_counted_by_their_words() {
        let mut notes = Notes::default();
        let failed = |note: &str| BackendEvent::Failed(note.to_owned());
        let changed = |note: &str| BackendEvent::Changed(note.to_owned());
        for is_first in [true, false] {
            assert_eq!(notes.add(failed("broken pipe")).is_some(), is_first);
            assert!(notes.add(changed("gone")).is_some() && notes.add(changed("back")).is_some());
        }
        notes.add(changed("gone"));
        assert_eq!(notes.counted(), ["broken pipe (2 times)", "gone (3 times)", "back (2 times)"]);
    }
}
