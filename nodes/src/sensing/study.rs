//! Nodes of the studies of chapter 4: four conditions of responsiveness, a warning of too much
//! force, and the time spent in each quadrant.

use haptograph_engine::frame::Scalar;
use haptograph_engine::node::{BuildContext, BuildError, Built, Io, LiveId, NodeKind, Port, Processor, Tick};
use haptograph_signal::quantity::Quantity;
use haptograph_signal::units::MillimetresPerSecond;

haptograph_engine::choices! {
    /// The inputs that a texture responds to (Table 4.1).
    pub enum Condition {
        /// Both (FS).
        ForceAndSpeed,
        /// Force only; the speed is constant (F).
        Force,
        /// Speed only; the force is constant (S).
        Speed,
        /// Neither (phi).
        Neither,
    }
}

haptograph_engine::settings! {
    /// Settings of [`Responsiveness`].
    pub struct ResponsivenessSettings {
        /// The inputs that the texture responds to.
        condition: Condition = Condition::ForceAndSpeed;
        /// Constant speed if it does not respond to speed, mm/s.
        [live] constant_mm_s: MillimetresPerSecond = MillimetresPerSecond(130.0), in 0.0..=10_000.0;
        /// Constant force if it does not respond to force, N.
        [live] constant_n: f64 = 1.2, in 0.0..=1000.0;
        /// Speed below which the hand is at rest if the texture does not respond to speed, mm/s.
        [live] rest_mm_s: MillimetresPerSecond = MillimetresPerSecond(1.0), in 0.0..=10_000.0;
    }
}

haptograph_engine::node! {
    /// The four rendering conditions of the study on responsiveness: force or speed or both are replaced by constants.
    /// There is no texture at rest or without force.
    pub struct Responsiveness(ResponsivenessSettings) in "sensing";
    source: "4.5.2, Table 4.1";
    example: r#""felt": Responsiveness(speed: "speed.speed", force: "normal.load", condition: Speed)"#;
    in SPEED: Scalar = Port::of(Quantity::SPEED, "Speed along the surface, m/s.");
    in FORCE: Scalar = Port::of(Quantity::FORCE, "Normal force, N.");
    out SPEED_TO_RENDER as "speed": Scalar = Port::of(Quantity::SPEED, "Speed to render, m/s.");
    out FORCE_TO_RENDER as "force": Scalar = Port::of(Quantity::FORCE, "Force to render, N.");
}

impl NodeKind for Responsiveness {
    fn build(settings: ResponsivenessSettings, _: &BuildContext) -> Result<Built<Self>, BuildError> {
        let (constant_m_s, constant_n) = (settings.constant_mm_s.si(), settings.constant_n);
        let (speed_m_s, force_n) = match settings.condition {
            Condition::ForceAndSpeed => (None, None),
            Condition::Force => (Some(constant_m_s), None),
            Condition::Speed => (None, Some(constant_n)),
            Condition::Neither => (Some(constant_m_s), Some(constant_n)),
        };
        Ok(Built::new(Responding { speed_m_s, force_n, rest_m_s: settings.rest_mm_s.si() }))
    }
}

/// Constants that replace the hand's speed and force.
#[derive(Debug, Clone)]
struct Responding {
    speed_m_s: Option<f64>,
    force_n: Option<f64>,
    rest_m_s: f64,
}

impl Processor<Responsiveness> for Responding {
    fn process(&mut self, _: &Tick, io: &mut Io<'_, Responsiveness>) {
        let (speeds, forces) = (io.read(Responsiveness::SPEED), io.read(Responsiveness::FORCE));
        let (speed, force) = io.write_all((Responsiveness::SPEED_TO_RENDER, Responsiveness::FORCE_TO_RENDER));
        for (((speed, force), &v), &f) in speed.iter_mut().zip(force).zip(speeds).zip(forces) {
            *speed = match self.speed_m_s {
                Some(constant) if v >= self.rest_m_s => constant,
                Some(_) => 0.0,
                None => v,
            };
            *force = match self.force_n {
                Some(constant) if f > 0.0 => constant,
                Some(_) => 0.0,
                None => f,
            };
        }
    }

    fn set(&mut self, setting: LiveId<ResponsivenessSettings>, value: f64) {
        // Inputs that it responds to do not change.
        match setting {
            ResponsivenessSettings::constant_mm_s => self.speed_m_s = self.speed_m_s.map(|_| value),
            ResponsivenessSettings::constant_n => self.force_n = self.force_n.map(|_| value),
            ResponsivenessSettings::rest_mm_s => self.rest_m_s = value,
            _ => {}
        }
    }
}

haptograph_engine::settings! {
    /// Settings of [`ForceWarning`].
    pub struct ForceWarningSettings {
        /// Threshold of the warning, N.
        [live] above_n: f64 = 2.75, in 0.0..=1000.0;
        /// Hold time of the warning, s, so that an eye can see it.
        hold_s: f64 = 0.1, in 0.0..=60.0;
    }
}

haptograph_engine::node! {
    /// Warns when the hand presses harder than the arm can render.
    pub struct ForceWarning(ForceWarningSettings) in "sensing";
    source: "4.5.1";
    example: r#""hard": ForceWarning(force: "normal.load", above_n: 2.75)"#;
    in FORCE: Scalar = Port::of(Quantity::FORCE, "Normal force, N.");
    out WARNING: Scalar = Port::of(Quantity::NUMBER, "1 while it warns, else 0.");
}

impl NodeKind for ForceWarning {
    fn build(settings: ForceWarningSettings, cx: &BuildContext) -> Result<Built<Self>, BuildError> {
        Ok(Built::new(Warning {
            above_n: settings.above_n,
            hold: (settings.hold_s * cx.rate.hz()).round() as u64,
            left: 0,
        }))
    }
}

#[derive(Debug, Clone)]
struct Warning {
    above_n: f64,
    /// Ticks left of the hold time.
    hold: u64,
    left: u64,
}

impl Processor<ForceWarning> for Warning {
    fn process(&mut self, _: &Tick, io: &mut Io<'_, ForceWarning>) {
        let forces = io.read(ForceWarning::FORCE);
        for (warning, force) in io.write(ForceWarning::WARNING).iter_mut().zip(forces) {
            let over = *force > self.above_n;
            self.left = if over { self.hold } else { self.left.saturating_sub(1) };
            *warning = f64::from(u8::from(over || self.left > 0));
        }
    }

    fn set(&mut self, setting: LiveId<ForceWarningSettings>, value: f64) {
        if setting == ForceWarningSettings::above_n {
            self.above_n = value;
        }
    }

    fn copy_state_into(&self, new: &mut Self) {
        new.left = self.left.min(new.hold);
    }
}

haptograph_engine::settings! {
    /// Settings of [`QuadrantDwell`].
    pub struct QuadrantDwellSettings {
        /// Speed between slow and fast, mm/s.
        [live] centre_mm_s: MillimetresPerSecond = MillimetresPerSecond(130.0), in 0.0..=10_000.0;
        /// Force between light and hard, N.
        [live] centre_n: f64 = 1.2, in 0.0..=1000.0;
        /// Speed below which the hand is at rest and no time counts, mm/s.
        [live] rest_mm_s: MillimetresPerSecond = MillimetresPerSecond(1.0), in 0.0..=10_000.0;
    }
}

haptograph_engine::node! {
    /// Time that the hand has slid in each quadrant of force and speed. The study required 5 s in each.
    pub struct QuadrantDwell(QuadrantDwellSettings) in "sensing";
    source: "4.5.2";
    example: r#""dwell": QuadrantDwell(speed: "speed.speed", force: "normal.load")"#;
    in SPEED: Scalar = Port::of(Quantity::SPEED, "Speed along the surface, m/s.");
    in FORCE: Scalar = Port::of(Quantity::FORCE, "Normal force, N.");
    out SLOW_LIGHT: Scalar = Port::of(Quantity::TIME, "Time slow and light, s.");
    out FAST_LIGHT: Scalar = Port::of(Quantity::TIME, "Time fast and light, s.");
    out SLOW_HARD: Scalar = Port::of(Quantity::TIME, "Time slow and hard, s.");
    out FAST_HARD: Scalar = Port::of(Quantity::TIME, "Time fast and hard, s.");
}

impl NodeKind for QuadrantDwell {
    fn build(settings: QuadrantDwellSettings, cx: &BuildContext) -> Result<Built<Self>, BuildError> {
        Ok(Built::new(Dwelling {
            centre_m_s: settings.centre_mm_s.si(),
            centre_n: settings.centre_n,
            rest_m_s: settings.rest_mm_s.si(),
            period_s: cx.rate.period_s(),
            ticks: [0; 4],
        }))
    }
}

#[derive(Debug, Clone)]
struct Dwelling {
    centre_m_s: f64,
    centre_n: f64,
    rest_m_s: f64,
    period_s: f64,
    /// Ticks in each quadrant, in the order of the outputs.
    ticks: [u64; 4],
}

impl Processor<QuadrantDwell> for Dwelling {
    fn process(&mut self, _: &Tick, io: &mut Io<'_, QuadrantDwell>) {
        let (speeds, forces) = (io.read(QuadrantDwell::SPEED), io.read(QuadrantDwell::FORCE));
        let (slow_light, fast_light, slow_hard, fast_hard) = io.write_all((
            QuadrantDwell::SLOW_LIGHT,
            QuadrantDwell::FAST_LIGHT,
            QuadrantDwell::SLOW_HARD,
            QuadrantDwell::FAST_HARD,
        ));
        for (frame, (speed, force)) in speeds.iter().zip(forces).enumerate() {
            if *speed >= self.rest_m_s && *force > 0.0 {
                let (fast, hard) = (*speed >= self.centre_m_s, *force >= self.centre_n);
                self.ticks[usize::from(fast) + 2 * usize::from(hard)] += 1;
            }
            let dwell_s = self.ticks.map(|ticks| ticks as f64 * self.period_s);
            [slow_light[frame], fast_light[frame], slow_hard[frame], fast_hard[frame]] = dwell_s;
        }
    }

    fn set(&mut self, setting: LiveId<QuadrantDwellSettings>, value: f64) {
        match setting {
            QuadrantDwellSettings::centre_mm_s => self.centre_m_s = value,
            QuadrantDwellSettings::centre_n => self.centre_n = value,
            QuadrantDwellSettings::rest_mm_s => self.rest_m_s = value,
            _ => {}
        }
    }

    fn copy_state_into(&self, new: &mut Self) {
        new.ticks = self.ticks;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptograph_engine::frame::Kind;
    use haptograph_engine::testing::Bench;

    const BOTH: [Kind; 2] = [Kind::SCALAR; 2];

    #[test]
    fn the_four_conditions_of_table_4_1() {
        let run = |condition| {
            let settings = ResponsivenessSettings {
                condition,
                constant_mm_s: MillimetresPerSecond(130.0),
                constant_n: 1.2,
                rest_mm_s: MillimetresPerSecond(1.0),
            };
            let mut bench = Bench::new::<Responsiveness>(settings, 1000.0, &BOTH).unwrap();
            // Sliding; creeping below 1 mm/s; in the air.
            bench.run(&[&[0.08, 0.0009, 0.2], &[0.5, 0.5, 0.0]])
        };
        assert_eq!(run(Condition::ForceAndSpeed), [[0.08, 0.0009, 0.2], [0.5, 0.5, 0.0]]);
        assert_eq!(run(Condition::Force), [[0.13, 0.0, 0.13], [0.5, 0.5, 0.0]]);
        assert_eq!(run(Condition::Speed), [[0.08, 0.0009, 0.2], [1.2, 1.2, 0.0]]);
        assert_eq!(run(Condition::Neither), [[0.13, 0.0, 0.13], [1.2, 1.2, 0.0]]);
    }

    #[test]
    fn a_warning_can_be_seen() {
        let settings = ForceWarningSettings { above_n: 2.75, hold_s: 0.002 };
        let mut bench = Bench::new::<ForceWarning>(settings, 1000.0, &[Kind::SCALAR]).unwrap();
        let warning = bench.run(&[&[2.75, 2.8, 1.0, 1.0, 1.0, f64::NAN]]).remove(0);
        assert_eq!(warning, [0.0, 1.0, 1.0, 0.0, 0.0, 0.0]);
    }

    #[test]
    fn time_is_counted_in_the_quadrant_of_the_hand_and_not_at_rest() {
        let settings = QuadrantDwellSettings {
            centre_mm_s: MillimetresPerSecond(130.0),
            centre_n: 1.2,
            rest_mm_s: MillimetresPerSecond(1.0),
        };
        let mut bench = Bench::new::<QuadrantDwell>(settings, 1000.0, &BOTH).unwrap();
        let out = bench.run(&[&[0.1, 0.2, 0.2, 0.1, 0.0, 0.2], &[1.0, 1.0, 2.0, 2.0, 2.0, 0.0]]);
        let last: Vec<f64> = out.iter().map(|dwell| dwell[5]).collect();
        assert_eq!(last, [0.001; 4]);
    }
}
