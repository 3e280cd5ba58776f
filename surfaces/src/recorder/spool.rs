//! Writes a recording to disk during recording, in constant memory: a folder with the archive's head and one file of
//! little-endian doubles for each array. The archive is assembled from it at the end. [`assemble`] recovers the archive
//! after the process was killed.

use super::head::Head;
use super::{Member, RawHead};
use crate::npz::{begin, put_rows};
use haptograph_signal::files;
use haptograph_signal::files::write_atomically_by;
use std::fs::{self, File};
use std::io::{self, BufReader, BufWriter, Read, Write};
use std::path::{Path, PathBuf};
use zip::write::ZipWriter;

const HEAD: &str = "head.ron";

/// An array of the archive, and of the spool.
struct Array {
    name: &'static str,
    row: u64,
    /// Arrays of one sensor have as many rows.
    sensor: usize,
}

const fn array(name: &'static str, row: u64, sensor: usize) -> Array {
    Array { name, row, sensor }
}

/// The arrays in the order of the archive.
const ARRAYS: [Array; 5] = [
    array("position_m", 3, 0),
    array("orientation", 4, 0),
    array("force_n", 3, 1),
    array("torque_n_m", 3, 1),
    array("acceleration_v", 3, 2),
];

/// A recording in progress.
pub struct Spool {
    folder: PathBuf,
    files: Vec<BufWriter<File>>,
}

/// The spool folder of the recording at `path`.
pub fn spool_folder(path: &Path) -> PathBuf {
    path.with_added_extension("part")
}

impl Spool {
    /// Starts the recording at `path`, in a folder beside it.
    ///
    /// # Errors
    /// An error of the file system, or if the folder already exists.
    pub fn create(path: &Path, head: &RawHead<'_>) -> io::Result<Self> {
        let folder = spool_folder(path);
        fs::create_dir(&folder)?;
        fs::write(folder.join(HEAD), Head::raw(head).text()?)?;
        let create = |array: &Array| File::create_new(file(&folder, array)).map(BufWriter::new);
        let files = ARRAYS.iter().map(create).collect::<io::Result<_>>()?;
        Ok(Self { folder, files })
    }

    /// Appends numbers to an array.
    ///
    /// # Errors
    /// An error of the file system.
    pub fn write(&mut self, member: Member, numbers: &[f64]) -> io::Result<()> {
        let bytes: Vec<[u8; 8]> = numbers.iter().map(|x| x.to_le_bytes()).collect();
        self.files[member as usize].write_all(bytes.as_flattened())
    }

    /// Flushes the buffers and returns the files, so that the caller can sync them.
    ///
    /// # Errors
    /// An error of the file system.
    pub fn flush(&mut self) -> io::Result<impl Iterator<Item = &File>> {
        self.files.iter_mut().try_for_each(BufWriter::flush)?;
        Ok(self.files.iter().map(BufWriter::get_ref))
    }

    /// Assembles the archive at `path` and removes the spool; the spool remains if that fails.
    ///
    /// # Errors
    /// An error of the file system, or too few samples.
    pub fn finish(mut self, path: &Path) -> io::Result<()> {
        self.files.iter_mut().try_for_each(BufWriter::flush)?;
        drop(self.files);
        assemble(&self.folder, path)?;
        fs::remove_dir_all(&self.folder)
    }
}

fn file(folder: &Path, array: &Array) -> PathBuf {
    folder.join(format!("{}.f64", array.name))
}

/// Assembles the archive at `path` from a spool folder, atomically. The spool remains.
///
/// # Errors
/// An error of the file system, a folder that is not a spool, or too few samples.
pub fn assemble(folder: &Path, path: &Path) -> io::Result<()> {
    let head = files::read(&folder.join(HEAD), files::MAX_NOTE_BYTES)?;
    let mut rows = [u64::MAX; 3];
    for array in &ARRAYS {
        let there = fs::metadata(file(folder, array))?.len() / 8 / array.row;
        rows[array.sensor] = rows[array.sensor].min(there);
    }
    if rows.iter().any(|rows| *rows < 2) {
        let [motion, wrench, acceleration] = rows;
        return Err(io::Error::other(format!(
            "a recording needs two samples of each sensor; this one has {motion} poses, {wrench} loads and {acceleration} accelerations"
        )));
    }
    write_atomically_by(path, |to| write_archive(folder, &head, rows, to))
}

fn write_archive(folder: &Path, head: &[u8], rows: [u64; 3], to: &mut File) -> io::Result<()> {
    let mut archive = ZipWriter::new(BufWriter::new(to));
    begin(&mut archive, HEAD, head.len() as u64)?;
    archive.write_all(head)?;
    for array in &ARRAYS {
        let rows = rows[array.sensor];
        let mut from = BufReader::new(files::open(&file(folder, array), u64::MAX)?);
        let numbers = (0..rows * array.row).map(|place| {
            let mut bytes = [0; 8];
            from.read_exact(&mut bytes)?;
            let number = f64::from_le_bytes(bytes);
            if number.is_finite() {
                return Ok(number);
            }
            let sample = place / array.row;
            let message = format!("sample {sample} of {} is {number}, not a finite number", array.name);
            Err(io::Error::other(message))
        });
        put_rows(&mut archive, array.name, &[array.row], rows, numbers)?;
    }
    archive.finish().map_err(io::Error::other)?.flush()
}
