//! Repairs the header of a WAV file whose writer was interrupted.

use super::reader::{WavError, read_header};
use super::{IN_DS64, size_chunk};
use std::io::{Read, Seek, SeekFrom, Write};

/// Result of a repair.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Repair {
    /// The header is correct.
    Whole,
    /// The header stated another number of frames than the file holds; it is corrected.
    Mended {
        /// Frames as stated before.
        before: u64,
        /// Frames in the file.
        now: u64,
    },
    /// The header is wrong and cannot state the size: more than 4 GiB without room for RF64.
    TooLarge,
}

/// Corrects the sizes in the header by the length of the file. The samples are not written.
///
/// # Errors
/// [`WavError`] if it is not a WAV file or cannot be read or written.
pub fn repair(file: &mut (impl Read + Write + Seek)) -> Result<Repair, WavError> {
    let layout = read_header(file)?;
    let file_bytes = file.seek(SeekFrom::End(0))?;
    let there = file_bytes.saturating_sub(layout.data_at);
    // Bytes within the form after the samples are other chunks; bytes beyond the form are samples.
    let data_end = layout.data_at.saturating_add(layout.data_bytes);
    let is_short = file_bytes > layout.form_bytes && data_end.saturating_add(1) >= layout.form_bytes;
    let frame_bytes = layout.frame_bytes();
    let data_bytes = there / frame_bytes * frame_bytes;
    if !is_short && layout.data_bytes <= there || data_bytes == layout.data_bytes {
        return Ok(Repair::Whole);
    }
    let mut form = [0; 20];
    file.seek(SeekFrom::Start(0))?;
    file.read_exact(&mut form)?;
    let form_bytes = layout.data_at - 8 + data_bytes;
    let room = size_chunk(None);
    let has_room = matches!(&form[12..16], b"JUNK" | b"ds64") && form[16..] == room[4..8];
    let short = match u32::try_from(form_bytes) {
        Ok(bytes) if bytes < IN_DS64 && &form[..4] == b"RIFF" => Some(bytes),
        _ if has_room => None,
        _ => return Ok(Repair::TooLarge),
    };
    if short.is_none() {
        let frames = data_bytes / frame_bytes;
        file.seek(SeekFrom::Start(12))?;
        file.write_all(&size_chunk(Some([form_bytes, data_bytes, frames])))?;
        file.seek(SeekFrom::Start(0))?;
        file.write_all(b"RF64")?;
    }
    file.seek(SeekFrom::Start(4))?;
    file.write_all(&short.unwrap_or(IN_DS64).to_le_bytes())?;
    file.seek(SeekFrom::Start(layout.data_at - 4))?;
    let stated = short.map_or(IN_DS64, |_| data_bytes as u32);
    file.write_all(&stated.to_le_bytes())?;
    file.flush()?;
    Ok(Repair::Mended { before: layout.frames(), now: data_bytes / frame_bytes })
}
