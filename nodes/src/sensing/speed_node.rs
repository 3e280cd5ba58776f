//! The node that computes the speed of a tool from its position.

use haptograph_engine::frame::{Scalar, Vector};
use haptograph_engine::node::{
    BuildContext, BuildError, Built, Io, Latency, LiveId, NodeKind, Optional, Port, Processor, Tick,
};
use haptograph_signal::quantity::Quantity;
use std::f64::consts::TAU;

use super::speed::{self, SpeedFilter};
use crate::filters::design_error;

haptograph_engine::choices! {
    /// The low-pass of a [`SpeedEstimator`].
    pub(crate) enum Smoothing {
        /// Second-order Butterworth: -3 dB at the cut-off.
        Butterworth,
        /// Two equal real poles at 2 pi cut-off; the haptic texture toolkit uses 125 rad/s (19.9 Hz).
        DoublePole,
    }
}

haptograph_engine::settings! {
    /// Settings of [`SpeedEstimator`].
    pub struct SpeedEstimatorSettings {
        /// Cut-off of the low-pass.
        [live, below_nyquist] cutoff_hz: f64 = 20.0, in 1e-3..=1e6;
        /// Type of the low-pass.
        smoothing: Smoothing = Smoothing::Butterworth;
    }
}

haptograph_engine::node! {
    /// Computes speed from position: the difference between frames, low-passed per component, then its length.
    pub struct SpeedEstimator(SpeedEstimatorSettings) in "sensing";
    source: "2.4, 3.1.1, A.3.2";
    example: r#""speed": SpeedEstimator(position: "stylus.position", cutoff_hz: 20.0)"#;
    in POSITION: Vector = Port::of(Quantity::LENGTH, "Position of the tip, m.");
    in TOUCHING: Scalar, Optional =
        Port::of(Quantity::NUMBER, "0 while the tip is lifted: the speed is then zero, and a tip put down \
                                    elsewhere has not moved.");
    out SPEED: Scalar = Port::of(Quantity::SPEED, "Magnitude of the velocity, m/s.");
    out VELOCITY: Vector = Port::of(Quantity::SPEED, "The smoothed velocity, m/s.");
}

impl NodeKind for SpeedEstimator {
    fn build(settings: SpeedEstimatorSettings, cx: &BuildContext) -> Result<Built<Self>, BuildError> {
        let (cutoff_hz, rate_hz) = (settings.cutoff_hz, cx.rate.hz());
        let (filter, per_hz) = match settings.smoothing {
            Smoothing::Butterworth => (SpeedFilter::Butterworth { order: 2, cutoff_hz }, 1.0),
            Smoothing::DoublePole => {
                let lambda_rad_s = TAU * cutoff_hz;
                (SpeedFilter::DoublePole { lambda_rad_s }, TAU)
            }
        };
        let estimator = speed::SpeedEstimator::new(filter, rate_hz).map_err(design_error("cutoff_hz"))?;
        Ok(Built::new(Estimating { estimator, per_hz }))
    }
}

#[derive(Debug, Clone)]
struct Estimating {
    estimator: speed::SpeedEstimator<3>,
    /// Frequency of the filter for a cut-off of 1 Hz.
    per_hz: f64,
}

impl Processor<SpeedEstimator> for Estimating {
    fn process(&mut self, _: &Tick, io: &mut Io<'_, SpeedEstimator>) {
        let (positions, touching) = (io.read(SpeedEstimator::POSITION), io.read(SpeedEstimator::TOUCHING));
        let (speed, velocity) = io.write_all((SpeedEstimator::SPEED, SpeedEstimator::VELOCITY));
        let frames = speed.iter_mut().zip(velocity).zip(positions);
        for (frame, ((speed, velocity), position)) in frames.enumerate() {
            if touching.is_some_and(|touching| touching[frame] == 0.0) {
                self.estimator.lift();
            } else {
                self.estimator.update(*position);
            }
            *velocity = self.estimator.velocity_m_s();
            *speed = self.estimator.speed_m_s();
        }
    }

    fn set(&mut self, setting: LiveId<SpeedEstimatorSettings>, value: f64) {
        if setting == SpeedEstimatorSettings::cutoff_hz {
            self.estimator.turn(self.per_hz * value);
        }
    }

    fn copy_state_into(&self, new: &mut Self) {
        new.estimator.copy_state_from(&self.estimator);
    }

    fn latency(&self) -> Latency {
        Latency::of_group(self.estimator.delay_s())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptograph_engine::frame::Kind;
    use haptograph_engine::testing::Bench;

    fn bench(cutoff_hz: f64, smoothing: Smoothing) -> Result<Bench, BuildError> {
        let settings = SpeedEstimatorSettings { cutoff_hz, smoothing };
        Bench::new::<SpeedEstimator>(settings, 125.0, &[Kind::VECTOR])
    }

    #[test]
    fn steady_motion_reads_its_speed_and_rest_reads_zero() {
        for smoothing in [Smoothing::Butterworth, Smoothing::DoublePole] {
            let mut bench = bench(20.0, smoothing).unwrap();
            let mut x: Vec<f64> =
                (0..250).flat_map(|k| [0.03, -0.04, 0.12].map(|v| v * f64::from(k) / 125.0)).collect();
            x.extend(x[747..].repeat(1000));
            let y = bench.run_in_blocks(&[&x], &[1, 5]);
            assert_eq!(y[0][0], 0.0);
            assert!((y[0][249] - 0.13).abs() < 1e-9, "{}", y[0][249]);
            assert!((y[1][747] - 0.03).abs() < 1e-9);
            assert_eq!(y[0][1249], 0.0, "rest is exactly rest");
        }
    }

    #[test]
    fn a_circle_reads_its_speed_without_ripple() {
        let mut bench = bench(20.0, Smoothing::Butterworth).unwrap();
        let (radius_m, turns_per_s) = (0.03, 0.8);
        let x: Vec<f64> = (0..1250)
            .flat_map(|k| {
                let (sin, cos) = (TAU * turns_per_s * f64::from(k) / 125.0).sin_cos();
                [radius_m * cos, radius_m * sin, 0.0]
            })
            .collect();
        let speed_m_s = TAU * turns_per_s * radius_m;
        for speed in &bench.run(&[&x])[0][125..] {
            assert!((speed / speed_m_s - 1.0).abs() < 1e-3);
        }
    }

    #[test]
    fn a_tip_put_down_elsewhere_has_not_moved() {
        let settings = SpeedEstimatorSettings { cutoff_hz: 20.0, smoothing: Smoothing::Butterworth };
        let mut bench = Bench::new::<SpeedEstimator>(settings, 125.0, &[Kind::VECTOR, Kind::SCALAR]).unwrap();
        let x: Vec<f64> =
            (0..30).flat_map(|k| [if k < 15 { 0.001 * f64::from(k) } else { 0.2 }, 0.0, 0.0]).collect();
        let touching: Vec<f64> = (0..30).map(|k| f64::from(u8::from(!(12..18).contains(&k)))).collect();
        let speed = bench.run(&[&x, &touching]).remove(0);
        assert!(speed[11] > 0.1);
        assert!(speed[12..].iter().all(|speed| *speed == 0.0));
    }

    #[test]
    fn a_cut_off_beyond_the_tablets_half_rate_is_refused() {
        let refused = bench(62.5, Smoothing::DoublePole).err();
        assert_eq!(refused.and_then(|e| e.field), Some("cutoff_hz"));
    }
}
