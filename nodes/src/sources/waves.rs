//! Sine oscillator and sine sweep.

use haptograph_engine::frame::Scalar;
use haptograph_engine::node::{
    BuildContext, BuildError, Built, Fallback, Io, LiveId, NodeKind, Optional, Port, Processor, Tick,
};
use std::f64::consts::TAU;

use haptograph_signal::quantity::Quantity;
use haptograph_signal::units::Degrees;

haptograph_engine::settings! {
    /// Settings of [`Sine`].
    pub struct SineSettings {
        /// Frequency; required unless `frequency` is connected.
        [live, below_nyquist] frequency_hz: Option<f64> = None, in 0.0..=1e9;
        /// Amplitude, in the SI unit of `quantity`.
        [live] amplitude: f64 = 1.0;
        /// Phase of the sine at the start.
        phase_deg: Degrees = Degrees(0.0);
        /// Quantity of the output, by name.
        quantity: String = "number".into();
    }
}

const FREQUENCY: Fallback<Sine> = Fallback::new(Sine::FREQUENCY, SineSettings::frequency_hz);

haptograph_engine::node! {
    /// A sine: an oscillator, or below some 20 Hz the slow modulation (LFO) of another signal. A change of frequency
    /// continues from the present phase.
    /// Elsewhere: SinOsc, osc~, cycle~, os.osc, sin.
    pub struct Sine(SineSettings) in "sources";
    example: r#""tone": Sine(clock: "audio", frequency_hz: 250.0, amplitude: 0.1, quantity: "current")"#;
    in FREQUENCY: Scalar, Optional =
        Port::of(Quantity::FREQUENCY, "Replaces `frequency_hz` at every tick. It is clamped to 0.499 of \
                                       the rate; a negative one turns backwards; NaN and infinity are \
                                       ignored.");
    out OUTPUT: Scalar = Port::of_setting("quantity", "The sine.");
}

impl NodeKind for Sine {
    fn build(settings: SineSettings, cx: &BuildContext) -> Result<Built<Self>, BuildError> {
        // A frequency signal has no value before the first tick.
        let frequency_hz = FREQUENCY.value(settings.frequency_hz, cx)?.unwrap_or(0.0);
        Ok(Built::new(Oscillator {
            turns_per_tick: frequency_hz / cx.rate.hz(),
            amplitude: settings.amplitude,
            anchor: 0,
            anchor_turns: settings.phase_deg.turns(),
            next: 0,
            rate_hz: cx.rate.hz(),
            follows: FREQUENCY.is_connected(cx),
        }))
    }

    fn advice(settings: &SineSettings, cx: &BuildContext) -> Vec<BuildError> {
        FREQUENCY.advice(settings.frequency_hz, cx).into_iter().collect()
    }
}

/// The phase is counted from an anchor, so that it does not depend on how often it was computed.
#[derive(Debug, Clone)]
struct Oscillator {
    turns_per_tick: f64,
    amplitude: f64,
    /// Tick of the anchor.
    anchor: u64,
    anchor_turns: f64,
    /// The next tick.
    next: u64,
    rate_hz: f64,
    /// True if the frequency is a signal.
    follows: bool,
}

impl Oscillator {
    fn turns_at(&self, tick: u64) -> f64 {
        self.anchor_turns + (tick - self.anchor) as f64 * self.turns_per_tick
    }

    /// Samples for a frequency signal: the phase is the sum of the frequencies.
    fn follow(&mut self, frequency_hz: &[f64], y: &mut [f64]) {
        let mut turns = self.anchor_turns;
        for (y, hz) in y.iter_mut().zip(frequency_hz) {
            if hz.is_finite() {
                self.turns_per_tick = (hz / self.rate_hz).clamp(-0.499, 0.499);
            }
            *y = self.amplitude * (TAU * (turns - turns.floor())).sin();
            turns += self.turns_per_tick;
            turns -= turns.floor();
        }
        (self.anchor, self.anchor_turns) = (self.next, turns);
    }
}

impl Processor<Sine> for Oscillator {
    fn process(&mut self, tick: &Tick, io: &mut Io<'_, Sine>) {
        self.next = tick.first + tick.frames as u64;
        if let Some(frequency_hz) = io.read(FREQUENCY.input) {
            return self.follow(frequency_hz, io.write(Sine::OUTPUT));
        }
        for (y, now) in io.write(Sine::OUTPUT).iter_mut().zip(tick.first..) {
            let turns = self.turns_at(now);
            *y = self.amplitude * (TAU * (turns - turns.floor())).sin();
        }
    }

    fn set(&mut self, setting: LiveId<SineSettings>, value: f64) {
        match setting {
            SineSettings::frequency_hz if self.follows => {}
            SineSettings::frequency_hz => {
                let turns = self.turns_at(self.next);
                (self.anchor, self.anchor_turns) = (self.next, turns - turns.floor());
                self.turns_per_tick = value / self.rate_hz;
            }
            SineSettings::amplitude => self.amplitude = value,
            _ => {}
        }
    }

    fn copy_state_into(&self, new: &mut Self) {
        if self.follows && new.follows && new.rate_hz == self.rate_hz {
            new.turns_per_tick = self.turns_per_tick;
        }
        let turns = self.turns_at(self.next);
        (new.anchor, new.next) = (self.next, self.next);
        new.anchor_turns = turns - turns.floor();
        if !self.follows && !new.follows && new.turns_per_tick == self.turns_per_tick {
            // The output stays bit-identical if nothing changed.
            (new.anchor, new.anchor_turns) = (self.anchor, self.anchor_turns);
        }
    }
}

haptograph_engine::choices! {
    /// Law by which the frequency of a [`Chirp`] changes.
    pub enum Sweep {
        /// A constant number of hertz per second.
        Linear,
        /// A constant number of octaves per second.
        Logarithmic,
    }
}

haptograph_engine::settings! {
    /// Settings of [`Chirp`].
    pub struct ChirpSettings {
        /// Frequency at the start.
        [live, below_nyquist] from_hz: f64 = 10.0, in 1e-6..=1e9;
        /// Frequency at the end.
        [live, below_nyquist] to_hz: f64 = 500.0, in 1e-6..=1e9;
        /// Duration of the sweep; the output is zero after it.
        duration_s: f64 = 10.0, in 1e-6..=1e9;
        /// Amplitude, in the SI unit of `quantity`.
        [live] amplitude: f64 = 1.0;
        /// Law by which the frequency changes.
        sweep: Sweep = Sweep::Logarithmic;
        /// Quantity of the output, by name.
        quantity: String = "number".into();
    }
}

haptograph_engine::node! {
    /// A sine whose frequency sweeps once from one value to another, to identify an actuator. A new frequency of its ends
    /// continues from the present phase.
    /// Elsewhere: sweep, chirp.
    pub struct Chirp(ChirpSettings) in "sources";
    example: r#""sweep": Chirp(clock: "synth", from_hz: 10.0, to_hz: 1000.0, amplitude: 0.2, quantity: "current")"#;
    out OUTPUT: Scalar = Port::of_setting("quantity", "The sweep.");
}

impl NodeKind for Chirp {
    fn build(settings: ChirpSettings, _: &BuildContext) -> Result<Built<Self>, BuildError> {
        Ok(Built::new(Sweeping { settings, ahead_turns: 0.0, next_s: 0.0 }))
    }
}

#[derive(Debug, Clone)]
struct Sweeping {
    settings: ChirpSettings,
    /// Phase minus that of a sweep that always had these frequencies.
    ahead_turns: f64,
    /// Time of the next tick.
    next_s: f64,
}

impl Sweeping {
    fn turns_at(&self, time_s: f64) -> f64 {
        let ChirpSettings { from_hz, to_hz, duration_s, .. } = self.settings;
        let part = time_s / duration_s;
        let octaves = (to_hz / from_hz).ln();
        let turns = if self.settings.sweep == Sweep::Linear || octaves.abs() < 1e-9 {
            time_s * (from_hz + 0.5 * (to_hz - from_hz) * part)
        } else {
            from_hz * duration_s / octaves * (octaves * part).exp_m1()
        };
        turns + self.ahead_turns
    }

    /// Continues from the phase reached so far.
    fn continue_from(&mut self, turns: f64) {
        let ahead = self.ahead_turns + turns - self.turns_at(self.next_s);
        self.ahead_turns = ahead - ahead.floor();
    }
}

impl Processor<Chirp> for Sweeping {
    fn process(&mut self, tick: &Tick, io: &mut Io<'_, Chirp>) {
        for (frame, y) in io.write(Chirp::OUTPUT).iter_mut().enumerate() {
            let time_s = tick.time_s(frame);
            let turns = self.turns_at(time_s.min(self.settings.duration_s));
            let sounds = time_s < self.settings.duration_s;
            *y = if sounds { self.settings.amplitude * (TAU * (turns - turns.floor())).sin() } else { 0.0 };
        }
        self.next_s = tick.time_s(tick.frames);
    }

    fn set(&mut self, setting: LiveId<ChirpSettings>, value: f64) {
        if !value.is_finite() {
            return;
        }
        let reached = self.turns_at(self.next_s);
        match setting {
            ChirpSettings::from_hz => self.settings.from_hz = value,
            ChirpSettings::to_hz => self.settings.to_hz = value,
            ChirpSettings::amplitude => {
                self.settings.amplitude = value;
                return;
            }
            _ => return,
        }
        self.continue_from(reached);
    }

    fn copy_state_into(&self, new: &mut Self) {
        (new.next_s, new.ahead_turns) = (self.next_s, self.ahead_turns);
        if new.settings != self.settings {
            new.continue_from(self.turns_at(self.next_s));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptograph_engine::testing::Bench;

    fn sine(frequency_hz: f64, phase_deg: f64) -> Bench {
        let settings = SineSettings {
            frequency_hz: Some(frequency_hz),
            amplitude: 2.0,
            phase_deg: Degrees(phase_deg),
            quantity: "number".into(),
        };
        Bench::new::<Sine>(settings, 1000.0, &[]).unwrap()
    }

    #[test]
    fn a_sine_is_a_sine_after_any_time() {
        let y = sine(37.0, 90.0).run_frames(100_000, &[], &[64]).remove(0);
        for (k, y) in y.iter().enumerate() {
            let exact = 2.0 * (TAU * ((37 * k % 1000) as f64 / 1000.0 + 0.25)).sin();
            assert!((y - exact).abs() < 1e-9);
        }
    }

    #[test]
    fn a_new_frequency_goes_on_from_the_phase_that_was_reached() {
        let mut bench = sine(10.0, 0.0);
        let before = bench.run_source(130).remove(0);
        bench.set(SineSettings::frequency_hz, 20.0);
        let after = bench.run_source(10).remove(0);
        let jump = (after[0] - before[129]).abs();
        assert!(jump < 2.0 * TAU * 0.02, "{jump}");
        assert!((after[0] - 2.0 * (TAU * 0.3).sin()).abs() < 1e-9);
    }

    #[test]
    fn a_chirp_passes_through_its_frequencies_and_ends() {
        for (sweep, middle_hz) in [(Sweep::Linear, 55.0), (Sweep::Logarithmic, 1000.0_f64.sqrt())] {
            let settings = ChirpSettings {
                from_hz: 10.0,
                to_hz: 100.0,
                duration_s: 4.0,
                amplitude: 1.0,
                sweep,
                quantity: "current".into(),
            };
            let chirp = Sweeping { settings: settings.clone(), ahead_turns: 0.0, next_s: 0.0 };
            let frequency_at = |t: f64| (chirp.turns_at(t + 1e-6) - chirp.turns_at(t - 1e-6)) / 2e-6;
            assert!((frequency_at(0.0) - 10.0).abs() < 1e-3);
            assert!((frequency_at(2.0) - middle_hz).abs() < 1e-3);
            assert!((frequency_at(4.0) - 100.0).abs() < 1e-3);
            let mut bench = Bench::new::<Chirp>(settings, 1000.0, &[]).unwrap();
            let y = bench.run_frames(5000, &[], &[777]).remove(0);
            assert!(y[4000..].iter().all(|y| *y == 0.0));
            assert!(y[3000..4000].iter().any(|y| y.abs() > 0.9));
        }
    }

    #[test]
    fn frequencies_beyond_half_the_rate_are_refused() {
        let settings = SineSettings {
            frequency_hz: Some(500.0),
            amplitude: 1.0,
            phase_deg: Degrees(0.0),
            quantity: "number".into(),
        };
        let refused = Bench::new::<Sine>(settings, 1000.0, &[]).err();
        assert_eq!(refused.and_then(|e| e.field), Some("frequency_hz"));
    }

    #[test]
    fn a_frequency_that_is_a_signal_adds_up_to_the_phase() {
        let settings = SineSettings {
            frequency_hz: None,
            amplitude: 2.0,
            phase_deg: Degrees(0.0),
            quantity: "number".into(),
        };
        assert!(Bench::new::<Sine>(settings.clone(), 1000.0, &[]).is_err());
        let mut bench =
            Bench::new::<Sine>(settings, 1000.0, &[haptograph_engine::frame::Kind::SCALAR]).unwrap();
        let frequency: Vec<f64> = (0..400)
            .map(|k| match k {
                0..100 => 20.0,
                100..200 => 40.0,
                200..300 => f64::NAN,
                _ => -40.0,
            })
            .collect();
        let y = bench.run_in_blocks(&[&frequency], &[1, 64, 7]).remove(0);
        for (k, y) in y.iter().enumerate() {
            // 2 turns in the first hundred ticks, then 4, 4, and 4 back.
            let turns = match k {
                0..100 => 0.02 * k as f64,
                100..300 => 0.04 * (k - 100) as f64,
                _ => -0.04 * (k - 300) as f64,
            };
            assert!((y - 2.0 * (TAU * turns).sin()).abs() < 1e-9, "{k}");
        }
    }

    #[test]
    fn a_chirp_that_is_turned_goes_on_from_its_phase() {
        let settings = ChirpSettings {
            from_hz: 10.0,
            to_hz: 100.0,
            duration_s: 4.0,
            amplitude: 1.0,
            sweep: Sweep::Logarithmic,
            quantity: "current".into(),
        };
        let mut bench = Bench::new::<Chirp>(settings, 1000.0, &[]).unwrap();
        let mut before = bench.run_source(500).remove(0)[499];
        let (from, to) = (ChirpSettings::from_hz, ChirpSettings::to_hz);
        for (setting, hz) in [(to, 60.0), (from, 30.0), (to, 499.0), (from, f64::NAN), (to, 80.0)] {
            bench.set(setting, hz);
            let y = bench.run_source(1).remove(0)[0];
            // A tick at 100 Hz turns it by no more than this.
            assert!((y - before).abs() < TAU * 0.1, "{setting:?} {hz}: {before} to {y}");
            before = y;
        }
    }
}
