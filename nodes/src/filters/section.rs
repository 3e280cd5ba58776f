//! A second-order section, given by its response or by its coefficients.

use haptograph_engine::frame::{Kind, Linear, Scalar};
use haptograph_engine::node::{
    BuildContext, BuildError, Built, Fallback, Io, Latency, LiveId, NodeKind, Optional, Port, Processor,
    Tick, next_change,
};
use haptograph_signal::filter;
use std::f64::consts::PI;

use super::{FilterKind, LaneFilter, Through, within};
use haptograph_signal::quantity::Quantity;

haptograph_engine::choices! {
    /// The response of a [`Biquad`].
    pub enum Shape {
        /// Low-pass.
        LowPass,
        /// High-pass.
        HighPass,
        /// Band-pass with unit gain at the centre.
        BandPass,
        /// Notch.
        Notch,
    }
}

haptograph_engine::settings! {
    /// Settings of [`Biquad`].
    pub struct BiquadSettings {
        /// The response.
        shape: Shape = Shape::LowPass;
        /// Cut-off or centre frequency; required unless `frequency` is connected.
        [live, below_nyquist] frequency_hz: Option<f64> = None, in 1e-6..=1e9;
        /// Quality: 0.7071 gives a Butterworth low-pass, a higher one a resonance.
        [live] q: f64 = std::f64::consts::FRAC_1_SQRT_2, in 0.01..=10_000.0;
    }
}

const FREQUENCY: Fallback<Biquad> = Fallback::new(Biquad::FREQUENCY, BiquadSettings::frequency_hz);

haptograph_engine::node! {
    /// A second-order filter whose frequency (cut-off) and quality can be turned while it runs, or swept by a signal.
    /// Elsewhere: biquad~, BPeakEQ, tf2.
    pub struct Biquad(BiquadSettings) in "filters";
    source: "trapezoidal state-variable filter (Zavalishin, Simper); bilinear transform, prewarped";
    example: r#""ring": Biquad(input: "noise.output", shape: BandPass, frequency_hz: 250.0, q: 8.0)"#;
    in INPUT: Linear = Port::any("The signal.");
    in FREQUENCY: Scalar, Optional =
        Port::of(Quantity::FREQUENCY, "Replaces `frequency_hz`, clamped from a millionth to 0.45 of the \
                                       rate; NaN and infinity are ignored. The group delay is then not \
                                       counted in the latency.");
    out OUTPUT: Linear = Port::like("input", "The filtered signal.");
}

impl NodeKind for Biquad {
    fn build(settings: BiquadSettings, cx: &BuildContext) -> Result<Built<Self>, BuildError> {
        let rate_hz = cx.rate.hz();
        let frequency_hz = FREQUENCY.value(settings.frequency_hz, cx)?;
        let wanted = Wanted {
            shape: settings.shape,
            frequency_hz: frequency_hz.unwrap_or(0.01 * rate_hz),
            q: settings.q,
        };
        Ok(Built::new(StateVariable {
            tuning: Tuning::of(&wanted, rate_hz),
            states: [[0.0; 2]; WIDEST],
            wanted,
            follows: FREQUENCY.is_connected(cx),
            rate_hz,
        }))
    }

    fn advice(settings: &BiquadSettings, cx: &BuildContext) -> Vec<BuildError> {
        FREQUENCY.advice(settings.frequency_hz, cx).into_iter().collect()
    }
}

/// The requested frequency and quality.
#[derive(Debug, Clone)]
struct Wanted {
    shape: Shape,
    frequency_hz: f64,
    q: f64,
}

/// Components of the widest linear frame.
const WIDEST: usize = Kind::WRENCH.width();
/// Ticks between checks whether a state has decayed to nothing or is NaN.
const SETTLE: u64 = 64;

/// The section as two trapezoidal integrators. Their states do not depend on the frequency, so that a change causes
/// no jump. The response is that of the section by the bilinear transform.
#[derive(Debug, Clone)]
struct StateVariable {
    tuning: Tuning,
    /// States of the two integrators, per component.
    states: [[f64; 2]; WIDEST],
    wanted: Wanted,
    /// True if the frequency is a signal.
    follows: bool,
    rate_hz: f64,
}

#[derive(Debug, Clone, Copy)]
struct Tuning {
    /// Gains of the implicit loop.
    a: [f64; 3],
    /// 1 / q.
    damping: f64,
    /// Weights of input, band-pass and low-pass in the output.
    mix: [f64; 3],
}

impl Tuning {
    fn of(wanted: &Wanted, rate_hz: f64) -> Self {
        let g = (PI * wanted.frequency_hz / rate_hz).tan();
        let damping = 1.0 / wanted.q;
        let a1 = 1.0 / (1.0 + g * (g + damping));
        let mix = match wanted.shape {
            Shape::LowPass => [0.0, 0.0, 1.0],
            Shape::HighPass => [1.0, -damping, -1.0],
            Shape::BandPass => [0.0, damping, 0.0],
            Shape::Notch => [1.0, -damping, 0.0],
        };
        Self { a: [a1, g * a1, g * g * a1], damping, mix }
    }

    /// The same filter as a section, to compute its delay.
    fn section(&self, wanted: &Wanted, rate_hz: f64) -> filter::Biquad {
        let g = (PI * wanted.frequency_hz / rate_hz).tan();
        let [a1, ..] = self.a;
        let low = g * g * a1;
        let [b_low, b_band, b_high] = match wanted.shape {
            Shape::LowPass => [low, 0.0, 0.0],
            Shape::HighPass => [0.0, 0.0, a1],
            Shape::BandPass => [0.0, g * self.damping * a1, 0.0],
            Shape::Notch => [low, 0.0, a1],
        };
        filter::Biquad {
            b: [b_low + b_band + b_high, 2.0 * (b_low - b_high), b_low - b_band + b_high],
            a: [2.0 * (g * g - 1.0) * a1, (1.0 + g * (g - self.damping)) * a1],
        }
    }
}

impl StateVariable {
    /// Filters a block of frames; the first frame is tick `first`.
    fn run(&mut self, first: u64, width: usize, x: &[f64], y: &mut [f64]) {
        let Tuning { a: [a1, a2, a3], mix: [direct, band, low], .. } = self.tuning;
        let frames = y.chunks_exact_mut(width).zip(x.chunks_exact(width));
        for ((y, x), now) in frames.zip(first..) {
            for ((y, x), [s1, s2]) in y.iter_mut().zip(x).zip(&mut self.states) {
                let rest = x - *s2;
                let v1 = a1 * *s1 + a2 * rest;
                let v2 = *s2 + a2 * *s1 + a3 * rest;
                *s1 = 2.0 * v1 - *s1;
                *s2 = 2.0 * v2 - *s2;
                *y = direct * x + band * v1 + low * v2;
            }
            if now % SETTLE == SETTLE - 1 {
                self.states.iter_mut().for_each(settle);
            }
        }
    }

    fn turn(&mut self, frequency_hz: f64) {
        if frequency_hz != self.wanted.frequency_hz {
            self.wanted.frequency_hz = frequency_hz;
            self.tuning = Tuning::of(&self.wanted, self.rate_hz);
        }
    }
}

impl Processor<Biquad> for StateVariable {
    fn process(&mut self, tick: &Tick, io: &mut Io<'_, Biquad>) {
        let (width, x) = (io.width(Biquad::INPUT).min(WIDEST), io.read(Biquad::INPUT));
        let frequency = io.read(FREQUENCY.input);
        let (y, mut from) = (io.write(Biquad::OUTPUT), 0);
        while from < tick.frames {
            let end = next_change(&[frequency], from, tick.frames);
            if let Some(hz) = frequency.map(|frequency| frequency[from]).filter(|hz| hz.is_finite()) {
                self.turn(within(hz, self.rate_hz));
            }
            let lanes = from * width..end * width;
            self.run(tick.first + from as u64, width, &x[lanes.clone()], &mut y[lanes]);
            from = end;
        }
    }

    fn set(&mut self, setting: LiveId<BiquadSettings>, value: f64) {
        match setting {
            _ if !value.is_finite() => {}
            BiquadSettings::frequency_hz if !self.follows => self.turn(value),
            BiquadSettings::q => {
                self.wanted.q = value;
                self.tuning = Tuning::of(&self.wanted, self.rate_hz);
            }
            _ => {}
        }
    }

    fn copy_state_into(&self, new: &mut Self) {
        new.states = self.states;
        if new.follows {
            new.turn(within(self.wanted.frequency_hz, new.rate_hz));
        }
    }

    fn latency(&self) -> Latency {
        if self.follows {
            return Latency::default();
        }
        let sections = filter::Sections { sections: vec![self.tuning.section(&self.wanted, self.rate_hz)] };
        let passband_hz = match self.wanted.shape {
            Shape::LowPass | Shape::Notch => 0.01 * self.wanted.frequency_hz,
            Shape::BandPass => self.wanted.frequency_hz,
            Shape::HighPass => (self.wanted.frequency_hz * 0.5 * self.rate_hz).sqrt(),
        };
        Latency::of_group(sections.group_delay_s(passband_hz, self.rate_hz))
    }
}

/// Decayed states become exactly zero, and so does NaN.
fn settle(state: &mut [f64; 2]) {
    let silent = state.iter().all(|s| s.abs() < 1e-30);
    if silent || !state.iter().all(|s| s.is_finite()) {
        *state = [0.0; 2];
    }
}

haptograph_engine::settings! {
    /// Settings of [`SecondOrderSection`].
    pub struct SecondOrderSectionSettings {
        /// b_0, b_1, b_2.
        b: [f64; 3];
        /// a_1, a_2 of the denominator 1 + a_1 z^-1 + a_2 z^-2.
        a: [f64; 2];
    }
}

haptograph_engine::node! {
    /// A second-order section given by its coefficients: (b_0 + b_1 z^-1 + b_2 z^-2) / (1 + a_1 z^-1 + a_2 z^-2).
    /// Elsewhere: SOS, sosfilt, zpk2sos.
    pub struct SecondOrderSection(SecondOrderSectionSettings) in "filters";
    example: r#""shape": SecondOrderSection(input: "noise.output", b: [0.2, 0.0, -0.2], a: [-1.2, 0.6])"#;
    in INPUT: Linear = Port::any("The signal.");
    out OUTPUT: Linear = Port::like("input", "The filtered signal.");
}

impl NodeKind for SecondOrderSection {
    fn build(settings: SecondOrderSectionSettings, cx: &BuildContext) -> Result<Built<Self>, BuildError> {
        let section = filter::Biquad { b: settings.b, a: settings.a };
        if !section.is_stable() {
            let message = "the section is unstable: a pole lies on or outside the unit circle";
            return Err(BuildError::at("a", message).help("stability needs |a_2| < 1 and |a_1| < 1 + a_2"));
        }
        let sections = filter::Sections { sections: vec![section] };
        Ok(Built::new(LaneFilter::fixed::<Self>(&sections, cx, 0.0)))
    }
}

impl FilterKind for SecondOrderSection {
    const PORTS: Through<Self> = (Self::INPUT, Self::OUTPUT);
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptograph_engine::testing::Bench;
    use haptograph_signal::filter::{SectionsState, butterworth_lowpass};

    fn settings(shape: Shape, frequency_hz: f64, q: f64) -> BiquadSettings {
        BiquadSettings { shape, frequency_hz: Some(frequency_hz), q }
    }

    fn section(settings: &BiquadSettings, rate_hz: f64) -> filter::Biquad {
        let wanted = Wanted {
            shape: settings.shape.clone(),
            frequency_hz: settings.frequency_hz.unwrap(),
            q: settings.q,
        };
        Tuning::of(&wanted, rate_hz).section(&wanted, rate_hz)
    }

    #[test]
    fn the_default_quality_is_butterworth() {
        let section = section(&settings(Shape::LowPass, 80.0, std::f64::consts::FRAC_1_SQRT_2), 1000.0);
        let butterworth = butterworth_lowpass(2, 80.0, 1000.0).unwrap().sections[0];
        let pairs = section.b.iter().chain(&section.a).zip(butterworth.b.iter().chain(&butterworth.a));
        assert!(pairs.into_iter().all(|(a, b)| (a - b).abs() < 1e-14));
    }

    #[test]
    fn gains_at_and_around_the_frequency() {
        let gain = |shape, at_hz| {
            let section = section(&settings(shape, 100.0, 5.0), 2000.0);
            filter::Sections { sections: vec![section] }.response(at_hz, 2000.0).norm()
        };
        assert!((gain(Shape::LowPass, 100.0) - 5.0).abs() < 1e-9);
        assert!((gain(Shape::HighPass, 100.0) - 5.0).abs() < 1e-9);
        assert!((gain(Shape::BandPass, 100.0) - 1.0).abs() < 1e-9);
        assert!(gain(Shape::Notch, 100.0) < 1e-9);
        assert!((gain(Shape::Notch, 1e-3) - 1.0).abs() < 1e-9);
    }

    #[test]
    fn what_runs_is_the_section() {
        for shape in [Shape::LowPass, Shape::HighPass, Shape::BandPass, Shape::Notch] {
            let settings = settings(shape, 130.0, 2.0);
            let sections = filter::Sections { sections: vec![section(&settings, 1000.0)] };
            let x: Vec<f64> = (0..900).map(|k| (0.1 * f64::from(k * k)).sin()).collect();
            let mut wanted = vec![0.0; 300];
            let middle: Vec<f64> = x.iter().skip(1).step_by(3).copied().collect();
            SectionsState::new(&sections).process(&middle, &mut wanted);
            let mut bench = Bench::new::<Biquad>(settings, 1000.0, &[Kind::VECTOR]).unwrap();
            let y = bench.run_in_blocks(&[&x], &[5, 64]).remove(0);
            let lane = y.iter().skip(1).step_by(3);
            assert!(lane.zip(&wanted).all(|(y, w)| (y - w).abs() < 1e-12));
        }
    }

    #[test]
    fn turning_keeps_the_state_and_the_bounds() {
        let mut bench =
            Bench::new::<Biquad>(settings(Shape::LowPass, 10.0, 0.7), 1000.0, &[Kind::SCALAR]).unwrap();
        let ones = vec![1.0; 1000];
        let settled = bench.run(&[&ones])[0][999];
        assert!((settled - 1.0).abs() < 1e-6);
        bench.set(FREQUENCY.setting, 200.0);
        let after = bench.run(&[&ones])[0].iter().map(|y| (y - 1.0).abs()).fold(0.0, f64::max);
        assert!(after < 1e-6, "a constant stays constant: {after}");
        bench.set(FREQUENCY.setting, 1e9);
        bench.set(FREQUENCY.setting, f64::NAN);
        assert!(bench.run(&[&ones])[0].iter().all(|y| y.is_finite()));
    }

    #[test]
    fn a_frequency_that_is_a_signal_is_what_the_setting_would_be() {
        let x: Vec<f64> = (0..300).map(|k| (0.2 * f64::from(k * k)).sin()).collect();
        let frequency: Vec<f64> = (0..300).map(|k| if k < 100 { 50.0 } else { 170.0 }).collect();
        let open = BiquadSettings { frequency_hz: None, ..settings(Shape::BandPass, 1.0, 3.0) };
        let kinds = [Kind::SCALAR, Kind::SCALAR];
        let mut bench = Bench::new::<Biquad>(open, 1000.0, &kinds).unwrap();
        let followed = bench.run_in_blocks(&[&x, &frequency], &[64, 7]).remove(0);
        let mut bench =
            Bench::new::<Biquad>(settings(Shape::BandPass, 50.0, 3.0), 1000.0, &[Kind::SCALAR]).unwrap();
        let mut wanted = bench.run(&[&x[..100]]).remove(0);
        bench.set(FREQUENCY.setting, 170.0);
        wanted.extend(bench.run(&[&x[100..]]).remove(0));
        assert_eq!(followed, wanted);
    }

    #[test]
    fn unstable_coefficients_are_refused() {
        let settings = SecondOrderSectionSettings { b: [1.0, 0.0, 0.0], a: [0.0, 1.0] };
        let refused = Bench::new::<SecondOrderSection>(settings, 1000.0, &[Kind::SCALAR]).err();
        assert_eq!(refused.and_then(|e| e.field), Some("a"));
    }
}
