//! Loads the takes in a folder.

use crate::cli::{Failure, eprint, read_file, recording};
use crate::learning::evaluate::{RecordingName, Take, TakeSource};
use crate::learning::recording::{AnyRecording, Gesture, ImportSettings, LoadError, ReadError};
use crate::signal::files;
use crate::surfaces::Origin;
use sha2::{Digest, Sha256};
use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Debug;
use std::io;
use std::path::{Path, PathBuf};

type Files = BTreeMap<RecordingName, PathBuf>;

/// A take that is read from its files whenever it is needed.
#[derive(Debug)]
pub(super) struct FileTake {
    name: RecordingName,
    /// The files, joined by `+`.
    path: PathBuf,
    import: ImportSettings,
    gesture: Gesture,
    origin: Origin,
}

impl TakeSource for FileTake {
    fn name(&self) -> &RecordingName {
        &self.name
    }

    fn gesture(&self) -> Gesture {
        self.gesture
    }

    fn origin(&self) -> Origin {
        self.origin
    }

    fn load(&self) -> Result<Cow<'_, AnyRecording>, String> {
        let loaded = recording::try_load(&self.path, &self.import).map_err(|error| error.to_string())?;
        Ok(Cow::Owned(loaded.recording))
    }
}

/// All takes in a folder, by name. The files of one take count as one recording: of the toolkit's triples the
/// first file stands for all three, a WAV file stands for the table beside it, and a table that lacks
/// quantities is joined with tables whose names extend its own, for example `oak.anna.1.csv` with
/// `oak.anna.1.motion.csv`. Each is read once, so that all errors and warnings come first.
pub(super) fn list_takes(dir: &Path, import: &ImportSettings) -> Result<Vec<FileTake>, Failure> {
    each_take(dir, import, |name, path, recording| FileTake {
        name,
        path,
        import: import.clone(),
        gesture: recording.gesture(),
        origin: recording.provenance().origin,
    })
}

/// The same with their recordings.
pub(super) fn read_takes(dir: &Path, import: &ImportSettings) -> Result<Vec<Take>, Failure> {
    each_take(dir, import, |name, _, recording| Take { name, recording })
}

fn each_take<T>(
    dir: &Path,
    import: &ImportSettings,
    take: impl Fn(RecordingName, PathBuf, AnyRecording) -> T,
) -> Result<Vec<T>, Failure> {
    let files = recordings(dir)?;
    let (mut takes, mut joined) = (vec![], BTreeSet::new());
    for (name, path) in &files {
        if joined.contains(name) {
            continue;
        }
        let (loaded, path, parts) = load(name, path, &files, import)?;
        loaded.warn();
        joined.extend(parts);
        takes.push(take(name.clone(), path, loaded.recording));
    }
    Ok(takes)
}

/// Loads the recording of a take; also returns the paths of its files, joined by `+`, and the names of those joined to it.
fn load(
    name: &RecordingName,
    path: &Path,
    files: &Files,
    import: &ImportSettings,
) -> Result<(recording::Loaded, PathBuf, Vec<RecordingName>), Failure> {
    let error = match recording::try_load(path, import) {
        Ok(loaded) => return Ok((loaded, path.to_owned(), vec![])),
        Err(error) => error,
    };
    let is_missing = |error: &LoadError| {
        let LoadError::Read { source, .. } = error else {
            return false;
        };
        matches!(source, ReadError::Missing { .. })
    };
    if !is_missing(&error) {
        return Err(recording::failure(&error));
    }
    let parts: Vec<(&RecordingName, &PathBuf)> =
        files.iter().filter(|(other, _)| is_part(other, name)).collect();
    if parts.is_empty() {
        let said = recording::failure(&error).to_string();
        let said = said.trim_start_matches("error: ").trim_end();
        let name = |path: &Path| path.file_name().unwrap_or_default().display().to_string();
        let (own, other) = (name(path), name(&path.with_extension("motion.csv")));
        return Err(Failure::Message(format!(
            "{said}\na take of two tables stands in a folder as {own} and {other}"
        )));
    }
    let mut all = path.as_os_str().to_owned();
    for (_, part) in &parts {
        all.push("+");
        all.push(part);
    }
    let all = PathBuf::from(all);
    let loaded = recording::try_load(&all, import).map_err(|error| recording::failure(&error))?;
    let parts = parts.into_iter().map(|(name, _)| name.clone()).collect();
    Ok((loaded, all, parts))
}

/// True if `other` names another part of `take`: `oak.anna.1.motion` of `oak.anna.1`.
fn is_part(other: &RecordingName, take: &RecordingName) -> bool {
    let rest = other.take.strip_prefix(&take.take);
    other.material == take.material
        && other.person == take.person
        && rest.is_some_and(|rest| rest.starts_with(['.', '-', '_']))
}

/// The files that represent the recordings of a folder, by the names of their takes.
fn recordings(dir: &Path) -> Result<Files, Failure> {
    let mut files = Files::new();
    for TakeFiles { take, recording, .. } in take_files(dir)? {
        if let Some(name) = recording_name(&take, &recording) {
            files.insert(name, recording);
        }
    }
    Ok(files)
}

/// The name of a take; without one, a warning that its recording is skipped.
pub(crate) fn recording_name(take: &str, recording: &Path) -> Option<RecordingName> {
    let name = RecordingName::parse(&format!("{take}."));
    if name.is_none() {
        eprint(&format!(
            "warning: skipped {}: its name is not <material>.<person>.<take>.<extension>\n",
            recording.display()
        ));
    }
    name
}

/// The files of one take in a folder.
pub(crate) struct TakeFiles {
    /// The common part of their names.
    pub take: String,
    /// The file that stands for all: of the toolkit's triples the first, and a WAV file for the table beside it.
    pub recording: PathBuf,
    /// All files, with the notes beside recordings.
    pub files: Vec<PathBuf>,
}

/// The takes of a folder, by name.
pub(crate) fn take_files(dir: &Path) -> Result<Vec<TakeFiles>, Failure> {
    let mut takes: BTreeMap<String, Vec<PathBuf>> = BTreeMap::new();
    for path in listed(dir)? {
        let file = path.file_name().unwrap_or_default().to_string_lossy();
        let file = file.strip_suffix(".ron").unwrap_or(&file);
        let parts = ["Accel_", "Position_", "Force_"];
        let file = parts.iter().find_map(|part| file.strip_prefix(part)).unwrap_or(file);
        let take = file.rsplit_once('.').map_or(file, |(take, _)| take).to_owned();
        takes.entry(take).or_default().push(path);
    }
    let is_of = |path: &Path, extension: &str| {
        path.extension().is_some_and(|own| own.eq_ignore_ascii_case(extension))
    };
    let take = |(take, files): (String, Vec<PathBuf>)| {
        let wav = files.iter().find(|path| is_of(path, "wav"));
        let recording = wav.or_else(|| files.iter().find(|path| !is_of(path, "ron")))?.clone();
        Some(TakeFiles { take, recording, files })
    };
    Ok(takes.into_iter().filter_map(take).collect())
}

/// The files of a folder by name, without hidden ones.
pub(super) fn listed(dir: &Path) -> Result<Vec<PathBuf>, Failure> {
    let entries: io::Result<Vec<_>> = files::entries(dir).and_then(Iterator::collect);
    let entries = entries.map_err(Failure::doing("read", dir))?;
    let mut paths: Vec<PathBuf> = entries
        .into_iter()
        .filter(|entry| !entry.file_name().to_string_lossy().starts_with('.'))
        .map(|entry| entry.path())
        .filter(|path| path.is_file())
        .collect();
    paths.sort();
    Ok(paths)
}

/// A hash over the names and contents of files, the settings and the version.
pub(crate) fn hash<'a>(
    files: impl Iterator<Item = &'a PathBuf>,
    settings: &dyn Debug,
) -> Result<String, Failure> {
    let mut hash = Sha256::new();
    hash.update(format!("haptograph {}\n{settings:?}\n", env!("CARGO_PKG_VERSION")));
    for path in files {
        let bytes = read_file(path)?;
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        hash.update(format!("{name} {}\n", bytes.len()));
        hash.update(bytes);
    }
    Ok(files::hex(&hash.finalize()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_of_a_take_begin_with_its_name() {
        let name = |file: &str| RecordingName::parse(file).unwrap();
        let take = name("oak.anna.1.csv");
        for part in ["oak.anna.1.motion.csv", "oak.anna.1-motion.tsv", "oak.anna.1_b.csv"] {
            assert!(is_part(&name(part), &take), "{part}");
        }
        for other in ["oak.anna.1.csv", "oak.anna.10.csv", "oak.ben.1.motion.csv", "elm.anna.1.motion.csv"] {
            assert!(!is_part(&name(other), &take), "{other}");
        }
    }
}
