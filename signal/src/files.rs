//! Bounded reading of files, folders and lines, and atomic writing. The library opens files and folders for reading only here.

mod limits;
#[cfg(target_family = "wasm")]
mod memory;
mod roots;
mod write;

use crate::spelling::closest;
pub use limits::*;
#[cfg(target_family = "wasm")]
pub use memory::*;
pub use roots::{Roots, noting_files, refused};
#[cfg(not(target_family = "wasm"))]
use std::fs::{DirEntry, File, OpenOptions};
use std::io::{self, BufRead, Read};
use std::path::{Path, PathBuf};
pub use write::{TEMPORARY, copy_atomically, is_temporary, write_atomically_by};
#[cfg(not(target_family = "wasm"))]
pub use {
    std::fs::{create_dir as create_new_folder, create_dir_all as create_folder},
    write::{Lock, append_at, lock, remove, write_atomically},
};

/// Largest number of names that are read from one folder: more than twice the chunks of the largest batch.
pub const MAX_NAMES: usize = 500_000;
/// Longest line that is read from terminals and other programs, bytes.
pub const MAX_LINE_BYTES: usize = 64 << 10;

/// Reason for refusing a file or a line. An [`io::Error`] carries it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Refusal {
    /// The path leads to a folder, pipe, socket or device.
    #[error("it is {found}, not a regular file")]
    NotRegular {
        /// The type.
        found: &'static str,
    },
    /// The path leads to a file where a folder is needed.
    #[error("it is a file, not a folder")]
    NotFolder,
    /// The file is not a serial port or other terminal.
    #[error("it is not a serial port")]
    NotTerminal,
    /// The path is outside the folders that may be read, whether it exists or not.
    #[error("it is outside the folders that may be read here")]
    Outside,
    /// More bytes were read than the bound allows.
    #[error("it is longer than {max_bytes} bytes")]
    TooLong {
        /// The bound.
        max_bytes: u64,
    },
    /// The folder has more names than are read.
    #[error(
        "it holds more than {max_names} names, notes and folders included; split it into several folders"
    )]
    TooManyNames {
        /// The bound.
        max_names: usize,
    },
}

/// Reason why a path leads to nothing. An [`io::Error`] of kind [`io::ErrorKind::NotFound`] carries it.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Missing {
    /// The folder of the path does not exist.
    #[error("there is no folder {}", folder.display())]
    Folder {
        /// The folder.
        folder: PathBuf,
    },
    /// The folder has no file of this name.
    #[error("there is no such file{}", meant(similar.as_deref()))]
    File {
        /// A name in the folder that the path may mean.
        similar: Option<String>,
    },
}

fn meant(similar: Option<&str>) -> String {
    similar.map_or_else(String::new, |name| format!("; did you mean `{name}`?"))
}

impl Missing {
    #[cfg(not(target_family = "wasm"))]
    fn of(path: &Path) -> io::Error {
        let folder = folder_of(path);
        let missing = match folder.is_dir() {
            true => Self::File { similar: similar(path) },
            false => Self::Folder { folder: folder.to_owned() },
        };
        io::Error::new(io::ErrorKind::NotFound, missing)
    }
}

fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    }
}

/// Largest number of names of a folder that are compared with that of a missing file.
const MAX_COMPARED: usize = 4096;

/// The name in the same folder, with the same extension, that was probably meant by a path that leads to nothing.
pub fn similar(path: &Path) -> Option<String> {
    let wanted = path.file_stem()?.to_str()?;
    let of_kind = |name: &PathBuf| name.extension() == path.extension();
    let names = names(folder_of(path)).take(MAX_COMPARED).filter(of_kind);
    let mut stems: Vec<String> =
        names.filter_map(|name| Some(name.file_stem()?.to_str()?.to_owned())).collect();
    stems.sort_unstable();
    let stem = closest(wanted, stems.iter().map(String::as_str))?;
    let extension = path.extension().map(|extension| extension.to_string_lossy());
    Some(extension.map_or_else(|| stem.to_owned(), |extension| format!("{stem}.{extension}")))
}

#[cfg(not(target_family = "wasm"))]
fn names(folder: &Path) -> impl Iterator<Item = PathBuf> {
    let entries = entries(folder).into_iter().flatten().flatten();
    entries.map(|entry| PathBuf::from(entry.file_name()))
}

#[cfg(target_family = "wasm")]
fn names(folder: &Path) -> impl Iterator<Item = PathBuf> {
    let files = list(folder).into_iter();
    files.filter_map(|file| file.file_name().map(PathBuf::from))
}

impl Refusal {
    /// The refusal in an error, if any.
    pub fn of(error: &io::Error) -> Option<Self> {
        error.get_ref()?.downcast_ref().copied()
    }
}

impl From<Refusal> for io::Error {
    fn from(refusal: Refusal) -> Self {
        let kind = match refusal {
            Refusal::NotRegular { .. } | Refusal::NotFolder | Refusal::NotTerminal => {
                io::ErrorKind::InvalidInput
            }
            Refusal::Outside => io::ErrorKind::PermissionDenied,
            Refusal::TooLong { .. } | Refusal::TooManyNames { .. } => io::ErrorKind::FileTooLarge,
        };
        Self::new(kind, refusal)
    }
}

/// An open file that gives an error beyond a number of bytes.
#[derive(Debug)]
pub struct Bounded {
    file: File,
    max_bytes: u64,
    left: u64,
}

impl Bounded {
    /// The file itself, for locks and metadata.
    pub fn as_file(&self) -> &File {
        &self.file
    }
}

impl Read for Bounded {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        // One byte beyond the bound shows that the file is longer.
        let most = into.len().min(usize::try_from(self.left).unwrap_or(usize::MAX).saturating_add(1));
        let read = self.file.read(&mut into[..most])?;
        let left = self.left.checked_sub(read as u64);
        let max_bytes = self.max_bytes;
        self.left = left.ok_or(Refusal::TooLong { max_bytes })?;
        Ok(read)
    }
}

/// Opens a regular file for reading at most `max_bytes` bytes.
///
/// Never blocks. The type is checked after opening, so that the file cannot be replaced in between. A thread that is
/// confined to [`Roots`] opens nothing else.
///
/// # Errors
/// Those of the file system, [`Missing`] and [`Refusal`].
pub fn open(path: &Path, max_bytes: u64) -> io::Result<Bounded> {
    let path = roots::admitted(path)?;
    let path = &*path;
    #[cfg(not(target_family = "wasm"))]
    let file = open_regular(path, File::options().read(true))?;
    #[cfg(target_family = "wasm")]
    let file = File::open(path)?;
    roots::note(path);
    if length(&file)? > max_bytes {
        return Err(Refusal::TooLong { max_bytes }.into());
    }
    Ok(Bounded { file, max_bytes, left: max_bytes })
}

#[cfg(not(target_family = "wasm"))]
fn length(file: &File) -> io::Result<u64> {
    Ok(file.metadata()?.len())
}

#[cfg(target_family = "wasm")]
fn length(file: &File) -> io::Result<u64> {
    file.length()
}

/// True if the path is a regular file that may be read.
pub fn is_file(path: &Path) -> bool {
    let Ok(path) = roots::admitted(path) else {
        return false;
    };
    #[cfg(not(target_family = "wasm"))]
    return path.is_file();
    #[cfg(target_family = "wasm")]
    return memory::is_file(&path);
}

/// True if the path is a folder that may be read.
pub fn is_folder(path: &Path) -> bool {
    let Ok(path) = roots::admitted(path) else {
        return false;
    };
    #[cfg(not(target_family = "wasm"))]
    return path.is_dir();
    #[cfg(target_family = "wasm")]
    return memory::is_folder(&path);
}

/// The entries of a folder that may be read, unordered: at most [`MAX_NAMES`], then [`Refusal::TooManyNames`].
///
/// # Errors
/// Those of the file system, [`Missing`], [`Refusal::NotFolder`] and [`Refusal::Outside`].
#[cfg(not(target_family = "wasm"))]
pub fn entries(folder: &Path) -> io::Result<impl Iterator<Item = io::Result<DirEntry>> + use<>> {
    let folder = roots::admitted(folder)?;
    let entries = std::fs::read_dir(&folder).map_err(|error| match error.kind() {
        io::ErrorKind::NotADirectory => Refusal::NotFolder.into(),
        io::ErrorKind::NotFound => Missing::of(&folder),
        _ => error,
    })?;
    Ok(bounded(entries, MAX_NAMES))
}

/// Returns at most `MAX_NAMES` entries, then an error.
#[cfg(not(target_family = "wasm"))]
fn bounded<T>(
    entries: impl Iterator<Item = io::Result<T>>,
    max_names: usize,
) -> impl Iterator<Item = io::Result<T>> {
    let refusal = Refusal::TooManyNames { max_names };
    entries.take(max_names + 1).enumerate().map(move |(count, entry)| match count < max_names {
        true => entry,
        false => Err(refusal.into()),
    })
}

/// The regular files of a folder that may be read, unordered; none if it does not exist, and the first [`MAX_NAMES`] names of
/// a larger folder.
pub fn list(folder: &Path) -> Vec<PathBuf> {
    if !is_folder(folder) {
        return Vec::new();
    }
    #[cfg(not(target_family = "wasm"))]
    {
        let entries = entries(folder).into_iter().flatten().flatten();
        entries.map(|entry| folder.join(entry.file_name())).filter(|path| is_file(path)).collect()
    }
    #[cfg(target_family = "wasm")]
    memory::list(folder)
}

/// The folders in a folder, unordered; none if it does not exist.
pub fn folders(folder: &Path) -> Vec<PathBuf> {
    #[cfg(not(target_family = "wasm"))]
    {
        let entries = entries(folder).into_iter().flatten().flatten();
        entries.map(|entry| folder.join(entry.file_name())).filter(|path| is_folder(path)).collect()
    }
    #[cfg(target_family = "wasm")]
    memory::folders(folder)
}

/// Opens a regular file for changes in place. Never blocks, as [`open`].
///
/// # Errors
/// Those of the file system, and [`Refusal::NotRegular`].
#[cfg(not(target_family = "wasm"))]
pub fn open_to_change(path: &Path) -> io::Result<File> {
    open_regular(path, File::options().read(true).write(true))
}

/// Opens a serial port or another terminal for reading. Neither opening nor reading blocks.
///
/// # Errors
/// Those of the file system, and [`Refusal::NotTerminal`].
#[cfg(unix)]
pub fn open_terminal(path: &Path) -> io::Result<File> {
    let mut options = File::options();
    std::os::unix::fs::OpenOptionsExt::custom_flags(&mut options, libc::O_NONBLOCK | libc::O_NOCTTY);
    let opened = options.read(true).open(path)?;
    match io::IsTerminal::is_terminal(&opened) {
        true => Ok(opened),
        false => Err(Refusal::NotTerminal.into()),
    }
}

#[cfg(not(target_family = "wasm"))]
fn open_regular(path: &Path, options: &mut OpenOptions) -> io::Result<File> {
    #[cfg(unix)]
    std::os::unix::fs::OpenOptionsExt::custom_flags(options, libc::O_NONBLOCK | libc::O_NOCTTY);
    let opened = options.open(path);
    // Sockets cannot be opened at all, nor can folders everywhere.
    let metadata = match &opened {
        Ok(file) => file.metadata()?,
        Err(_) => match path.metadata() {
            Ok(metadata) if !metadata.is_file() => metadata,
            _ => return opened.map_err(|error| unopened(path, error)),
        },
    };
    if !metadata.is_file() {
        let found = kind(metadata.file_type());
        return Err(Refusal::NotRegular { found }.into());
    }
    opened
}

#[cfg(not(target_family = "wasm"))]
fn unopened(path: &Path, error: io::Error) -> io::Error {
    match error.kind() {
        // The path goes on below a file.
        io::ErrorKind::NotFound | io::ErrorKind::NotADirectory => Missing::of(path),
        _ => error,
    }
}

#[cfg(unix)]
fn kind(of: std::fs::FileType) -> &'static str {
    use std::os::unix::fs::FileTypeExt;
    match of {
        _ if of.is_dir() => "a folder",
        _ if of.is_fifo() => "a named pipe",
        _ if of.is_socket() => "a socket",
        _ => "a device",
    }
}

#[cfg(not(any(unix, target_family = "wasm")))]
fn kind(of: std::fs::FileType) -> &'static str {
    if of.is_dir() { "a folder" } else { "something else" }
}

/// Reads a regular file of at most `max_bytes` bytes.
///
/// # Errors
/// As [`open`].
pub fn read(path: &Path, max_bytes: u64) -> io::Result<Vec<u8>> {
    let mut file = open(path, max_bytes)?;
    // Exact if the file has this length and does not grow.
    let length = usize::try_from(length(&file.file)?.min(max_bytes)).unwrap_or(usize::MAX);
    let mut bytes = Vec::new();
    bytes.try_reserve_exact(length).map_err(|_| io::ErrorKind::OutOfMemory)?;
    file.read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// Reads a regular UTF-8 file of at most `max_bytes` bytes.
///
/// # Errors
/// As [`open`]; and [`io::ErrorKind::InvalidData`] if it is not UTF-8.
pub fn read_text(path: &Path, max_bytes: u64) -> io::Result<String> {
    let not_text = |_| io::Error::new(io::ErrorKind::InvalidData, "it is not UTF-8 text");
    String::from_utf8(read(path, max_bytes)?).map_err(not_text)
}

/// Bytes, such as a hash, as hexadecimal digits.
pub fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// The lines of a source without their ends, each of at most `max_bytes` bytes. A longer line is skipped and gives
/// [`Refusal::TooLong`].
pub fn lines(mut source: impl BufRead, max_bytes: usize) -> impl Iterator<Item = io::Result<Vec<u8>>> {
    std::iter::from_fn(move || line(&mut source, max_bytes).transpose())
}

fn line(source: &mut impl BufRead, max_bytes: usize) -> io::Result<Option<Vec<u8>>> {
    let mut line = Vec::new();
    // Its end does not count.
    let most = max_bytes as u64 + 1;
    if source.by_ref().take(most).read_until(b'\n', &mut line)? == 0 {
        return Ok(None);
    }
    if line.pop_if(|last| *last == b'\n').is_none() && line.len() > max_bytes {
        source.skip_until(b'\n')?;
        let max_bytes = max_bytes as u64;
        return Err(Refusal::TooLong { max_bytes }.into());
    }
    Ok(Some(line))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refusal(result: io::Result<Vec<u8>>) -> Option<Refusal> {
        Refusal::of(&result.unwrap_err())
    }

    #[test]
    fn files_are_read_up_to_their_bound() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x");
        std::fs::write(&path, "12345").unwrap();
        assert_eq!(read(&path, 5).unwrap(), b"12345");
        assert_eq!(refusal(read(&path, 4)), Some(Refusal::TooLong { max_bytes: 4 }));
        // A file that grows after it was opened.
        let mut file = open(&path, 8).unwrap();
        std::fs::write(&path, "123456789").unwrap();
        let error = file.read_to_end(&mut Vec::new()).unwrap_err();
        assert_eq!(Refusal::of(&error), Some(Refusal::TooLong { max_bytes: 8 }));
    }

    #[cfg(unix)]
    #[test]
    fn what_is_no_regular_file_is_refused_at_once() {
        let folder = tempfile::tempdir().unwrap();
        let (pipe, socket) = (folder.path().join("pipe"), folder.path().join("socket"));
        let made = std::process::Command::new("mkfifo").arg(&pipe).status().unwrap();
        assert!(made.success());
        let _socket = std::os::unix::net::UnixListener::bind(&socket).unwrap();
        for (path, found) in [
            (folder.path(), "a folder"),
            (&pipe, "a named pipe"),
            (&socket, "a socket"),
            (Path::new("/dev/zero"), "a device"),
        ] {
            assert_eq!(refusal(read(path, 9)), Some(Refusal::NotRegular { found }));
        }
        assert_eq!(read(&folder.path().join("none"), 9).unwrap_err().kind(), io::ErrorKind::NotFound);
    }

    #[test]
    fn a_missing_file_is_named_with_the_one_that_was_meant() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["tile.ron", "tile.csv", "canvas.ron"] {
            std::fs::write(folder.path().join(name), "").unwrap();
        }
        let found = |name: &str| {
            let error = read(&folder.path().join(name), 9).unwrap_err();
            assert_eq!(error.kind(), io::ErrorKind::NotFound);
            error.get_ref().unwrap().downcast_ref::<Missing>().unwrap().clone()
        };
        let file = |similar: Option<&str>| Missing::File { similar: similar.map(str::to_owned) };
        assert_eq!(found("tlie.ron"), file(Some("tile.ron")));
        assert_eq!(found("canvsa.csv"), file(None));
        for below in ["nowhere", "tile.ron"] {
            let folder = folder.path().join(below);
            assert_eq!(found(&format!("{below}/tile.ron")), Missing::Folder { folder });
        }
        let listed = entries(&folder.path().join("tile.ron")).map(|_| ()).unwrap_err();
        assert_eq!(Refusal::of(&listed), Some(Refusal::NotFolder));
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn what_the_file_system_says_of_a_length_is_not_trusted() {
        let path = Path::new("/proc/self/status");
        assert_eq!(path.metadata().unwrap().len(), 0);
        assert!(!read(path, 1 << 20).unwrap().is_empty());
        assert_eq!(refusal(read(path, 9)), Some(Refusal::TooLong { max_bytes: 9 }));
    }

    #[test]
    fn a_folder_is_read_up_to_a_bound() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["a", "b", "c"] {
            std::fs::write(folder.path().join(name), "").unwrap();
        }
        assert_eq!(entries(folder.path()).unwrap().flatten().count(), 3);
        assert_eq!(list(folder.path()).len(), 3);
        let read = |most| -> io::Result<Vec<DirEntry>> {
            bounded(std::fs::read_dir(folder.path()).unwrap(), most).collect()
        };
        assert_eq!(read(3).unwrap().len(), 3);
        let refused = Refusal::of(&read(2).unwrap_err());
        assert_eq!(refused, Some(Refusal::TooManyNames { max_names: 2 }));
    }

    #[test]
    fn lines_too_long_are_told_of_and_passed_over() {
        let source = io::Cursor::new("abc\n\nabcdef\nabcd\nlong end");
        let read: Vec<_> = lines(source, 4).map(|line| line.ok()).collect();
        let line = |text: &str| Some(text.as_bytes().to_vec());
        assert_eq!(read, [line("abc"), line(""), None, line("abcd"), None]);
    }

    /// The sources of a folder that are part of what is shipped.
    fn sources(folder: &Path, found: &mut Vec<std::path::PathBuf>) {
        for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
            let path = entry.path();
            let name = entry.file_name();
            if path.is_dir() && name != "tests" {
                sources(&path, found);
            } else if name.to_string_lossy().ends_with(".rs") && name != "tests.rs" {
                found.push(path);
            }
        }
    }

    #[test]
    fn files_and_typed_lines_are_read_here_alone() {
        const OPENERS: [&str; 9] = [
            "File::open(",
            "fs::read(",
            "fs::read_to_string(",
            "read_dir(",
            "ReadDir",
            "WavReader::open(",
            ".from_path(",
            "lock().split(",
            "lock().lines(",
        ];
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
        let mut found = Vec::new();
        for part in ["signal", "engine", "surfaces", "nodes", "report", "studio", "bindings/c", ""] {
            let before = found.len();
            sources(&root.join(part).join("src"), &mut found);
            // Where the crate stands alone there are only its own.
            assert!(found.len() > before || !root.join("Cargo.toml").is_file(), "{part}");
        }
        for path in found.iter().filter(|path| !path.ends_with("signal/src/files.rs")) {
            let text = std::fs::read_to_string(path).unwrap();
            // A folder is opened to be locked; nothing is read of it.
            let text = text.replace("let lock = File::open(folder).ok()?;", "");
            let shipped = text.split("#[cfg(test)]\nmod").next().unwrap_or_default();
            for opener in OPENERS {
                assert!(!shipped.contains(opener), "{}: {opener}...", path.display());
            }
        }
    }
}
