//! Classical designs: Butterworth, Bessel, and the double pole of the haptic texture toolkit.

use haptograph_engine::frame::{Linear, Scalar};
use haptograph_engine::node::{BuildContext, BuildError, Built, Fallback, Input, NodeKind, Optional, Port};
use haptograph_signal::filter::{DesignError, Prototype};

use super::{FilterKind, Frequency, LaneFilter, Through, design_error};
use haptograph_signal::quantity::Quantity;

haptograph_engine::settings! {
    /// Settings of a low-pass or high-pass.
    pub struct CutoffSettings {
        /// Cut-off (-3 dB); required unless `cutoff` is connected.
        [live, below_nyquist] cutoff_hz: Option<f64> = None, in 1e-6..=1e9;
        /// Number of poles.
        order: u32 = 2, in 1..=16;
    }
}

const CUTOFF: Port = Port::of(
    Quantity::FREQUENCY,
    "Replaces `cutoff_hz`, clamped from a millionth to 0.45 of the rate; NaN and infinity are ignored. Each \
     change redesigns the filter at its tick. The group delay is then not counted in the latency.",
);

/// The cut-off of a filter that has one.
const fn cutoff_of<K: NodeKind<Settings = CutoffSettings>>(input: Input<K, Scalar, Optional>) -> Fallback<K> {
    Fallback::new(input, CutoffSettings::cutoff_hz)
}

/// A filter of one cut-off; `passband` maps the cut-off to a frequency of the pass band.
fn of_cutoff<K: FilterKind<Settings = CutoffSettings>>(
    prototype: Result<Prototype, DesignError>,
    cutoff: Fallback<K>,
    cutoff_hz: Option<f64>,
    cx: &BuildContext,
    passband_hz: impl Fn(f64) -> f64,
) -> Result<Built<K>, BuildError> {
    let cutoff_hz = cutoff.value(cutoff_hz, cx)?.unwrap_or(START * cx.rate.hz());
    let passband_hz = passband_hz(cutoff_hz);
    let filter =
        prototype.and_then(|prototype| LaneFilter::tuned::<K>(prototype, [cutoff_hz; 2], cx, passband_hz));
    Ok(Built::new(filter.map_err(design_error("cutoff_hz"))?))
}

/// Fraction of the rate: cut-off of a filter before its frequency signal is finite.
const START: f64 = 0.01;

haptograph_engine::node! {
    /// Butterworth low-pass: maximally flat magnitude, unit gain at 0 Hz. A change of the cut-off keeps its state: a
    /// constant stays constant.
    /// Elsewhere: Lag, LPF, OnePole, lop~, lowpass, butter, si.smoo.
    pub struct LowPass(CutoffSettings) in "filters";
    source: "bilinear transform, prewarped; tuned like a trapezoidal state-variable filter";
    example: r#""smooth": LowPass(input: "sensor.force", cutoff_hz: 20.0)"#;
    in INPUT: Linear = Port::any("The signal.");
    in CUTOFF: Scalar, Optional = CUTOFF;
    out OUTPUT: Linear = Port::like("input", "The signal below the cut-off.");
}

impl NodeKind for LowPass {
    fn build(settings: CutoffSettings, cx: &BuildContext) -> Result<Built<Self>, BuildError> {
        let CutoffSettings { cutoff_hz, order } = settings;
        let prototype = Prototype::butterworth_lowpass(order as usize);
        of_cutoff(prototype, cutoff_of(Self::CUTOFF), cutoff_hz, cx, |cutoff_hz| 0.01 * cutoff_hz)
    }

    fn advice(settings: &CutoffSettings, cx: &BuildContext) -> Vec<BuildError> {
        cutoff_of(Self::CUTOFF).advice(settings.cutoff_hz, cx).into_iter().collect()
    }
}

impl FilterKind for LowPass {
    const PORTS: Through<Self> = (Self::INPUT, Self::OUTPUT);
    const FREQUENCIES: &[Frequency<Self>] = &[Frequency::or_input(cutoff_of(Self::CUTOFF))];
}

haptograph_engine::node! {
    /// Butterworth high-pass: maximally flat magnitude, unit gain at half the rate. A change of the cut-off keeps its
    /// state.
    /// Elsewhere: HPF, hip~, highpass, LeakDC, dcblocker.
    pub struct HighPass(CutoffSettings) in "filters";
    source: "bilinear transform, prewarped; tuned like a trapezoidal state-variable filter";
    example: r#""vibration": HighPass(input: "sensor.acceleration", cutoff_hz: 20.0)"#;
    in INPUT: Linear = Port::any("The signal.");
    in CUTOFF: Scalar, Optional = CUTOFF;
    out OUTPUT: Linear = Port::like("input", "The signal above the cut-off.");
}

impl NodeKind for HighPass {
    fn build(settings: CutoffSettings, cx: &BuildContext) -> Result<Built<Self>, BuildError> {
        let CutoffSettings { cutoff_hz, order } = settings;
        let prototype = Prototype::butterworth_highpass(order as usize);
        // The geometric mean of the pass band.
        let middle_hz = |cutoff_hz: f64| (cutoff_hz * 0.5 * cx.rate.hz()).sqrt();
        of_cutoff(prototype, cutoff_of(Self::CUTOFF), cutoff_hz, cx, middle_hz)
    }

    fn advice(settings: &CutoffSettings, cx: &BuildContext) -> Vec<BuildError> {
        cutoff_of(Self::CUTOFF).advice(settings.cutoff_hz, cx).into_iter().collect()
    }
}

impl FilterKind for HighPass {
    const PORTS: Through<Self> = (Self::INPUT, Self::OUTPUT);
    const FREQUENCIES: &[Frequency<Self>] = &[Frequency::or_input(cutoff_of(Self::CUTOFF))];
}

haptograph_engine::settings! {
    /// Settings of [`BandPass`].
    pub struct BandPassSettings {
        /// Lower edge (-3 dB); required unless `low` is connected.
        [live, below_nyquist] low_hz: Option<f64> = None, in 1e-6..=1e9;
        /// Upper edge (-3 dB); required unless `high` is connected.
        [live, below_nyquist] high_hz: Option<f64> = None, in 1e-6..=1e9;
        /// Order of the prototype: half the number of poles.
        order: u32 = 2, in 1..=16;
    }
}

const LOW: Fallback<BandPass> = Fallback::new(BandPass::LOW, BandPassSettings::low_hz);
const HIGH: Fallback<BandPass> = Fallback::new(BandPass::HIGH, BandPassSettings::high_hz);

haptograph_engine::node! {
    /// Butterworth band-pass: unit gain in the middle of the band. A change of its edges keeps its state; if `low` is not
    /// below `high`, the filter does not change.
    /// Elsewhere: BPF, bp~, bandpass, Resonz.
    pub struct BandPass(BandPassSettings) in "filters";
    source: "bilinear transform, prewarped; tuned like a trapezoidal state-variable filter";
    example: r#""felt": BandPass(input: "texture.acceleration", low_hz: 20.0, high_hz: 400.0)"#;
    in INPUT: Linear = Port::any("The signal.");
    in LOW: Scalar, Optional =
        Port::of(Quantity::FREQUENCY, "Replaces `low_hz`, clamped from a millionth to 0.45 of the rate; \
                                       NaN and infinity are ignored.");
    in HIGH: Scalar, Optional = Port::of(Quantity::FREQUENCY, "Replaces `high_hz`, likewise.");
    out OUTPUT: Linear = Port::like("input", "The signal within the band.");
}

impl NodeKind for BandPass {
    fn build(settings: BandPassSettings, cx: &BuildContext) -> Result<Built<Self>, BuildError> {
        let low_hz = LOW.value(settings.low_hz, cx)?;
        let high_hz = HIGH.value(settings.high_hz, cx)?;
        // An edge that is a signal starts one octave from the other edge, or nearer if the rate leaves no room.
        let rate_hz = cx.rate.hz();
        let low_hz = low_hz.unwrap_or_else(|| high_hz.map_or(START * rate_hz, |high_hz| 0.5 * high_hz));
        let high_hz = high_hz.unwrap_or_else(|| (2.0 * low_hz).min((low_hz * 0.5 * rate_hz).sqrt()));
        let prototype = Prototype::butterworth_bandpass(settings.order as usize);
        let filter = prototype.and_then(|prototype| {
            LaneFilter::tuned::<Self>(prototype, [low_hz, high_hz], cx, (low_hz * high_hz).sqrt())
        });
        Ok(Built::new(filter.map_err(design_error("high_hz"))?))
    }

    fn advice(settings: &BandPassSettings, cx: &BuildContext) -> Vec<BuildError> {
        let edges = [(&LOW, settings.low_hz), (&HIGH, settings.high_hz)].into_iter();
        edges.filter_map(|(edge, setting)| edge.advice(setting, cx)).collect()
    }
}

impl FilterKind for BandPass {
    const PORTS: Through<Self> = (Self::INPUT, Self::OUTPUT);
    const FREQUENCIES: &[Frequency<Self>] = &[Frequency::or_input(LOW), Frequency::or_input(HIGH)];
}

haptograph_engine::node! {
    /// Bessel low-pass: maximally flat delay, so that transients keep their shape. A change of the cut-off keeps its state:
    /// a constant stays constant.
    /// Elsewhere: besself.
    pub struct Bessel(CutoffSettings) in "filters";
    source: "2.2; bilinear transform, prewarped; tuned like a trapezoidal state-variable filter";
    example: r#""antialias": Bessel(input: "accelerometer.acceleration", cutoff_hz: 400.0, order: 5)"#;
    in INPUT: Linear = Port::any("The signal.");
    in CUTOFF: Scalar, Optional = CUTOFF;
    out OUTPUT: Linear = Port::like("input", "The signal below the cut-off.");
}

impl NodeKind for Bessel {
    fn build(settings: CutoffSettings, cx: &BuildContext) -> Result<Built<Self>, BuildError> {
        let CutoffSettings { cutoff_hz, order } = settings;
        let prototype = Prototype::bessel_lowpass(order as usize);
        of_cutoff(prototype, cutoff_of(Self::CUTOFF), cutoff_hz, cx, |cutoff_hz| 0.01 * cutoff_hz)
    }

    fn advice(settings: &CutoffSettings, cx: &BuildContext) -> Vec<BuildError> {
        cutoff_of(Self::CUTOFF).advice(settings.cutoff_hz, cx).into_iter().collect()
    }
}

impl FilterKind for Bessel {
    const PORTS: Through<Self> = (Self::INPUT, Self::OUTPUT);
    const FREQUENCIES: &[Frequency<Self>] = &[Frequency::or_input(cutoff_of(Self::CUTOFF))];
}

haptograph_engine::settings! {
    /// Settings of [`DoublePole`].
    pub struct DoublePoleSettings {
        /// Both poles, rad/s. The response is -3 dB at 0.64 lambda and -6 dB at lambda; the delay is 2 / lambda.
        [live] lambda_rad_s: f64 = 125.0, in 1e-6..=1e9;
    }
}

haptograph_engine::node! {
    /// Low-pass with two equal real poles: no overshoot.
    pub struct DoublePole(DoublePoleSettings) in "filters";
    source: "the public haptic texture toolkit's filter for velocity (backward differences)";
    example: r#""calm": DoublePole(input: "velocity.output", lambda_rad_s: 125.0)"#;
    in INPUT: Linear = Port::any("The signal.");
    out OUTPUT: Linear = Port::like("input", "The smoothed signal.");
}

impl NodeKind for DoublePole {
    fn build(settings: DoublePoleSettings, cx: &BuildContext) -> Result<Built<Self>, BuildError> {
        let lambda = settings.lambda_rad_s;
        let passband_hz = 0.01 * lambda / std::f64::consts::TAU;
        let filter = LaneFilter::tuned::<Self>(Prototype::double_pole(), [lambda; 2], cx, passband_hz);
        Ok(Built::new(filter.map_err(design_error("lambda_rad_s"))?))
    }
}

impl FilterKind for DoublePole {
    const PORTS: Through<Self> = (Self::INPUT, Self::OUTPUT);
    const FREQUENCIES: &[Frequency<Self>] = &[Frequency::of(DoublePoleSettings::lambda_rad_s)];
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptograph_engine::frame::Kind;
    use haptograph_engine::node::LiveId;
    use haptograph_engine::testing::Bench;
    use std::f64::consts::TAU;

    const RATE_HZ: f64 = 1000.0;

    /// Root mean square of the second half of the answer to a sine of amplitude root 2, lane 1 of 3.
    fn gain(mut bench: Bench, frequency_hz: f64) -> f64 {
        let x: Vec<f64> = (0..8000)
            .flat_map(|k| [1.0, 2.0_f64.sqrt() * (TAU * frequency_hz * f64::from(k) / RATE_HZ).sin(), 0.0])
            .collect();
        let y = &bench.run_in_blocks(&[&x], &[1, 64, 333])[0];
        let frames = &y.as_chunks::<3>().0[4000..];
        assert!(frames.iter().all(|y| y[2] == 0.0), "lanes do not mix");
        (frames.iter().map(|y| y[1] * y[1]).sum::<f64>() / frames.len() as f64).sqrt()
    }

    fn cutoff(cutoff_hz: f64, order: u32) -> CutoffSettings {
        CutoffSettings { cutoff_hz: Some(cutoff_hz), order }
    }

    fn bench<K: NodeKind>(settings: K::Settings) -> Bench {
        Bench::new::<K>(settings, RATE_HZ, &[Kind::VECTOR]).unwrap()
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
        let band = BandPassSettings { low_hz: Some(40.0), high_hz: Some(90.0), order: 2 };
        near(gain(bench::<BandPass>(band.clone()), 40.0), half_power);
        near(gain(bench::<BandPass>(band), 90.0), half_power);
        // Backward differences bend it a little: (lambda T)^2 / |1 + lambda T - z^-1|^2.
        let step = TAU * 5.0 / RATE_HZ;
        let exact = step * step / ((1.0 + step - step.cos()).powi(2) + step.sin().powi(2));
        assert!((exact - 0.5).abs() < 0.02);
        let pole = DoublePoleSettings { lambda_rad_s: TAU * 5.0 };
        near(gain(bench::<DoublePole>(pole), 5.0), exact);
    }

    #[test]
    fn a_cut_off_at_half_the_rate_is_refused_at_its_field() {
        let refused = Bench::new::<LowPass>(cutoff(500.0, 2), RATE_HZ, &[Kind::SCALAR]).err();
        assert_eq!(refused.and_then(|e| e.field), Some("cutoff_hz"));
    }

    /// Noise, the cut-off as a signal that stays, leaps and is no number.
    fn sweeping(blocks: &[usize]) -> Vec<f64> {
        let open = CutoffSettings { cutoff_hz: None, order: 3 };
        let mut bench = Bench::new::<LowPass>(open, RATE_HZ, &[Kind::SCALAR, Kind::SCALAR]).unwrap();
        let x: Vec<f64> = (0..900).map(|k| (0.3 * f64::from(k * k)).sin()).collect();
        let cutoff: Vec<f64> = (0..900)
            .map(|k| match k {
                0..300 => 50.0,
                300..600 => f64::from(k),
                600..700 => f64::NAN,
                _ => -1.0,
            })
            .collect();
        bench.run_in_blocks(&[&x, &cutoff], blocks).remove(0)
    }

    #[test]
    fn a_cut_off_that_is_a_signal_is_that_of_its_tick() {
        let y = sweeping(&[1024]);
        assert_eq!(y, sweeping(&[1, 7, 64]));
        let x: Vec<f64> = (0..300).map(|k| (0.3 * f64::from(k * k)).sin()).collect();
        let mut fixed = Bench::new::<LowPass>(cutoff(50.0, 3), RATE_HZ, &[Kind::SCALAR]).unwrap();
        let same = fixed.run(&[&x]).remove(0);
        let apart = same.iter().zip(&y).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(apart < 1e-12, "{apart}");
        let largest = y.iter().fold(0.0_f64, |most, y| most.max(y.abs()));
        assert!(largest < 2.0, "{largest}");
        let last = y[899] - y[890];
        assert!(last.abs() < 1e-3, "below zero it is nearly closed: {last}");
    }

    #[test]
    fn a_constant_stays_constant_while_the_cut_off_is_turned() {
        for order in [1, 2, 7] {
            let mut bench = Bench::new::<LowPass>(cutoff(20.0, order), RATE_HZ, &[Kind::SCALAR]).unwrap();
            bench.run(&[&[1.0; 2000]]);
            for hz in [200.0, 1.0, 499.0, 600.0, f64::NAN, 40.0] {
                bench.set(CutoffSettings::cutoff_hz, hz);
                let y = bench.run(&[&[1.0; 100]]).remove(0);
                assert!(y.iter().all(|y| (y - 1.0).abs() < 1e-6), "{order} at {hz}");
            }
        }
    }

    #[test]
    fn a_cut_off_too_low_for_the_coefficients_is_tuned_to_the_lowest() {
        for order in [1, 2, 7] {
            let mut bench = Bench::new::<LowPass>(cutoff(20.0, order), RATE_HZ, &[Kind::SCALAR]).unwrap();
            bench.run(&[&[0.0; 100]]);
            bench.set(CutoffSettings::cutoff_hz, 1e-6);
            let y = bench.run(&[&[1.0; 1000]]).remove(0);
            assert!(y.iter().all(|y| y.abs() < 0.01), "{order}: {:?}", y.last());
        }
    }

    #[test]
    fn edges_that_make_no_band_leave_the_last_one() {
        let band = BandPassSettings { low_hz: Some(40.0), high_hz: Some(90.0), order: 2 };
        let run = |first: &[(LiveId<BandPassSettings>, f64)]| {
            let mut bench = Bench::new::<BandPass>(band.clone(), RATE_HZ, &[Kind::SCALAR]).unwrap();
            first.iter().for_each(|(setting, hz)| bench.set(*setting, *hz));
            let x: Vec<f64> = (0..500).map(|k| f64::from(k % 17) - 8.0).collect();
            bench.run(&[&x]).remove(0)
        };
        let (low, high) = (LOW.setting, HIGH.setting);
        assert_eq!(run(&[(low, 100.0)]), run(&[]));
        assert_eq!(run(&[(low, 100.0), (high, 200.0)]), run(&[(high, 200.0), (low, 100.0)]));
    }

    #[test]
    fn a_cut_off_is_given_once() {
        let open = CutoffSettings { cutoff_hz: None, order: 2 };
        assert!(Bench::new::<LowPass>(open, RATE_HZ, &[Kind::SCALAR]).is_err());
        let cx = BuildContext::new("low", haptograph_signal::time::Rate::new(1000, 1).unwrap());
        let scalar = Some(Kind::SCALAR);
        let cx = cx.connected(&[scalar, scalar]);
        let advice = LowPass::advice(&cutoff(50.0, 2), &cx);
        assert_eq!(advice.first().and_then(|advice| advice.field), Some("cutoff_hz"));
        let cx = cx.connected(&[scalar, None]);
        assert!(LowPass::advice(&cutoff(50.0, 2), &cx).is_empty());
    }
}
