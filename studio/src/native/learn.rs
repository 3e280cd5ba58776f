//! Learns a surface from a recording dropped on the page.

use haptograph_surfaces::files::native;
use haptograph_surfaces::learning::{LearnSettings, learn};
use haptograph_surfaces::recording::{ImportSettings, load_with};
use std::io::Write;
use std::path::{Path, PathBuf};

/// Maximum length of a surface's name.
const MAX_LETTERS: usize = 60;

/// A learned surface.
#[derive(Debug)]
pub struct Learned {
    /// Its file.
    pub path: PathBuf,
    /// The report of the learning, as HTML.
    pub report: String,
}

/// Learns the table `name` and writes its surface to a new file in `folder`.
pub fn surface(name: &str, table: &[u8], folder: &Path) -> Result<Learned, String> {
    let stem = stem(name);
    let workplace =
        tempfile::tempdir().map_err(|error| format!("cannot create a temporary folder: {error}"))?;
    let taken = workplace.path().join(format!("{stem}.csv"));
    std::fs::write(&taken, table).map_err(|error| format!("cannot store the recording: {error}"))?;
    let shown = |error: &dyn std::fmt::Display| {
        error
            .to_string()
            .replace(&*workplace.path().to_string_lossy(), "")
    };
    let (recording, _) = load_with(&[taken], &ImportSettings::default()).map_err(|error| shown(&error))?;
    let (surface, report) =
        learn(&stem, &[recording], &LearnSettings::default(), &|_| ()).map_err(|error| shown(&error))?;
    if surface.texture.is_none() {
        return Err("cannot learn a texture: the recording holds no drag with force and speed".to_owned());
    }
    let failed = |error: std::io::Error| format!("cannot write the surface: {error}");
    let mut file = tempfile::NamedTempFile::new_in(folder).map_err(failed)?;
    file.write_all(native::write(&surface).as_bytes())
        .map_err(failed)?;
    make_readable(file.as_file()).map_err(failed)?;
    for number in 0..1000 {
        let path = match number {
            0 => folder.join(format!("{stem}.ron")),
            number => folder.join(format!("{stem}-{number}.ron")),
        };
        match file.persist_noclobber(&path) {
            Ok(_) => {
                let report = haptograph_report::learning::page(&surface, &report);
                return Ok(Learned { path, report });
            }
            Err(error) if error.error.kind() == std::io::ErrorKind::AlreadyExists => file = error.file,
            Err(error) => return Err(failed(error.error)),
        }
    }
    Err("a thousand surfaces with this name exist; remove or rename some".to_owned())
}

/// Temporary files are private; surfaces get the permissions of ordinary files.
#[cfg(unix)]
fn make_readable(file: &std::fs::File) -> std::io::Result<()> {
    use std::os::unix::fs::PermissionsExt;
    file.set_permissions(std::fs::Permissions::from_mode(0o644))
}

#[cfg(not(unix))]
fn make_readable(_: &std::fs::File) -> std::io::Result<()> {
    Ok(())
}

/// Letters, digits and hyphens of a file's name without its extension.
fn stem(name: &str) -> String {
    let name = name.rsplit(['/', '\\']).next().unwrap_or_default();
    let name = name.rsplit_once('.').map_or(name, |(stem, _)| stem);
    let kept = name
        .chars()
        .map(|c| if c.is_ascii_alphanumeric() { c } else { '-' });
    let kept: String = kept.take(MAX_LETTERS).collect();
    let kept = kept.trim_matches('-');
    if kept.is_empty() {
        "recording".to_owned()
    } else {
        kept.to_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_become_names_of_files_and_nothing_more() {
        for (name, kept) in [
            ("take 3.csv", "take-3"),
            ("../../etc/passwd", "passwd"),
            ("C:\\x\\..\\..", "recording"),
            ("", "recording"),
            ("...", "recording"),
        ] {
            assert_eq!(stem(name), kept, "{name}");
        }
    }

    #[test]
    fn what_is_no_recording_says_why_and_writes_nothing() {
        let folder = tempfile::tempdir().expect("a folder");
        let why = surface("x.csv", b"a,b\n1,2\n", folder.path()).expect_err("it is none");
        assert!(!why.is_empty() && !why.contains("/tmp"), "{why}");
        assert_eq!(std::fs::read_dir(folder.path()).expect("a folder").count(), 0);
    }
}
