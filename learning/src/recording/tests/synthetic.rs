//! Synthetic recordings for tests: a tool moves over a tilted plane with forces, speeds and vibrations known in closed form.

use super::{Calibration, Gesture, Pose, ProcessedRecording, Recording, Series, Signals, Wrench};
use haptograph_signal::noise::Gaussian;
use haptograph_surfaces::{Origin, Provenance};
use nalgebra::{Rotation3, UnitQuaternion, Vector3};

pub const RATE_HZ: f64 = 10_000.0;
pub const TRACKER_HZ: f64 = 240.0;

pub fn provenance() -> Provenance {
    Provenance::new(Origin::Simulated, "made up for a test")
}

/// The plane's outward normal in the world.
pub fn normal() -> Vector3<f64> {
    Vector3::new(0.2, -0.3, 0.9).normalize()
}

/// Two directions in the plane.
pub fn tangents() -> [Vector3<f64>; 2] {
    let first = normal().cross(&Vector3::x()).normalize();
    [first, normal().cross(&first)]
}

/// The state of the tool at one time.
pub struct Moment {
    /// Position of the tip from the plane's origin: along both tangents and the normal, m.
    pub place_m: [f64; 3],
    /// Force on the tool along the normal, N.
    pub push_n: f64,
    /// Force on the tool along both tangents, N.
    pub friction_n: [f64; 2],
    /// Acceleration of the tool in the world, without gravity, m/s².
    pub vibration_m_s2: [f64; 3],
}

/// A raw recording of a tool that tilts and turns while it follows `moment`, by sensors with unusual calibrations.
pub fn raw(
    seconds: f64,
    gesture: Gesture,
    tracker_hz: f64,
    mut moment: impl FnMut(f64) -> Moment,
) -> Recording {
    let force_sensor_to_tool = Rotation3::from_euler_angles(0.3, -0.2, 0.5);
    let to_tip = Vector3::new(0.01, -0.02, -0.15);
    let calibration = Calibration {
        acceleration_m_s2_per_v: [170.0, 180.0, -175.0],
        acceleration_zero_v: [2.5, 2.4, 2.6],
        force_sensor_to_tool: std::array::from_fn(|i| std::array::from_fn(|j| force_sensor_to_tool[(i, j)])),
        tracker_to_tip_m: to_tip.into(),
    };
    let orientation = |t: f64| UnitQuaternion::from_euler_angles(0.3 * (2.0 * t).sin(), 0.4, 1.5 * t);
    let [first, second] = tangents();
    let world = |a: f64, b: f64, c: f64| first * a + second * b + normal() * c;
    let poses = (0..(seconds * tracker_hz) as usize)
        .map(|i| {
            let t = i as f64 / tracker_hz;
            let [a, b, c] = moment(t).place_m;
            let position = world(a, b, c) - orientation(t) * to_tip;
            let q = orientation(t);
            Pose { position_m: position.into(), orientation: [q.w, q.i, q.j, q.k] }
        })
        .collect();
    let (mut wrenches, mut volts) = (vec![], vec![]);
    for i in 0..(seconds * RATE_HZ) as usize {
        let t = i as f64 / RATE_HZ;
        let now = moment(t);
        let force = orientation(t).inverse() * world(now.friction_n[0], now.friction_n[1], now.push_n);
        wrenches.push(Wrench {
            force_n: (force_sensor_to_tool.inverse() * force).into(),
            torque_n_m: [0.0, 0.01, 0.0],
        });
        let felt =
            orientation(t).inverse() * (Vector3::from(now.vibration_m_s2) + Vector3::new(0.0, 0.0, 9.81));
        volts.push(std::array::from_fn(|axis| {
            felt[axis] / calibration.acceleration_m_s2_per_v[axis] + calibration.acceleration_zero_v[axis]
        }));
    }
    let (wrenches, volts) = (Series::new(RATE_HZ, wrenches), Series::new(RATE_HZ, volts));
    Recording::new(Series::new(tracker_hz, poses), wrenches, volts, calibration, gesture, provenance())
        .unwrap()
}

/// A circle of radius `radius_m` at `turns_hz` turns per second under a constant push, with friction coefficient `mu`.
pub fn circle(seconds: f64, radius_m: f64, turns_hz: f64, push_n: f64, mu: f64) -> Recording {
    raw(seconds, Gesture::Circle, TRACKER_HZ, |t| {
        let angle = std::f64::consts::TAU * turns_hz * t;
        let (sin, cos) = angle.sin_cos();
        Moment {
            place_m: [radius_m * cos, radius_m * sin, 0.0],
            push_n,
            friction_n: [mu * push_n * sin, -mu * push_n * cos],
            vibration_m_s2: [3.0 * (1500.0 * t).sin(), 2.0 * (900.0 * t).cos(), 0.0],
        }
    })
}

/// A processed recording that steps through (seconds, speed m/s, force N) while the tool vibrates as an AR process with
/// coefficients `model(speed, force)` and that variance.
pub fn drag(
    steps: &[(f64, f64, f64)],
    mu: f64,
    seed: u64,
    model: impl Fn(f64, f64) -> (Vec<f64>, f64),
) -> ProcessedRecording {
    let mut noise = Gaussian::new(seed);
    let mut signals = Signals { rate_hz: RATE_HZ, force_tangential_n: Some(vec![]), ..Default::default() };
    for &(seconds, speed_m_s, force_n) in steps {
        let (a, variance) = model(speed_m_s, force_n);
        for _ in 0..(seconds * RATE_HZ) as usize {
            let y = &mut signals.acceleration_m_s2;
            let past: f64 = a.iter().zip(y.iter().rev()).map(|(a, y)| a * y).sum();
            y.push(variance.sqrt() * noise.next_sample() - past);
            // Hands are never quite steady.
            signals.speed_m_s.push(speed_m_s * (1.0 + 0.01 * noise.next_sample()));
            let force_n = force_n * (1.0 + 0.01 * noise.next_sample());
            signals.force_normal_n.push(force_n);
            if let Some(tangential) = &mut signals.force_tangential_n {
                tangential.push(mu * force_n);
            }
        }
    }
    ProcessedRecording::new(signals, Gesture::Drag, provenance()).unwrap()
}
