//! The classical designs: Butterworth, Bessel, and the double pole of the haptic texture toolkit.

use haptograph_engine::node::{
    BuildContext, BuildError, NodeKind, NodeSpec, Processor, any_input, output_like,
};
use haptograph_signal::filter::{
    bessel_lowpass, butterworth_bandpass, butterworth_highpass, butterworth_lowpass, double_pole,
};

use super::{LaneFilter, design_error};

haptograph_engine::settings! {
    /// Settings of a low-pass or high-pass.
    pub struct CutoffSettings {
        /// Where the response has fallen by 3 dB.
        cutoff_hz: f64, in 1e-6..=1e9;
        /// Number of poles.
        order: u32 = 2, in 1..=16;
    }
}

/// Butterworth low-pass.
pub struct LowPass;

impl NodeKind for LowPass {
    type Settings = CutoffSettings;
    const SPEC: NodeSpec = NodeSpec {
        name: "LowPass",
        group: "filters",
        doc: "Butterworth low-pass: the flattest magnitude, unit gain at rest.",
        source: "bilinear transform, prewarped",
        inputs: &[any_input("input", "The signal.")],
        outputs: &[output_like("output", "input", "What lies below the cut-off.")],
        example: r#""smooth": LowPass(input: "sensor.force", cutoff_hz: 20.0)"#,
    };

    fn build(settings: CutoffSettings, cx: &BuildContext) -> Result<Box<dyn Processor>, BuildError> {
        let CutoffSettings { cutoff_hz, order } = settings;
        let filter = butterworth_lowpass(order as usize, cutoff_hz, cx.rate.hz())
            .map_err(design_error("cutoff_hz"))?;
        Ok(Box::new(LaneFilter::new(&filter, cx, 0.01 * cutoff_hz)))
    }
}

/// Butterworth high-pass.
pub struct HighPass;

impl NodeKind for HighPass {
    type Settings = CutoffSettings;
    const SPEC: NodeSpec = NodeSpec {
        name: "HighPass",
        group: "filters",
        doc: "Butterworth high-pass: the flattest magnitude, unit gain at half the rate.",
        source: "bilinear transform, prewarped",
        inputs: &[any_input("input", "The signal.")],
        outputs: &[output_like("output", "input", "What lies above the cut-off.")],
        example: r#""vibration": HighPass(input: "sensor.acceleration", cutoff_hz: 20.0)"#,
    };

    fn build(settings: CutoffSettings, cx: &BuildContext) -> Result<Box<dyn Processor>, BuildError> {
        let CutoffSettings { cutoff_hz, order } = settings;
        let rate_hz = cx.rate.hz();
        let filter =
            butterworth_highpass(order as usize, cutoff_hz, rate_hz).map_err(design_error("cutoff_hz"))?;
        // The middle, on a logarithmic scale, of what passes.
        let middle_hz = (cutoff_hz * 0.5 * rate_hz).sqrt();
        Ok(Box::new(LaneFilter::new(&filter, cx, middle_hz)))
    }
}

haptograph_engine::settings! {
    /// Settings of [`BandPass`].
    pub struct BandPassSettings {
        /// Lower edge, where the response has fallen by 3 dB.
        low_hz: f64, in 1e-6..=1e9;
        /// Upper edge, where the response has fallen by 3 dB.
        high_hz: f64, in 1e-6..=1e9;
        /// Order of the prototype: half the number of poles.
        order: u32 = 2, in 1..=16;
    }
}

/// Butterworth band-pass.
pub struct BandPass;

impl NodeKind for BandPass {
    type Settings = BandPassSettings;
    const SPEC: NodeSpec = NodeSpec {
        name: "BandPass",
        group: "filters",
        doc: "Butterworth band-pass: unit gain in the middle of the band.",
        source: "bilinear transform, prewarped",
        inputs: &[any_input("input", "The signal.")],
        outputs: &[output_like("output", "input", "What lies within the band.")],
        example: r#""felt": BandPass(input: "texture.acceleration", low_hz: 20.0, high_hz: 400.0)"#,
    };

    fn build(settings: BandPassSettings, cx: &BuildContext) -> Result<Box<dyn Processor>, BuildError> {
        let BandPassSettings {
            low_hz,
            high_hz,
            order,
        } = settings;
        let filter = butterworth_bandpass(order as usize, low_hz, high_hz, cx.rate.hz())
            .map_err(design_error("high_hz"))?;
        Ok(Box::new(LaneFilter::new(&filter, cx, (low_hz * high_hz).sqrt())))
    }
}

/// Bessel low-pass.
pub struct Bessel;

impl NodeKind for Bessel {
    type Settings = CutoffSettings;
    const SPEC: NodeSpec = NodeSpec {
        name: "Bessel",
        group: "filters",
        doc: "Bessel low-pass: the flattest delay, so that transients keep their shape.",
        source: "2.2; bilinear transform, prewarped",
        inputs: &[any_input("input", "The signal.")],
        outputs: &[output_like("output", "input", "What lies below the cut-off.")],
        example: r#""antialias": Bessel(input: "accelerometer.acceleration", cutoff_hz: 400.0, order: 5)"#,
    };

    fn build(settings: CutoffSettings, cx: &BuildContext) -> Result<Box<dyn Processor>, BuildError> {
        let CutoffSettings { cutoff_hz, order } = settings;
        let filter =
            bessel_lowpass(order as usize, cutoff_hz, cx.rate.hz()).map_err(design_error("cutoff_hz"))?;
        Ok(Box::new(LaneFilter::new(&filter, cx, 0.01 * cutoff_hz)))
    }
}

haptograph_engine::settings! {
    /// Settings of [`DoublePole`].
    pub struct DoublePoleSettings {
        /// Both poles, rad/s. The response falls by 3 dB at 0.64 of it, by 6 dB at it; the delay is 2 / lambda.
        lambda_rad_s: f64 = 125.0, in 1e-6..=1e9;
    }
}

/// Two equal real poles.
pub struct DoublePole;

impl NodeKind for DoublePole {
    type Settings = DoublePoleSettings;
    const SPEC: NodeSpec = NodeSpec {
        name: "DoublePole",
        group: "filters",
        doc: "Low-pass with two equal real poles: no overshoot.",
        source: "the public haptic texture toolkit's filter for velocity (backward differences)",
        inputs: &[any_input("input", "The signal.")],
        outputs: &[output_like("output", "input", "The signal, smoothed.")],
        example: r#""calm": DoublePole(input: "velocity.output", lambda_rad_s: 125.0)"#,
    };

    fn build(settings: DoublePoleSettings, cx: &BuildContext) -> Result<Box<dyn Processor>, BuildError> {
        let lambda = settings.lambda_rad_s;
        let filter = double_pole(lambda, cx.rate.hz()).map_err(design_error("lambda_rad_s"))?;
        let passband_hz = 0.01 * lambda / std::f64::consts::TAU;
        Ok(Box::new(LaneFilter::new(&filter, cx, passband_hz)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptograph_engine::frame::Kind;
    use haptograph_engine::testing::Bench;
    use std::f64::consts::TAU;

    const RATE_HZ: f64 = 1000.0;

    /// Root mean square of the second half of the answer to a sine of amplitude root 2, lane 1 of 3.
    fn gain(mut bench: Bench, frequency_hz: f64) -> f64 {
        let x: Vec<f64> = (0..8000)
            .flat_map(|k| {
                [
                    1.0,
                    2.0_f64.sqrt() * (TAU * frequency_hz * f64::from(k) / RATE_HZ).sin(),
                    0.0,
                ]
            })
            .collect();
        let y = &bench.run_in_blocks(&[&x], &[1, 64, 333])[0];
        let frames = &y.as_chunks::<3>().0[4000..];
        assert!(frames.iter().all(|y| y[2] == 0.0), "lanes do not mix");
        (frames.iter().map(|y| y[1] * y[1]).sum::<f64>() / frames.len() as f64).sqrt()
    }

    fn cutoff(cutoff_hz: f64, order: u32) -> CutoffSettings {
        CutoffSettings { cutoff_hz, order }
    }

    fn bench<K: NodeKind>(settings: K::Settings) -> Bench {
        Bench::new::<K>(settings, RATE_HZ, &[Kind::Vector]).unwrap()
    }

    #[test]
    fn each_filter_has_its_3_db_points_where_it_says() {
        let half_power = 0.5_f64.sqrt();
        let near =
            |gain: f64, wanted: f64| assert!((gain - wanted).abs() < 2e-3, "{gain} instead of {wanted}");
        near(gain(bench::<LowPass>(cutoff(50.0, 3)), 50.0), half_power);
        near(gain(bench::<LowPass>(cutoff(50.0, 3)), 5.0), 1.0);
        near(gain(bench::<HighPass>(cutoff(50.0, 3)), 50.0), half_power);
        near(gain(bench::<HighPass>(cutoff(50.0, 3)), 400.0), 1.0);
        near(gain(bench::<Bessel>(cutoff(50.0, 5)), 50.0), half_power);
        let band = BandPassSettings {
            low_hz: 40.0,
            high_hz: 90.0,
            order: 2,
        };
        near(gain(bench::<BandPass>(band.clone()), 40.0), half_power);
        near(gain(bench::<BandPass>(band), 90.0), half_power);
        // Backward differences bend it a little: (lambda T)^2 / |1 + lambda T - z^-1|^2.
        let step = TAU * 5.0 / RATE_HZ;
        let exact = step * step / ((1.0 + step - step.cos()).powi(2) + step.sin().powi(2));
        assert!((exact - 0.5).abs() < 0.02);
        let pole = DoublePoleSettings {
            lambda_rad_s: TAU * 5.0,
        };
        near(gain(bench::<DoublePole>(pole), 5.0), exact);
    }

    #[test]
    fn a_cut_off_at_half_the_rate_is_refused_at_its_field() {
        let refused = Bench::new::<LowPass>(cutoff(500.0, 2), RATE_HZ, &[Kind::Scalar]).err();
        assert_eq!(refused.and_then(|e| e.field), Some("cutoff_hz"));
    }
}
