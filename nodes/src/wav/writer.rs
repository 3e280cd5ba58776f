//! A writer of WAV files that updates the header at least once a second.

use super::{Format, HEADER_BYTES, header};
use std::io::{self, Seek, SeekFrom, Write};
use std::time::{Duration, Instant};

/// Buffered bytes that cause a write.
const BUFFER_BYTES: usize = 1 << 16;
/// Longest time between updates of the header.
const PACE: Duration = Duration::from_secs(1);

/// Writes 32-bit floats. At least once a second, of wall time and of the signal's time, all samples are in the
/// file and the header states them, so that the file is valid however the process ends.
pub struct WavWriter<W: Write + Seek> {
    out: W,
    format: Format,
    waiting: Vec<u8>,
    /// Bytes of samples that are in the file, and those that its header states.
    reached: u64,
    stated: u64,
    /// Bytes of samples that came since the header was written, and when that was.
    since: u64,
    written_at: Instant,
    most_bytes: u64,
}

impl<W: Write + Seek> WavWriter<W> {
    /// Writes the header of an empty file.
    ///
    /// # Errors
    /// The file system's error.
    pub fn new(out: W, format: Format) -> io::Result<Self> {
        Self::with_most_bytes(out, format, u64::MAX)
    }

    /// The same; the file becomes RF64 beyond `most_bytes`, or 4 GiB if that is less.
    pub(super) fn with_most_bytes(mut out: W, format: Format, most_bytes: u64) -> io::Result<Self> {
        out.write_all(&header(format, 0, most_bytes))?;
        Ok(Self {
            out,
            format,
            waiting: Vec::with_capacity(BUFFER_BYTES),
            reached: 0,
            stated: 0,
            since: 0,
            written_at: Instant::now(),
            most_bytes,
        })
    }

    /// Appends interleaved samples. Returns whether the header was updated.
    ///
    /// # Errors
    /// The file system's error.
    pub fn write(&mut self, samples: &[f32]) -> io::Result<bool> {
        for sample in samples {
            self.waiting.extend(sample.to_le_bytes());
            if self.waiting.len() >= BUFFER_BYTES {
                self.flush()?;
            }
        }
        self.since += 4 * samples.len() as u64;
        let second_bytes = u64::from(self.format.rate_hz) * self.format.frame_bytes();
        let is_due = self.since >= second_bytes || self.written_at.elapsed() >= PACE;
        if is_due && self.since > 0 {
            self.update()?;
        }
        Ok(is_due)
    }

    /// Writes the buffer, and the header.
    ///
    /// # Errors
    /// The file system's error.
    pub fn finish(mut self) -> io::Result<()> {
        self.update()?;
        self.out.flush()
    }

    /// Writes the buffer; counts what reached the file, also where the rest does not.
    fn flush(&mut self) -> io::Result<()> {
        let (mut done, mut result) = (0, Ok(()));
        while done < self.waiting.len() && result.is_ok() {
            match self.out.write(&self.waiting[done..]) {
                Ok(0) => result = Err(io::ErrorKind::WriteZero.into()),
                Ok(count) => done += count,
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) => result = Err(error),
            }
        }
        self.reached += done as u64;
        self.waiting.drain(..done);
        result
    }

    fn update(&mut self) -> io::Result<()> {
        self.since = 0;
        self.written_at = Instant::now();
        self.flush()?;
        self.state()
    }

    /// Updates the header to the content of the file.
    fn state(&mut self) -> io::Result<()> {
        let frame_bytes = self.format.frame_bytes().max(1);
        let whole = self.reached / frame_bytes * frame_bytes;
        self.out.seek(SeekFrom::Start(0))?;
        self.out.write_all(&header(self.format, whole, self.most_bytes))?;
        self.out.seek(SeekFrom::Start(HEADER_BYTES + self.reached))?;
        self.stated = whole;
        self.out.flush()
    }
}

impl<W: Write + Seek> Drop for WavWriter<W> {
    /// Updates the header after a failure such as a full disk, which needs no new room.
    fn drop(&mut self) {
        if self.stated < self.reached {
            // The failure itself was already returned.
            let _ = self.state();
        }
    }
}
