//! Reads and writes arrays in uncompressed `.npz` archives, as `numpy.savez` does. Writing takes constant memory and gives the
//! same bytes for the same arrays.

use npyz::{NpyHeader, WriterBuilder};
use std::io::{self, BufWriter, Read, Seek, Write};
use zip::CompressionMethod;
use zip::write::{SimpleFileOptions, ZipWriter};

/// Larger members need the 64-bit form of an archive; the difference is room for an array's header.
const MAX_SMALL_BYTES: u64 = 0xffff_0000;
/// Largest header of an array, bytes. NumPy writes 128.
const MAX_ARRAY_HEADER_BYTES: usize = 4096;

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
    let bytes = rows * row.iter().product::<u64>() * 8;
    begin(archive, &format!("{name}.npy"), bytes)?;
    let shape: Vec<u64> = std::iter::once(rows).chain(row.iter().copied()).collect();
    let mut buffered = BufWriter::new(archive);
    let mut writer = npyz::WriteOptions::new()
        .default_dtype()
        .shape(&shape)
        .writer(&mut buffered)
        .begin_nd()?;
    for value in values {
        writer.push(&value?)?;
    }
    writer.finish()?;
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
    let mut header = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': ({shape}), }}");
    // The numbers are aligned to 64 bytes.
    let padding = (10 + header.len() + 1).next_multiple_of(64) - (10 + header.len() + 1);
    header.extend(std::iter::repeat_n(' ', padding));
    header.push('\n');
    archive.write_all(b"\x93NUMPY\x01\x00")?;
    archive.write_all(&(header.len() as u16).to_le_bytes())?;
    archive.write_all(header.as_bytes())
}

/// Reads the header of an array. It is a Python expression, which a hostile file may make arbitrarily long or
/// deep; NumPy's own headers are short and shallow. The numbers follow in `source`.
pub fn array_header(source: &mut impl Read) -> Result<NpyHeader, String> {
    let failed = |error: &dyn std::fmt::Display| error.to_string();
    let mut bytes = vec![0; 8];
    source.read_exact(&mut bytes).map_err(|_| "it is not an array")?;
    let width = if bytes[6] > 1 { 4 } else { 2 };
    bytes.resize(8 + width, 0);
    source
        .read_exact(&mut bytes[8..])
        .map_err(|_| "it is not an array")?;
    let length = bytes[8..]
        .iter()
        .rev()
        .fold(0, |length, byte| length << 8 | usize::from(*byte));
    let begun = bytes.len();
    let unusual = "its header is not in NumPy's format";
    if length > MAX_ARRAY_HEADER_BYTES {
        return Err(unusual.to_owned());
    }
    bytes.resize(begun + length, 0);
    source.read_exact(&mut bytes[begun..]).map_err(|_| unusual)?;
    let opening = bytes[begun..].iter().filter(|b| matches!(b, b'(' | b'[' | b'{'));
    if opening.count() > 4 {
        return Err(unusual.to_owned());
    }
    NpyHeader::from_reader(&bytes[..]).map_err(|error| failed(&error))
}
