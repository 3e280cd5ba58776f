//! Learns a surface from a recording dropped on the page, into a file.

use crate::learn::{FULL, learn_table, paths, stem};
use std::io::Write;
use std::path::{Path, PathBuf};

/// Learns the table `name` and writes its surface to a new file in `folder`; returns the file and the report as HTML.
pub fn surface(name: &str, table: &[u8], folder: &Path) -> Result<(PathBuf, String), String> {
    let stem = stem(name);
    let workplace =
        tempfile::tempdir().map_err(|error| format!("cannot create a temporary folder: {error}"))?;
    let taken = workplace.path().join(format!("{stem}.csv"));
    std::fs::write(&taken, table).map_err(|error| format!("cannot store the recording: {error}"))?;
    let learned = learn_table(&stem, &taken)?;
    let failed = |error: std::io::Error| format!("cannot write the surface: {error}");
    let mut file = tempfile::NamedTempFile::new_in(folder).map_err(failed)?;
    file.write_all(learned.text().as_bytes()).map_err(failed)?;
    make_readable(file.as_file()).map_err(failed)?;
    for path in paths(folder, &stem) {
        match file.persist_noclobber(&path) {
            Ok(_) => return Ok((path, learned.page())),
            Err(error) if error.error.kind() == std::io::ErrorKind::AlreadyExists => file = error.file,
            Err(error) => return Err(failed(error.error)),
        }
    }
    Err(FULL.to_owned())
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_recording_says_why_and_writes_nothing() {
        let folder = tempfile::tempdir().expect("a folder");
        let why = surface("x.csv", b"a,b\n1,2\n", folder.path()).expect_err("it is none");
        assert!(!why.is_empty() && !why.contains("/tmp"), "{why}");
        assert_eq!(std::fs::read_dir(folder.path()).expect("a folder").count(), 0);
    }
}
