//! A meter of RMS and peak.

use haptograph_engine::frame::{Linear, Scalar};
use haptograph_engine::node::{
    BuildContext, BuildError, Built, Io, LiveId, NodeKind, Port, Processor, QuantityRule, Tick,
};

haptograph_engine::settings! {
    /// Settings of [`Meter`].
    pub struct MeterSettings {
        /// Time constant of both outputs.
        [live] window_s: f64 = 0.3, in 1e-6..=1e6;
    }
}

haptograph_engine::node! {
    /// The level of a signal: the root of its exponentially weighted mean square, and a peak that decays with the same time
    /// constant. For a vector they measure its length.
    /// Elsewhere: Amplitude, env~, rms, Scope.
    pub struct Meter(MeterSettings) in "sinks";
    example: r#""level": Meter(input: "texture.acceleration", window_s: 0.3)"#;
    in INPUT: Linear = Port::any("The signal.");
    out RMS: Scalar =
        Port::any("Root mean square over the time constant.").carrying(QuantityRule::Same("input"));
    out PEAK: Scalar =
        Port::any("Largest magnitude, with exponential decay.").carrying(QuantityRule::Same("input"));
}

impl NodeKind for Meter {
    fn build(settings: MeterSettings, cx: &BuildContext) -> Result<Built<Self>, BuildError> {
        Ok(Built::new(Level {
            keep: keep(cx.rate.period_s(), settings.window_s),
            period_s: cx.rate.period_s(),
            mean_square: 0.0,
            peak: 0.0,
        }))
    }
}

/// Decay factor per frame.
fn keep(period_s: f64, window_s: f64) -> f64 {
    (-period_s / window_s).exp()
}

#[derive(Debug, Clone)]
struct Level {
    /// Decay factor per frame.
    keep: f64,
    period_s: f64,
    mean_square: f64,
    peak: f64,
}

impl Processor<Meter> for Level {
    fn process(&mut self, _: &Tick, io: &mut Io<'_, Meter>) {
        let (width, x) = (io.width(Meter::INPUT), io.read(Meter::INPUT));
        let (rms, peak) = io.write_all((Meter::RMS, Meter::PEAK));
        for ((rms, peak), x) in rms.iter_mut().zip(peak).zip(x.chunks_exact(width)) {
            let square = x.iter().map(|x| x * x).sum::<f64>();
            // NaN, infinity and values too large to square are ignored.
            let square = if square.is_finite() { square } else { 0.0 };
            self.mean_square = flushed(self.keep * self.mean_square + (1.0 - self.keep) * square);
            self.peak = flushed((self.keep * self.peak).max(square.sqrt()));
            (*rms, *peak) = (self.mean_square.sqrt(), self.peak);
        }
    }

    fn set(&mut self, setting: LiveId<MeterSettings>, value: f64) {
        if setting == MeterSettings::window_s {
            self.keep = keep(self.period_s, value);
        }
    }

    fn copy_state_into(&self, new: &mut Self) {
        (new.mean_square, new.peak) = (self.mean_square, self.peak);
    }
}

fn flushed(value: f64) -> f64 {
    if value < 1e-200 { 0.0 } else { value }
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptograph_engine::frame::Kind;
    use haptograph_engine::testing::Bench;

    #[test]
    fn a_sine_reads_its_rms_and_peak_and_silence_reads_zero() {
        let mut bench =
            Bench::new::<Meter>(MeterSettings { window_s: 0.1 }, 1000.0, &[Kind::SCALAR]).unwrap();
        let mut x: Vec<f64> = (0..5000).map(|k| 3.0 * (0.7 * f64::from(k)).sin()).collect();
        x.resize(60_000, 0.0);
        let y = bench.run(&[&x]);
        assert!((y[0][4999] - 3.0 / 2.0_f64.sqrt()).abs() < 0.05);
        let highest = y[1][..5000].iter().fold(0.0_f64, |m, y| m.max(*y));
        assert!((highest - 3.0).abs() < 1e-3);
        assert!((y[1][5200] / y[1][5100] - (-1.0_f64).exp()).abs() < 1e-9);
        assert_eq!((y[0][59_999], y[1][59_999]), (0.0, 0.0));
    }
}
