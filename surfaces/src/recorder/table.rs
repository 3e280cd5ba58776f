//! The readings of a recording tool as CSV, calibrated: acceleration in m/s², forces in the tool's frame, positions of the tip.

use super::{AXES, Calibration, Gesture, Pose, RawHead, Wrench};
use crate::Provenance;
use crate::provenance::TOUCH;
use haptograph_signal::units::decimal::format_thousandfold;
use std::collections::VecDeque;
use std::io::{BufWriter, Write};

/// The lines above the header.
pub fn origin_lines(gesture: Gesture, provenance: &Provenance) -> String {
    let one_line = |text: &str| text.replace(['\n', '\r'], " ");
    let mut lines = format!(
        "# gesture: {}\n# origin: {}\n# source: {}\n",
        gesture.as_str(),
        provenance.origin.as_str(),
        one_line(&provenance.source)
    );
    for name in TOUCH {
        if let Some(value) = provenance.settings.get(name) {
            lines += &format!("# {name}: {}\n", one_line(value));
        }
    }
    lines
}

/// The times of a sensor's samples.
#[derive(Debug, Clone, Copy)]
pub struct Clock {
    /// Samples per second.
    pub rate_hz: f64,
    /// Time of the first sample, s.
    pub start_s: f64,
}

/// Writes a raw recording as a table during recording. Memory holds only the
/// samples by which one sensor is ahead of the others.
pub struct RawTable<W: Write> {
    writer: BufWriter<W>,
    calibration: Calibration,
    clocks: [Clock; 3],
    /// Written samples of each sensor, and pending samples that wait for the other sensors.
    written: [u64; 3],
    acceleration: VecDeque<[f64; 3]>,
    loads: VecDeque<Wrench>,
    /// The tip, and the orientation.
    poses: VecDeque<([f64; 3], [f64; 4])>,
}

impl<W: Write> RawTable<W> {
    /// Begins a table: the lines above its header, and the header.
    ///
    /// # Errors
    /// An error of the file system.
    pub fn begin(mut to: W, head: &RawHead<'_>) -> std::io::Result<Self> {
        to.write_all(origin_lines(head.gesture, head.provenance).as_bytes())?;
        let clocks = [head.acceleration_hz, head.wrench_hz, head.motion_hz];
        let clocks = clocks.map(|rate_hz| Clock { rate_hz, start_s: 0.0 });
        Self::over(to, head.calibration, clocks)
    }

    /// Begins a table below the lines above its header; the clocks are those of accelerations, loads and poses.
    ///
    /// # Errors
    /// An error of the file system.
    pub fn over(to: W, calibration: &Calibration, clocks: [Clock; 3]) -> std::io::Result<Self> {
        let mut writer = BufWriter::new(to);
        let mut header = vec!["time_s".to_owned()];
        header.extend(AXES.map(|axis| format!("accel_{axis}_m_s2")));
        header.extend(AXES.map(|axis| format!("force_{axis}_n")));
        header.extend(AXES.map(|axis| format!("torque_{axis}_n_mm")));
        header.extend(AXES.map(|axis| format!("position_{axis}_mm")));
        header.extend(["w", "x", "y", "z"].map(|part| format!("orientation_{part}")));
        writeln!(writer, "{}", header.join(","))?;
        Ok(Self {
            writer,
            calibration: *calibration,
            clocks,
            written: [0; 3],
            acceleration: VecDeque::new(),
            loads: VecDeque::new(),
            poses: VecDeque::new(),
        })
    }

    /// Appends readings of the accelerometer, V.
    pub fn push_acceleration(&mut self, volts: &[f64; 3]) {
        self.acceleration.push_back(self.calibration.acceleration_m_s2(volts));
    }

    /// Appends a load in the force sensor's frame.
    pub fn push_load(&mut self, load: &Wrench) {
        self.loads.push_back(self.calibration.load_on_tool(load));
    }

    /// Appends a pose of the tracker's sensor.
    pub fn push_pose(&mut self, pose: &Pose) {
        let tip = self.calibration.tip_m(pose);
        self.poses.push_back((tip, pose.orientation));
    }

    /// Writes the rows that no later sample can precede.
    ///
    /// # Errors
    /// An error of the file system.
    pub fn write_due(&mut self) -> std::io::Result<()> {
        while !(self.acceleration.is_empty() || self.loads.is_empty() || self.poses.is_empty()) {
            self.write_row()?;
        }
        Ok(())
    }

    /// Flushes the buffer and returns the file, so that the caller can sync it.
    ///
    /// # Errors
    /// An error of the file system.
    pub fn flush(&mut self) -> std::io::Result<&W> {
        self.writer.flush()?;
        Ok(self.writer.get_ref())
    }

    /// Writes all pending rows; returns the numbers of poses, loads and accelerations.
    ///
    /// # Errors
    /// An error of the file system.
    pub fn finish(mut self) -> std::io::Result<[u64; 3]> {
        while self.write_row()? {}
        self.writer.flush()?;
        let [accelerations, loads, poses] = self.written;
        Ok([poses, loads, accelerations])
    }

    /// Writes the row of the earliest time; false if there is none.
    fn write_row(&mut self) -> std::io::Result<bool> {
        let waits = [!self.acceleration.is_empty(), !self.loads.is_empty(), !self.poses.is_empty()];
        let time = |sensor: usize| {
            let Clock { rate_hz, start_s } = self.clocks[sensor];
            waits[sensor].then_some(start_s + self.written[sensor] as f64 / rate_hz)
        };
        let times = [time(0), time(1), time(2)];
        let Some(now) = times.into_iter().flatten().min_by(f64::total_cmp) else {
            return Ok(false);
        };
        let due = times.map(|time| time == Some(now));
        let plain = |value: f64| format!("{value:?}");
        write!(self.writer, "{now}")?;
        let acceleration = due[0].then(|| self.acceleration.pop_front()).flatten();
        let load = due[1].then(|| self.loads.pop_front()).flatten();
        let pose = due[2].then(|| self.poses.pop_front()).flatten();
        self.cells::<3>(acceleration, plain)?;
        self.cells::<3>(load.as_ref().map(|load| load.force_n), plain)?;
        self.cells::<3>(load.map(|load| load.torque_n_m), format_thousandfold)?;
        self.cells::<3>(pose.map(|(tip, _)| tip), format_thousandfold)?;
        self.cells::<4>(pose.map(|(_, orientation)| orientation), plain)?;
        writeln!(self.writer)?;
        for (written, due) in self.written.iter_mut().zip(due) {
            *written += u64::from(due);
        }
        Ok(true)
    }

    /// Writes numbers, or the same number of empty cells.
    fn cells<const N: usize>(
        &mut self,
        numbers: Option<[f64; N]>,
        text: impl Fn(f64) -> String,
    ) -> std::io::Result<()> {
        for place in 0..N {
            let cell = numbers.map_or_else(String::new, |numbers| text(numbers[place]));
            write!(self.writer, ",{cell}")?;
        }
        Ok(())
    }
}
