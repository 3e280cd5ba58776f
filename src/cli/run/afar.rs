//! What a value may be that is told from afar: a number, a truth, or a plain text. A text that names a file names one
//! in the graph's folder, or below it.

use std::path::{Component, Path};

/// What would make more of a text than the text: quotes, escapes and brackets of RON.
const WRITTEN: [char; 6] = ['"', '\\', '(', '[', '{', '\''];

/// Why a value is not taken from afar.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum Refusal {
    #[error("from afar a value is a number, a truth or a plain text")]
    Written,
    #[error("from afar only files in the graph's folder are named, without `..`")]
    Outside,
    #[error("from afar only files are named, no devices, pipes or folders")]
    NoFile,
}

/// Refuses what somebody who does not sit here may not set. `graph` is the graph's file; as for what is typed, names of
/// files begin where the program was started.
pub fn refusal(value: &str, graph: &Path) -> Option<Refusal> {
    if value.contains(WRITTEN) {
        return Some(Refusal::Written);
    }
    let path = Path::new(value);
    let plain = |part: Component<'_>| matches!(part, Component::Normal(_) | Component::CurDir);
    if !path.components().all(plain) {
        return Some(Refusal::Outside);
    }
    // What does not exist is no file, and is told of where it was meant as one.
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
        let graph = Path::new("graphs/texturepad.ron");
        for value in [
            "0.5",
            "-3",
            "true",
            "soft",
            "inf",
            "graphs/surfaces/t2-canvas.ron",
            "nobody.ron",
            "",
        ] {
            assert_eq!(refusal(value, graph), None, "{value}");
        }
        for (value, why) in [
            ("/dev/zero", Refusal::Outside),
            ("/dev/stdin", Refusal::Outside),
            ("graphs/../Cargo.toml", Refusal::Outside),
            ("graphs/surfaces/../../Cargo.toml", Refusal::Outside),
            ("Cargo.toml", Refusal::Outside),
            ("graphs/surfaces", Refusal::NoFile),
            ("\"/dev/zero\"", Refusal::Written),
            ("r\"/dev/zero\"", Refusal::Written),
            ("Param(\"wish\")", Refusal::Written),
            ("[1]", Refusal::Written),
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
