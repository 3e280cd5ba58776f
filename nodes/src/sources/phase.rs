//! Phase of a frequency signal, and envelope of a gate signal.

use haptograph_engine::frame::Scalar;
use haptograph_engine::node::{BuildContext, BuildError, Built, Io, LiveId, NodeKind, Port, Processor, Tick};
use haptograph_signal::quantity::Quantity;
use haptograph_signal::units::{Degrees, Milliseconds};

haptograph_engine::settings! {
    /// Settings of [`Phase`].
    pub struct PhaseSettings {
        /// Phase at the start.
        start_deg: Degrees = Degrees(0.0), in -360.0..=360.0;
    }
}

haptograph_engine::node! {
    /// The phase of an oscillator whose frequency is a signal, in turns from 0 up to 1: frequency modulation, or an LFO of
    /// any shape. A sine of it is an `Expression`: `sin(2*pi * a)`; a `Curve` over it is any other.
    /// Elsewhere: Phasor, phasor~, LFSaw, sawtooth.
    pub struct Phase(PhaseSettings) in "sources";
    example: r#""turn": Phase(frequency: "pitch.output")"#;
    in FREQUENCY: Scalar =
        Port::of(Quantity::FREQUENCY, "Frequency, Hz; a negative frequency turns backwards.");
    out PHASE: Scalar = Port::of(Quantity::NUMBER, "The phase in turns, from 0 up to 1.");
}

impl NodeKind for Phase {
    fn build(settings: PhaseSettings, cx: &BuildContext) -> Result<Built<Self>, BuildError> {
        Ok(Built::new(Turning {
            turns: settings.start_deg.turns().rem_euclid(1.0),
            tick_s: 1.0 / cx.rate.hz(),
        }))
    }
}

#[derive(Debug, Clone)]
struct Turning {
    turns: f64,
    tick_s: f64,
}

impl Processor<Phase> for Turning {
    fn process(&mut self, _: &Tick, io: &mut Io<'_, Phase>) {
        let frequency_hz = io.read(Phase::FREQUENCY);
        for (phase, hz) in io.write(Phase::PHASE).iter_mut().zip(frequency_hz) {
            *phase = self.turns;
            let next = self.turns + hz * self.tick_s;
            // NaN and infinity leave the phase as it is; the remainder can round up to 1.
            self.turns = if next.is_finite() { next - next.floor() } else { self.turns };
            self.turns = if self.turns < 1.0 { self.turns } else { 0.0 };
        }
    }

    fn copy_state_into(&self, new: &mut Self) {
        new.turns = self.turns;
    }
}

haptograph_engine::settings! {
    /// Settings of [`Adsr`].
    pub struct AdsrSettings {
        /// Time from 0 to 1, ms.
        [live] attack_ms: Milliseconds = Milliseconds(5.0), in 0.0..=1e6;
        /// Time from 1 to 0, ms. The decay to a `sustain` of 0.5 takes half of it.
        [live] decay_ms: Milliseconds = Milliseconds(50.0), in 0.0..=1e6;
        /// Level while the gate is open, 0 to 1.
        [live] sustain: f64 = 0.5, in 0.0..=1.0;
        /// Time from 1 to 0 after the gate has closed, ms.
        [live] release_ms: Milliseconds = Milliseconds(100.0), in 0.0..=1e6;
    }
}

haptograph_engine::node! {
    /// An envelope of linear segments: attack, decay, sustain, release. The attack starts from the present level, so that
    /// nothing jumps.
    /// Elsewhere: EnvGen, adsr~, en.adsr.
    pub struct Adsr(AdsrSettings) in "sources";
    example: r#""swell": Adsr(gate: "stylus.force", attack_ms: 20, release_ms: 200)"#;
    in GATE: Scalar = Port::any("The gate is open while this is above zero.");
    out OUTPUT: Scalar = Port::of(Quantity::NUMBER, "0 to 1.");
}

impl NodeKind for Adsr {
    fn build(settings: AdsrSettings, cx: &BuildContext) -> Result<Built<Self>, BuildError> {
        Ok(Built::new(Envelope { settings, tick_ms: 1e3 / cx.rate.hz(), level: 0.0, stage: Stage::Closed }))
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Stage {
    Closed,
    Rising,
    Settling,
}

#[derive(Debug, Clone)]
struct Envelope {
    settings: AdsrSettings,
    tick_ms: f64,
    level: f64,
    stage: Stage,
}

impl Envelope {
    fn next(&mut self, is_open: bool) -> f64 {
        let AdsrSettings { attack_ms, decay_ms, sustain, release_ms } = self.settings;
        self.stage = match (is_open, self.stage) {
            (false, _) => Stage::Closed,
            (true, Stage::Closed) => Stage::Rising,
            (true, Stage::Rising) if self.level >= 1.0 => Stage::Settling,
            (true, stage) => stage,
        };
        // The step of a segment of zero duration is infinite; the level is clamped.
        self.level = match self.stage {
            Stage::Closed => (self.level - self.tick_ms / release_ms.0).max(0.0),
            Stage::Rising => (self.level + self.tick_ms / attack_ms.0).min(1.0),
            Stage::Settling if self.level > sustain => (self.level - self.tick_ms / decay_ms.0).max(sustain),
            Stage::Settling => (self.level + self.tick_ms / decay_ms.0).min(sustain),
        };
        self.level
    }
}

impl Processor<Adsr> for Envelope {
    fn process(&mut self, _: &Tick, io: &mut Io<'_, Adsr>) {
        let gate = io.read(Adsr::GATE);
        for (y, gate) in io.write(Adsr::OUTPUT).iter_mut().zip(gate) {
            *y = self.next(*gate > 0.0);
        }
    }

    fn set(&mut self, setting: LiveId<AdsrSettings>, value: f64) {
        match setting {
            AdsrSettings::attack_ms => self.settings.attack_ms = Milliseconds::of_si(value),
            AdsrSettings::decay_ms => self.settings.decay_ms = Milliseconds::of_si(value),
            AdsrSettings::sustain => self.settings.sustain = value,
            AdsrSettings::release_ms => self.settings.release_ms = Milliseconds::of_si(value),
            _ => {}
        }
    }

    fn copy_state_into(&self, new: &mut Self) {
        (new.level, new.stage) = (self.level, self.stage);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptograph_engine::frame::Kind;
    use haptograph_engine::testing::Bench;

    #[test]
    fn the_phase_of_a_rising_frequency_is_its_integral() {
        let settings = PhaseSettings { start_deg: Degrees(90.0) };
        let mut bench = Bench::new::<Phase>(settings, 100.0, &[Kind::SCALAR]).unwrap();
        let sweep: Vec<f64> = (0..300).map(|i| f64::from(i) * 0.1).collect();
        let phase = bench.run(&[&sweep]).remove(0);
        for (i, phase) in phase.iter().enumerate() {
            let turns = 0.25 + 0.1 * (i * i.saturating_sub(1)) as f64 / 2.0 / 100.0;
            let apart = (phase - turns).rem_euclid(1.0);
            assert!(apart.min(1.0 - apart) < 1e-9 && (0.0..1.0).contains(phase), "{i}");
        }
        let backwards = bench.run(&[&[-1e-20, f64::NAN, -10.0, -10.0]]).remove(0);
        assert!(backwards.iter().all(|phase| (0.0..1.0).contains(phase)), "{backwards:?}");
    }

    fn envelope(settings: AdsrSettings, gate: &[f64]) -> Vec<f64> {
        let mut bench = Bench::new::<Adsr>(settings, 1000.0, &[Kind::SCALAR]).unwrap();
        bench.run(&[gate]).remove(0)
    }

    #[test]
    fn an_envelope_rises_settles_stays_and_falls() {
        let settings = AdsrSettings {
            attack_ms: Milliseconds(4.0),
            decay_ms: Milliseconds(8.0),
            sustain: 0.75,
            release_ms: Milliseconds(4.0),
        };
        let gate: Vec<f64> = (0..14).map(|i| if i < 9 { 0.3 } else { 0.0 }).collect();
        let expected = [0.25, 0.5, 0.75, 1.0, 0.875, 0.75, 0.75, 0.75, 0.75, 0.5, 0.25, 0.0, 0.0, 0.0];
        assert_eq!(envelope(settings, &gate), expected);
    }

    #[test]
    fn an_envelope_of_no_time_jumps_and_one_that_opens_again_goes_on() {
        let at_once = AdsrSettings {
            attack_ms: Milliseconds(0.0),
            decay_ms: Milliseconds(0.0),
            sustain: 1.0,
            release_ms: Milliseconds(0.0),
        };
        assert_eq!(envelope(at_once, &[1.0, 1.0, 0.0, f64::NAN]), [1.0, 1.0, 0.0, 0.0]);
        let slow = AdsrSettings {
            attack_ms: Milliseconds(4.0),
            decay_ms: Milliseconds(1.0),
            sustain: 1.0,
            release_ms: Milliseconds(8.0),
        };
        assert_eq!(envelope(slow, &[1.0, 1.0, 0.0, 1.0]), [0.25, 0.5, 0.375, 0.625]);
    }
}
