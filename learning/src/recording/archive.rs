//! haptograph's recording file: an uncompressed `.npz` archive that `numpy.load` can open.
//!
//! | member | shape | content |
//! |---|---|---|
//! | `head.ron` | text | format, kind, rates, calibration, gesture, provenance |
//! | raw: `position_m`, `orientation` | (m, 3), (m, 4) | of the tracker's sensor; quaternion w, x, y, z |
//! | raw: `force_n`, `torque_n_m` | (n, 3) | on the tool, in the force sensor's frame |
//! | raw: `acceleration_v` | (k, 3) | accelerometer readings, V |
//! | processed: `acceleration_m_s2`, `force_normal_n`, `speed_m_s` | (n) | at one rate |
//! | processed, optional: `force_tangential_n`, `axes_m_s2`, `position_m`, `force_n` | (n), (n, 3) | the last two in the world |
//!
//! Arrays are little-endian doubles in C order, named `<member>.npy` in the archive; single precision and big-endian numbers are read too. Any bytes
//! give a recording or an error, in memory of at most a few times the file's size.

use super::ReadError;
use super::{
    AnyRecording, Gesture, Pose, ProcessedRecording, Recording, Sensor, Series, Signals, WorldAxes, Wrench,
};
use crate::signals::series::Rows;
use haptograph_signal::files::{Bounded, MAX_NOTE_BYTES};
use haptograph_surfaces::npy;
use haptograph_surfaces::npz::{begin, put_rows};
use haptograph_surfaces::recorder::head::{FORMAT, Head, Kind, ProvenanceHead, Timing};
use haptograph_surfaces::{Origin, Provenance};
use std::fmt::{Debug, Display};
use std::fs::File;
use std::io::{self, BufReader, Cursor, Read, Seek, SeekFrom, Write};
use std::ops::Range;
use std::sync::{Arc, Mutex, PoisonError};
use zip::write::ZipWriter;
use zip::{CompressionMethod, ZipArchive};

/// The bytes of a recording's archive.
pub fn write_archive(recording: &AnyRecording) -> std::io::Result<Vec<u8>> {
    let mut archive = ZipWriter::new(Cursor::new(Vec::new()));
    let head = head_of(recording).text()?;
    begin(&mut archive, "head.ron", head.len() as u64)?;
    archive.write_all(head.as_bytes())?;
    match recording {
        AnyRecording::Raw(raw) => {
            let motion = &raw.motion().samples;
            put(&mut archive, "position_m", &[3], motion.iter().flat_map(|pose| pose.position_m))?;
            put(&mut archive, "orientation", &[4], motion.iter().flat_map(|pose| pose.orientation))?;
            let wrench = raw.wrench();
            put(&mut archive, "force_n", &[3], wrench.iter().flat_map(|w| w.force_n))?;
            put(&mut archive, "torque_n_m", &[3], wrench.iter().flat_map(|w| w.torque_n_m))?;
            put(&mut archive, "acceleration_v", &[3], raw.acceleration_v().iter().flatten())?;
        }
        AnyRecording::Processed(processed) => {
            let signals = processed.signals();
            put(&mut archive, "acceleration_m_s2", &[], signals.acceleration_m_s2.iter().copied())?;
            put(&mut archive, "force_normal_n", &[], signals.force_normal_n.iter().copied())?;
            if let Some(tangential) = &signals.force_tangential_n {
                put(&mut archive, "force_tangential_n", &[], tangential.iter().copied())?;
            }
            put(&mut archive, "speed_m_s", &[], signals.speed_m_s.iter().copied())?;
            if let Some(axes) = &signals.axes_m_s2 {
                put(&mut archive, "axes_m_s2", &[3], axes.iter().copied().flatten())?;
            }
            let world = processed.world();
            for (name, axes) in [("position_m", &world.position_m), ("force_n", &world.force_n)] {
                if let Some(axes) = axes {
                    put(&mut archive, name, &[3], axes.iter().copied().flatten())?;
                }
            }
        }
    }
    Ok(archive.finish().map_err(std::io::Error::other)?.into_inner())
}

fn head_of(recording: &AnyRecording) -> Head {
    let kind = match recording {
        AnyRecording::Raw(raw) => {
            let (motion, wrench, acceleration) = (raw.motion(), raw.wrench(), raw.acceleration_v());
            Kind::Raw {
                motion: Timing { rate_hz: motion.rate_hz, start_s: motion.start_s },
                wrench: Timing { rate_hz: wrench.rate_hz, start_s: wrench.start_s },
                acceleration: Timing { rate_hz: acceleration.rate_hz, start_s: acceleration.start_s },
                calibration: raw.calibration().into(),
            }
        }
        AnyRecording::Processed(processed) => Kind::Processed { rate_hz: processed.rate_hz() },
    };
    Head::new(kind, recording.gesture(), recording.provenance())
}

/// Adds an array; `row` is the shape of one sample.
fn put<W: Write + Seek>(
    archive: &mut ZipWriter<W>,
    name: &str,
    row: &[u64],
    values: impl Iterator<Item = f64>,
) -> std::io::Result<()> {
    let values: Vec<f64> = values.collect();
    let rows = values.len() as u64 / row.iter().product::<u64>();
    put_rows(archive, name, row, rows, values.into_iter().map(Ok))
}

/// Reads a recording from the bytes of an archive.
pub fn read_archive(bytes: &[u8]) -> Result<AnyRecording, ReadError> {
    read(Cursor::new(bytes), bytes.len() as u64, None)
}

/// Reads a recording from an archive's file. The samples of sensors with many stay there.
pub(super) fn open_archive(file: &Bounded) -> Result<AnyRecording, ReadError> {
    let file = file.as_file();
    let again = file.try_clone().and_then(|again| Ok((file.metadata()?.len(), again)));
    let (bytes, again) = again.map_err(|error| ReadError::Io(error.to_string()))?;
    read(BufReader::new(file), bytes, Some(Arc::new(Mutex::new(again))))
}

/// `file` is the file of `source`, if it is one.
fn read(
    source: impl Read + Seek,
    bytes: u64,
    file: Option<Arc<Mutex<File>>>,
) -> Result<AnyRecording, ReadError> {
    let archive = ZipArchive::new(source).map_err(|_| ReadError::CutArchive)?;
    let mut archive = Archive { archive, bytes, file };
    let head = archive.member("head.ron", MAX_NOTE_BYTES)?;
    let head =
        std::str::from_utf8(&head).map_err(|_| ReadError::member("head.ron", "it is not UTF-8 text"))?;
    let head: Head = ron::from_str(head).map_err(|e| ReadError::member("head.ron", e))?;
    if head.format != FORMAT {
        let message = format!("its format is {}, but this version reads {FORMAT}", head.format);
        return Err(ReadError::member("head.ron", message));
    }
    let gesture = (head.gesture.parse::<Gesture>()).map_err(|error| ReadError::member("head.ron", error))?;
    let provenance = provenance_of(head.provenance)?;
    Ok(match head.kind {
        Kind::Processed { rate_hz } => {
            let signals = Signals {
                rate_hz,
                acceleration_m_s2: archive.column("acceleration_m_s2")?,
                force_normal_n: archive.column("force_normal_n")?,
                force_tangential_n: archive.optional("force_tangential_n", Archive::column)?,
                speed_m_s: archive.column("speed_m_s")?,
                axes_m_s2: archive.optional("axes_m_s2", Archive::rows)?,
            };
            let world = WorldAxes {
                position_m: archive.optional("position_m", Archive::rows)?,
                force_n: archive.optional("force_n", Archive::rows)?,
            };
            let processed = ProcessedRecording::new(signals, gesture, provenance)?;
            AnyRecording::Processed(processed.with_world(world)?)
        }
        Kind::Raw { motion, wrench, acceleration, calibration } => {
            let poses = zip_rows("orientation", archive.rows("position_m")?, archive.rows("orientation")?)?
                .map(|(position_m, orientation)| Pose { position_m, orientation });
            let loads = |[force_n, torque_n_m]: [_; 2]| Wrench { force_n, torque_n_m };
            AnyRecording::Raw(Recording::new(
                Series { rate_hz: motion.rate_hz, start_s: motion.start_s, samples: poses.collect() },
                archive.sensor(wrench, ["force_n", "torque_n_m"], loads)?,
                archive.sensor(acceleration, ["acceleration_v"], |[volts]| volts)?,
                calibration.into(),
                gesture,
                provenance,
            )?)
        }
    })
}

fn provenance_of(head: ProvenanceHead) -> Result<Provenance, ReadError> {
    let origin = (head.origin.parse::<Origin>()).map_err(|error| ReadError::member("head.ron", error))?;
    Ok(Provenance { origin, source: head.source, settings: head.settings, version: head.made_by })
}

/// Pairs the rows of two arrays, of which the second is called `name`.
fn zip_rows<const A: usize, const B: usize>(
    name: &str,
    a: Vec<[f64; A]>,
    b: Vec<[f64; B]>,
) -> Result<impl Iterator<Item = ([f64; A], [f64; B])>, ReadError> {
    if a.len() == b.len() { Ok(a.into_iter().zip(b)) } else { Err(other_length(name, b.len(), a.len())) }
}

fn other_length(name: &str, rows: usize, expected: usize) -> ReadError {
    ReadError::member(name, format!("it has {rows} rows where {expected} are expected"))
}

/// The place of an array's rows of three doubles in a file.
#[derive(Debug)]
struct InFile {
    start: u64,
    rows: usize,
}

/// What is made of the rows of arrays in a file.
#[derive(Debug)]
struct FileRows<T, const N: usize> {
    file: Arc<Mutex<File>>,
    arrays: [InFile; N],
    make: fn([[f64; 3]; N]) -> T,
}

impl<T: Debug + 'static, const N: usize> Rows<T> for FileRows<T, N> {
    fn count(&self) -> usize {
        self.arrays[0].rows
    }

    fn read(&self, rows: Range<usize>) -> Vec<T> {
        let mut file = self.file.lock().unwrap_or_else(PoisonError::into_inner);
        let read = self.arrays.each_ref().map(|array| {
            let mut bytes = vec![0; 24 * rows.len()];
            let begun = file.seek(SeekFrom::Start(array.start + 24 * rows.start as u64));
            match begun.and_then(|_| file.read_exact(&mut bytes)) {
                Ok(()) => bytes,
                Err(_) => f64::NAN.to_le_bytes().repeat(3 * rows.len()),
            }
        });
        let value = |array: usize, place: usize| f64::from_le_bytes(read[array].as_chunks().0[place]);
        let row = |array: usize, row: usize| [0, 1, 2].map(|axis| value(array, 3 * row + axis));
        (0..rows.len()).map(|at| (self.make)(std::array::from_fn(|array| row(array, at)))).collect()
    }
}

struct Archive<R> {
    archive: ZipArchive<R>,
    bytes: u64,
    file: Option<Arc<Mutex<File>>>,
}

/// Arrays of more bytes stay in their file.
const LARGE_BYTES: u64 = 8 << 20;

impl<R: Read + Seek> Archive<R> {
    /// What `make` makes of the rows of these arrays, which have as many.
    fn sensor<T: Clone + Debug + 'static, const N: usize>(
        &mut self,
        Timing { rate_hz, start_s }: Timing,
        names: [&str; N],
        make: fn([[f64; 3]; N]) -> T,
    ) -> Result<Sensor<T>, ReadError> {
        let mut in_file = vec![];
        for name in names {
            in_file.extend(self.in_file(&format!("{name}.npy"))?);
        }
        if let (Some(file), Ok(arrays)) = (&self.file, <[InFile; N]>::try_from(in_file))
            && arrays.iter().all(|array| array.rows == arrays[0].rows)
        {
            return Ok(Sensor::in_file(rate_hz, start_s, FileRows { file: Arc::clone(file), arrays, make }));
        }
        let mut rows = vec![];
        for name in names {
            rows.push(self.rows::<3>(name)?);
            if rows[0].len() != rows[rows.len() - 1].len() {
                return Err(other_length(name, rows[rows.len() - 1].len(), rows[0].len()));
            }
        }
        let at = |row: usize| make(std::array::from_fn(|array| rows[array][row]));
        let samples = (0..rows[0].len()).map(at).collect();
        Ok(Series { rate_hz, start_s, samples }.into())
    }

    /// The place of a large array of rows of three doubles, if its bytes are sound.
    fn in_file(&mut self, name: &str) -> Result<Option<InFile>, ReadError> {
        let wrong = |error: &dyn Display| ReadError::member(name, error);
        let Ok(member) = self.archive.by_name(name) else { return Ok(None) };
        let size = member.size();
        let is_stored = member.compression() == CompressionMethod::Stored;
        let Some(start) = member.data_start().filter(|_| self.file.is_some() && is_stored) else {
            return Ok(None);
        };
        if !(LARGE_BYTES..=self.bytes).contains(&size) {
            return Ok(None);
        }
        let mut member = member.take(size + 1);
        let Ok(npy::Header { descr, is_fortran: false, shape }) = npy::Header::read(&mut member) else {
            return Ok(None);
        };
        let header = size + 1 - member.limit();
        // To the end, where the checksum is compared.
        io::copy(&mut member, &mut io::sink()).map_err(|error| wrong(&error))?;
        let of_shape = matches!(shape[..], [rows, 3] if rows.checked_mul(24) == Some(size - header));
        Ok((descr == "<f8" && of_shape).then(|| InFile { start: start + header, rows: shape[0] as usize }))
    }

    fn member(&mut self, name: &str, most: u64) -> Result<Vec<u8>, ReadError> {
        let index = self
            .archive
            .index_for_name(name)
            .ok_or_else(|| ReadError::member(name, match name {
                "head.ron" => "it is missing, so haptograph did not write this archive; a recording of another program is a CSV, .xlsx, \
                         .mat or .wav file",
                _ => "it is missing",
            }))?;
        // Reads the raw size first: a compressed member can be much larger than the file.
        let raw = self.archive.by_index_raw(index).map_err(|e| ReadError::member(name, e))?;
        let (method, size) = (raw.compression(), raw.size());
        drop(raw);
        if method != CompressionMethod::Stored {
            let advice =
                "it is compressed; write the archive without compression (numpy.savez, not savez_compressed)";
            return Err(ReadError::member(name, advice));
        }
        if size > most.min(self.bytes) {
            return Err(ReadError::member(name, format!("it claims to be {size} bytes long")));
        }
        let member = self.archive.by_index(index).map_err(|e| ReadError::member(name, e))?;
        let mut bytes = Vec::with_capacity(size as usize);
        // Requests one more byte, because the checksum is compared at the end.
        member.take(size + 1).read_to_end(&mut bytes).map_err(|e| ReadError::member(name, e))?;
        Ok(bytes)
    }

    /// The result of `read`, or `None` if the archive has no such array.
    fn optional<T>(
        &mut self,
        name: &str,
        read: impl Fn(&mut Self, &str) -> Result<T, ReadError>,
    ) -> Result<Option<T>, ReadError> {
        let there = self.archive.index_for_name(&format!("{name}.npy")).is_some();
        there.then(|| read(self, name)).transpose()
    }

    fn column(&mut self, name: &str) -> Result<Vec<f64>, ReadError> {
        self.array(name, &[])
    }

    fn rows<const N: usize>(&mut self, name: &str) -> Result<Vec<[f64; N]>, ReadError> {
        let values = self.array(name, &[N as u64])?;
        Ok(values.as_chunks().0.to_vec())
    }

    /// The values of an array of rows of shape `row`.
    fn array(&mut self, name: &str, row: &[u64]) -> Result<Vec<f64>, ReadError> {
        let name = format!("{name}.npy");
        let bytes = self.member(&name, self.bytes)?;
        npy::doubles(&bytes, row).map_err(|error| ReadError::member(&name, error))
    }
}
