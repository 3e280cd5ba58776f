//! A simulated recording session (2.2): a person, a piece of a material, the recording tool, its sensors, and what they write
//! down. `graphs/recorder.ron` is this as a graph; here it is in one call, for tests and for batches.

use super::accelerometer::{Accelerometer, AccelerometerSettings};
use super::force_sensor::{ForceSensor, ForceSensorSettings};
use super::ground::Ground;
use super::material::{Material, MaterialName};
use super::script::{Action, ScriptError, ScriptSettings};
use super::stroke::{StrokeSettings, StrokeShape};
use super::tool::{
    FORCE_SENSOR_UP_M, SUBSTEPS, SimulatedTool, TOOL_RATE_HZ, TRACKER_UP_M, ToolGrip, ToolReading, conjugate, rotate,
};
use super::tracker::TrackerSettings;
use crate::vector::{Vec3, cross, dot};
use haptograph_signal::filter::DesignError;
use haptograph_signal::noise::stream_seed;
use haptograph_surfaces::recording::{Calibration, Gesture, Pose, Recording, RecordingError, Series, Wrench};
use haptograph_surfaces::{Origin, Provenance};
use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;

/// What is recorded.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Session {
    /// The material.
    pub material: MaterialName,
    /// What the hand does.
    pub gesture: Gesture,
    /// Who does it; people differ in hands, posture and habits.
    pub person: u64,
    /// Length, s.
    pub seconds: f64,
    /// The piece of material and the attempt.
    pub seed: u64,
}

/// Why nothing can be recorded.
#[derive(Debug, thiserror::Error)]
pub enum SessionError {
    /// No time.
    #[error("a recording of {seconds} s: give a finite time from 0.1 to 3600 s")]
    Length {
        /// The time asked for.
        seconds: f64,
    },
    /// The hand cannot play its script.
    #[error(transparent)]
    Script(#[from] ScriptError),
    /// A sensor's filter cannot be designed.
    #[error(transparent)]
    Sensor(#[from] DesignError),
    /// The recording is not sound.
    #[error(transparent)]
    Recording(#[from] RecordingError),
}

/// Rotation of the force sensor in the tool: an eighth of a turn about the tool's axis.
pub const FORCE_SENSOR_TO_TOOL: [[f64; 3]; 3] = [
    [std::f64::consts::FRAC_1_SQRT_2, -std::f64::consts::FRAC_1_SQRT_2, 0.0],
    [std::f64::consts::FRAC_1_SQRT_2, std::f64::consts::FRAC_1_SQRT_2, 0.0],
    [0.0, 0.0, 1.0],
];
/// Time from the start of the simulation to the start of the recording, s: the tool is on the surface.
const LEAD_S: f64 = 1.0;

/// What a person does when asked for a gesture: everyone draws larger or smaller, faster or slower, harder or softer.
pub fn habit(gesture: Gesture, person: u64) -> ScriptSettings {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(stream_seed(person, "habit"));
    let mut around = |value: f64| value * 1.25_f64.powf(rng.random_range(-1.0..1.0));
    let (size, pace, force) = (around(1.0), around(1.0), around(1.0));
    let long_s = 4000.0;
    let draw = |shape, force_n, force_variation, pace_variation| Action::Draw {
        stroke: StrokeSettings { shape, force_n, force_variation, pace_variation, size_variation: 0.1 },
        duration_s: long_s,
    };
    let action = match gesture {
        Gesture::Drag => {
            let shape = StrokeShape::Wander { side_m: 0.05 * size, fastest_hz: 1.6 * pace };
            draw(shape, 1.2 * force, 0.45, 0.25)
        }
        Gesture::Circle => {
            let shape = StrokeShape::Circles { radius_m: 0.025 * size, period_s: 1.3 / pace };
            draw(shape, 1.1 * force, 0.3, 0.1)
        }
        Gesture::Tap => Action::Taps {
            count: 4000,
            slowest_m_s: 0.06 * pace,
            fastest_m_s: 0.3 * pace,
            interval_s: 0.7,
            force_n: 0.5 * force,
        },
        Gesture::Press => Action::Press { force_n: 5.0 * force, duration_s: 6.0 / pace },
    };
    ScriptSettings { ground: Ground::TABLE, actions: vec![action], hover_m: 0.008 }
}

/// Where the sensors are and what their readings mean.
pub fn calibration(accelerometer: &AccelerometerSettings) -> Calibration {
    Calibration {
        acceleration_m_s2_per_v: [accelerometer.m_s2_per_v; 3],
        acceleration_zero_v: [accelerometer.zero_v; 3],
        force_sensor_to_tool: FORCE_SENSOR_TO_TOOL,
        tracker_to_tip_m: [0.0, 0.0, -TRACKER_UP_M],
    }
}

/// The load on the force sensor in its own frame, N and N m, of a tool's reading.
pub fn sensor_load(reading: &ToolReading) -> (Vec3, Vec3) {
    let in_tool = rotate(conjugate(reading.orientation), reading.force_n);
    // Sensor to tool is a rotation by rows; its transpose leads back.
    let to_sensor = |v: Vec3| -> Vec3 {
        std::array::from_fn(|i| dot(v, std::array::from_fn(|j| FORCE_SENSOR_TO_TOOL[j][i])))
    };
    let lever_m = [0.0, 0.0, -FORCE_SENSOR_UP_M];
    (to_sensor(in_tool), to_sensor(cross(lever_m, in_tool)))
}

/// Records a session. Everything in it is simulated, and the recording says so.
pub fn record(session: &Session) -> Result<Recording, SessionError> {
    if !(0.1..=3600.0).contains(&session.seconds) {
        return Err(SessionError::Length { seconds: session.seconds });
    }
    let material = Material::of(session.material);
    let seed = stream_seed(session.seed, &format!("{}/{}", session.person, session.gesture.word()));
    let grip = ToolGrip::of_person(session.person);
    let script = habit(session.gesture, session.person);
    let mut tool = SimulatedTool::new(&material, grip, &script, SUBSTEPS, seed)?;
    let accelerometer_settings = AccelerometerSettings::default();
    let mut accelerometer =
        Accelerometer::new(accelerometer_settings, TOOL_RATE_HZ, stream_seed(seed, "accelerometer"))?;
    let raw = ForceSensorSettings { cutoff_hz: None, ..ForceSensorSettings::default() };
    let mut force_sensor = ForceSensor::new(raw, TOOL_RATE_HZ, stream_seed(seed, "force"))?;
    let tracker = TrackerSettings::default();

    let lead = if session.gesture == Gesture::Press { 0.0 } else { LEAD_S };
    for _ in 0..(lead * TOOL_RATE_HZ) as usize {
        tool.advance();
        accelerometer.sample(tool.read().specific_m_s2);
    }
    let ticks = (session.seconds * TOOL_RATE_HZ).round() as usize;
    let (mut poses, mut wrenches, mut volts) = (Vec::new(), Vec::with_capacity(ticks), Vec::with_capacity(ticks));
    for tick in 0..ticks {
        let reading = tool.read();
        // The tracker's samples fall due when its count of periods reaches this tick.
        if tick as f64 * tracker.rate_hz / TOOL_RATE_HZ >= poses.len() as f64 {
            let (position_m, orientation) = tracker.sample(reading.tracker_m, reading.orientation);
            poses.push(Pose { position_m, orientation });
        }
        let (force_n, torque_n_m) = sensor_load(&reading);
        let load = force_sensor.sample(force_n, torque_n_m);
        wrenches.push(Wrench { force_n: load.force_n, torque_n_m: load.torque_n_m });
        volts.push(accelerometer.sample(reading.specific_m_s2));
        tool.advance();
    }
    let provenance = Provenance::new(Origin::Simulated, "simulated recording tool")
        .with_setting("material", session.material.word())
        .with_setting("person", session.person)
        .with_setting("seed", session.seed);
    Ok(Recording::new(
        Series::new(tracker.rate_hz, poses),
        Series::new(TOOL_RATE_HZ, wrenches),
        Series::new(TOOL_RATE_HZ, volts),
        calibration(&accelerometer_settings),
        session.gesture,
        provenance,
    )?)
}

#[cfg(test)]
mod tests;
