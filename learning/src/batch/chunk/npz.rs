//! A chunk as an archive of arrays.
//!
//! Its hash is that of the arrays: their names, types, shapes and numbers.

use super::{About, BLOCK, Chunk, invalid};
use crate::batch::hex;
use haptograph_surfaces::npy::Header;
use haptograph_surfaces::npz::{begin, begin_array};
use sha2::{Digest, Sha256};
use std::fs::File;
use std::io::{self, BufReader, BufWriter, Read, Write};
use zip::read::ZipArchive;
use zip::write::ZipWriter;

/// The member with the description of a chunk.
const ABOUT: &str = "about.json";
/// Largest description that is read, bytes.
const MAX_ABOUT_BYTES: u64 = 1 << 16;

/// Writes a chunk with its description, to which the hash is added.
pub(super) fn write(chunk: &Chunk, mut about: About, file: &mut File) -> io::Result<About> {
    let mut archive = ZipWriter::new(BufWriter::with_capacity(BLOCK, file));
    let mut hash = Sha256::new();
    for (name, shape, numbers) in &chunk.arrays {
        let count = shape.iter().product::<u64>() as usize;
        let bytes = count as u64 * if numbers.descr() == "<f4" { 4 } else { 8 };
        begin_array(&mut archive, name, (numbers.descr(), shape), bytes)?;
        hash_head(&mut hash, name, numbers.descr(), shape);
        let mut block = Vec::with_capacity(BLOCK);
        for start in (0..count).step_by(BLOCK / 8) {
            block.clear();
            numbers.append(start..count.min(start + BLOCK / 8), &mut block);
            hash.update(&block);
            archive.write_all(&block)?;
        }
    }
    about.sha256 = hex(&hash.finalize());
    let text = serde_json::to_string_pretty(&about)? + "\n";
    begin(&mut archive, ABOUT, text.len() as u64)?;
    archive.write_all(text.as_bytes())?;
    archive.finish().map_err(io::Error::other)?.flush()?;
    Ok(about)
}

/// The header of an array, which is hashed before its numbers.
fn hash_head(hash: &mut Sha256, name: &str, descr: &str, shape: &[u64]) {
    hash.update(format!("{name} {descr} {shape:?}\n"));
}

/// The description of a chunk, and the hash of its content.
pub(super) fn read(file: &File) -> io::Result<(About, String)> {
    let mut archive = ZipArchive::new(BufReader::new(file)).map_err(invalid)?;
    let mut hash = Sha256::new();
    let mut about = None;
    for member in 0..archive.len() {
        let member = archive.by_index(member).map_err(invalid)?;
        let name = member.name().map_err(invalid)?.into_owned();
        match name.strip_suffix(".npy") {
            Some(name) => hash_array(&mut hash, name, member)?,
            None => about = Some(serde_json::from_reader(member.take(MAX_ABOUT_BYTES))?),
        }
    }
    let about = about.ok_or_else(|| invalid(format!("it has no {ABOUT}")))?;
    Ok((about, hex(&hash.finalize())))
}

fn hash_array(hash: &mut Sha256, name: &str, mut member: impl Read) -> io::Result<()> {
    let header = Header::read(&mut member).map_err(invalid)?;
    hash_head(hash, name, &header.descr, &header.shape);
    let mut block = vec![0; BLOCK];
    loop {
        match member.read(&mut block)? {
            0 => return Ok(()),
            read => hash.update(&block[..read]),
        }
    }
}
