//! Recordings on disk: what kind a file is, told by its content, and where reading failed.

use super::{AnyRecording, ReadError, read_archive, read_csv, read_hatt, write_archive, write_csv};
use crate::files::write_atomically;
use haptograph_signal::files::{self, Bounded, MAX_RECORDING_BYTES};
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};

/// A recording from a file: [our own archive](read_archive), [CSV](read_csv), or any of the three
/// XML files that the public haptic texture toolkit (HaTT) makes of a recording (the other two must lie beside it).
///
/// Kinds are told apart by content.
pub fn load(path: &Path) -> Result<AnyRecording, LoadError> {
    let failed = |source| LoadError::Read {
        path: path.to_owned(),
        source,
    };
    let mut file = open(path)?;
    let start = file.fill_buf().map_err(|source| io_error(path, source))?;
    let is_archive = start.starts_with(b"PK");
    if start
        .strip_prefix(b"\xef\xbb\xbf")
        .unwrap_or(start)
        .trim_ascii_start()
        .starts_with(b"<")
    {
        return load_hatt(path);
    }
    let mut bytes = vec![];
    file.read_to_end(&mut bytes)
        .map_err(|source| io_error(path, source))?;
    let read = if is_archive {
        read_archive(&bytes)
    } else {
        read_csv(&bytes, &path.display().to_string())
    };
    read.map_err(failed)
}

/// Writes a recording, complete or not at all: as CSV where the name ends so, else as our own archive.
pub fn save(recording: &AnyRecording, path: &Path) -> std::io::Result<()> {
    let is_csv = path
        .extension()
        .is_some_and(|extension| extension.eq_ignore_ascii_case("csv"));
    let bytes = if is_csv {
        write_csv(recording)?
    } else {
        write_archive(recording)?
    };
    write_atomically(path, &bytes)
}

/// The prefixes of a HaTT triple's file names.
const TRIPLE: [&str; 3] = ["Accel_", "Position_", "Force_"];

fn load_hatt(path: &Path) -> Result<AnyRecording, LoadError> {
    let name = path
        .file_name()
        .map(|name| name.to_string_lossy().into_owned())
        .unwrap_or_default();
    let material = TRIPLE
        .iter()
        .find_map(|prefix| name.strip_prefix(prefix))
        .ok_or_else(|| LoadError::Read {
            path: path.to_owned(),
            source: ReadError::NotATriple,
        })?;
    let [accel, position, force] = TRIPLE.map(|prefix| path.with_file_name(format!("{prefix}{material}")));
    let source = material.strip_suffix(".xml").unwrap_or(material);
    read_hatt(open(&accel)?, open(&position)?, open(&force)?, source)
        .map(AnyRecording::Processed)
        .map_err(|source| LoadError::Read {
            path: path.to_owned(),
            source,
        })
}

fn open(path: &Path) -> Result<BufReader<Bounded>, LoadError> {
    let file = files::open(path, MAX_RECORDING_BYTES).map_err(|source| io_error(path, source))?;
    Ok(BufReader::with_capacity(1 << 16, file))
}

fn io_error(path: &Path, source: std::io::Error) -> LoadError {
    LoadError::Io {
        path: path.to_owned(),
        source,
    }
}

/// Why a file gives no recording.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)] // the messages say it
pub enum LoadError {
    #[error("cannot read {}: {source}", path.display())]
    Io { path: PathBuf, source: std::io::Error },
    #[error("{} is no recording: {source}", path.display())]
    Read { path: PathBuf, source: ReadError },
}
