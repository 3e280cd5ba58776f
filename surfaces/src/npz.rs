//! Writes arrays into uncompressed `.npz` archives, as `numpy.savez` does, in constant memory and with the same bytes for the
//! same arrays.

use crate::npy::Header;
use std::io::{self, BufWriter, Seek, Write};
use zip::CompressionMethod;
use zip::write::{SimpleFileOptions, ZipWriter};

/// Larger members need the 64-bit form of an archive; the difference is room for an array's header.
const MAX_SMALL_BYTES: u64 = 0xffff_0000;

/// Begins a member of `bytes` bytes.
pub fn begin<W: Write + Seek>(archive: &mut ZipWriter<W>, name: &str, bytes: u64) -> io::Result<()> {
    // Stored without compression, so that reading takes no more memory than the file; dated 1980, so that
    // equal content gives equal bytes.
    let options = SimpleFileOptions::default()
        .compression_method(CompressionMethod::Stored)
        .large_file(bytes > MAX_SMALL_BYTES);
    archive.start_file(name, options).map_err(io::Error::other)
}

/// Adds an array of rows, each with the shape `row`.
pub fn put_rows<W: Write + Seek>(
    archive: &mut ZipWriter<W>,
    name: &str,
    row: &[u64],
    rows: u64,
    values: impl Iterator<Item = io::Result<f64>>,
) -> io::Result<()> {
    let count = rows * row.iter().product::<u64>();
    begin(archive, &format!("{name}.npy"), count * 8)?;
    let shape: String = { std::iter::once(&rows).chain(row) }.map(|n| format!("{n}, ")).collect();
    let mut buffered = BufWriter::new(archive);
    buffered.write_all(&Header::bytes("<f8", &shape))?;
    let mut written = 0;
    for value in values {
        buffered.write_all(&value?.to_le_bytes())?;
        written += 1;
    }
    if written != count {
        return Err(io::Error::other(format!("`{name}` has {written} numbers and not {count}")));
    }
    buffered.flush()
}

/// Begins an array in C order; the numbers follow as they are in memory, `bytes` bytes.
pub fn begin_array<W: Write + Seek>(
    archive: &mut ZipWriter<W>,
    name: &str,
    (descr, shape): (&str, &[u64]),
    bytes: u64,
) -> io::Result<()> {
    begin(archive, &format!("{name}.npy"), bytes)?;
    let shape = match shape {
        [one] => format!("{one},"),
        more => more.iter().map(u64::to_string).collect::<Vec<_>>().join(", "),
    };
    archive.write_all(&Header::bytes(descr, &shape))
}
