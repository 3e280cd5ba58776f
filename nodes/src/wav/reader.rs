//! Reading WAV files: RIFF and RF64, integers and floats.

use super::{FLOAT, IN_DS64};
use haptograph_signal::files::MAX_SAMPLES;
use std::io::{self, Read, Seek, SeekFrom};

const PCM: u16 = 1;
/// The tag is in the first two bytes of a GUID further on.
const EXTENSIBLE: u16 = 0xfffe;
/// Where the first chunk begins.
const FIRST_CHUNK: u64 = 12;
/// Bytes that are read at a time; a multiple of every sample's width.
const CHUNK_BYTES: usize = 24 << 12;

/// Error of a WAV file.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)] // documented by the messages
pub enum WavError {
    #[error("{0}")]
    Io(#[from] io::Error),
    #[error("it is not a WAV file: it begins with neither RIFF nor RF64")]
    NotWav,
    #[error("the file ends within its header")]
    Header,
    #[error(
        "its samples have format {tag} with {bits} bits; integers of 8, 16, 24 or 32 bits and floats of 32 or 64 bits are supported"
    )]
    Encoding { tag: u16, bits: u16 },
    #[error("its header announces {announced} frames, but the file ends after {there}; it was cut off")]
    Cut { announced: u64, there: u64 },
    #[error("frame {frame} of channel {channel} is {value}, not a finite number")]
    NotFinite { frame: u64, channel: usize, value: f64 },
    #[error("it has {frames} frames; at most {MAX_SAMPLES} are read into memory")]
    TooLong { frames: u64 },
}

/// Sample format.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Encoding {
    /// Unsigned, 8 bits.
    Unsigned8,
    /// Signed, of 2, 3 or 4 bytes.
    Integer(usize),
    /// IEEE, 32 bits.
    Float32,
    /// IEEE, 64 bits.
    Float64,
}

impl Encoding {
    fn of(tag: u16, bits: u16) -> Result<Self, WavError> {
        match (tag, bits) {
            (PCM, 8) => Ok(Self::Unsigned8),
            (PCM, 16 | 24 | 32) => Ok(Self::Integer(usize::from(bits / 8))),
            (FLOAT, 32) => Ok(Self::Float32),
            (FLOAT, 64) => Ok(Self::Float64),
            _ => Err(WavError::Encoding { tag, bits }),
        }
    }

    /// Bytes of a sample.
    pub(crate) fn bytes(self) -> usize {
        match self {
            Self::Unsigned8 => 1,
            Self::Integer(bytes) => bytes,
            Self::Float32 => 4,
            Self::Float64 => 8,
        }
    }

    /// The number that a sample's bytes are; integers are parts of full scale.
    fn number(self, bytes: &[u8]) -> f64 {
        match (self, bytes) {
            (Self::Unsigned8, [byte, ..]) => (f64::from(*byte) - 128.0) / 128.0,
            (Self::Integer(_), bytes) => {
                let mut word = [0; 4];
                word.iter_mut().rev().zip(bytes.iter().rev()).for_each(|(to, from)| *to = *from);
                f64::from(i32::from_le_bytes(word)) / 31_f64.exp2()
            }
            (Self::Float32, &[a, b, c, d, ..]) => f32::from_le_bytes([a, b, c, d]).into(),
            (Self::Float64, &[a, b, c, d, e, f, g, h]) => f64::from_le_bytes([a, b, c, d, e, f, g, h]),
            _ => 0.0,
        }
    }
}

/// Position and format of the samples of a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Layout {
    /// Channels.
    pub channels: u16,
    /// Frames per second.
    pub rate_hz: u32,
    /// Sample format.
    pub encoding: Encoding,
    /// First byte of the samples.
    pub data_at: u64,
    /// Bytes of samples as the header states them.
    pub data_bytes: u64,
    /// Bytes of the whole form as the header states them, with the eight before it.
    pub(super) form_bytes: u64,
}

impl Layout {
    /// Bytes of a frame.
    pub(crate) fn frame_bytes(&self) -> u64 {
        u64::from(self.channels) * self.encoding.bytes() as u64
    }

    /// Whole frames.
    pub fn frames(&self) -> u64 {
        self.data_bytes / self.frame_bytes()
    }
}

/// The layout of a file, checked against its length.
///
/// # Errors
/// [`WavError`] if it is not a WAV file, or ends before its samples do.
pub fn read_layout(file: &mut (impl Read + Seek)) -> Result<Layout, WavError> {
    let layout = read_header(file)?;
    let there = file.seek(SeekFrom::End(0))?.saturating_sub(layout.data_at);
    if layout.data_bytes > there {
        let there = there / layout.frame_bytes();
        return Err(WavError::Cut { announced: layout.frames(), there });
    }
    Ok(layout)
}

/// The layout as the header states it, unchecked.
pub(super) fn read_header(file: &mut (impl Read + Seek)) -> Result<Layout, WavError> {
    let file_bytes = file.seek(SeekFrom::End(0))?;
    file.seek(SeekFrom::Start(0))?;
    let mut start = [0; 12];
    file.read_exact(&mut start).map_err(|_| WavError::NotWav)?;
    if !matches!(&start[..4], b"RIFF" | b"RF64") || &start[8..] != b"WAVE" {
        return Err(WavError::NotWav);
    }
    let mut form_bytes = u64::from(word(&start[4..]));
    let (mut large_data_bytes, mut format) = (None, None);
    let mut at = FIRST_CHUNK;
    while at + 8 <= file_bytes {
        let mut head = [0; 8];
        file.seek(SeekFrom::Start(at))?;
        file.read_exact(&mut head)?;
        let bytes = u64::from(word(&head[4..]));
        match &head[..4] {
            // The sizes of RF64 are in the first chunk; a chunk further on or in a RIFF has no meaning.
            b"ds64" if at == FIRST_CHUNK && start.starts_with(b"RF64") => {
                let body = body(file, bytes)?;
                form_bytes = long(&body).ok_or(WavError::Header)?;
                large_data_bytes = Some(body.get(8..).and_then(long).ok_or(WavError::Header)?);
            }
            b"fmt " => format = Some(read_format(&body(file, bytes)?)?),
            b"data" => {
                let (channels, rate_hz, encoding) = format.ok_or(WavError::Header)?;
                let large = large_data_bytes.filter(|_| bytes == u64::from(IN_DS64));
                return Ok(Layout {
                    channels,
                    rate_hz,
                    encoding,
                    data_at: at + 8,
                    data_bytes: large.unwrap_or(bytes),
                    form_bytes: form_bytes.saturating_add(8),
                });
            }
            _ => {}
        }
        at = at.saturating_add(8 + bytes + bytes % 2);
    }
    Err(WavError::Header)
}

/// The beginning of a chunk's body, which contains all known fields.
fn body(file: &mut impl Read, bytes: u64) -> Result<Vec<u8>, WavError> {
    let mut body = vec![0; bytes.min(40) as usize];
    file.read_exact(&mut body).map_err(|_| WavError::Header)?;
    Ok(body)
}

fn read_format(body: &[u8]) -> Result<(u16, u32, Encoding), WavError> {
    let half = |at: usize| {
        let bytes = body.get(at..at + 2).ok_or(WavError::Header)?;
        Ok::<u16, WavError>(bytes.iter().rev().fold(0, |sum, byte| sum << 8 | u16::from(*byte)))
    };
    let rate_hz = word(body.get(4..8).ok_or(WavError::Header)?);
    let (tag, channels, frame_bytes) = (half(0)?, half(2)?, half(12)?);
    let tag = if tag == EXTENSIBLE { half(24)? } else { tag };
    if channels == 0 || frame_bytes % channels != 0 {
        return Err(WavError::Header);
    }
    // Where fewer bits are used than the bytes have, those are the upper ones.
    let encoding = Encoding::of(tag, (frame_bytes / channels).saturating_mul(8))?;
    Ok((channels, rate_hz, encoding))
}

fn word(bytes: &[u8]) -> u32 {
    let first = bytes.iter().take(4);
    first.rev().fold(0, |sum, byte| sum << 8 | u32::from(*byte))
}

fn long(bytes: &[u8]) -> Option<u64> {
    let first = bytes.get(..8)?.iter();
    Some(first.rev().fold(0, |sum, byte| sum << 8 | u64::from(*byte)))
}

/// All samples of one channel, from 0.
///
/// # Errors
/// [`WavError`] where the file cannot be read or a sample is NaN or infinite.
pub fn read_channel(
    file: &mut (impl Read + Seek),
    layout: &Layout,
    channel: usize,
) -> Result<Vec<f64>, WavError> {
    file.seek(SeekFrom::Start(layout.data_at))?;
    let frame_bytes = layout.frame_bytes() as usize;
    let (width, at) = (layout.encoding.bytes(), channel * layout.encoding.bytes());
    let frames_at_once = (CHUNK_BYTES / frame_bytes).max(1);
    let mut left = layout.frames();
    if left > MAX_SAMPLES {
        return Err(WavError::TooLong { frames: left });
    }
    let mut chunk = vec![0; frames_at_once * frame_bytes];
    let mut samples = Vec::new();
    samples.try_reserve_exact(left as usize).map_err(|_| io::Error::from(io::ErrorKind::OutOfMemory))?;
    while left > 0 {
        let frames = left.min(frames_at_once as u64) as usize;
        let read = &mut chunk[..frames * frame_bytes];
        file.read_exact(read)?;
        for frame in read.chunks_exact(frame_bytes) {
            let value = layout.encoding.number(frame.get(at..at + width).unwrap_or_default());
            if !value.is_finite() {
                let frame = samples.len() as u64;
                return Err(WavError::NotFinite { frame, channel, value });
            }
            samples.push(value);
        }
        left -= frames as u64;
    }
    Ok(samples)
}
