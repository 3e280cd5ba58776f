//! A sink that writes the recording of a surface to one file, for learning.

use super::visits::{Visited, Visits};
use super::{inside_the_run, sync};
use crate::simulated::orientation::{from_rotation_vector, rotation_of};
use haptograph_engine::frame::{self, Vector};
use haptograph_engine::node::{
    BuildError, FileContext, FileKind, FileProgress, FileSink, FrameWriter, Port, Stream,
};
use haptograph_signal::quantity::Quantity;
use haptograph_signal::units::{Degrees, Millimetres};
use haptograph_surfaces::recorder::{Calibration, Gesture, Member, Pose, RawHead, RawTable, Spool, Wrench};
use haptograph_surfaces::{Origin, Provenance};
use std::collections::VecDeque;
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

haptograph_engine::choices! {
    /// The gesture of a recording.
    pub enum Motion {
        /// Free dragging at many speeds and forces: for textures.
        Drag,
        /// Smooth circles: for friction.
        Circle,
        /// Tapping: for taps.
        Tap,
        /// One slow press by a testing machine: for stiffness.
        Press,
    }
}

impl Motion {
    /// The gesture in the recording's format.
    pub(crate) fn gesture(&self) -> Gesture {
        match self {
            Self::Drag => Gesture::Drag,
            Self::Circle => Gesture::Circle,
            Self::Tap => Gesture::Tap,
            Self::Press => Gesture::Press,
        }
    }
}

haptograph_engine::settings! {
    /// Settings of [`RecordingSink`].
    pub struct RecordingSinkSettings {
        /// Name of the file in the run's folder: our own archive, or a table where it ends in `.csv`.
        [output_file] file: String;
        /// The gesture: Drag, Circle, Tap or Press.
        motion: Motion = Motion::Drag;
        /// Name of the material.
        material: String;
        /// Number of the person who recorded.
        person: u64 = 1;
        /// Sensitivity of the accelerometer, m/s2 per V.
        m_s2_per_v: f64, in 1e-6..=1e6;
        /// Accelerometer voltage at rest, V.
        zero_v: f64 = 0.0, in -1000.0..=1000.0;
        /// From the tracker's sensor to the tip, in the tool's frame, mm.
        tracker_to_tip_mm: [Millimetres; 3] = [Millimetres(0.0); 3];
        /// Rotation from the force sensor's frame to the tool's: axis times angle, degrees.
        force_sensor_turn_deg: [Degrees; 3] = [Degrees(0.0); 3];
    }
}

haptograph_engine::node! {
    /// Writes the signals of a recording tool to one file, each sensor at its own rate, with the calibration that makes
    /// physical quantities of the readings, and the provenance. During the run the readings go to a folder `<file>.part`,
    /// at least once a second; the file is made from it at the end. A CSV file is written directly, calibrated. Surfaces
    /// are learned from both. During a Drag the terminal shows which areas of speed and force have been visited, and what
    /// to record next.
    pub struct RecordingSink(RecordingSinkSettings) in "sinks";
    source: "2.2";
    example: r#""recording": RecordingSink(
    position: "tracker.position", orientation: "tracker.orientation", wrench: "force", voltage: "accelerometer",
    file: "recording.npz", motion: Drag, material: "T2", m_s2_per_v: 172.1, zero_v: 1.5)"#;
    in POSITION: Vector = Port::of(Quantity::LENGTH, "Position of the tracker's sensor in the world, m.");
    in ORIENTATION: Vector = Port::of(Quantity::ANGLE, "Rotation from tool to world, axis times angle, rad.");
    in WRENCH: frame::Wrench = Port::of(Quantity::FORCE, "Load on the tool in the force sensor's frame, N and N m.");
    in VOLTAGE: Vector = Port::of(Quantity::VOLTAGE, "Readings of the accelerometer's axes, V.");
}

impl FileKind for RecordingSink {
    fn build(settings: RecordingSinkSettings, cx: &FileContext) -> Result<Box<dyn FileSink>, BuildError> {
        if let [position, orientation, ..] = cx.streams.as_slice()
            && position.rate != orientation.rate
        {
            let message = format!(
                "{} has {} but {} has {}; position and orientation need one rate",
                position.name, position.rate, orientation.name, orientation.rate
            );
            return Err(BuildError::at("orientation", message).help("connect both to one tracker"));
        }
        let calibration = Calibration {
            acceleration_m_s2_per_v: [settings.m_s2_per_v; 3],
            acceleration_zero_v: [settings.zero_v; 3],
            force_sensor_to_tool: rotation_of(settings.force_sensor_turn_deg),
            tracker_to_tip_m: settings.tracker_to_tip_mm.map(Millimetres::si),
        };
        let simulated = cx.streams.iter().any(|stream| stream.simulated);
        let (origin, source) = if simulated {
            (Origin::Simulated, "simulated recording tool")
        } else {
            (Origin::Measured, "recording tool")
        };
        let mut provenance = Provenance::new(origin, source)
            .with_setting("material", settings.material)
            .with_setting("person", settings.person);
        if simulated {
            provenance = provenance.with_setting("seed", cx.graph_seed);
        }
        Ok(Box::new(Session {
            file: inside_the_run(&settings.file, &["npz", "csv"])?,
            calibration,
            gesture: settings.motion.gesture(),
            provenance,
            visits: Arc::default(),
        }))
    }
}

#[derive(Debug)]
struct Session {
    file: PathBuf,
    calibration: Calibration,
    gesture: Gesture,
    provenance: Provenance,
    visits: Arc<Visited>,
}

impl FileSink for Session {
    fn file_name(&self) -> &Path {
        &self.file
    }

    fn open(&self, path: &Path, streams: &[Stream]) -> io::Result<Box<dyn FrameWriter>> {
        let [position, _, wrench, voltage] = streams else {
            return Err(io::Error::other("a recording has four signals"));
        };
        let head = RawHead {
            motion_hz: position.rate.hz(),
            wrench_hz: wrench.rate.hz(),
            acceleration_hz: voltage.rate.hz(),
            calibration: &self.calibration,
            gesture: self.gesture,
            provenance: &self.provenance,
        };
        let tape = match is_csv(path) {
            true => Tape::Table(Box::new(RawTable::begin(File::create(path)?, &head)?)),
            false => Tape::Spool(Spool::create(path, &head)?),
        };
        Ok(Box::new(Writer {
            path: path.to_owned(),
            tape,
            visits: (self.gesture == Gesture::Drag).then(|| {
                let tip_m = self.calibration.tracker_to_tip_m;
                Visits::new(Arc::clone(&self.visits), tip_m, position.rate.hz())
            }),
            position: VecDeque::new(),
            turned: VecDeque::new(),
            flushed_at: Instant::now(),
        }))
    }

    fn progress(&self) -> Option<Arc<dyn FileProgress>> {
        let visits: Arc<dyn FileProgress> = Arc::clone(&self.visits) as _;
        (self.gesture == Gesture::Drag).then_some(visits)
    }
}

fn is_csv(path: &Path) -> bool {
    path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("csv"))
}

/// Output of a recording in progress: parts of an archive, which is made at the end, or a CSV file.
enum Tape {
    Spool(Spool),
    Table(Box<RawTable<File>>),
}

/// A recording in progress.
struct Writer {
    path: PathBuf,
    tape: Tape,
    visits: Option<Visits>,
    /// Incomplete poses, for a CSV file.
    position: VecDeque<[f64; 3]>,
    turned: VecDeque<[f64; 4]>,
    flushed_at: Instant,
}

/// Longest time between writes.
const PACE: Duration = Duration::from_secs(1);

fn spool(spool: &mut Spool, stream: usize, frames: &[f64]) -> io::Result<()> {
    match stream {
        0 => spool.write(Member::PositionM, frames),
        1 => {
            let turns: Vec<_> = frames.as_chunks().0.iter().map(|turn| from_rotation_vector(*turn)).collect();
            spool.write(Member::Orientation, turns.as_flattened())
        }
        2 => {
            let halves = frames.as_chunks::<3>().0.chunks_exact(2);
            let (forces, torques): (Vec<_>, Vec<_>) = halves.map(|load| (load[0], load[1])).unzip();
            spool.write(Member::ForceN, forces.as_flattened())?;
            spool.write(Member::TorqueNM, torques.as_flattened())
        }
        _ => spool.write(Member::AccelerationV, frames),
    }
}

impl Writer {
    /// Appends frames to a CSV file, which cannot hold NaN or infinity.
    fn tabulate(&mut self, stream: usize, frames: &[f64]) -> io::Result<()> {
        let Tape::Table(table) = &mut self.tape else {
            return Ok(());
        };
        if let Some(number) = frames.iter().find(|number| !number.is_finite()) {
            return Err(io::Error::other(format!("a reading is {number}, not a finite number")));
        }
        match stream {
            0 => self.position.extend(frames.as_chunks::<3>().0),
            1 => self.turned.extend(frames.as_chunks().0.iter().map(|turned| from_rotation_vector(*turned))),
            2 => frames.as_chunks::<6>().0.iter().for_each(|&[x, y, z, u, v, w]| {
                table.push_load(&Wrench { force_n: [x, y, z], torque_n_m: [u, v, w] });
            }),
            _ => { frames.as_chunks::<3>().0.iter() }.for_each(|volts| table.push_acceleration(volts)),
        }
        while !self.position.is_empty()
            && let Some(orientation) = self.turned.pop_front()
        {
            let position_m = self.position.pop_front().unwrap_or_default();
            table.push_pose(&Pose { position_m, orientation });
        }
        table.write_due()
    }

    /// Writes the buffers and syncs them to the disk.
    fn flush(&mut self) -> io::Result<()> {
        match &mut self.tape {
            Tape::Spool(spool) => spool.flush()?.for_each(sync::request),
            Tape::Table(table) => sync::request(table.flush()?),
        }
        Ok(())
    }
}

impl FrameWriter for Writer {
    fn write(&mut self, stream: usize, frames: &[f64]) -> io::Result<()> {
        match &mut self.tape {
            Tape::Spool(parts) => spool(parts, stream, frames)?,
            Tape::Table(_) => self.tabulate(stream, frames)?,
        }
        if let Some(visits) = &mut self.visits {
            visits.take(stream, frames);
        }
        if self.flushed_at.elapsed() >= PACE {
            self.flush()?;
            self.flushed_at = Instant::now();
        }
        Ok(())
    }

    fn finish(self: Box<Self>) -> io::Result<()> {
        let counts = match self.tape {
            Tape::Spool(spool) => return spool.finish(&self.path),
            Tape::Table(table) => table.finish()?,
        };
        let [poses, loads, accelerations] = counts;
        match counts.iter().all(|count| *count >= 2) {
            true => Ok(()),
            false => Err(io::Error::other(format!(
                "a recording needs two samples of each sensor; this one has {poses} poses, {loads} loads and {accelerations} \
                 accelerations"
            ))),
        }
    }
}
