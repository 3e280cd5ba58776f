//! Commands typed while a graph runs.

use super::super::keys::Editor;
use super::super::stderr::{self, Message};
use super::super::{eprint, screen};
use crate::engine::settings::closest;
use crate::live::supervisor::RequestSender;
use crate::signal::files::{self, Refusal};
use std::io::Read;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::SyncSender;

/// A typed command.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum ConsoleCommand {
    /// Sets a parameter of the graph or a live setting.
    Set { name: String, value: String },
    /// Prints the parameters and live settings.
    List,
    /// Prints the changes of settings, with their origins.
    History,
    /// Prints the commands.
    Help,
    /// Ends the run.
    Stop,
    /// Any other line.
    Unknown(String),
}

pub(super) const HELP: &str = "set NAME=VALUE, list, history, help, stop";
/// Help text of the commands.
pub(super) const HELP_LINES: &str = "\
set NAME=VALUE   gives a parameter (gain) or a live setting of a node (out.gain) another value
list             shows the parameters and the live settings, with their values
history          shows what was set, when and by whom
help             shows this
stop             ends the run, like ctrl-C
";

impl ConsoleCommand {
    fn parse(line: &str) -> Option<Self> {
        let line = line.trim();
        let (word, rest) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
        match (word, rest.split_once('=')) {
            ("", _) => None,
            ("set", Some((name, value))) if !name.trim().is_empty() => {
                Some(Self::Set { name: name.trim().to_owned(), value: value.trim().to_owned() })
            }
            ("list", None) if rest.is_empty() => Some(Self::List),
            ("history", None) if rest.is_empty() => Some(Self::History),
            ("help" | "?", None) if rest.is_empty() => Some(Self::Help),
            ("stop" | "quit" | "exit", None) if rest.is_empty() => Some(Self::Stop),
            _ => Some(Self::Unknown(line.to_owned())),
        }
    }

    /// The command closest to an unknown line.
    pub(super) fn suggestion(line: &str) -> Option<String> {
        let line = line.trim();
        let with_set = format!("set {line}");
        match Self::parse(&with_set) {
            Some(Self::Set { name, .. }) if !name.contains(char::is_whitespace) => Some(with_set),
            _ => {
                let word = line.split_whitespace().next()?;
                let words = ["list", "history", "help", "stop", "quit", "exit"];
                closest(word, words).filter(|near| *near != line).map(str::to_owned)
            }
        }
    }
}

/// Reads commands from standard input on a thread of its own, which blocks while the queue is full. The end
/// of the input ends only this thread. With `keys` the program echoes each key itself. `run` is woken for each command.
pub(super) fn read_commands(
    commands: SyncSender<ConsoleCommand>,
    stop: Arc<AtomicBool>,
    run: RequestSender,
    keys: bool,
) {
    let mut send = move |command: ConsoleCommand| {
        // A stop bypasses the queue.
        if command == ConsoleCommand::Stop {
            stop.store(true, Ordering::Relaxed);
            run.wake();
            return true;
        }
        let is_sent = commands.send(command).is_ok();
        run.wake();
        is_sent
    };
    std::thread::spawn(move || match keys {
        true => read_keys(&mut send),
        false => read_lines(&mut send),
    });
}

fn read_lines(send: &mut impl FnMut(ConsoleCommand) -> bool) {
    for line in files::lines(std::io::stdin().lock(), files::MAX_LINE_BYTES) {
        let command = match line {
            // Invalid UTF-8 is reported as an unknown command.
            Ok(line) => ConsoleCommand::parse(&String::from_utf8_lossy(&line)),
            Err(error) if Refusal::of(&error).is_some() => {
                Some(ConsoleCommand::Unknown(format!("a line: {error}")))
            }
            Err(_) => break,
        };
        if command.is_some_and(|command| !send(command)) {
            break;
        }
    }
}

fn read_keys(send: &mut impl FnMut(ConsoleCommand) -> bool) {
    let mut editor = Editor::default();
    screen::type_in(Some(editor.prompt()));
    for byte in std::io::stdin().lock().bytes() {
        let Ok(byte) = byte else { break };
        let line = editor.feed(byte);
        screen::type_in(Some(editor.prompt()));
        stderr::display(Message::InputChanged);
        let Some(line) = line else { continue };
        eprint(&format!("> {line}\n"));
        if ConsoleCommand::parse(&line).is_some_and(|command| !send(command)) {
            break;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_understood_or_given_back() {
        let set = |name: &str, value: &str| ConsoleCommand::Set { name: name.into(), value: value.into() };
        for (line, command) in [
            ("", None),
            ("  set gain=0.5 ", Some(set("gain", "0.5"))),
            ("set out.gain = 0.5", Some(set("out.gain", "0.5"))),
            ("set surface=a=b.ron", Some(set("surface", "a=b.ron"))),
            ("set gain", Some(ConsoleCommand::Unknown("set gain".into()))),
            ("set =1", Some(ConsoleCommand::Unknown("set =1".into()))),
            ("list", Some(ConsoleCommand::List)),
            ("stop", Some(ConsoleCommand::Stop)),
            ("help", Some(ConsoleCommand::Help)),
            (" history", Some(ConsoleCommand::History)),
            ("stop it", Some(ConsoleCommand::Unknown("stop it".into()))),
        ] {
            assert_eq!(ConsoleCommand::parse(line), command, "{line}");
        }
        for (line, meant) in [
            ("gain=0.3", Some("set gain=0.3")),
            ("lst", Some("list")),
            ("stop it", Some("stop")),
            ("set gain", None),
            ("=1", None),
            ("set a b=1", None),
        ] {
            assert_eq!(ConsoleCommand::suggestion(line).as_deref(), meant, "{line}");
        }
    }
}
