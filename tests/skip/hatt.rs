//! The toolkit's own files, which may not be redistributed: read where `HATT_DIR` names the folder they are in.

use std::path::{Path, PathBuf};

#[path = "mod.rs"]
mod skip;

/// The files of a sub-folder, sorted; none, saying so, without the toolkit.
pub fn hatt_files(folder: &str) -> Vec<PathBuf> {
    let Some(root) = std::env::var_os("HATT_DIR") else {
        skip::skip("HATT_DIR names no folder of the toolkit's files");
        return Vec::new();
    };
    let mut files = haptograph_signal::files::list(&Path::new(&root).join(folder));
    files.retain(|file| file.extension().is_some_and(|extension| extension == "xml"));
    files.sort();
    assert_eq!(files.len(), 100, "HATT_DIR holds Models and Taps");
    files
}

pub const AT_10_KHZ: &str = "Models/Models10000Hz/XML";
#[allow(dead_code)] // not every test needs both
pub const AT_1_KHZ: &str = "Models/Models1000Hz/XML";
