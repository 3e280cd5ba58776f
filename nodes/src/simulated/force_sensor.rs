//! A simulated six-axis force/torque sensor of the kind of the Nano17 SI-25-0.25, with its converter and filter (5.2.1).

use crate::vector::Vec3;
use haptograph_signal::filter::{DesignError, SectionsState, butterworth_lowpass};
use haptograph_signal::noise::Gaussian;

/// Properties of the sensor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ForceSensorSettings {
    /// Step of each force, N.
    pub force_step_n: f64,
    /// Step of each torque, N m.
    pub torque_step_n_m: f64,
    /// Largest forces along x, y, z, N.
    pub most_force_n: Vec3,
    /// Largest torque about each axis, N m.
    pub most_torque_n_m: f64,
    /// Standard deviation of the noise before the filter, in steps.
    pub noise_steps: f64,
    /// Corner of the second-order low-pass, Hz; none: unfiltered.
    pub cutoff_hz: Option<f64>,
}

impl Default for ForceSensorSettings {
    /// 1/160 N, 1/32 N mm, 25/25/35 N, 250 N mm, noise of one step, 20 Hz.
    fn default() -> Self {
        Self {
            force_step_n: 1.0 / 160.0,
            torque_step_n_m: 1e-3 / 32.0,
            most_force_n: [25.0, 25.0, 35.0],
            most_torque_n_m: 0.25,
            noise_steps: 1.0,
            cutoff_hz: Some(20.0),
        }
    }
}

/// A reading of the sensor.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct WrenchReading {
    /// Force, N.
    pub force_n: Vec3,
    /// Torque about the sensor's origin, N m.
    pub torque_n_m: Vec3,
    /// True if an axis is saturated.
    pub saturated: bool,
}

/// The sensor. Allocates only when made. It is labelled simulated wherever it is shown.
#[derive(Debug, Clone)]
pub(crate) struct ForceSensor {
    settings: ForceSensorSettings,
    noise: Gaussian,
    filters: Option<[SectionsState; 6]>,
    delay_s: f64,
}

impl ForceSensor {
    /// A sensor at rest, sampled at `rate_hz`.
    pub(crate) fn new(settings: ForceSensorSettings, rate_hz: f64, seed: u64) -> Result<Self, DesignError> {
        let (filters, delay_s) = match settings.cutoff_hz {
            Some(cutoff_hz) => {
                let sections = butterworth_lowpass(2, cutoff_hz, rate_hz)?;
                let filters = std::array::from_fn(|_| SectionsState::new(&sections));
                (Some(filters), sections.group_delay_s(0.0, rate_hz))
            }
            None => (None, 0.0),
        };
        Ok(Self { settings, noise: Gaussian::new(seed), filters, delay_s })
    }

    /// Delay of slow changes of the wrench, s: the filter's delay.
    pub(crate) fn delay_s(&self) -> f64 {
        self.delay_s
    }

    /// Converts one sample of a true wrench, N and N m: noise, saturation, quantisation, filter.
    pub(crate) fn sample(&mut self, force_n: Vec3, torque_n_m: Vec3) -> WrenchReading {
        let s = &self.settings;
        let mut saturated = false;
        let mut converted = [0.0; 6];
        for (axis, value) in converted.iter_mut().enumerate() {
            let (truth, step, most) = if axis < 3 {
                (force_n[axis], s.force_step_n, s.most_force_n[axis])
            } else {
                (torque_n_m[axis - 3], s.torque_step_n_m, s.most_torque_n_m)
            };
            let noisy = truth + s.noise_steps * step * self.noise.next_sample();
            saturated |= noisy.abs() > most;
            *value = (noisy.clamp(-most, most) / step).round() * step;
        }
        if let Some(filters) = &mut self.filters {
            for (filter, value) in filters.iter_mut().zip(&mut converted) {
                filter.process_in_place(std::slice::from_mut(value));
            }
        }
        let [fx, fy, fz, mx, my, mz] = converted;
        WrenchReading { force_n: [fx, fy, fz], torque_n_m: [mx, my, mz], saturated }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn unfiltered(noise_steps: f64) -> ForceSensor {
        let settings = ForceSensorSettings { noise_steps, cutoff_hz: None, ..ForceSensorSettings::default() };
        ForceSensor::new(settings, 1000.0, 1).unwrap()
    }

    #[test]
    fn readings_are_whole_steps() {
        let reading = unfiltered(0.0).sample([0.1, -1.0 / 160.0, 3.0], [0.0, 1e-5, 0.1]);
        assert_eq!(reading.force_n, [0.1, -1.0 / 160.0, 3.0]);
        assert_eq!(reading.torque_n_m, [0.0, 0.0, 0.1]);
        let noisy = unfiltered(1.0).sample([0.0; 3], [0.0; 3]);
        assert!(noisy.force_n.iter().all(|f| (f * 160.0 - (f * 160.0).round()).abs() < 1e-9));
    }

    #[test]
    fn noise_is_one_step_before_and_a_fifth_behind_the_filter() {
        let deviation = |sensor: &mut ForceSensor| {
            let square: f64 =
                (0..20_000).map(|_| sensor.sample([0.0; 3], [0.0; 3]).torque_n_m[1].powi(2)).sum();
            (square / 20_000.0).sqrt() * 32e3
        };
        assert!((deviation(&mut unfiltered(1.0)) - (1.0 + 1.0 / 12.0_f64).sqrt()).abs() < 0.02);
        let filtered = deviation(&mut ForceSensor::new(ForceSensorSettings::default(), 1000.0, 2).unwrap());
        assert!((filtered - 0.21).abs() < 0.03, "{filtered}");
    }

    #[test]
    fn a_rising_force_is_read_as_late_as_the_sensor_says() {
        let settings =
            ForceSensorSettings { noise_steps: 0.0, force_step_n: 1e-9, ..ForceSensorSettings::default() };
        let mut sensor = ForceSensor::new(settings, 1000.0, 3).unwrap();
        let read_n = (0..500).map(|k| sensor.sample([0.0, 0.0, 0.02 * f64::from(k)], [0.0; 3]).force_n[2]);
        let late_s = 0.499 - read_n.last().unwrap() / 20.0;
        assert!((late_s - sensor.delay_s()).abs() < 1e-5, "{late_s}");
        assert!((sensor.delay_s() - 0.01125).abs() < 1e-4 && unfiltered(0.0).delay_s() == 0.0);
    }

    #[test]
    fn beyond_the_scale_the_reading_stays_at_its_end_and_says_so() {
        let reading = unfiltered(0.0).sample([0.0, 0.0, -40.0], [0.26, 0.0, 0.0]);
        assert_eq!((reading.force_n[2], reading.torque_n_m[0], reading.saturated), (-35.0, 0.25, true));
    }
}
