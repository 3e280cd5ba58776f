//! Sinks: files, plots and meters.

pub mod csv;
pub(crate) mod meter;
mod note;
#[cfg(feature = "touch")]
pub mod plots;
#[cfg(feature = "touch")]
pub mod recording;
mod sync;
#[cfg(feature = "touch")]
mod visits;
pub mod wav;

use haptograph_engine::node::BuildError;
use std::path::{Component, Path, PathBuf};

/// Names that mean a device on some systems, with any extension.
const DEVICES: [&str; 4] = ["con", "prn", "aux", "nul"];

/// Checks that a file name stays inside the run's folder and has one of the `endings`.
fn inside_the_run(file: &str, endings: &[&str]) -> Result<PathBuf, BuildError> {
    let path = Path::new(file);
    let refused = |message: String| {
        let help = format!(
            "give a plain name such as \"texture.{}\"; the folder is chosen where the graph is run",
            endings[0]
        );
        Err(BuildError::at("file", message).help(help))
    };
    // `components` skips empty parts: "a//b", "a/".
    let is_inside = path.components().all(|part| matches!(part, Component::Normal(_)));
    if !is_inside || file.is_empty() || file.split('/').any(|part| matches!(part, "" | "." | "..")) {
        return refused(format!("`{file}` is not a file name inside the run's folder"));
    }
    if let Some(part) = file.split('/').find(|part| !is_portable(part)) {
        return refused(format!("`{}` is not a valid file name on every system", part.escape_debug()));
    }
    let ending = path.extension().and_then(|ending| ending.to_str()).unwrap_or_default();
    if !endings.iter().any(|known| known.eq_ignore_ascii_case(ending)) {
        let known: Vec<String> = endings.iter().map(|ending| format!(".{ending}")).collect();
        return refused(format!("`{file}` does not end in {}", known.join(" or ")));
    }
    Ok(path.to_owned())
}

/// True if every file system accepts this part of a path.
fn is_portable(part: &str) -> bool {
    let stem = part.split('.').next().unwrap_or_default().to_ascii_lowercase();
    let is_port = |name: &str| {
        let number = stem.strip_prefix(name).unwrap_or_default();
        number.len() == 1 && number.chars().all(|digit| digit.is_ascii_digit())
    };
    let is_device = DEVICES.contains(&stem.as_str()) || is_port("com") || is_port("lpt");
    let forbidden = |c: char| c.is_control() || r#"\<>:"|?*"#.contains(c);
    part.len() <= 200 && !is_device && !part.contains(forbidden) && !part.ends_with(['.', ' '])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn file_names_stay_inside_the_run_and_end_as_what_is_written() {
        for name in ["x.wav", "X.WAV", "a/b.wav", "a b.wav", "..x.wav", "comb.wav", "größe.wav"] {
            assert!(inside_the_run(name, &["wav"]).is_ok(), "{name}");
        }
        let long = format!("{}.wav", "x".repeat(300));
        for name in [
            "",
            ".",
            "..",
            "../x.wav",
            "/tmp/x.wav",
            "a/../x.wav",
            "a//x.wav",
            "x.wav/",
            "./x.wav",
            r"..\x.wav",
            r"C:\x.wav",
            "a\0.wav",
            "a\n.wav",
            "NUL.wav",
            "com1.wav",
            "aux/x.wav",
            "x",
            "x.mp3",
            ".wav",
            "x.wav ",
            &long,
        ] {
            let refused = inside_the_run(name, &["wav"]).err();
            assert_eq!(refused.and_then(|e| e.field), Some("file"), "{name}");
        }
    }
}
