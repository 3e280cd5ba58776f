//! What haptograph wrote into a folder, and whether it is still as it was written: names with SHA-256 hashes, as JSON.
//!
//! A run's folder has its list in `manifest.json`; single files have theirs in `.haptograph.json` beside them.

use crate::signal::files;
use crate::surfaces::files::write_atomically;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use std::fs;
use std::io::{self, Read};
use std::path::{Component, Path, PathBuf};

/// Longer lists are not read, bytes: a hundred thousand files.
const MOST_BYTES: u64 = 16 << 20;
/// What is read at a time for a hash, bytes.
const CHUNK: usize = 1 << 16;

/// Names of files, relative to the list's folder, and the hash of each as it was written.
#[derive(Debug, Default, Clone, PartialEq, Serialize, Deserialize)]
pub struct Written {
    haptograph: String,
    sha256: BTreeMap<String, String>,
    /// What is about to be moved there: a kill may come before or after the move.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    coming: BTreeMap<String, String>,
}

impl Written {
    /// The list in a file; none where that is not there, or is none.
    pub fn read(path: &Path) -> Option<Self> {
        // Not followed: a link could lead to what blocks.
        let found = fs::symlink_metadata(path).ok()?;
        if !found.is_file() {
            return None;
        }
        let text = files::read_text(path, MOST_BYTES).ok()?;
        serde_json::from_str(&text).ok()
    }

    /// Writes the list whole or not at all.
    pub fn save(&mut self, path: &Path) -> io::Result<()> {
        env!("CARGO_PKG_VERSION").clone_into(&mut self.haptograph);
        let text = serde_json::to_string_pretty(self)? + "\n";
        write_atomically(path, text.as_bytes())
    }

    /// Notes a file of `folder` as it is now. A name that is no Unicode is not noted: the file counts as somebody's.
    pub fn note(&mut self, folder: &Path, name: &Path) -> io::Result<()> {
        if let Some(text) = name.to_str() {
            let hash = hash(&folder.join(name))?;
            self.sha256.insert(text.to_owned(), hash);
        }
        Ok(())
    }

    /// Notes a file that is about to be moved to this name.
    pub fn announce(&mut self, name: &Path, waiting: &Path) -> io::Result<()> {
        if let Some(text) = name.to_str() {
            self.coming.insert(text.to_owned(), hash(waiting)?);
        }
        Ok(())
    }

    /// What was announced by this name is there.
    pub fn arrived(&mut self, name: &Path) {
        if let Some((name, hash)) = name.to_str().and_then(|text| self.coming.remove_entry(text)) {
            self.sha256.insert(name, hash);
        }
    }

    /// What was announced by this name does not come.
    pub fn withdraw(&mut self, name: &Path) {
        name.to_str().and_then(|text| self.coming.remove(text));
    }

    /// Is this file in the list, and still as it was written?
    pub fn is_unchanged(&self, folder: &Path, name: &Path) -> bool {
        let noted = |list: &BTreeMap<String, String>| list.get(name.to_str()?).cloned();
        let noted = [noted(&self.sha256), noted(&self.coming)];
        let file = folder.join(name);
        let is_file = fs::symlink_metadata(&file).is_ok_and(|found| found.is_file());
        let is_noted = |hash: String| noted.contains(&Some(hash));
        is_file && noted.iter().any(Option::is_some) && hash(&file).is_ok_and(is_noted)
    }

    /// All names that stay inside the folder: a list can be forged.
    pub fn names(&self) -> impl Iterator<Item = PathBuf> {
        let names = self.sha256.keys().map(PathBuf::from);
        let inside = |name: &PathBuf| name.components().all(|part| matches!(part, Component::Normal(_)));
        names.filter(move |name| inside(name) && !name.as_os_str().is_empty())
    }

    /// Forgets all but some names.
    pub fn retain(&mut self, mut keep: impl FnMut(&str) -> bool) {
        self.sha256.retain(|name, _| keep(name));
    }
}

/// The SHA-256 hash of a file's bytes, in hexadecimal digits.
fn hash(path: &Path) -> io::Result<String> {
    // However long: runs last hours.
    let mut file = files::open(path, u64::MAX)?;
    let (mut hasher, mut chunk) = (Sha256::new(), vec![0; CHUNK]);
    loop {
        match file.read(&mut chunk)? {
            0 => break,
            read => hasher.update(&chunk[..read]),
        }
    }
    Ok(hasher
        .finalize()
        .iter()
        .map(|byte| format!("{byte:02x}"))
        .collect())
}

/// The path itself where it is free, or else with the first number behind its name that makes it so: `x-1.wav`.
pub fn free_beside(path: &Path) -> PathBuf {
    let mut free = path.to_owned();
    for number in 1_u64.. {
        if fs::symlink_metadata(&free).is_err() {
            break;
        }
        let mut name = path.file_stem().unwrap_or_default().to_owned();
        name.push(format!("-{number}"));
        if let Some(extension) = path.extension() {
            name.push(".");
            name.push(extension);
        }
        free = path.with_file_name(name);
    }
    free
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_counts_as_written_until_it_changes() {
        let folder = tempfile::tempdir().unwrap();
        let (list, name) = (folder.path().join("list"), Path::new("a.txt"));
        fs::write(folder.path().join(name), "abc").unwrap();
        let mut written = Written::default();
        written.note(folder.path(), name).unwrap();
        written.save(&list).unwrap();
        let read = Written::read(&list).unwrap();
        // The hash of FIPS 180-2, B.1.
        assert!(read.sha256["a.txt"].starts_with("ba7816bf"), "{read:?}");
        assert!(read.is_unchanged(folder.path(), name));
        fs::write(folder.path().join(name), "abd").unwrap();
        assert!(!read.is_unchanged(folder.path(), name));
        assert!(!read.is_unchanged(folder.path(), Path::new("b.txt")));
        assert_eq!(Written::read(&folder.path().join("a.txt")), None);
    }

    #[test]
    fn a_forged_list_does_not_lead_out_of_its_folder() {
        let text =
            r#"{"haptograph": "1", "sha256": {"../a": "", "/b": "", "c/../../d": "", "": "", "e/f": ""}}"#;
        let written: Written = serde_json::from_str(text).unwrap();
        assert_eq!(written.names().collect::<Vec<_>>(), [Path::new("e/f")]);
    }

    #[test]
    fn a_free_name_keeps_its_extension() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.wav");
        assert_eq!(free_beside(&path), path);
        fs::write(&path, "").unwrap();
        fs::create_dir(folder.path().join("x-1.wav")).unwrap();
        assert_eq!(free_beside(&path), folder.path().join("x-2.wav"));
    }
}
