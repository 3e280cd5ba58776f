//! What is typed while a graph runs, or told by Open Sound Control.

use crate::nodes::network::Told;
use crate::signal::files::{self, Refusal};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::SyncSender;

/// A line that was typed.
#[derive(Debug, Clone, PartialEq)]
pub enum Typed {
    /// Gives a parameter of the graph or a live setting another value.
    Set { name: String, value: String },
    /// Shows what can be set.
    List,
    /// Ends the run.
    Stop,
    /// Anything else, with what could have been meant.
    Unknown(String),
}

pub const HELP: &str = "set NAME=VALUE, list, stop";

impl Typed {
    fn parse(line: &str) -> Option<Self> {
        let line = line.trim();
        let (word, rest) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
        match (word, rest.split_once('=')) {
            ("", _) => None,
            ("set", Some((name, value))) if !name.trim().is_empty() => Some(Self::Set {
                name: name.trim().to_owned(),
                value: value.trim().to_owned(),
            }),
            ("list", None) if rest.is_empty() => Some(Self::List),
            ("stop" | "quit" | "exit", None) if rest.is_empty() => Some(Self::Stop),
            _ => Some(Self::Unknown(line.to_owned())),
        }
    }
}

/// What is asked for, and by whom.
#[derive(Debug)]
pub enum Asked {
    Typed(Typed),
    Told(Told),
}

/// Listens on standard input, on a thread of its own that waits while too much is asked. The end of the input ends
/// nothing.
pub fn listen(asked: SyncSender<Asked>, stop: Arc<AtomicBool>) {
    std::thread::spawn(move || {
        for line in files::lines(std::io::stdin().lock(), files::MAX_LINE_BYTES) {
            let typed = match line {
                // What is no text is told of like any other line that is not understood.
                Ok(line) => Typed::parse(&String::from_utf8_lossy(&line)),
                Err(error) if Refusal::of(&error).is_some() => {
                    Some(Typed::Unknown(format!("a line: {error}")))
                }
                Err(_) => break,
            };
            let Some(typed) = typed else { continue };
            // A stop waits for nobody.
            if typed == Typed::Stop {
                stop.store(true, Ordering::Relaxed);
            } else if asked.send(Asked::Typed(typed)).is_err() {
                break;
            }
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_understood_or_given_back() {
        let set = |name: &str, value: &str| Typed::Set {
            name: name.into(),
            value: value.into(),
        };
        for (line, typed) in [
            ("", None),
            ("  set gain=0.5 ", Some(set("gain", "0.5"))),
            ("set out.gain = 0.5", Some(set("out.gain", "0.5"))),
            ("set surface=a=b.ron", Some(set("surface", "a=b.ron"))),
            ("set gain", Some(Typed::Unknown("set gain".into()))),
            ("set =1", Some(Typed::Unknown("set =1".into()))),
            ("list", Some(Typed::List)),
            ("stop", Some(Typed::Stop)),
            ("stop it", Some(Typed::Unknown("stop it".into()))),
        ] {
            assert_eq!(Typed::parse(line), typed, "{line}");
        }
    }
}
