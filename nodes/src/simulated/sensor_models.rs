//! Nodes that model the sensors of the recording tool (2.2.1).

use super::accelerometer::{self, AccelerometerSettings};
use super::force_sensor::{self, ForceSensorSettings};
use super::orientation::{from_rotation_vector, rotation_vector};
use super::tracker::TrackerSettings;
use crate::sinks::recording::Motion;
use crate::vector::Vec3;
use haptograph_engine::frame::{Vector, Wrench};
use haptograph_engine::node::{
    BuildContext, BuildError, Built, Io, Latency, NodeKind, Port, Processor, Tick,
};
use haptograph_signal::quantity::Quantity;
use haptograph_signal::units::{Degrees, Millimetres, NewtonMillimetres};

haptograph_engine::settings! {
    /// Settings of [`AccelerometerModel`].
    pub struct AccelerometerModelSettings {
        /// Sensitivity, m/s2 per V: 57 mV per g.
        m_s2_per_v: f64 = 9.81 / 0.057, in 1e-6..=1e6;
        /// Voltage at rest, V.
        zero_v: f64 = 1.5, in -1000.0..=1000.0;
        /// Largest acceleration, m/s2: 18 g.
        range_m_s2: f64 = 18.0 * 9.81, in 1e-6..=1e6;
        /// Standard deviation of the noise in the voltage as acceleration, m/s2.
        noise_m_s2: f64 = 0.126, in 0.0..=1e6;
        /// Corner of the five-pole Bessel low-pass before the converter, Hz.
        cutoff_hz: f64 = 1000.0, in 0.001..=1e6;
        /// Full scale of the converter, from minus to plus this, V.
        full_scale_v: f64 = 5.0, in 1e-6..=1000.0;
        /// Bits of the converter.
        bits: u32 = 16, in 1..=32;
    }
}

haptograph_engine::node! {
    /// Models an analogue three-axis accelerometer with anti-aliasing filter and converter. The defaults are the thesis's:
    /// +-18 g, 0.126 m/s2 of noise, a five-pole Bessel low-pass at 1000 Hz, 16 bits.
    pub struct AccelerometerModel(AccelerometerModelSettings) in "sensors";
    source: "2.2.1";
    example: r#""accelerometer": AccelerometerModel(acceleration: "tool.acceleration")"#;
    in ACCELERATION: Vector = Port::of(Quantity::ACCELERATION, "Acceleration less gravity, m/s2.");
    out VOLTAGE: Vector = Port::of(Quantity::VOLTAGE, "Readings of the three axes, V.");
}

impl NodeKind for AccelerometerModel {
    fn build(settings: AccelerometerModelSettings, cx: &BuildContext) -> Result<Built<Self>, BuildError> {
        let settings = AccelerometerSettings {
            m_s2_per_v: settings.m_s2_per_v,
            zero_v: settings.zero_v,
            range_m_s2: settings.range_m_s2,
            noise_m_s2: settings.noise_m_s2,
            cutoff_hz: settings.cutoff_hz,
            full_scale_v: settings.full_scale_v,
            bits: settings.bits,
        };
        let sensor = accelerometer::Accelerometer::new(settings, cx.rate.hz(), cx.seed)
            .map_err(|error| BuildError::at("cutoff_hz", error.to_string()))?;
        Ok(Built::new(Accelerometer(sensor)))
    }
}

#[derive(Debug, Clone)]
struct Accelerometer(accelerometer::Accelerometer);

impl Processor<AccelerometerModel> for Accelerometer {
    fn process(&mut self, _: &Tick, io: &mut Io<'_, AccelerometerModel>) {
        let felt = io.read(AccelerometerModel::ACCELERATION);
        for (volts, felt) in io.write(AccelerometerModel::VOLTAGE).iter_mut().zip(felt) {
            *volts = self.0.sample(felt.map(number));
        }
    }

    fn copy_state_into(&self, new: &mut Self) {
        new.0.clone_from(&self.0);
    }

    fn latency(&self) -> Latency {
        Latency::of_group(self.0.delay_s())
    }
}

/// NaN and infinity become zero.
fn number(x: f64) -> f64 {
    if x.is_finite() { x } else { 0.0 }
}

haptograph_engine::settings! {
    /// Settings of [`TrackerModel`].
    pub struct TrackerModelSettings {
        /// Step of the position, mm.
        step_mm: Millimetres = Millimetres(0.5), in 1e-9..=1000.0;
        /// Step of yaw, pitch and roll, degrees.
        step_deg: Degrees = Degrees(0.1), in 1e-9..=90.0;
        /// The gesture. A testing machine makes the Press; its measurement of position is finer.
        motion: Motion = Motion::Drag;
        /// Step of the testing machine's position, mm.
        machine_step_mm: Millimetres = Millimetres(6e-5), in 1e-9..=1000.0;
    }
}

haptograph_engine::node! {
    /// Models a magnetic tracker: quantised position and angles, at the rate of its clock. The defaults are the thesis's:
    /// 0.5 mm and 0.1 degrees, and 0.06 um for the machine that presses.
    pub struct TrackerModel(TrackerModelSettings) in "sensors";
    source: "2.2.1, 3.2.2";
    example: r#""tracker": TrackerModel(clock: "tracker", position: Hold("tool.position"), orientation: Hold("tool.orientation"))"#;
    in POSITION: Vector = Port::of(Quantity::LENGTH, "Position of the tracker's sensor, m.");
    in ORIENTATION: Vector = Port::of(Quantity::ANGLE, "Orientation as axis times angle, rad.");
    out POSITION_READING as "position": Vector = Port::of(Quantity::LENGTH, "Position reading, m.");
    out ORIENTATION_READING as "orientation": Vector =
        Port::of(Quantity::ANGLE, "Orientation reading, axis times angle, rad.");
}

impl NodeKind for TrackerModel {
    fn build(settings: TrackerModelSettings, _: &BuildContext) -> Result<Built<Self>, BuildError> {
        let step = if settings.motion == Motion::Press { settings.machine_step_mm } else { settings.step_mm };
        Ok(Built::new(Tracker(TrackerSettings { step_m: step.si(), step_rad: settings.step_deg.si() })))
    }
}

#[derive(Debug, Clone)]
struct Tracker(TrackerSettings);

impl Processor<TrackerModel> for Tracker {
    fn process(&mut self, _: &Tick, io: &mut Io<'_, TrackerModel>) {
        let (positions, orientations) = (io.read(TrackerModel::POSITION), io.read(TrackerModel::ORIENTATION));
        let (position, orientation) =
            io.write_all((TrackerModel::POSITION_READING, TrackerModel::ORIENTATION_READING));
        let out = position.iter_mut().zip(orientation);
        for ((position, orientation), (at_m, turned)) in out.zip(positions.iter().zip(orientations)) {
            let turned: Vec3 = turned.map(number);
            let (read_m, read) = self.0.sample(at_m.map(number), from_rotation_vector(turned));
            (*position, *orientation) = (read_m, rotation_vector(read));
        }
    }
}

haptograph_engine::settings! {
    /// Settings of [`ForceSensorModel`].
    pub struct ForceSensorModelSettings {
        /// Step of each force, N.
        force_step_n: f64 = 1.0 / 160.0, in 1e-9..=1000.0;
        /// Step of each torque, N mm.
        torque_step_n_mm: NewtonMillimetres = NewtonMillimetres(1.0 / 32.0), in 1e-9..=1000.0;
        /// Largest forces along x, y and z, N.
        most_force_n: [f64; 3] = [25.0, 25.0, 35.0];
        /// Largest torque about each axis, N mm.
        most_torque_n_mm: NewtonMillimetres = NewtonMillimetres(250.0), in 1e-9..=1e6;
        /// Standard deviation of the noise in steps.
        noise_steps: f64 = 1.0, in 0.0..=1000.0;
    }
}

haptograph_engine::node! {
    /// Models a six-axis force/torque sensor: noise, saturation, quantisation. The defaults are those of a Nano17
    /// SI-25-0.25.
    pub struct ForceSensorModel(ForceSensorModelSettings) in "sensors";
    source: "2.2.1";
    example: r#""force": ForceSensorModel(wrench: "tool.wrench")"#;
    in WRENCH: Wrench = Port::of(Quantity::FORCE, "The load, N and N m.");
    out READING as "wrench": Wrench = Port::of(Quantity::FORCE, "Load reading, N and N m.");
}

impl NodeKind for ForceSensorModel {
    fn build(settings: ForceSensorModelSettings, cx: &BuildContext) -> Result<Built<Self>, BuildError> {
        if settings.most_force_n.iter().any(|most| *most <= 0.0) {
            return Err(BuildError::at("most_force_n", "the largest forces have to be above zero"));
        }
        let settings = ForceSensorSettings {
            force_step_n: settings.force_step_n,
            torque_step_n_m: settings.torque_step_n_mm.si(),
            most_force_n: settings.most_force_n,
            most_torque_n_m: settings.most_torque_n_mm.si(),
            noise_steps: settings.noise_steps,
            cutoff_hz: None,
        };
        let sensor = force_sensor::ForceSensor::new(settings, cx.rate.hz(), cx.seed)
            .map_err(|error| BuildError::of_node(error.to_string()))?;
        Ok(Built::new(ForceSensor(sensor)))
    }
}

#[derive(Debug, Clone)]
struct ForceSensor(force_sensor::ForceSensor);

impl Processor<ForceSensorModel> for ForceSensor {
    fn process(&mut self, _: &Tick, io: &mut Io<'_, ForceSensorModel>) {
        let loads = io.read(ForceSensorModel::WRENCH);
        for (read, load) in io.write(ForceSensorModel::READING).iter_mut().zip(loads) {
            let [fx, fy, fz, mx, my, mz] = load.map(number);
            let reading = self.0.sample([fx, fy, fz], [mx, my, mz]);
            read[..3].copy_from_slice(&reading.force_n);
            read[3..].copy_from_slice(&reading.torque_n_m);
        }
    }

    fn copy_state_into(&self, new: &mut Self) {
        new.0.clone_from(&self.0);
    }

    fn latency(&self) -> Latency {
        Latency::of_group(self.0.delay_s())
    }
}
