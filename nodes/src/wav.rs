//! WAV files: a writer whose file is always valid, a reader, and the repair of headers.
//!
//! The container is RIFF, and RF64 (EBU Tech 3306) where the samples take more than 4 GiB: the writer reserves the room
//! of the `ds64` chunk from the start, so that a file becomes RF64 in place.

mod reader;
mod repair;
mod writer;

pub use reader::{Encoding, Layout, WavError, read_channel, read_layout};
pub use repair::{Repair, repair};
pub use writer::WavWriter;

/// Format of a written file: 32-bit floats.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Format {
    /// Channels.
    pub channels: u16,
    /// Frames per second.
    pub rate_hz: u32,
}

impl Format {
    /// Bytes of a frame.
    pub(crate) fn frame_bytes(self) -> u64 {
        4 * u64::from(self.channels)
    }
}

/// Bytes before the samples of a written file.
pub(crate) const HEADER_BYTES: u64 = 94;
/// Bytes in the body of a `ds64` chunk, and of the `JUNK` chunk that reserves its room.
const DS64_BYTES: u32 = 28;
/// The format tag of IEEE floats.
const FLOAT: u16 = 3;
/// The size that stands for "see `ds64`".
const IN_DS64: u32 = u32::MAX;

/// The header of a file with `data_bytes` of samples. With more than `most_bytes` after its eighth byte it is RF64.
fn header(format: Format, data_bytes: u64, most_bytes: u64) -> [u8; HEADER_BYTES as usize] {
    let riff_bytes = HEADER_BYTES - 8 + data_bytes;
    let frames = data_bytes / format.frame_bytes().max(1);
    let is_large = riff_bytes > most_bytes.min(u64::from(IN_DS64) - 1);
    let short = |bytes: u64| if is_large { IN_DS64 } else { bytes as u32 };
    let mut bytes = Vec::with_capacity(HEADER_BYTES as usize);
    bytes.extend(if is_large { b"RF64" } else { b"RIFF" });
    bytes.extend(short(riff_bytes).to_le_bytes());
    bytes.extend(b"WAVE");
    bytes.extend(size_chunk(is_large.then_some([riff_bytes, data_bytes, frames])));
    bytes.extend(b"fmt ");
    bytes.extend(18_u32.to_le_bytes());
    bytes.extend(FLOAT.to_le_bytes());
    bytes.extend(format.channels.to_le_bytes());
    bytes.extend(format.rate_hz.to_le_bytes());
    let bytes_a_second = u64::from(format.rate_hz) * format.frame_bytes();
    bytes.extend(u32::try_from(bytes_a_second).unwrap_or(u32::MAX).to_le_bytes());
    bytes.extend((format.frame_bytes() as u16).to_le_bytes());
    bytes.extend(32_u16.to_le_bytes());
    bytes.extend(0_u16.to_le_bytes());
    bytes.extend(b"fact");
    bytes.extend(4_u32.to_le_bytes());
    bytes.extend(short(frames).to_le_bytes());
    bytes.extend(b"data");
    bytes.extend(short(data_bytes).to_le_bytes());
    let mut header = [0; HEADER_BYTES as usize];
    header.iter_mut().zip(bytes).for_each(|(to, from)| *to = from);
    header
}

/// The `ds64` chunk with the sizes of the form, of the samples and the number of frames; a `JUNK` chunk of the same
/// length without them.
fn size_chunk(sizes: Option<[u64; 3]>) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(8 + DS64_BYTES as usize);
    bytes.extend(if sizes.is_some() { b"ds64" } else { b"JUNK" });
    bytes.extend(DS64_BYTES.to_le_bytes());
    for size in sizes.unwrap_or_default() {
        bytes.extend(size.to_le_bytes());
    }
    // The length of an empty table.
    bytes.extend(0_u32.to_le_bytes());
    bytes
}

/// A file of one channel, by another writer than this one.
#[cfg(test)]
pub(crate) fn write_mono(path: &std::path::Path, rate_hz: u32, samples: impl IntoIterator<Item = f64>) {
    let spec = hound::WavSpec {
        channels: 1,
        sample_rate: rate_hz,
        bits_per_sample: 32,
        sample_format: hound::SampleFormat::Float,
    };
    let mut writer = hound::WavWriter::create(path, spec).unwrap();
    for sample in samples {
        writer.write_sample(sample as f32).unwrap();
    }
    writer.finalize().unwrap();
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Cursor;

    const FORMAT: Format = Format { channels: 2, rate_hz: 1000 };

    /// A file of these frames, as RF64 where its form has more than `most_bytes`.
    fn written(frames: &[[f32; 2]], most_bytes: u64) -> Vec<u8> {
        let mut file = Cursor::new(Vec::new());
        let mut writer = WavWriter::with_most_bytes(&mut file, FORMAT, most_bytes).unwrap();
        for frame in frames {
            writer.write(frame).unwrap();
        }
        writer.finish().unwrap();
        file.into_inner()
    }

    #[test]
    fn a_form_of_4_gib_becomes_rf64_with_its_true_sizes() {
        let most = u64::from(u32::MAX) - 1 - (HEADER_BYTES - 8);
        let small = header(FORMAT, most / 8 * 8, u64::MAX);
        assert!(small.starts_with(b"RIFF") && &small[12..16] == b"JUNK");
        let data_bytes = 5_u64 << 30;
        let large = header(FORMAT, data_bytes, u64::MAX);
        assert!(large.starts_with(b"RF64\xff\xff\xff\xffWAVEds64"));
        let number = |at: usize| u64::from_le_bytes(large[at..at + 8].try_into().unwrap());
        assert_eq!(
            [number(20), number(28), number(36)],
            [data_bytes + HEADER_BYTES - 8, data_bytes, data_bytes / 8]
        );
        assert_eq!(large[90..94], [0xff; 4]);
    }

    #[test]
    fn large_sizes_count_only_in_rf64() {
        let mut bytes = written(&[[0.25, -1.0], [0.5, 8.0]], 90);
        bytes[20..28].copy_from_slice(&1_u64.to_le_bytes());
        bytes[28..36].copy_from_slice(&8_u64.to_le_bytes());
        let frames = |bytes: &[u8]| read_layout(&mut Cursor::new(bytes)).map(|layout| layout.frames());
        assert_eq!(frames(&bytes).unwrap(), 1);
        bytes[..4].copy_from_slice(b"RIFF");
        assert!(matches!(frames(&bytes), Err(reader::WavError::Cut { .. })));
    }

    #[test]
    fn both_forms_are_read_back() {
        let frames = [[0.25, -1.0], [0.5, 8.0], [0.0, 1e-9]];
        for (most_bytes, name) in [(u64::MAX, b"RIFF"), (90, b"RF64")] {
            let bytes = written(&frames, most_bytes);
            assert!(bytes.starts_with(name));
            let mut file = Cursor::new(bytes);
            let layout = read_layout(&mut file).unwrap();
            assert_eq!((layout.channels, layout.rate_hz, layout.frames()), (2, 1000, 3));
            let second = read_channel(&mut file, &layout, 1).unwrap();
            assert_eq!(second, [-1.0, 8.0, f64::from(1e-9_f32)]);
        }
    }

    #[test]
    fn other_readers_read_what_is_written() {
        let bytes = written(&[[0.25, -1.0], [0.5, 8.0]], u64::MAX);
        let mut reader = hound::WavReader::new(bytes.as_slice()).unwrap();
        let samples: Vec<f32> = reader.samples::<f32>().map(Result::unwrap).collect();
        assert_eq!(samples, [0.25, -1.0, 0.5, 8.0]);
    }

    #[test]
    fn the_file_is_valid_every_second_while_it_is_written() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.wav");
        let mut writer = WavWriter::new(std::fs::File::create(&path).unwrap(), FORMAT).unwrap();
        for second in 1..=3 {
            for _ in 0..1000 {
                writer.write(&[1.0, 2.0]).unwrap();
            }
            // Read as it would lie there after the process was killed.
            let layout = read_layout(&mut std::fs::File::open(&path).unwrap()).unwrap();
            assert_eq!(layout.frames(), 1000 * second);
        }
    }

    #[test]
    fn a_header_that_falls_short_is_mended_by_the_length_of_the_file() {
        for most_bytes in [u64::MAX, 90] {
            let mut bytes = written(&[[1.0, 2.0]], most_bytes);
            for number in [3.0_f32, 4.0, 5.0] {
                bytes.extend(number.to_le_bytes());
            }
            let mut file = Cursor::new(bytes);
            assert_eq!(repair(&mut file).unwrap(), Repair::Mended { before: 1, now: 2 });
            assert_eq!(repair(&mut file).unwrap(), Repair::Whole);
            let layout = read_layout(&mut file).unwrap();
            assert_eq!(read_channel(&mut file, &layout, 0).unwrap(), [1.0, 3.0]);
            // The part of a frame is still there.
            assert!(file.get_ref().ends_with(&5.0_f32.to_le_bytes()));
        }
    }

    #[test]
    fn on_a_full_disk_the_failure_is_returned_and_what_was_written_is_valid() {
        /// Has room for so many bytes.
        struct Small<'a>(&'a mut Cursor<Vec<u8>>, u64);
        impl std::io::Write for Small<'_> {
            fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
                let room = (self.1 - self.0.position()).min(bytes.len() as u64) as usize;
                if room == 0 {
                    return Err(std::io::ErrorKind::StorageFull.into());
                }
                self.0.write(&bytes[..room])
            }
            fn flush(&mut self) -> std::io::Result<()> {
                Ok(())
            }
        }
        impl std::io::Seek for Small<'_> {
            fn seek(&mut self, to: std::io::SeekFrom) -> std::io::Result<u64> {
                self.0.seek(to)
            }
        }
        let mut file = Cursor::new(Vec::new());
        let mut writer = WavWriter::new(Small(&mut file, HEADER_BYTES + 8 * 1500 + 3), FORMAT).unwrap();
        let failed = (0..2000).find_map(|_| writer.write(&[0.5, 0.25]).err()).unwrap();
        assert_eq!(failed.kind(), std::io::ErrorKind::StorageFull);
        drop(writer);
        let layout = read_layout(&mut file).unwrap();
        assert_eq!(layout.frames(), 1500);
        assert_eq!(read_channel(&mut file, &layout, 1).unwrap(), [0.25; 1500]);
    }

    #[test]
    fn what_is_no_wav_file_or_was_cut_off_is_an_error() {
        let whole = written(&[[1.0, 2.0], [3.0, 4.0]], u64::MAX);
        for cut in 0..whole.len() {
            let mut file = Cursor::new(&whole[..cut]);
            assert!(read_layout(&mut file).is_err(), "{cut}");
        }
        assert!(matches!(read_layout(&mut Cursor::new(b"PK nothing of that kind")), Err(WavError::NotWav)));
    }
}
