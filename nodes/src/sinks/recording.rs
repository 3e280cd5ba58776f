//! A sink that writes the recording of a surface to one file, for learning.

use super::visits::{Visited, Visits};
use super::{inside_the_run, sync};
use crate::simulated::orientation::{from_rotation_vector, rotation_of};
use haptograph_engine::frame::Kind;
use haptograph_engine::node::{
    BuildError, FileContext, FileKind, FileProgress, FileSink, FrameWriter, NodeSpec, Stream, input,
};
use haptograph_signal::quantity::Quantity;
use haptograph_signal::units::{Degrees, Millimetres};
use haptograph_surfaces::recording::{Calibration, Gesture, Member, Pose, RawHead, RawTable, Spool, Wrench};
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
    pub fn gesture(&self) -> Gesture {
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

/// Writes a recording of a surface.
pub struct RecordingSink;

impl FileKind for RecordingSink {
    type Settings = RecordingSinkSettings;
    const SPEC: NodeSpec = NodeSpec {
        name: "RecordingSink",
        group: "sinks",
        doc: "Writes the signals of a recording tool to one file, each sensor at its own rate, with the calibration that makes physical \
              quantities of the readings, and the provenance. During the run the readings go to a folder `<file>.part`, \
              at least once a second; the file is made from it at the end. A CSV file is written directly, calibrated. Surfaces are \
              learned from both. During a Drag the terminal shows which areas of speed and force have been \
              visited, and what to record next.",
        source: "2.2",
        inputs: &[
            input(
                "position",
                Kind::VECTOR,
                Quantity::LENGTH,
                "Position of the tracker's sensor in the world, m.",
            ),
            input(
                "orientation",
                Kind::VECTOR,
                Quantity::ANGLE,
                "Rotation from tool to world, axis times angle, rad.",
            ),
            input(
                "wrench",
                Kind::WRENCH,
                Quantity::FORCE,
                "Load on the tool in the force sensor's frame, N and N m.",
            ),
            input("voltage", Kind::VECTOR, Quantity::VOLTAGE, "Readings of the accelerometer's axes, V."),
        ],
        outputs: &[],
        example: r#""recording": RecordingSink(
    position: "tracker.position", orientation: "tracker.orientation", wrench: "force", voltage: "accelerometer",
    file: "recording.npz", motion: Drag, material: "T2", m_s2_per_v: 172.1, zero_v: 1.5)"#,
    };

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
            second: 3 * voltage.rate.hz() as u64,
            since: 0,
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
    /// Accelerometer readings per second, and those since the last write.
    second: u64,
    since: u64,
    flushed_at: Instant,
}

/// Longest time between writes.
const PACE: Duration = Duration::from_secs(1);

fn spool(spool: &mut Spool, stream: usize, frames: &[f64]) -> io::Result<()> {
    match stream {
        0 => spool.write(Member::PositionM, frames),
        1 => {
            let mut turns = frames.as_chunks().0.iter();
            turns.try_for_each(|turned| spool.write(Member::Orientation, &from_rotation_vector(*turned)))
        }
        2 => frames.as_chunks::<6>().0.iter().try_for_each(|load| {
            spool.write(Member::ForceN, &load[..3])?;
            spool.write(Member::TorqueNM, &load[3..])
        }),
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
        self.since += if stream == 3 { frames.len() as u64 } else { 0 };
        if self.since >= self.second || self.flushed_at.elapsed() >= PACE {
            self.flush()?;
            self.since = 0;
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vector::{norm, sub};
    use haptograph_signal::time::Rate;
    use haptograph_surfaces::learning::processing::{acceleration_axes, tip_positions, tool_wrench};
    use haptograph_surfaces::recording::{AnyRecording, Recording, assemble, load, spool_folder, write_csv};

    fn stream(name: &str, kind: Kind, rate: &str, simulated: bool) -> Stream {
        Stream {
            name: name.into(),
            kind,
            quantity: Quantity::NUMBER,
            rate: Rate::parse(rate).unwrap(),
            simulated,
        }
    }

    fn context(tracker: [&str; 2], simulated: bool) -> FileContext {
        let streams = vec![
            stream("tracker.position", Kind::VECTOR, tracker[0], simulated),
            stream("tracker.orientation", Kind::VECTOR, tracker[1], simulated),
            stream("force.wrench", Kind::WRENCH, "1000", simulated),
            stream("accelerometer.voltage", Kind::VECTOR, "1000", simulated),
        ];
        FileContext { streams, graph_seed: 7 }
    }

    fn settings(file: &str) -> RecordingSinkSettings {
        RecordingSinkSettings {
            file: file.into(),
            motion: Motion::Tap,
            material: "T3".into(),
            person: 2,
            m_s2_per_v: 100.0,
            zero_v: 1.5,
            tracker_to_tip_mm: [0.0, 0.0, -120.0].map(Millimetres),
            force_sensor_turn_deg: [0.0, 0.0, 90.0].map(Degrees),
        }
    }

    /// Writes ten frames of the fast sensors and five poses; reads them again.
    fn written(file: &str, simulated: bool) -> Recording {
        let cx = context(["500", "500"], simulated);
        let folder = tempfile::tempdir().unwrap();
        let sink = RecordingSink::build(settings(file), &cx).unwrap();
        let path = folder.path().join(sink.file_name());
        let mut writer = sink.open(&path, &cx.streams).unwrap();
        for block in 0..5 {
            let t = f64::from(block);
            writer.write(0, &[t, 2.0, 3.0]).unwrap();
            writer.write(1, &[0.0, 0.1 * t, 0.0]).unwrap();
            writer.write(2, &[t, 0.0, 1.0, 0.0, 0.5, 0.0, t, 0.0, 1.0, 0.0, 0.5, 0.0]).unwrap();
            writer.write(3, &[1.5, 1.5, t, 1.5, 1.5, t]).unwrap();
        }
        writer.finish().unwrap();
        match load(&path).unwrap() {
            AnyRecording::Raw(recording) => recording,
            AnyRecording::Processed(_) => panic!("readings of sensors are raw"),
        }
    }

    #[test]
    fn what_the_sensors_read_is_found_in_the_file_with_its_calibration_and_source() {
        for file in ["felt.npz", "felt.csv"] {
            let recording = written(file, true);
            assert_eq!((recording.motion().samples.len(), recording.motion().rate_hz), (5, 500.0));
            assert_eq!((recording.wrench().samples.len(), recording.wrench().rate_hz), (10, 1000.0));
            // Whether a file keeps readings and calibration apart or not: the physical quantities are the same.
            assert_eq!(acceleration_axes(&recording)[9], [0.0, 0.0, 250.0]);
            let tip_m = tip_positions(&recording)[4];
            let sway = 0.4_f64;
            let wanted_m = [4.0 - 0.12 * sway.sin(), 2.0, 3.0 - 0.12 * sway.cos()];
            assert!(norm(sub(tip_m, wanted_m)) < 1e-12, "{tip_m:?}");
            let load = tool_wrench(&recording)[2];
            assert!(norm(sub(load.force_n, [0.0, 1.0, 1.0])) < 1e-12, "{load:?}");
            assert!(norm(sub(load.torque_n_m, [-0.5, 0.0, 0.0])) < 1e-12, "{load:?}");
            assert_eq!(recording.gesture(), Gesture::Tap);
            let provenance = recording.provenance();
            assert_eq!(provenance.origin, Origin::Simulated);
            // A table has no place for the rest.
            for (name, value) in [("material", "T3"), ("person", "2"), ("seed", "7")] {
                assert!(file.ends_with("csv") || provenance.settings[name] == value);
            }
        }
    }

    #[test]
    fn a_table_is_written_as_it_goes_and_is_that_of_the_whole_recording() {
        let cx = context(["500", "500"], true);
        let folder = tempfile::tempdir().unwrap();
        let open = |file: &str| {
            let sink = RecordingSink::build(settings(file), &cx).unwrap();
            let path = folder.path().join(sink.file_name());
            (sink.open(&path, &cx.streams).unwrap(), path)
        };
        let ((mut table, at), (mut archive, whole)) = (open("x.csv"), open("x.npz"));
        for block in 0..2000 {
            let t = f64::from(block);
            for writer in [&mut table, &mut archive] {
                writer.write(3, &[1.5, 1.5, t, 1.5, 1.5, 0.3 * t]).unwrap();
                writer.write(1, &[0.0, 0.001 * t, 0.0]).unwrap();
                writer.write(0, &[0.1 * t, 2.0, 3.0]).unwrap();
                writer.write(2, &[0.7; 12]).unwrap();
            }
        }
        // All but the last second is there for a process that is killed.
        let killed = std::fs::read_to_string(&at).unwrap();
        table.finish().unwrap();
        archive.finish().unwrap();
        assert!(killed.lines().count() > 2000, "{}", killed.lines().count());
        let now = std::fs::read_to_string(&at).unwrap();
        assert!(now.starts_with(&killed) && !spool_folder(&at).exists());
        // But for the provenance, of which a table keeps less.
        let of_whole = write_csv(&load(&whole).unwrap()).unwrap();
        assert!(now.as_bytes() == of_whole);
        let (mut wrong, _) = open("y.csv");
        assert!(wrong.write(3, &[f64::NAN; 3]).is_err());
    }

    #[test]
    fn what_no_simulation_made_is_measured() {
        let provenance = written("felt.npz", false).provenance().clone();
        assert_eq!(provenance.origin, Origin::Measured);
        assert!(!provenance.settings.contains_key("seed"));
    }

    #[test]
    fn poses_of_two_rates_are_refused() {
        let refused = RecordingSink::build(settings("x.npz"), &context(["240", "1000"], true)).err();
        assert_eq!(refused.and_then(|e| e.field), Some("orientation"));
    }

    #[test]
    fn what_a_dead_run_left_is_the_recording_up_to_there() {
        let cx = context(["500", "500"], true);
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.npz");
        let sink = RecordingSink::build(settings("x.npz"), &cx).unwrap();
        let mut writer = sink.open(&path, &cx.streams).unwrap();
        for second in 0..2 {
            let t = f64::from(second);
            for stream in [0, 1] {
                writer.write(stream, &[t; 1500]).unwrap();
            }
            writer.write(2, &[t; 6000]).unwrap();
            writer.write(3, &[t; 3000]).unwrap();
        }
        // Nothing after this point is done for a process that is killed.
        let (left, made) = (spool_folder(&path), folder.path().join("made.npz"));
        assemble(&left, &made).unwrap();
        let AnyRecording::Raw(recording) = load(&made).unwrap() else {
            panic!("readings of sensors are raw");
        };
        assert_eq!(recording.motion().samples.len(), 1000);
        assert_eq!(recording.acceleration_v().samples.len(), 2000);
        assert_eq!(recording.gesture(), Gesture::Tap);
        writer.finish().unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), std::fs::read(&made).unwrap());
        assert!(!left.exists());
    }

    #[test]
    fn a_run_too_short_for_a_recording_says_so() {
        let cx = context(["500", "500"], true);
        let folder = tempfile::tempdir().unwrap();
        let sink = RecordingSink::build(settings("x.npz"), &cx).unwrap();
        let writer = sink.open(&folder.path().join("x.npz"), &cx.streams).unwrap();
        assert!(writer.finish().unwrap_err().to_string().contains("needs two"));
        assert!(!folder.path().join("x.npz").exists());
    }
}
