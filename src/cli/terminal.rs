//! Detects whether a terminal supports colours and animation, and whether its user wants them.

use std::ffi::OsStr;
use std::io::IsTerminal;

/// True if the stream is a terminal with colours and `NO_COLOR` is not set (no-color.org).
pub(super) fn is_coloured(stream: &impl IsTerminal) -> bool {
    let variable = |name: &str| std::env::var_os(name);
    stream.is_terminal() && can_colour(variable("TERM").as_deref(), variable("NO_COLOR").as_deref())
}

/// True if standard error can show a progress bar.
pub(super) fn is_animated() -> bool {
    std::io::stderr().is_terminal() && !is_dumb(std::env::var_os("TERM").as_deref())
}

fn can_colour(term: Option<&OsStr>, no_color: Option<&OsStr>) -> bool {
    !is_dumb(term) && no_color.is_none_or(OsStr::is_empty)
}

fn is_dumb(term: Option<&OsStr>) -> bool {
    term.is_some_and(|term| term == "dumb")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_are_left_out_where_they_are_not_wanted() {
        let word = |text: &'static str| Some(OsStr::new(text));
        assert!(can_colour(word("xterm-256color"), None) && can_colour(None, word("")));
        assert!(!can_colour(word("dumb"), None));
        assert!(!can_colour(word("xterm"), word("1")));
    }
}
