//! Piecewise linear sources: constant, step, ramp, pulse.

use haptograph_engine::frame::{Scalar, Vector};
use haptograph_engine::node::{
    BuildContext, BuildError, Built, Io, LiveId, NodeKind, Output, Port, Processor, Tick,
};

use super::tick_at;

haptograph_engine::settings! {
    /// Settings of [`Constant`].
    pub struct ConstantSettings {
        /// The value, in the SI unit of `quantity`.
        [live] value: f64;
        /// Quantity of the output, by name: `"force"`, `"speed"`.
        quantity: String = "number".into();
    }
}

haptograph_engine::node! {
    /// A constant number.
    /// Elsewhere: DC, sig~.
    pub struct Constant(ConstantSettings) in "sources";
    example: r#""speed": Constant(clock: "control", value: 0.13, quantity: "speed")"#;
    out OUTPUT: Scalar = Port::of_setting("quantity", "The value.");
}

impl NodeKind for Constant {
    fn build(settings: ConstantSettings, _: &BuildContext) -> Result<Built<Self>, BuildError> {
        Ok(Built::new(Same { value: settings.value }))
    }
}

#[derive(Debug, Clone)]
struct Same {
    value: f64,
}

impl Processor<Constant> for Same {
    fn process(&mut self, _: &Tick, io: &mut Io<'_, Constant>) {
        io.write(Constant::OUTPUT).fill(self.value);
    }

    fn set(&mut self, setting: LiveId<ConstantSettings>, value: f64) {
        if setting == ConstantSettings::value {
            self.value = value;
        }
    }
}

haptograph_engine::settings! {
    /// Settings of [`ConstantVector`].
    pub struct ConstantVectorSettings {
        /// x, y and z, in the SI unit of `quantity`.
        [live] value: [f64; 3];
        /// Quantity of the output, by name: `"force"`, `"length"`.
        quantity: String = "number".into();
    }
}

haptograph_engine::node! {
    /// The same 3-vector at every tick.
    pub struct ConstantVector(ConstantVectorSettings) in "sources";
    example: r#""weight": ConstantVector(clock: "servo", value: [0.0, 0.0, -0.5], quantity: "force")"#;
    out OUTPUT: Vector = Port::of_setting("quantity", "The value.");
}

impl NodeKind for ConstantVector {
    fn build(settings: ConstantVectorSettings, _: &BuildContext) -> Result<Built<Self>, BuildError> {
        Ok(Built::new(SameVector { value: settings.value }))
    }
}

#[derive(Debug, Clone)]
struct SameVector {
    value: [f64; 3],
}

impl Processor<ConstantVector> for SameVector {
    fn process(&mut self, _: &Tick, io: &mut Io<'_, ConstantVector>) {
        io.write(ConstantVector::OUTPUT).fill(self.value);
    }

    fn set_item(&mut self, setting: LiveId<ConstantVectorSettings>, item: usize, value: f64) {
        if setting == ConstantVectorSettings::value
            && let Some(component) = self.value.get_mut(item)
        {
            *component = value;
        }
    }
}

haptograph_engine::settings! {
    /// Settings of [`Step`].
    pub struct StepSettings {
        /// Value before the step, in the SI unit of `quantity`.
        [live] before: f64 = 0.0;
        /// Value from the step on, in the SI unit of `quantity`.
        [live] after: f64 = 1.0;
        /// Time of the step.
        at_s: f64 = 0.0, in 0.0..=1e9;
        /// Quantity of the output, by name.
        quantity: String = "number".into();
    }
}

haptograph_engine::node! {
    /// A step: one value before a time, another from that time on.
    pub struct Step(StepSettings) in "sources";
    example: r#""press": Step(clock: "control", after: 1.2, at_s: 0.5, quantity: "force")"#;
    out OUTPUT: Scalar = Port::of_setting("quantity", "The step.");
}

impl NodeKind for Step {
    fn build(settings: StepSettings, cx: &BuildContext) -> Result<Built<Self>, BuildError> {
        Ok(Built::new(Line {
            from: settings.before,
            to: settings.after,
            first: tick_at(settings.at_s, cx),
            ticks: 0.0,
        }))
    }
}

haptograph_engine::settings! {
    /// Settings of [`Ramp`].
    pub struct RampSettings {
        /// Value before the ramp, in the SI unit of `quantity`.
        [live] from: f64 = 0.0;
        /// Value after the ramp, in the SI unit of `quantity`.
        [live] to: f64 = 1.0;
        /// Time at which the ramp starts.
        start_s: f64 = 0.0, in 0.0..=1e9;
        /// Duration of the ramp.
        duration_s: f64 = 1.0, in 0.0..=1e9;
        /// Quantity of the output, by name.
        quantity: String = "number".into();
    }
}

haptograph_engine::node! {
    /// A linear ramp from one value to another; constant before and after.
    /// Elsewhere: Line, XLine, line~, linspace.
    pub struct Ramp(RampSettings) in "sources";
    example: r#""faster": Ramp(clock: "control", to: 0.2, duration_s: 10.0, quantity: "speed")"#;
    out OUTPUT: Scalar = Port::of_setting("quantity", "The ramp.");
}

impl NodeKind for Ramp {
    fn build(settings: RampSettings, cx: &BuildContext) -> Result<Built<Self>, BuildError> {
        Ok(Built::new(Line {
            from: settings.from,
            to: settings.to,
            first: tick_at(settings.start_s, cx),
            ticks: settings.duration_s * cx.rate.hz(),
        }))
    }
}

/// A kind whose processor is a [`Line`].
trait LineKind: NodeKind {
    const OUTPUT: Output<Self, Scalar>;
    const FROM: LiveId<Self::Settings>;
    const TO: LiveId<Self::Settings>;
}

impl LineKind for Step {
    const OUTPUT: Output<Self, Scalar> = Self::OUTPUT;
    const FROM: LiveId<StepSettings> = StepSettings::before;
    const TO: LiveId<StepSettings> = StepSettings::after;
}

impl LineKind for Ramp {
    const OUTPUT: Output<Self, Scalar> = Self::OUTPUT;
    const FROM: LiveId<RampSettings> = RampSettings::from;
    const TO: LiveId<RampSettings> = RampSettings::to;
}

/// A line between two values, for [`Step`] and [`Ramp`].
#[derive(Debug, Clone)]
struct Line {
    from: f64,
    to: f64,
    first: u64,
    /// Duration of the ramp; zero is a step.
    ticks: f64,
}

impl<K: LineKind> Processor<K> for Line {
    fn process(&mut self, tick: &Tick, io: &mut Io<'_, K>) {
        for (y, now) in io.write(K::OUTPUT).iter_mut().zip(tick.first..) {
            let since = now.saturating_sub(self.first) as f64;
            *y = if now < self.first {
                self.from
            } else if since >= self.ticks {
                self.to
            } else {
                self.from + (self.to - self.from) * (since / self.ticks)
            };
        }
    }

    fn set(&mut self, setting: LiveId<K::Settings>, value: f64) {
        if setting == K::FROM {
            self.from = value;
        } else if setting == K::TO {
            self.to = value;
        }
    }
}

haptograph_engine::settings! {
    /// Settings of [`Pulse`].
    pub struct PulseSettings {
        /// Value between the pulses, in the SI unit of `quantity`.
        [live] low: f64 = 0.0;
        /// Value during a pulse, in the SI unit of `quantity`.
        [live] high: f64 = 1.0;
        /// Start of the first pulse.
        start_s: f64 = 0.0, in 0.0..=1e9;
        /// Duration of each pulse.
        width_s: f64 = 0.5, in 0.0..=1e9;
        /// Time from one start to the next; none: one pulse only.
        period_s: Option<f64> = None, in 1e-9..=1e9;
        /// Quantity of the output, by name.
        quantity: String = "number".into();
    }
}

haptograph_engine::node! {
    /// One rectangular pulse or, with a period, a square wave. Every edge falls on the first tick at or after its time.
    /// Elsewhere: LFPulse, Impulse, square, metro.
    pub struct Pulse(PulseSettings) in "sources";
    example: r#""knock": Pulse(clock: "servo", high: 2.0, width_s: 0.01, period_s: 1.0, quantity: "force")"#;
    out OUTPUT: Scalar = Port::of_setting("quantity", "The pulses.");
}

impl NodeKind for Pulse {
    fn build(settings: PulseSettings, cx: &BuildContext) -> Result<Built<Self>, BuildError> {
        let ticks = |time_s: f64| time_s * cx.rate.hz();
        if settings.period_s.is_some_and(|period_s| ticks(period_s) < 1.0) {
            let message = format!("the period is shorter than a tick of {}", cx.rate);
            return Err(
                BuildError::at("period_s", message).help("make it longer, or run the node on a faster clock")
            );
        }
        Ok(Built::new(Pulsing {
            low: settings.low,
            high: settings.high,
            start: ticks(settings.start_s),
            width: ticks(settings.width_s),
            period: settings.period_s.map(ticks),
        }))
    }
}

/// Times in ticks, with fractions.
#[derive(Debug, Clone)]
struct Pulsing {
    low: f64,
    high: f64,
    start: f64,
    width: f64,
    period: Option<f64>,
}

impl Processor<Pulse> for Pulsing {
    fn process(&mut self, tick: &Tick, io: &mut Io<'_, Pulse>) {
        for (y, now) in io.write(Pulse::OUTPUT).iter_mut().zip(tick.first..) {
            // Rounding must not move an edge off its tick.
            let since = now as f64 - self.start + 1e-6;
            let within = match self.period {
                Some(period) => since.rem_euclid(period),
                None => since,
            };
            let high = since >= 0.0 && within < self.width;
            *y = if high { self.high } else { self.low };
        }
    }

    fn set(&mut self, setting: LiveId<PulseSettings>, value: f64) {
        match setting {
            PulseSettings::low => self.low = value,
            PulseSettings::high => self.high = value,
            _ => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptograph_engine::testing::Bench;

    fn number() -> String {
        "number".into()
    }

    fn run<K: NodeKind>(settings: K::Settings, frames: usize) -> Vec<f64> {
        let mut bench = Bench::new::<K>(settings, 10.0, &[]).unwrap();
        bench.run_frames(frames, &[], &[1, 3]).remove(0)
    }

    #[test]
    fn a_constant_is_constant_and_can_be_turned() {
        let settings = ConstantSettings { value: 2.5, quantity: number() };
        let mut bench = Bench::new::<Constant>(settings, 10.0, &[]).unwrap();
        assert_eq!(bench.run_source(3), [[2.5; 3]]);
        bench.set(ConstantSettings::value, -1.0);
        assert_eq!(bench.run_source(3), [[-1.0; 3]]);
        let settings = ConstantVectorSettings { value: [1.0, 2.0, 3.0], quantity: number() };
        assert_eq!(run::<ConstantVector>(settings, 2), [1.0, 2.0, 3.0, 1.0, 2.0, 3.0]);
    }

    #[test]
    fn a_step_falls_on_its_tick() {
        let settings = StepSettings { before: -1.0, after: 1.0, at_s: 0.3, quantity: number() };
        assert_eq!(run::<Step>(settings, 5), [-1.0, -1.0, -1.0, 1.0, 1.0]);
    }

    #[test]
    fn a_ramp_is_straight() {
        let settings = RampSettings { from: 1.0, to: 3.0, start_s: 0.1, duration_s: 0.4, quantity: number() };
        assert_eq!(run::<Ramp>(settings.clone(), 7), [1.0, 1.0, 1.5, 2.0, 2.5, 3.0, 3.0]);
        let mut bench = Bench::new::<Ramp>(settings, 10.0, &[]).unwrap();
        bench.set(Ramp::FROM, 3.0);
        bench.set(Ramp::TO, 1.0);
        assert_eq!(bench.run_source(4), [[3.0, 3.0, 2.5, 2.0]]);
    }

    #[test]
    fn pulses_have_their_width_and_period() {
        let settings = |period_s| PulseSettings {
            low: 0.0,
            high: 1.0,
            start_s: 0.2,
            width_s: 0.1,
            period_s,
            quantity: number(),
        };
        assert_eq!(run::<Pulse>(settings(None), 8), [0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        assert_eq!(run::<Pulse>(settings(Some(0.3)), 8), [0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0]);
        let refused = Bench::new::<Pulse>(settings(Some(0.01)), 10.0, &[]).err();
        assert_eq!(refused.and_then(|e| e.field), Some("period_s"));
    }
}
