//! The list of files that haptograph wrote into a folder, with SHA-256 hashes, as JSON. It shows which files
//! are unchanged since.
//!
//! A run's folder has its list in `manifest.json`, single files in `.haptograph.json` beside them.

use crate::signal::files;
use crate::signal::files::write_atomically;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use std::fs;
use std::io::{self, Read};
use std::path::{Component, Path, PathBuf};

/// Bytes hashed at a time.
const CHUNK: usize = 1 << 16;

/// File names, relative to the list's folder, and the hash of each.
#[derive(Debug, Default, Clone, PartialEq, Serialize, Deserialize)]
pub struct FileManifest {
    haptograph: String,
    sha256: BTreeMap<String, String>,
    /// Files about to be moved to these names: a kill may come before or after the move.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    coming: BTreeMap<String, String>,
}

impl FileManifest {
    /// Reads a list; `None` if the file is missing or invalid.
    pub fn read(path: &Path) -> Option<Self> {
        // Links are not followed: their targets may block.
        let found = fs::symlink_metadata(path).ok()?;
        if !found.is_file() {
            return None;
        }
        let text = files::read_text(path, files::MAX_MANIFEST_BYTES).ok()?;
        serde_json::from_str(&text).ok()
    }

    /// Writes the whole list or nothing.
    pub fn save(&mut self, path: &Path) -> io::Result<()> {
        env!("CARGO_PKG_VERSION").clone_into(&mut self.haptograph);
        let text = serde_json::to_string_pretty(self)? + "\n";
        write_atomically(path, text.as_bytes())
    }

    /// Adds a file of `folder` with its present hash. A name that is not Unicode is not added: the file
    /// counts as foreign.
    pub fn note(&mut self, folder: &Path, name: &Path) -> io::Result<()> {
        if let Some(text) = name.to_str() {
            let hash = hash(&folder.join(name))?;
            self.sha256.insert(text.to_owned(), hash);
        }
        Ok(())
    }

    /// Adds a file that is about to be moved to this name.
    pub fn announce(&mut self, name: &Path, waiting: &Path) -> io::Result<()> {
        if let Some(text) = name.to_str() {
            self.coming.insert(text.to_owned(), hash(waiting)?);
        }
        Ok(())
    }

    /// Confirms that an announced file was moved.
    pub fn arrived(&mut self, name: &Path) {
        if let Some((name, hash)) = name.to_str().and_then(|text| self.coming.remove_entry(text)) {
            self.sha256.insert(name, hash);
        }
    }

    /// Removes an announced file that was not moved.
    pub fn withdraw(&mut self, name: &Path) {
        name.to_str().and_then(|text| self.coming.remove(text));
    }

    /// True if this file is in the list and unchanged.
    pub fn is_unchanged(&self, folder: &Path, name: &Path) -> bool {
        let noted = |list: &BTreeMap<String, String>| list.get(name.to_str()?).cloned();
        let noted = [noted(&self.sha256), noted(&self.coming)];
        let file = folder.join(name);
        let is_file = fs::symlink_metadata(&file).is_ok_and(|found| found.is_file());
        let is_noted = |hash: String| noted.contains(&Some(hash));
        is_file && noted.iter().any(Option::is_some) && hash(&file).is_ok_and(is_noted)
    }

    /// All names that stay inside the folder, since a list can be forged.
    pub fn names(&self) -> impl Iterator<Item = PathBuf> {
        let names = self.sha256.keys().map(PathBuf::from);
        let inside = |name: &PathBuf| name.components().all(|part| matches!(part, Component::Normal(_)));
        names.filter(move |name| inside(name) && !name.as_os_str().is_empty())
    }

    /// Keeps only some names.
    pub fn retain(&mut self, mut keep: impl FnMut(&str) -> bool) {
        self.sha256.retain(|name, _| keep(name));
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
    Ok(hasher.finalize().iter().map(|byte| format!("{byte:02x}")).collect())
}

/// The path itself if it is free, otherwise with the first free number: `x-1.wav`.
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
        let mut written = FileManifest::default();
        written.note(folder.path(), name).unwrap();
        written.save(&list).unwrap();
        let read = FileManifest::read(&list).unwrap();
        // Hash from FIPS 180-2, B.1.
        assert!(read.sha256["a.txt"].starts_with("ba7816bf"), "{read:?}");
        assert!(read.is_unchanged(folder.path(), name));
        fs::write(folder.path().join(name), "abd").unwrap();
        assert!(!read.is_unchanged(folder.path(), name));
        assert!(!read.is_unchanged(folder.path(), Path::new("b.txt")));
        assert_eq!(FileManifest::read(&folder.path().join("a.txt")), None);
    }

    #[test]
    fn a_forged_list_does_not_lead_out_of_its_folder() {
        let text =
            r#"{"haptograph": "1", "sha256": {"../a": "", "/b": "", "c/../../d": "", "": "", "e/f": ""}}"#;
        let written: FileManifest = serde_json::from_str(text).unwrap();
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
