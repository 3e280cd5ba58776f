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
use super::{AnyRecording, Gesture, Pose, ProcessedRecording, Recording, Series, Signals, WorldAxes, Wrench};
use haptograph_signal::files::MAX_NOTE_BYTES;
use haptograph_surfaces::npy;
use haptograph_surfaces::npz::{begin, put_rows};
use haptograph_surfaces::recorder::head::{FORMAT, Head, Kind, ProvenanceHead, Timing};
use haptograph_surfaces::{Origin, Provenance};
use std::io::{Cursor, Read, Seek, Write};
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
            let wrench = &raw.wrench().samples;
            put(&mut archive, "force_n", &[3], wrench.iter().flat_map(|w| w.force_n))?;
            put(&mut archive, "torque_n_m", &[3], wrench.iter().flat_map(|w| w.torque_n_m))?;
            let acceleration = &raw.acceleration_v().samples;
            put(&mut archive, "acceleration_v", &[3], acceleration.iter().copied().flatten())?;
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

fn timing<T>(series: &Series<T>) -> Timing {
    Timing { rate_hz: series.rate_hz, start_s: series.start_s }
}

fn series<T>(timing: Timing, samples: Vec<T>) -> Series<T> {
    Series { rate_hz: timing.rate_hz, start_s: timing.start_s, samples }
}

fn head_of(recording: &AnyRecording) -> Head {
    let kind = match recording {
        AnyRecording::Raw(raw) => Kind::Raw {
            motion: timing(raw.motion()),
            wrench: timing(raw.wrench()),
            acceleration: timing(raw.acceleration_v()),
            calibration: raw.calibration().into(),
        },
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
    let archive = ZipArchive::new(Cursor::new(bytes)).map_err(|_| ReadError::CutArchive)?;
    let mut archive = Archive { archive, bytes: bytes.len() as u64 };
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
            let wrenches = zip_rows("torque_n_m", archive.rows("force_n")?, archive.rows("torque_n_m")?)?
                .map(|(force_n, torque_n_m)| Wrench { force_n, torque_n_m });
            AnyRecording::Raw(Recording::new(
                series(motion, poses.collect()),
                series(wrench, wrenches.collect()),
                series(acceleration, archive.rows("acceleration_v")?),
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
    if a.len() == b.len() {
        Ok(a.into_iter().zip(b))
    } else {
        Err(ReadError::member(name, format!("it has {} rows where {} are expected", b.len(), a.len())))
    }
}

struct Archive<'a> {
    archive: ZipArchive<Cursor<&'a [u8]>>,
    bytes: u64,
}

impl Archive<'_> {
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
