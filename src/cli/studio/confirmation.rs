//! Confirmation at the terminal of edits that a page may not make alone: raising limits, adding actuators, changing
//! devices.

use super::super::{Failure, keys, print};
use crate::signal::files;
use haptograph_studio::Studio;
use std::io::IsTerminal;
use std::sync::mpsc::{Receiver, sync_channel};
use std::time::{Duration, Instant};

/// Minimum time between two printed edits: a page can ask at any rate.
const PAUSE: Duration = Duration::from_secs(1);

/// The dialogue at the terminal.
#[derive(Default)]
pub(super) struct Confirmation {
    /// The edit that was printed last.
    shown: Option<(u64, Instant)>,
    /// Lines of standard input, which is read from the first edit on.
    lines: Option<Receiver<String>>,
}

impl Confirmation {
    /// Prints a new edit, and carries out what was typed.
    ///
    /// # Errors
    /// [`Failure`] if nothing can be printed.
    pub(super) fn poll(&mut self, studio: &Studio) -> Result<(), Failure> {
        if let Some((number, beyond)) = studio.proposal()
            && self.shown.is_none_or(|(shown, at)| shown != number && at.elapsed() > PAUSE)
        {
            self.shown = Some((number, Instant::now()));
            // A process in the background of a terminal would be stopped for reading, with the actuators that it drives.
            if self.lines.is_none() && (!std::io::stdin().is_terminal() || keys::is_in_front()) {
                self.lines = Some(read_lines());
            }
            print(&question(number, &beyond, self.lines.is_some()))?;
        }
        let typed: Vec<String> = self.lines.iter().flat_map(Receiver::try_iter).collect();
        for line in typed {
            print(&self.answer(studio, line.trim()))?;
        }
        Ok(())
    }

    fn answer(&self, studio: &Studio, line: &str) -> String {
        let shown = self.shown.map_or(0, |(number, _)| number);
        let number = line.strip_prefix("allow ").map(|number| number.trim().parse());
        match number {
            _ if line.is_empty() => String::new(),
            // Only what was shown can be allowed.
            Some(Ok(number)) if number == shown => match studio.confirm(number) {
                Ok(()) => format!("edit {number} is allowed; repeat it on the page\n"),
                Err(error) => format!("nothing was allowed: {error}\n"),
            },
            _ => format!(
                "nothing was allowed; type `allow {shown}` to allow edit {shown}, ctrl-C to close the studio\n"
            ),
        }
    }
}

fn question(number: u64, beyond: &[String], is_heard: bool) -> String {
    let mut text = "a page asks for more than the file permitted when the studio was opened:\n".to_owned();
    for excess in beyond {
        // It quotes the page's text, which must not control the terminal.
        let plain = excess.chars().flat_map(|c| match c.is_control() {
            true => c.escape_default().collect::<Vec<_>>(),
            false => vec![c],
        });
        text.push_str("  ");
        text.extend(plain);
        text.push('\n');
    }
    text + &match is_heard {
        true => {
            format!("type `allow {number}` and Enter to allow this edit; anything else leaves it refused\n")
        }
        false => "the edit stays refused: a studio in the background cannot read an answer; start the studio in the foreground\n"
            .to_owned(),
    }
}

/// Reads standard input on a thread of its own. The end of the input ends only that thread.
fn read_lines() -> Receiver<String> {
    let (lines, typed) = sync_channel(16);
    std::thread::spawn(move || {
        for line in files::lines(std::io::stdin().lock(), files::MAX_LINE_BYTES) {
            let Ok(line) = line else { break };
            if lines.send(String::from_utf8_lossy(&line).into_owned()).is_err() {
                break;
            }
        }
    });
    typed
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_cannot_write_to_the_terminal_what_it_likes() {
        let text = question(7, &["actuator `a\u{1b}[2Jb\nallowed` is new".to_owned()], true);
        assert!(text.contains("allow 7") && text.contains(r"a\u{1b}[2Jb\nallowed"), "{text}");
        assert!(!text.chars().any(|c| c.is_control() && c != '\n'));
        assert_eq!(text.lines().count(), 3);
    }
}
