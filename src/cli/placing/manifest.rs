//! The list of files that haptograph wrote into a folder, with SHA-256 hashes, as JSON. It shows which files
//! are unchanged since.

use crate::signal::files::{self, write_atomically};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use std::fs;
use std::io::{self, Read};
use std::path::{Component, Path, PathBuf};

/// The list of a run's files, in its folder.
pub(crate) const MANIFEST: &str = "manifest.json";
/// Bytes hashed at a time.
const CHUNK: usize = 1 << 16;

/// File names, relative to the list's folder, and the hash of each.
#[derive(Debug, Default, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Manifest {
    haptograph: String,
    sha256: BTreeMap<String, String>,
    /// Files about to be moved to these names: a kill may come before or after the move.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    coming: BTreeMap<String, String>,
}

impl Manifest {
    /// Reads a list; `None` if the file is missing or invalid.
    pub(super) fn read(path: &Path) -> Option<Self> {
        // Links are not followed: their targets may block.
        fs::symlink_metadata(path).ok().filter(fs::Metadata::is_file)?;
        let text = files::read_text(path, files::MAX_MANIFEST_BYTES).ok()?;
        serde_json::from_str(&text).ok()
    }

    /// Writes the whole list or nothing.
    pub(super) fn save(&mut self, path: &Path) -> io::Result<()> {
        env!("CARGO_PKG_VERSION").clone_into(&mut self.haptograph);
        let text = serde_json::to_string_pretty(self)? + "\n";
        write_atomically(path, text.as_bytes())
    }

    /// Adds a file of `folder` with its present hash. A name that is not Unicode is not added: the file
    /// counts as foreign.
    pub(super) fn add(&mut self, folder: &Path, name: &Path) -> io::Result<()> {
        if let Some(text) = name.to_str() {
            self.sha256.insert(text.to_owned(), hash(&folder.join(name))?);
        }
        Ok(())
    }

    /// Adds a file that is about to be moved to this name, where the present file stays until then.
    pub(super) fn announce(&mut self, name: &str, waiting: &Path) -> io::Result<()> {
        self.coming.insert(name.to_owned(), hash(waiting)?);
        Ok(())
    }

    /// Ends the announcement of a file after its move, or after the attempt.
    pub(super) fn settle(&mut self, name: &str, is_moved: bool) {
        if let Some((name, hash)) = self.coming.remove_entry(name).filter(|_| is_moved) {
            self.sha256.insert(name, hash);
        }
    }

    /// True if this file is in the list and unchanged.
    pub(super) fn is_unchanged(&self, folder: &Path, name: &Path) -> bool {
        let file = folder.join(name);
        let listed = |list: &BTreeMap<String, String>| list.get(name.to_str()?).cloned();
        let hashes = [listed(&self.sha256), listed(&self.coming)];
        let is_file = fs::symlink_metadata(&file).is_ok_and(|found| found.is_file());
        let is_listed = |hash: String| hashes.contains(&Some(hash));
        is_file && hashes.iter().any(Option::is_some) && hash(&file).is_ok_and(is_listed)
    }

    /// All names that stay inside the folder, since a list can be forged.
    pub(super) fn names(&self) -> impl Iterator<Item = PathBuf> {
        let names = self.sha256.keys().map(PathBuf::from);
        let inside = |name: &PathBuf| name.components().all(|part| matches!(part, Component::Normal(_)));
        names.filter(move |name| inside(name) && !name.as_os_str().is_empty())
    }

    /// Removes the names of files that do not exist.
    pub(super) fn forget_missing(&mut self, folder: &Path) {
        self.sha256.retain(|name, _| folder.join(name).exists());
    }
}

/// The SHA-256 hash of a file's bytes, in hexadecimal digits.
fn hash(path: &Path) -> io::Result<String> {
    // Unbounded, since runs may last hours.
    let mut file = files::open(path, u64::MAX)?;
    let (mut hasher, mut chunk) = (Sha256::new(), vec![0; CHUNK]);
    loop {
        match file.read(&mut chunk)? {
            0 => break,
            read => hasher.update(&chunk[..read]),
        }
    }
    Ok(files::hex(&hasher.finalize()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_counts_as_written_until_it_changes() {
        let folder = tempfile::tempdir().unwrap();
        let (list, name) = (folder.path().join("list"), Path::new("a.txt"));
        fs::write(folder.path().join(name), "abc").unwrap();
        let mut written = Manifest::default();
        written.add(folder.path(), name).unwrap();
        written.save(&list).unwrap();
        let read = Manifest::read(&list).unwrap();
        // Hash from FIPS 180-2, B.1.
        assert!(read.sha256["a.txt"].starts_with("ba7816bf"), "{read:?}");
        assert!(read.is_unchanged(folder.path(), name));
        fs::write(folder.path().join(name), "abd").unwrap();
        assert!(!read.is_unchanged(folder.path(), name));
        assert!(!read.is_unchanged(folder.path(), Path::new("b.txt")));
        assert_eq!(Manifest::read(&folder.path().join("a.txt")), None);
    }

    #[test]
    fn a_forged_list_does_not_lead_out_of_its_folder() {
        let text =
            r#"{"haptograph": "1", "sha256": {"../a": "", "/b": "", "c/../../d": "", "": "", "e/f": ""}}"#;
        let written: Manifest = serde_json::from_str(text).unwrap();
        assert_eq!(written.names().collect::<Vec<_>>(), [Path::new("e/f")]);
    }
}
