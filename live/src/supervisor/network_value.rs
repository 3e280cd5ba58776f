//! Restrictions on values that arrive by network: a number, a boolean or plain text. Text that names a file
//! must name one in the graph's folder or below it.

use std::path::{Component, Path};

/// Characters that RON would parse as more than plain text: quotes, escapes and brackets.
const SYNTAX: [char; 6] = ['"', '\\', '(', '[', '{', '\''];

/// Reason for refusing a value from the network.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub(super) enum Refusal {
    #[error("a value from the network must be a number, a boolean or plain text")]
    NotPlain,
    #[error("a file named from the network must be in the graph's folder, without `..`")]
    Outside,
    #[error("a path from the network must name a file, not a device, a pipe or a folder")]
    NoFile,
}

/// Checks a value that arrived by network. `graph` is the graph's file. Relative paths start at the current
/// folder, as for typed values.
pub(super) fn refusal(value: &str, graph: &Path) -> Option<Refusal> {
    if value.contains(SYNTAX) {
        return Some(Refusal::NotPlain);
    }
    let path = Path::new(value);
    let plain = |part: Component<'_>| matches!(part, Component::Normal(_) | Component::CurDir);
    if !path.components().all(plain) {
        return Some(Refusal::Outside);
    }
    // A path that does not exist is plain text; the setting itself reports a missing file.
    path.symlink_metadata().ok()?;
    let inside = || {
        let folder = graph.canonicalize().ok()?;
        Some(path.canonicalize().ok()?.starts_with(folder.parent()?))
    };
    match (inside(), path.metadata()) {
        (Some(true), Ok(facts)) if facts.is_file() => None,
        (Some(true), _) => Some(Refusal::NoFile),
        _ => Some(Refusal::Outside),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_and_words_are_taken_and_no_paths_out() {
        let graph = Path::new("src/lib.rs");
        for value in ["0.5", "-3", "true", "soft", "inf", "src/supervisor/swap.rs", "nobody.ron", ""] {
            assert_eq!(refusal(value, graph), None, "{value}");
        }
        for (value, why) in [
            ("/dev/zero", Refusal::Outside),
            ("/dev/stdin", Refusal::Outside),
            ("src/../Cargo.toml", Refusal::Outside),
            ("src/supervisor/../../Cargo.toml", Refusal::Outside),
            ("Cargo.toml", Refusal::Outside),
            ("src/supervisor", Refusal::NoFile),
            ("\"/dev/zero\"", Refusal::NotPlain),
            ("r\"/dev/zero\"", Refusal::NotPlain),
            ("Param(\"wish\")", Refusal::NotPlain),
            ("[1]", Refusal::NotPlain),
        ] {
            assert_eq!(refusal(value, graph), Some(why), "{value}");
        }
    }

    #[cfg(unix)]
    #[test]
    fn links_out_of_the_folder_are_not_followed() {
        let here = tempfile::tempdir_in(".").unwrap();
        let name = here.path().file_name().unwrap().to_string_lossy().into_owned();
        std::fs::write(here.path().join("g.ron"), "").unwrap();
        std::os::unix::fs::symlink("/dev/zero", here.path().join("zero.ron")).unwrap();
        std::os::unix::fs::symlink("../Cargo.toml", here.path().join("out.ron")).unwrap();
        std::os::unix::fs::symlink("g.ron", here.path().join("in.ron")).unwrap();
        let graph = here.path().join("g.ron");
        let of = |file: &str| refusal(&format!("{name}/{file}"), &graph);
        assert_eq!(of("zero.ron"), Some(Refusal::Outside));
        assert_eq!(of("out.ron"), Some(Refusal::Outside));
        assert_eq!(of("in.ron"), None);
    }
}
