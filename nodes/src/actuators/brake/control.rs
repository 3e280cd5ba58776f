//! Control of the brake (5.5.4): current by the experimental line, with a slow correction by the measured friction.

use super::solenoid::{self, Solenoid};
use super::thermal::{CoilSettings, CoilThermal};

/// Settings of the control.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BrakeSettings {
    /// Largest current, A.
    pub most_current_a: f64,
    /// Gain of the correction, 1/s: an error shrinks by this fraction per second. Zero: open loop, as in the thesis.
    pub trim_per_s: f64,
    /// Largest correction of the coefficient of friction.
    pub most_trim: f64,
    /// Normal force below which friction is not measured, N.
    pub least_normal_n: f64,
    /// Speed below which friction is not measured, m/s.
    pub least_speed_m_s: f64,
    /// The solenoid and its experimental line.
    pub solenoid: Solenoid,
    /// The coil.
    pub coil: CoilSettings,
}

impl Default for BrakeSettings {
    fn default() -> Self {
        Self {
            most_current_a: solenoid::MAX_CURRENT_A,
            trim_per_s: 2.0,
            most_trim: 0.2,
            least_normal_n: 0.2,
            least_speed_m_s: 0.005,
            solenoid: Solenoid::THESIS,
            coil: CoilSettings::default(),
        }
    }
}

/// Measurements of a tick.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Dragging {
    /// Normal force, N.
    pub normal_n: f64,
    /// Friction, N.
    pub friction_n: f64,
    /// Speed along the surface, m/s.
    pub speed_m_s: f64,
}

/// Result of comparing the requested friction with the brake's range.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reach {
    /// The requested friction can be rendered.
    Within,
    /// The pen's own friction is higher.
    BelowFreePen,
    /// The current would exceed its limit: press less.
    CurrentLimit,
    /// The plunger would push the ball off its bearings.
    PlungerLimit,
    /// The correction is at its limit: the pen differs from the experimental line.
    TrimLimit,
    /// The coil is too hot; the current is zero until it has cooled.
    TooHot,
}

/// Output of the control at a tick.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BrakeCommand {
    /// Current, A.
    pub current_a: f64,
    /// Whether the requested friction can be rendered.
    pub reach: Reach,
    /// Measured effective friction (over about 0.1 s), if there is a measurement.
    pub measured: Option<f64>,
    /// Correction of the coefficient of friction.
    pub trim: f64,
}

/// The control of one brake. Never allocates.
#[derive(Debug, Clone)]
pub struct Brake {
    settings: BrakeSettings,
    period_s: f64,
    coil: CoilThermal,
    trim: f64,
    /// Friction and normal force, low-passed while dragging, N.
    dragged_n: [f64; 2],
    /// Direction in which a larger correction has no effect.
    stuck: f64,
}

/// Time over which friction is measured, s.
const MEASURED_S: f64 = 0.1;

impl Brake {
    /// A brake with zero current and a cold coil, for ticks at `rate_hz`.
    pub fn new(settings: BrakeSettings, rate_hz: f64) -> Self {
        let coil = CoilThermal::new(settings.coil);
        Self { settings, period_s: 1.0 / rate_hz, coil, trim: 0.0, dragged_n: [0.0; 2], stuck: 0.0 }
    }

    /// Takes over the state of another control.
    pub fn copy_state_from(&mut self, other: &Self) {
        self.coil.copy_state_from(&other.coil);
        (self.trim, self.dragged_n, self.stuck) = (other.trim, other.dragged_n, other.stuck);
    }

    /// Computes one tick: the current for a requested coefficient of friction. If a measurement is not finite the current is zero.
    pub(crate) fn update(&mut self, wanted: f64, dragging: &Dragging) -> BrakeCommand {
        let usable = [wanted, dragging.normal_n, dragging.friction_n, dragging.speed_m_s]
            .iter()
            .all(|x| x.is_finite());
        let measured = if usable { self.measure(dragging) } else { None };
        if let Some(measured) = measured {
            self.correct(wanted - measured);
        }
        let normal_n = if usable { dragging.normal_n.max(0.0) } else { 0.0 };
        let (current_a, reach) = self.drive(if usable { wanted } else { 0.0 }, normal_n);
        self.coil.advance(current_a, self.period_s);
        BrakeCommand { current_a, reach, measured, trim: self.trim }
    }

    /// The settings, which may change from tick to tick; those of the coil have no effect after the start.
    pub(crate) fn settings_mut(&mut self) -> &mut BrakeSettings {
        &mut self.settings
    }

    /// The coil.
    pub(crate) fn coil(&self) -> &CoilThermal {
        &self.coil
    }

    fn measure(&mut self, dragging: &Dragging) -> Option<f64> {
        let moving = dragging.normal_n >= self.settings.least_normal_n
            && dragging.speed_m_s >= self.settings.least_speed_m_s;
        if !moving {
            return None;
        }
        let weight = 1.0 - (-self.period_s / MEASURED_S).exp();
        let now_n = [dragging.friction_n, dragging.normal_n];
        for (kept, now) in self.dragged_n.iter_mut().zip(now_n) {
            *kept += weight * (now - *kept);
        }
        // Without load the coefficient of friction is undefined.
        (self.dragged_n[1] > 0.0).then(|| self.dragged_n[0] / self.dragged_n[1])
    }

    fn correct(&mut self, error: f64) {
        // At a limit the correction stops (anti-windup).
        if error * self.stuck <= 0.0 {
            let most = self.settings.most_trim;
            self.trim = (self.trim + self.settings.trim_per_s * self.period_s * error).clamp(-most, most);
        }
    }

    fn drive(&mut self, wanted: f64, normal_n: f64) -> (f64, Reach) {
        // Settings may have changed, or be those of another graph, since the last measurement.
        let most = self.settings.most_trim;
        self.trim = self.trim.clamp(-most, most);
        if self.settings.trim_per_s <= 0.0 {
            self.trim -= self.trim * (self.period_s / MEASURED_S).min(1.0);
        }
        let solenoid = &self.settings.solenoid;
        let phi = solenoid.experimental_phi(wanted + self.trim);
        let plunger_n = phi.min(1.0) * normal_n;
        let asked_a = solenoid.current_a(plunger_n);
        let current_a = asked_a.min(self.settings.most_current_a);
        let reach = if self.coil.is_tripped() {
            Reach::TooHot
        } else if asked_a > self.settings.most_current_a {
            Reach::CurrentLimit
        } else if phi > 1.0 {
            Reach::PlungerLimit
        } else if normal_n > self.settings.least_normal_n && plunger_n < solenoid.plunger_n {
            Reach::BelowFreePen
        } else if self.trim.abs() >= self.settings.most_trim && self.settings.trim_per_s > 0.0 {
            Reach::TrimLimit
        } else {
            Reach::Within
        };
        self.stuck = match reach {
            Reach::TooHot | Reach::CurrentLimit | Reach::PlungerLimit => 1.0,
            Reach::BelowFreePen => -1.0,
            Reach::Within | Reach::TrimLimit => 0.0,
        };
        (if reach == Reach::TooHot { 0.0 } else { current_a }, reach)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn open_loop() -> Brake {
        Brake::new(BrakeSettings { trim_per_s: 0.0, ..BrakeSettings::default() }, 1000.0)
    }

    fn drag(normal_n: f64, friction_n: f64) -> Dragging {
        Dragging { normal_n, friction_n, speed_m_s: 0.05 }
    }

    #[test]
    fn open_loop_current_is_eq_5_5_12() {
        for (mu, normal_n) in [(0.3, 1.0), (0.45, 2.0), (0.52, 2.6)] {
            let command = open_loop().update(mu, &drag(normal_n, 0.0));
            let expected = (((2.92 * mu - 0.56) * normal_n - 0.042) / 27.8_f64).sqrt();
            assert!((command.current_a - expected).abs() < 1e-15);
            assert_eq!(command.reach, Reach::Within);
        }
    }

    #[test]
    fn the_brake_says_when_it_cannot() {
        let reach = |mu, normal_n| {
            let command = open_loop().update(mu, &drag(normal_n, 0.0));
            assert!(command.current_a <= 0.3);
            command.reach
        };
        assert_eq!(reach(0.5, 5.0), Reach::CurrentLimit);
        assert_eq!(reach(0.6, 0.5), Reach::PlungerLimit);
        assert_eq!(reach(0.15, 1.0), Reach::BelowFreePen);
        assert_eq!(open_loop().update(0.15, &drag(1.0, 0.0)).current_a, 0.0);
        assert_eq!(reach(0.35, 5.0), Reach::Within);
    }

    #[test]
    fn a_correction_ends_with_its_settings() {
        let corrected = || {
            let settings = BrakeSettings { trim_per_s: 1.0, most_trim: 0.2, ..BrakeSettings::default() };
            let mut brake = Brake::new(settings, 1000.0);
            (0..2000).for_each(|_| {
                brake.update(0.4, &drag(1.0, 0.1));
            });
            assert!(brake.trim > 0.1, "{}", brake.trim);
            brake
        };
        // The pen rests: nothing is measured, and so nothing corrected.
        let rest = Dragging { speed_m_s: 0.0, ..drag(1.0, 0.0) };
        let mut bounded = corrected();
        bounded.settings_mut().most_trim = 0.0;
        assert_eq!(bounded.update(0.4, &rest).trim, 0.0);
        let mut open = corrected();
        let before = open.trim;
        open.settings_mut().trim_per_s = 0.0;
        let next = open.update(0.4, &rest).trim;
        assert!(next < before && next > 0.9 * before, "it fades: {before}, {next}");
        (0..2000).for_each(|_| {
            open.update(0.4, &rest);
        });
        assert!(open.trim < 1e-6, "{}", open.trim);
    }

    #[test]
    fn a_hot_coil_rests() {
        let coil = CoilSettings { trip_c: 25.5, ..CoilSettings::default() };
        let mut brake = Brake::new(BrakeSettings { coil, ..BrakeSettings::default() }, 1000.0);
        let rested =
            (0..10_000).map(|_| brake.update(0.5, &drag(2.0, 0.8))).find(|c| c.reach == Reach::TooHot);
        assert_eq!(rested.map(|c| c.current_a), Some(0.0));
    }

    #[test]
    fn the_correction_waits_at_a_limit_and_without_motion() {
        let mut brake = Brake::new(BrakeSettings::default(), 1000.0);
        (0..5000).for_each(|_| {
            brake.update(0.5, &drag(5.0, 1.0));
        });
        assert!(brake.trim < 0.01, "no winding up at the current's limit: {}", brake.trim);
        let mut brake = Brake::new(BrakeSettings::default(), 1000.0);
        (0..5000).for_each(|_| {
            let still = Dragging { speed_m_s: 0.001, ..drag(1.0, 0.1) };
            assert_eq!(brake.update(0.4, &still).measured, None);
        });
        assert_eq!(brake.trim, 0.0);
    }

    #[test]
    fn a_fault_leaves_the_brake_off() {
        let mut brake = Brake::new(BrakeSettings::default(), 1000.0);
        brake.update(0.4, &drag(1.0, 0.3));
        let command = brake.update(0.4, &drag(f64::NAN, 0.3));
        assert_eq!((command.current_a, command.measured), (0.0, None));
        assert!(brake.update(0.4, &drag(1.0, 0.3)).measured.is_some_and(f64::is_finite));
    }
}
