//! Processes sensor readings to the signals from which models are learned (thesis 2.2.3): acceleration on one axis, normal and
//! tangential force, speed.
//!
//! All filters run offline without phase shift. Signs differ from the thesis, which has errors: forces act on the tool, so that
//! with the surface's outward normal `n` and the direction of motion `t` pressing is `F.n > 0` and friction `-F.t > 0`.

mod geometry;
mod rate;
mod reduction;
#[cfg(test)]
mod tests;

pub use geometry::SurfaceNormal;
pub use rate::LOWEST_RATE_HZ;
use reduction::reduce_by;
pub use reduction::{AxisReduction, reduce};

use crate::signals::{
    AnyRecording, ProcessedRecording, Recording, RecordingError, Series, Signals, WorldAxes,
};
use geometry::{Vector, WorldForces, along, dot, norm};
use haptograph_signal::filter::{DesignError, butterworth_highpass, butterworth_lowpass, filtfilt};
use haptograph_signal::resample::ResampleError;
use haptograph_surfaces::texture::HIGHPASS_ORDER;
use std::ops::Range;

/// Settings for processing; the defaults are the thesis's if it states them.
#[derive(Debug, Clone, PartialEq)]
pub struct ProcessingSettings {
    /// Removes gravity and the hand's own motion from the acceleration.
    pub highpass_hz: f64,
    /// Reduction of three axes of acceleration to one.
    pub reduction: AxisReduction,
    /// Smooths forces and speed; never above nine tenths of the tracker's (for forces the force sensor's) Nyquist frequency.
    pub lowpass_hz: f64,
    /// Smooths the velocity vector before its length is taken. Not in the thesis: a tracker that resolves 0.5 mm at 240 Hz has 25 mm/s
    /// of noise, whose length would count as speed. No hand moves faster than this.
    pub velocity_lowpass_hz: f64,
    /// Source of the surface normal.
    pub normal: SurfaceNormal,
    /// Rate to which [`processed`] resamples vibrations; if `None`, their own rate. At a lower rate, models of the same order span
    /// more time, and so resolve lower frequencies.
    pub rate_hz: Option<f64>,
}

impl Default for ProcessingSettings {
    fn default() -> Self {
        Self {
            highpass_hz: 20.0,
            reduction: AxisReduction::Dft321,
            lowpass_hz: 100.0,
            velocity_lowpass_hz: 20.0,
            normal: SurfaceNormal::PlaneFit,
            rate_hz: None,
        }
    }
}

/// Order of the Butterworth low-passes; forward and backward filtering doubles it. The thesis does not state it.
const LOWPASS_ORDER: usize = 2;
/// A tool slower than this keeps its last direction of motion, m/s.
const SLOWEST_DIRECTION_M_S: f64 = 0.002;

/// An error of processing a recording.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs)] // see the messages
pub enum ProcessingError {
    #[error("cannot design a filter of the processing: {0}")]
    Filter(#[from] DesignError),
    #[error(
        "the tip's path in contact does not define a plane (it spreads {spread_mm:.2} mm along its second direction, {thickness_mm:.2} mm across): drag over an area, or take the normal from the force or as given"
    )]
    NoPlane { spread_mm: f64, thickness_mm: f64 },
    #[error("the mean force is zero, so it has no direction for the normal")]
    NoForce,
    #[error("the recording has no third axis {0}: axes are 0, 1 and 2")]
    Axis(usize),
    #[error("the recording has no separate acceleration axes, so their reduction cannot be changed")]
    NoAxes,
    #[error(
        "cannot resample vibrations of {own_hz} Hz to {rate_hz} Hz: give a rate from {LOWEST_RATE_HZ} Hz to {own_hz} Hz"
    )]
    Rate { rate_hz: f64, own_hz: f64 },
    #[error("cannot resample the vibration: {0}")]
    Resampling(ResampleError),
    #[error(transparent)]
    Recording(#[from] RecordingError),
}

/// The signals of a processed recording that are kept: all, those of which a static peak is learned (its vibration is silent), or
/// a texture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Kept {
    All,
    Forces,
    Texture,
}

/// A recording ready to learn from, at the requested rate: processes a raw one, and keeps a processed one.
pub fn processed(
    recording: &AnyRecording,
    settings: &ProcessingSettings,
) -> Result<ProcessedRecording, ProcessingError> {
    processed_keeping(recording, settings, Kept::All)
}

pub(crate) fn processed_keeping(
    recording: &AnyRecording,
    settings: &ProcessingSettings,
    kept: Kept,
) -> Result<ProcessedRecording, ProcessingError> {
    let processed = match recording {
        AnyRecording::Raw(raw) => process_keeping(raw, settings, kept)?,
        AnyRecording::Processed(processed) => processed.clone(),
    };
    match settings.rate_hz {
        Some(rate_hz) if rate_hz != processed.rate_hz() => Ok(ProcessedRecording::new(
            rate::lowered(processed.signals(), rate_hz)?,
            processed.gesture(),
            processed.provenance().clone(),
        )?),
        _ => Ok(processed),
    }
}

/// Processes a raw recording. The result has the accelerometer's rate and covers the time in which all sensors have samples.
pub fn process(
    recording: &Recording,
    settings: &ProcessingSettings,
) -> Result<ProcessedRecording, ProcessingError> {
    process_keeping(recording, settings, Kept::All)
}

fn process_keeping(
    recording: &Recording,
    settings: &ProcessingSettings,
    kept: Kept,
) -> Result<ProcessedRecording, ProcessingError> {
    let accelerometer = recording.acceleration_v();
    let (rate_hz, common) = (accelerometer.rate_hz, common_samples(recording));
    let axis = |axis: usize| {
        let mut acceleration = Vec::with_capacity(accelerometer.count());
        acceleration.extend(
            accelerometer.iter().map(|volts| recording.calibration().acceleration_m_s2(&volts)[axis]),
        );
        acceleration
    };
    let mut acceleration_m_s2 = match kept {
        Kept::Forces => vec![0.0; accelerometer.count()],
        _ => combined_by(axis, rate_hz, settings)?,
    };
    acceleration_m_s2.truncate(common.end);
    acceleration_m_s2.drain(..common.start);
    let times = common.clone().map(|i| accelerometer.time_s(i));
    let contact = contact_signals(recording, settings, times, kept)?;
    let axes = (kept == Kept::All).then(|| {
        let volts = accelerometer.stretch(common);
        volts.iter().map(|volts| recording.calibration().acceleration_m_s2(volts)).collect()
    });
    let signals = Signals {
        rate_hz,
        acceleration_m_s2,
        force_normal_n: contact.force_normal_n,
        force_tangential_n: contact.force_tangential_n,
        speed_m_s: contact.speed_m_s,
        axes_m_s2: axes,
    };
    Ok(ProcessedRecording::new(signals, recording.gesture(), recording.provenance().clone())?)
}

/// The same with the tip's position and the force on the tool by axis.
pub(crate) fn process_with_world(
    recording: &Recording,
    settings: &ProcessingSettings,
) -> Result<ProcessedRecording, ProcessingError> {
    let times = common_samples(recording).map(|i| recording.acceleration_v().time_s(i));
    let (mut forces, motion) = (WorldForces::new(recording), recording.motion());
    let tips = Series { rate_hz: motion.rate_hz, start_s: motion.start_s, samples: tip_positions(recording) };
    let world = WorldAxes {
        position_m: Some(times.clone().map(|time| tips.at(time)).collect()),
        force_n: Some(times.map(|time| forces.at(time)).collect()),
    };
    Ok(process(recording, settings)?.with_world(world)?)
}

/// The samples of the accelerometer at which all sensors have samples.
fn common_samples(recording: &Recording) -> Range<usize> {
    let accelerometer = recording.acceleration_v();
    let overlap = |series: (f64, f64)| move |time: f64| time >= series.0 - 1e-9 && time <= series.1 + 1e-9;
    let in_motion = overlap((recording.motion().start_s, recording.motion().end_s()));
    let in_wrench = overlap((recording.wrench().start_s, recording.wrench().end_s()));
    let is_common = |i: &usize| {
        let time = accelerometer.time_s(*i);
        in_motion(time) && in_wrench(time)
    };
    let start = (0..accelerometer.count()).find(is_common).unwrap_or(accelerometer.count());
    start..(start..accelerometer.count()).find(|i| !is_common(i)).unwrap_or(accelerometer.count())
}

/// Acceleration axes high-passed and combined to one, m/s².
pub fn combined(
    axes: &[[f64; 3]],
    rate_hz: f64,
    settings: &ProcessingSettings,
) -> Result<Vec<f64>, ProcessingError> {
    combined_by(|axis| axes.iter().map(|a| a[axis]).collect(), rate_hz, settings)
}

/// The same of axes that are made one at a time.
fn combined_by(
    axis: impl Fn(usize) -> Vec<f64>,
    rate_hz: f64,
    settings: &ProcessingSettings,
) -> Result<Vec<f64>, ProcessingError> {
    let highpass = butterworth_highpass(HIGHPASS_ORDER, settings.highpass_hz, rate_hz)?;
    let filtered = |number: usize| (number < 3).then(|| filtfilt(&highpass, axis(number)));
    let combined = reduce_by(filtered, settings.reduction).ok_or(match settings.reduction {
        AxisReduction::SingleAxis(axis) => ProcessingError::Axis(axis),
        _ => ProcessingError::NoAxes,
    })?;
    Ok(match settings.reduction {
        // A magnitude is never negative: it has a mean of its own.
        AxisReduction::VectorMagnitude => filtfilt(&highpass, combined),
        _ => combined,
    })
}

/// A vibration without gravity and the hand's own motion.
pub(crate) fn high_passed(
    signal: &[f64],
    rate_hz: f64,
    settings: &ProcessingSettings,
) -> Result<Vec<f64>, DesignError> {
    let highpass = butterworth_highpass(HIGHPASS_ORDER, settings.highpass_hz, rate_hz)?;
    Ok(filtfilt(&highpass, signal.to_vec()))
}

/// The tip in the world, m, sample by sample of the tracker.
pub fn tip_positions(recording: &Recording) -> Vec<[f64; 3]> {
    let poses = recording.motion().samples.iter();
    poses.map(|pose| recording.calibration().tip_m(pose)).collect()
}

/// Forces and speed at given moments.
pub(super) struct ContactSignals {
    pub force_normal_n: Vec<f64>,
    pub force_tangential_n: Option<Vec<f64>>,
    pub speed_m_s: Vec<f64>,
}

/// Forces and speed, low-passed, at evenly spaced `times`.
pub(super) fn contact_signals(
    recording: &Recording,
    settings: &ProcessingSettings,
    mut times: impl DoubleEndedIterator<Item = f64> + ExactSizeIterator + Clone,
    kept: Kept,
) -> Result<ContactSignals, ProcessingError> {
    let mut forces = WorldForces::new(recording);
    let tips = tip_positions(recording);
    let normal = geometry::surface_normal(recording, &mut forces, &tips, settings.normal)?;
    let velocity = velocities(recording, &tips, settings)?;
    drop(tips);
    let samples = times.len();
    let [mut normal_n, mut speed_m_s] = [(); 2].map(|()| Vec::with_capacity(samples));
    let mut tangential_n = (kept != Kept::Texture).then(|| Vec::with_capacity(samples));
    let mut direction: Vector = [0.0; 3];
    for time in times.clone() {
        let (force, velocity) = (forces.at(time), velocity.at(time));
        let in_plane = along(velocity, -dot(velocity, normal), normal);
        if norm(in_plane) > SLOWEST_DIRECTION_M_S {
            direction = in_plane.map(|x| x / norm(in_plane));
        }
        normal_n.push(dot(force, normal));
        tangential_n.iter_mut().for_each(|tangential_n| tangential_n.push(-dot(force, direction)));
        speed_m_s.push(norm(velocity));
    }
    let (Some(first), Some(last)) = (times.next(), times.next_back()) else {
        return Err(RecordingError::TooShort { quantity: "recording", samples }.into());
    };
    let rate_hz = (samples - 1) as f64 / (last - first);
    let smooth = |signal: Vec<f64>, sensor_hz: f64| -> Result<Vec<f64>, ProcessingError> {
        let cutoff_hz = settings.lowpass_hz.min(0.45 * sensor_hz.min(rate_hz));
        Ok(filtfilt(&butterworth_lowpass(LOWPASS_ORDER, cutoff_hz, rate_hz)?, signal))
    };
    let (force_hz, tracker_hz) = (recording.wrench().rate_hz, recording.motion().rate_hz);
    let force_normal_n = smooth(normal_n, force_hz)?;
    let force_tangential_n = tangential_n.map(|signal| smooth(signal, force_hz)).transpose()?;
    let mut speed_m_s = smooth(speed_m_s, tracker_hz)?;
    // Smoothing may undershoot zero where the tool stops.
    speed_m_s.iter_mut().for_each(|v| *v = v.max(0.0));
    Ok(ContactSignals { force_normal_n, force_tangential_n, speed_m_s })
}

/// Indentation in m, zero at its smallest, and normal force in N at given moments.
pub(super) fn press_curve(
    recording: &Recording,
    normal: SurfaceNormal,
    times: &[f64],
) -> Result<Vec<(f64, f64)>, ProcessingError> {
    let mut forces = WorldForces::new(recording);
    let tips = tip_positions(recording);
    let normal = geometry::surface_normal(recording, &mut forces, &tips, normal)?;
    let motion = recording.motion();
    let depth = |tip: &Vector| -dot(*tip, normal);
    let depths = Series {
        rate_hz: motion.rate_hz,
        start_s: motion.start_s,
        samples: tips.iter().map(depth).collect(),
    };
    let least = depths.samples.iter().copied().fold(f64::INFINITY, f64::min);
    Ok(times.iter().map(|&time| (depths.at(time) - least, dot(forces.at(time), normal))).collect())
}

/// Velocities of the tip, m/s, sample by sample of the tracker.
fn velocities(
    recording: &Recording,
    tips: &[Vector],
    settings: &ProcessingSettings,
) -> Result<Series<Vector>, ProcessingError> {
    let motion = recording.motion();
    Ok(Series {
        rate_hz: motion.rate_hz,
        start_s: motion.start_s,
        samples: derivative(tips, motion.rate_hz, settings)?,
    })
}

/// The speed of a tip by its positions, m/s.
pub(crate) fn speeds(
    tips: &[[f64; 3]],
    rate_hz: f64,
    settings: &ProcessingSettings,
) -> Result<Vec<f64>, DesignError> {
    let velocities = derivative(tips, rate_hz, settings)?;
    Ok(velocities.into_iter().map(norm).collect())
}

/// Velocities, low-passed, m/s.
fn derivative(
    tips: &[Vector],
    rate_hz: f64,
    settings: &ProcessingSettings,
) -> Result<Vec<Vector>, DesignError> {
    let cutoff_hz = settings.velocity_lowpass_hz.min(0.45 * rate_hz);
    let lowpass = butterworth_lowpass(LOWPASS_ORDER, cutoff_hz, rate_hz)?;
    let Some(last) = tips.len().checked_sub(1).filter(|last| *last > 0) else {
        return Ok(vec![[0.0; 3]; tips.len()]);
    };
    let smooth: [Vec<f64>; 3] = std::array::from_fn(|axis| {
        let derivative: Vec<f64> = (0..=last)
            .map(|i| {
                let (before, after) = (i.saturating_sub(1), (i + 1).min(last));
                (tips[after][axis] - tips[before][axis]) * rate_hz / (after - before) as f64
            })
            .collect();
        filtfilt(&lowpass, derivative)
    });
    Ok((0..=last).map(|i| std::array::from_fn(|axis| smooth[axis][i])).collect())
}
