//! A simulated three-axis accelerometer with its anti-aliasing filter and converter (2.2.1): the reading is a voltage.

use crate::vector::Vec3;
use haptograph_signal::filter::{DesignError, SectionsState, bessel_lowpass};
use haptograph_signal::noise::Gaussian;

/// Properties of the sensor and its converter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct AccelerometerSettings {
    /// Sensitivity, m/s2 per V.
    pub m_s2_per_v: f64,
    /// Output at rest, V.
    pub zero_v: f64,
    /// Largest acceleration, m/s2.
    pub range_m_s2: f64,
    /// Standard deviation of the noise in the reading, m/s2.
    pub noise_m_s2: f64,
    /// Corner of the five-pole Bessel low-pass, Hz.
    pub cutoff_hz: f64,
    /// Full scale of the converter, from minus to plus this, V.
    pub full_scale_v: f64,
    /// Bits of the converter.
    pub bits: u32,
}

impl Default for AccelerometerSettings {
    /// An ADXL321: +-18 g, 57 mV per g around 1.5 V; noise of 0.126 m/s2; 1000 Hz; 16 bits over +-5 V.
    fn default() -> Self {
        Self {
            m_s2_per_v: 9.81 / 0.057,
            zero_v: 1.5,
            range_m_s2: 18.0 * 9.81,
            noise_m_s2: 0.126,
            cutoff_hz: 1000.0,
            full_scale_v: 5.0,
            bits: 16,
        }
    }
}

/// The sensor. Allocates only when made. It is labelled simulated wherever it is shown.
#[derive(Debug, Clone)]
pub(crate) struct Accelerometer {
    settings: AccelerometerSettings,
    step_v: f64,
    /// Noise before the filter that gives the specified noise after it, m/s2.
    raw_noise_m_s2: f64,
    noise: Gaussian,
    filters: [SectionsState; 3],
    delay_s: f64,
    settled: bool,
}

impl Accelerometer {
    /// A sensor sampled at `rate_hz`. Its filter starts at rest at the first sample: a recording begins while the tool is held.
    pub(crate) fn new(settings: AccelerometerSettings, rate_hz: f64, seed: u64) -> Result<Self, DesignError> {
        let sections = bessel_lowpass(5, settings.cutoff_hz, rate_hz)?;
        let mut impulse = [0.0; 4096];
        impulse[0] = 1.0;
        SectionsState::new(&sections).process_in_place(&mut impulse);
        let gain = impulse.iter().map(|h| h * h).sum::<f64>().sqrt();
        Ok(Self {
            settings,
            step_v: 2.0 * settings.full_scale_v / 2.0_f64.powi(settings.bits.min(52) as i32),
            raw_noise_m_s2: settings.noise_m_s2 / gain,
            noise: Gaussian::new(seed),
            filters: [(); 3].map(|()| SectionsState::new(&sections)),
            delay_s: sections.group_delay_s(0.0, rate_hz),
            settled: false,
        })
    }

    /// Delay of the low-pass, the same up to its corner, s.
    pub(crate) fn delay_s(&self) -> f64 {
        self.delay_s
    }

    /// Converts one sample of acceleration less gravity, m/s2, to voltages.
    pub(crate) fn sample(&mut self, felt_m_s2: Vec3) -> Vec3 {
        let s = &self.settings;
        let mut volts = felt_m_s2.map(|felt| {
            let noisy = felt + self.raw_noise_m_s2 * self.noise.next_sample();
            s.zero_v + noisy.clamp(-s.range_m_s2, s.range_m_s2) / s.m_s2_per_v
        });
        if !self.settled {
            self.settled = true;
            self.filters.iter_mut().zip(volts).for_each(|(filter, value)| filter.settle_at(value));
        }
        for (filter, value) in self.filters.iter_mut().zip(&mut volts) {
            filter.process_in_place(std::slice::from_mut(value));
        }
        let most_v = s.full_scale_v - self.step_v;
        volts.map(|v| ((v / self.step_v).round() * self.step_v).clamp(-s.full_scale_v, most_v))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RATE_HZ: f64 = 10_000.0;

    fn sensor(noise_m_s2: f64) -> Accelerometer {
        let settings = AccelerometerSettings { noise_m_s2, ..AccelerometerSettings::default() };
        Accelerometer::new(settings, RATE_HZ, 1).unwrap()
    }

    fn in_m_s2(volts: f64) -> f64 {
        (volts - 1.5) * 9.81 / 0.057
    }

    #[test]
    fn the_reading_has_the_noise_of_the_data_sheet() {
        let mut sensor = sensor(0.126);
        let readings: Vec<f64> = (0..50_000).map(|_| in_m_s2(sensor.sample([0.0; 3])[0])).collect();
        let square = readings[100..].iter().map(|a| a * a).sum::<f64>() / 49_900.0;
        assert!((square.sqrt() / 0.126 - 1.0).abs() < 0.05, "{}", square.sqrt());
    }

    #[test]
    fn the_filter_is_down_by_3_db_at_1000_hz() {
        let mut sensor = sensor(0.0);
        let peak = (0..5000)
            .map(|k| 10.0 * (std::f64::consts::TAU * 1000.0 * f64::from(k) / RATE_HZ).sin())
            .map(|a| in_m_s2(sensor.sample([0.0, a, 0.0])[1]))
            .skip(4000)
            .fold(0.0, f64::max);
        // Ten samples a period: the peak is seen to 5 %.
        assert!((20.0 * (peak / 10.0).log10() + 3.0).abs() < 0.5, "{peak}");
    }

    #[test]
    fn a_rising_acceleration_is_read_as_late_as_the_sensor_says() {
        let settings =
            AccelerometerSettings { noise_m_s2: 0.0, bits: 32, ..AccelerometerSettings::default() };
        let mut sensor = Accelerometer::new(settings, RATE_HZ, 1).unwrap();
        let read = (0..500).map(|k| in_m_s2(sensor.sample([0.1 * f64::from(k), 0.0, 0.0])[0]));
        let late_s = 0.0499 - read.last().unwrap() / (0.1 * RATE_HZ);
        assert!((late_s - sensor.delay_s()).abs() < 1e-6, "{late_s}");
        assert!((2e-4..6e-4).contains(&sensor.delay_s()), "{}", sensor.delay_s());
    }

    #[test]
    fn the_range_is_18_g_and_the_steps_are_the_converters() {
        let mut sensor = sensor(0.0);
        let volts = (0..1000).map(|_| sensor.sample([1e4, -1e4, 3.0])).last().unwrap();
        assert!((in_m_s2(volts[0]) - 18.0 * 9.81).abs() < 0.03);
        assert!((in_m_s2(volts[1]) + 18.0 * 9.81).abs() < 0.03);
        let steps = volts[2] / (10.0 / 65_536.0);
        assert!((steps - steps.round()).abs() < 1e-6);
    }
}
