//! The node that controls the pen's friction brake, and the sink that drives it.

use super::brake::{Brake, BrakeSettings, CoilSettings, Dragging, Reach, Solenoid};
use super::limit::CurrentLimitSettings;
use crate::texture::load_surface;
use crate::vector::norm;
use haptograph_engine::frame::{Scalar, Vector};
use haptograph_engine::node::{
    ActuatorKind, BuildContext, BuildError, Built, Io, Limit, LiveId, NodeKind, OutputRole, Port, Processor,
    Tick,
};
use haptograph_signal::quantity::Quantity;
use haptograph_signal::units::MillimetresPerSecond;
use std::path::PathBuf;

haptograph_engine::settings! {
    /// Settings of [`BrakeController`].
    pub struct BrakeControllerSettings {
        /// Surface file with the requested coefficient of friction, relative to the graph file.
        surface: Option<PathBuf> = None;
        /// Requested coefficient of friction; replaces the surface's.
        [live] mu: Option<f64> = None, in 0.0..=2.0;
        /// Gain of the correction by the measured friction, 1/s; zero: open loop, as in the thesis.
        [live] trim_per_s: f64 = BrakeSettings::default().trim_per_s, in 0.0..=100.0;
        /// Largest correction of the coefficient.
        [live] most_trim: f64 = BrakeSettings::default().most_trim, in 0.0..=2.0;
        /// Largest current, A.
        [live] most_current_a: f64 = BrakeSettings::default().most_current_a, in 0.0..=100.0;
        /// Normal force below which friction is not measured, N.
        [live] least_load_n: f64 = BrakeSettings::default().least_normal_n, in 0.0..=100.0;
        /// Speed below which friction is not measured, mm/s.
        [live] least_speed_mm_s: MillimetresPerSecond = MillimetresPerSecond::of_si(BrakeSettings::default().least_speed_m_s), in 0.0..=10_000.0;
        /// The pen's experimental line: plunger force by normal force per coefficient of friction (Eq. 5.5.12).
        [live] line_slope: f64 = Solenoid::THESIS.line_slope, in 1e-3..=1000.0;
        /// The line at a coefficient of zero (Eq. 5.5.12).
        [live] line_offset: f64 = Solenoid::THESIS.line_offset, in -100.0..=100.0;
        /// Force of the solenoid by current squared, N/A2 (Eq. 5.5.10).
        [live] force_n_per_a2: f64 = Solenoid::THESIS.force_n_per_a2, in 1e-3..=1e6;
        /// Weight of the plunger, the least force on the ball, N.
        [live] plunger_n: f64 = Solenoid::THESIS.plunger_n, in 0.0..=100.0;
        /// The coil's resistance and its thermal model.
        coil: CoilSettings = CoilSettings::default();
    }
}

impl BrakeControllerSettings {
    fn to_brake(&self) -> BrakeSettings {
        BrakeSettings {
            most_current_a: self.most_current_a,
            trim_per_s: self.trim_per_s,
            most_trim: self.most_trim,
            least_normal_n: self.least_load_n,
            least_speed_m_s: self.least_speed_mm_s.si(),
            solenoid: Solenoid {
                line_slope: self.line_slope,
                line_offset: self.line_offset,
                force_n_per_a2: self.force_n_per_a2,
                plunger_n: self.plunger_n,
            },
            coil: self.coil,
        }
    }
}

haptograph_engine::node! {
    /// The brake current that makes the pen drag like a surface of a requested friction: by the experimental line, with a
    /// slow correction by the measured friction. It reports whether the requested friction can be rendered, and outputs
    /// zero while the modelled coil is too hot.
    pub struct BrakeController(BrakeControllerSettings) in "actuators";
    source: "5.5, Eq. 5.5.9, 5.5.10 and 5.5.12";
    example: r#""brake": BrakeController(load: "touch.load", friction: "touch.friction", speed: "speed.speed", surface: "surfaces/t3-tile.ron")"#;
    in LOAD: Scalar = Port::of(Quantity::FORCE, "Normal force, N.");
    in FRICTION: Vector = Port::of(Quantity::FORCE, "Measured friction, N.");
    in SPEED: Scalar = Port::of(Quantity::SPEED, "Speed along the surface, m/s.");
    out CURRENT: Scalar = Port::of(Quantity::CURRENT, "Current for the brake, A.");
    out MEASURED: Scalar =
        Port::of(Quantity::NUMBER, "Measured coefficient of friction; it holds its last value at rest.")
            .with_role(OutputRole::FrictionCoefficient);
    out TRIM: Scalar = Port::of(Quantity::NUMBER, "Correction of the coefficient.");
    out REACH: Scalar =
        Port::of(Quantity::NUMBER, "0: the requested friction can be rendered; else why it cannot.")
            .with_role(OutputRole::Shortfall(&[
                "the free pen has more than the requested friction",
                "the current was at its limit",
                "the plunger would have lifted the ball",
                "the correction of the friction was at its limit",
                "the coil was too hot",
            ]));
    out COIL: Scalar = Port::of(Quantity::TEMPERATURE, "Modelled temperature of the coil, K.");
}

impl NodeKind for BrakeController {
    fn build(settings: BrakeControllerSettings, cx: &BuildContext) -> Result<Built<Self>, BuildError> {
        if settings.coil.rearm_c > settings.coil.trip_c || settings.coil.ambient_c >= settings.coil.rearm_c {
            let message = "`rearm_c` has to lie above `ambient_c` and no higher than `trip_c`";
            return Err(BuildError::at("coil", message).help("give ambient_c < rearm_c <= trip_c"));
        }
        Ok(Built::new(Braking {
            brake: Brake::new(settings.to_brake(), cx.rate.hz()),
            wanted: wanted(&settings)?,
            measured: 0.0,
        }))
    }

    fn advice(settings: &BrakeControllerSettings, _: &BuildContext) -> Vec<BuildError> {
        let (Ok(mu), [least, most]) = (wanted(settings), settings.to_brake().solenoid.friction_range())
        else {
            return Vec::new();
        };
        if (least..=most).contains(&mu) {
            return Vec::new();
        }
        let message = format!(
            "the requested coefficient of friction is {}; by its experimental line this brake renders {least:.2} to {most:.2}",
            (mu * 1e3).round() / 1e3
        );
        let field = if settings.mu.is_some() { "mu" } else { "surface" };
        vec![BuildError::at(field, message).help(
            "request one within that range, or state `line_slope` and `line_offset` as measured on your pen",
        )]
    }
}

fn wanted(settings: &BrakeControllerSettings) -> Result<f64, BuildError> {
    if let Some(mu) = settings.mu {
        return Ok(mu);
    }
    let Some(path) = &settings.surface else {
        return Err(BuildError::at("mu", "the requested friction is missing")
            .help("give `mu` or a `surface` that has one"));
    };
    let surface = load_surface(path)?;
    surface.friction.map(|friction| friction.mu()).ok_or_else(|| {
        let message = format!("the surface {} has no friction", surface.name);
        BuildError::at("surface", message).help("give `mu`")
    })
}

#[derive(Debug, Clone)]
struct Braking {
    brake: Brake,
    wanted: f64,
    measured: f64,
}

impl Processor<BrakeController> for Braking {
    fn process(&mut self, _: &Tick, io: &mut Io<'_, BrakeController>) {
        let (loads, frictions) = (io.read(BrakeController::LOAD), io.read(BrakeController::FRICTION));
        let speeds = io.read(BrakeController::SPEED);
        let (current, measured, trim, reach, coil) = io.write_all((
            BrakeController::CURRENT,
            BrakeController::MEASURED,
            BrakeController::TRIM,
            BrakeController::REACH,
            BrakeController::COIL,
        ));
        for (frame, ((load, friction), speed)) in loads.iter().zip(frictions).zip(speeds).enumerate() {
            let dragging = Dragging { normal_n: *load, friction_n: norm(*friction), speed_m_s: *speed };
            let command = self.brake.update(self.wanted, &dragging);
            self.measured = command.measured.unwrap_or(self.measured);
            current[frame] = command.current_a;
            measured[frame] = self.measured;
            trim[frame] = command.trim;
            reach[frame] = match command.reach {
                Reach::Within => 0.0,
                Reach::BelowFreePen => 1.0,
                Reach::CurrentLimit => 2.0,
                Reach::PlungerLimit => 3.0,
                Reach::TrimLimit => 4.0,
                Reach::TooHot => 5.0,
            };
            coil[frame] = self.brake.coil().coil_c() + 273.15;
        }
    }

    fn set(&mut self, setting: LiveId<BrakeControllerSettings>, value: f64) {
        let brake = self.brake.settings_mut();
        match setting {
            BrakeControllerSettings::mu => self.wanted = value,
            BrakeControllerSettings::trim_per_s => brake.trim_per_s = value,
            BrakeControllerSettings::most_trim => brake.most_trim = value,
            BrakeControllerSettings::most_current_a => brake.most_current_a = value,
            BrakeControllerSettings::least_load_n => brake.least_normal_n = value,
            BrakeControllerSettings::least_speed_mm_s => brake.least_speed_m_s = value,
            BrakeControllerSettings::line_slope => brake.solenoid.line_slope = value,
            BrakeControllerSettings::line_offset => brake.solenoid.line_offset = value,
            BrakeControllerSettings::force_n_per_a2 => brake.solenoid.force_n_per_a2 = value,
            BrakeControllerSettings::plunger_n => brake.solenoid.plunger_n = value,
            _ => {}
        }
    }

    fn copy_state_into(&self, new: &mut Self) {
        new.brake.copy_state_from(&self.brake);
        new.measured = self.measured;
    }
}

haptograph_engine::settings! {
    /// Settings of [`BrakeSink`].
    pub struct BrakeSinkSettings {
        /// Limit of the solenoid.
        [limit] limit: CurrentLimitSettings;
    }
}

haptograph_engine::node! {
    /// Drives the solenoid of the pen's brake by current, within limits that the graph has to state.
    pub struct BrakeSink(BrakeSinkSettings) in "sinks";
    source: "5.5";
    example: r#""hold": BrakeSink(brake: "brake.current", endpoint: "pen", limit: (peak_a: 0.3, continuous_a: 0.3))"#;
    in BRAKE: Scalar = Port::of(Quantity::CURRENT, "Requested current, A.");
    out DELIVERED: Scalar = Port::of(Quantity::CURRENT, "Current after the limit, A.");
}

impl ActuatorKind for BrakeSink {
    fn limit(settings: &BrakeSinkSettings) -> Result<(f64, Limit), BuildError> {
        // The controller's thermal model would not include a gain here.
        Ok((1.0, settings.limit.limit()?))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptograph_engine::frame::Kind;
    use haptograph_engine::testing::Bench;

    fn settings(mu: Option<f64>) -> BrakeControllerSettings {
        let BrakeSettings {
            most_current_a,
            trim_per_s,
            most_trim,
            least_normal_n,
            least_speed_m_s,
            solenoid,
            coil,
        } = BrakeSettings::default();
        BrakeControllerSettings {
            surface: None,
            mu,
            trim_per_s,
            most_trim,
            most_current_a,
            least_load_n: least_normal_n,
            least_speed_mm_s: MillimetresPerSecond::of_si(least_speed_m_s),
            line_slope: solenoid.line_slope,
            line_offset: solenoid.line_offset,
            force_n_per_a2: solenoid.force_n_per_a2,
            plunger_n: solenoid.plunger_n,
            coil,
        }
    }

    #[test]
    fn at_rest_the_current_is_that_of_the_experimental_line() {
        let kinds = [Kind::SCALAR, Kind::VECTOR, Kind::SCALAR];
        let mut bench = Bench::new::<BrakeController>(settings(Some(0.35)), 1000.0, &kinds).unwrap();
        let out = bench.run(&[&[1.0], &[0.0; 3], &[0.0]]);
        let pen = Solenoid::THESIS;
        let wanted = pen.current_a(pen.experimental_phi(0.35) * 1.0);
        assert!((out[0][0] - wanted).abs() < 1e-12 && wanted > 0.05);
        assert_eq!(out[3][0], 0.0);
        assert!((out[4][0] - 298.15).abs() < 1.0);
    }

    #[test]
    fn another_pen_is_driven_by_its_own_constants() {
        let kinds = [Kind::SCALAR, Kind::VECTOR, Kind::SCALAR];
        let other = BrakeControllerSettings {
            line_slope: 3.1,
            line_offset: -0.5,
            force_n_per_a2: 35.0,
            plunger_n: 0.05,
            coil: CoilSettings { ambient_c: 20.0, ..CoilSettings::default() },
            ..settings(Some(0.35))
        };
        let mut bench = Bench::new::<BrakeController>(other.clone(), 1000.0, &kinds).unwrap();
        let out = bench.run(&[&[2.0], &[0.0; 3], &[0.0]]);
        let by_hand_a = (((3.1 * 0.35 - 0.5) * 2.0 - 0.05) / 35.0_f64).sqrt();
        assert!((out[0][0] - by_hand_a).abs() < 1e-12, "{}", out[0][0]);
        assert!((out[4][0] - 293.15).abs() < 0.1, "{}", out[4][0]);
        let never_back = BrakeControllerSettings {
            coil: CoilSettings { rearm_c: 130.0, ..CoilSettings::default() },
            ..other
        };
        let refused = Bench::new::<BrakeController>(never_back, 1000.0, &kinds).err();
        assert_eq!(refused.and_then(|e| e.field), Some("coil"));
    }

    #[test]
    fn too_little_friction_raises_the_trim_and_too_much_to_ask_is_said() {
        let kinds = [Kind::SCALAR, Kind::VECTOR, Kind::SCALAR];
        let mut bench = Bench::new::<BrakeController>(settings(Some(0.4)), 1000.0, &kinds).unwrap();
        let n = 500;
        let out = bench.run(&[&vec![1.0; n], &[-0.3, 0.0, 0.0].repeat(n), &vec![0.05; n]]);
        assert!((out[1][n - 1] - 0.3).abs() < 1e-6, "measured");
        assert!(out[2][n - 1] > 0.01 && out[0][n - 1] > out[0][0]);
        bench.set(BrakeControllerSettings::mu, 0.9);
        let out = bench.run(&[&[1.0], &[-0.3, 0.0, 0.0], &[0.05]]);
        assert!(out[3][0] >= 2.0, "out of reach");
        let refused = Bench::new::<BrakeController>(settings(None), 1000.0, &kinds).err();
        assert_eq!(refused.and_then(|e| e.field), Some("mu"));
    }
}
