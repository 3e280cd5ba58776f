//! Derivative and integral in time.

use haptograph_engine::frame::{Event, Kind, Linear, Record};
use haptograph_engine::node::{
    BuildContext, BuildError, Built, Io, Latency, LiveId, NodeKind, Optional, Port, Processor, QuantityRule,
    Tick,
};
use haptograph_engine::settings::NoSettings;

/// Components of the widest linear frame.
const WIDEST: usize = Kind::WRENCH.width();

haptograph_engine::node! {
    /// The difference to the last frame, per second; zero at the first frame. Follow it with a low-pass: it amplifies noise
    /// in proportion to frequency.
    /// Elsewhere: Slope, diff, gradient.
    pub struct Derivative(NoSettings) in "math";
    example: r#""velocity": Derivative(input: "stylus.position")"#;
    in INPUT: Linear = Port::any("The signal.");
    out OUTPUT: Linear = Port::like("input", "Its derivative.").carrying(QuantityRule::PerSecond("input"));
}

impl NodeKind for Derivative {
    fn build(_: NoSettings, cx: &BuildContext) -> Result<Built<Self>, BuildError> {
        Ok(Built::new(Difference { previous: [0.0; WIDEST], started: false, rate_hz: cx.rate.hz() }))
    }
}

#[derive(Debug, Clone)]
struct Difference {
    previous: [f64; WIDEST],
    started: bool,
    rate_hz: f64,
}

impl Processor<Derivative> for Difference {
    fn process(&mut self, _: &Tick, io: &mut Io<'_, Derivative>) {
        let (width, x) = (io.width(Derivative::INPUT).min(WIDEST), io.read(Derivative::INPUT));
        for (y, x) in io.write(Derivative::OUTPUT).chunks_exact_mut(width).zip(x.chunks_exact(width)) {
            if !self.started {
                self.previous[..width].copy_from_slice(x);
                self.started = true;
            }
            for ((y, previous), x) in y.iter_mut().zip(&mut self.previous).zip(x) {
                *y = (x - *previous) * self.rate_hz;
                *previous = *x;
            }
        }
    }

    fn copy_state_into(&self, new: &mut Self) {
        (new.previous, new.started) = (self.previous, self.started);
    }

    fn latency(&self) -> Latency {
        Latency::of_group(0.5 / self.rate_hz)
    }
}

haptograph_engine::settings! {
    /// Settings of [`Integrator`].
    pub struct IntegratorSettings {
        /// Time constant of the leak, s; none: no leak.
        [live] leak_s: Option<f64> = None, in 1e-6..=1e9;
        /// Value at the start and after a reset, in the SI unit of the output.
        start: f64 = 0.0;
    }
}

haptograph_engine::node! {
    /// The integral over time by the trapezoidal rule; with `leak_s` the integral decays exponentially. A frame with NaN or
    /// infinity is skipped.
    /// Elsewhere: cumsum, cumtrapz, integral.
    pub struct Integrator(IntegratorSettings) in "math";
    example: r#""distance": Integrator(input: "speed.speed")"#;
    in INPUT: Linear = Port::any("The signal.");
    in RESET: Event, Optional = Port::any("Resets the integral to `start`.");
    out OUTPUT: Linear =
        Port::like("input", "The integral up to this frame.").carrying(QuantityRule::TimesSeconds("input"));
}

impl NodeKind for Integrator {
    fn build(settings: IntegratorSettings, cx: &BuildContext) -> Result<Built<Self>, BuildError> {
        let period_s = cx.rate.period_s();
        Ok(Built::new(Integral {
            keep: settings.leak_s.map_or(1.0, |leak_s| keep(period_s, leak_s)),
            period_s,
            start: settings.start,
            sum: [settings.start; WIDEST],
            previous: [0.0; WIDEST],
            started: false,
        }))
    }
}

/// Decay factor per frame.
fn keep(period_s: f64, leak_s: f64) -> f64 {
    (-period_s / leak_s).exp()
}

#[derive(Debug, Clone)]
struct Integral {
    /// Decay factor per frame.
    keep: f64,
    period_s: f64,
    start: f64,
    sum: [f64; WIDEST],
    previous: [f64; WIDEST],
    started: bool,
}

impl Processor<Integrator> for Integral {
    fn process(&mut self, _: &Tick, io: &mut Io<'_, Integrator>) {
        let (width, x) = (io.width(Integrator::INPUT).min(WIDEST), io.read(Integrator::INPUT));
        let resets = io.read(Integrator::RESET);
        let frames = io.write(Integrator::OUTPUT).chunks_exact_mut(width).zip(x.chunks_exact(width));
        for (frame, (y, x)) in frames.enumerate() {
            if resets.is_some_and(|resets| Event::from_components(&resets[frame]).fired) {
                self.sum = [self.start; WIDEST];
                self.started = false;
            }
            for (((y, x), sum), previous) in y.iter_mut().zip(x).zip(&mut self.sum).zip(&mut self.previous) {
                let before = if self.started { *previous } else { *x };
                let added = if self.started { 0.5 * self.period_s * (before + x) } else { 0.0 };
                let next = self.keep * *sum + added;
                if next.is_finite() {
                    // A leaking sum must not stay among the denormals.
                    *sum = if next.abs() < 1e-200 { 0.0 } else { next };
                    *previous = *x;
                }
                *y = *sum;
            }
            self.started = true;
        }
    }

    fn set(&mut self, setting: LiveId<IntegratorSettings>, value: f64) {
        if setting == IntegratorSettings::leak_s {
            self.keep = keep(self.period_s, value);
        }
    }

    fn copy_state_into(&self, new: &mut Self) {
        (new.sum, new.previous, new.started) = (self.sum, self.previous, self.started);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptograph_engine::testing::Bench;

    #[test]
    fn the_derivative_of_a_line_is_its_slope() {
        let mut bench = Bench::new::<Derivative>(NoSettings {}, 250.0, &[Kind::VECTOR]).unwrap();
        let x: Vec<f64> =
            (0..40).flat_map(|k| [f64::from(k) / 250.0, 1.0, -2.0 * f64::from(k) / 250.0]).collect();
        let y = &bench.run_in_blocks(&[&x], &[1, 7])[0];
        assert_eq!(y[..3], [0.0; 3]);
        for frame in &y.as_chunks::<3>().0[1..] {
            assert!((frame[0] - 1.0).abs() < 1e-12 && frame[1] == 0.0 && (frame[2] + 2.0).abs() < 1e-12);
        }
    }

    fn integrator(leak_s: Option<f64>, inputs: &[Kind]) -> Bench {
        Bench::new::<Integrator>(IntegratorSettings { leak_s, start: 0.0 }, 1000.0, inputs).unwrap()
    }

    #[test]
    fn the_integral_of_a_line_is_exact() {
        let x: Vec<f64> = (0..=1000).map(|k| f64::from(k) / 1000.0).collect();
        let y = &integrator(None, &[Kind::SCALAR]).run(&[&x])[0];
        for (t, y) in x.iter().zip(y) {
            assert!((y - t * t / 2.0).abs() < 1e-12);
        }
    }

    #[test]
    fn a_leak_forgets_with_its_time_constant_and_ends_at_zero() {
        let mut bench = integrator(Some(0.01), &[Kind::SCALAR]);
        let mut x = vec![0.0; 6000];
        x[1] = 1.0;
        let y = &bench.run(&[&x])[0];
        assert!((y[12] / y[2] - (-1.0_f64).exp()).abs() < 1e-9);
        assert_eq!(y[5999], 0.0);
    }

    #[test]
    fn a_reset_starts_again_and_a_bad_frame_does_not_stick() {
        let mut bench = integrator(None, &[Kind::SCALAR, Kind::EVENT]);
        let x = [2.0, 2.0, f64::NAN, 2.0, 2.0];
        let resets = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0];
        let y = &bench.run(&[&x, &resets])[0];
        assert_eq!(y, &[0.0, 0.002, 0.002, 0.0, 0.002]);
    }
}
