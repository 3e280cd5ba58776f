//! The node of the normal force.

use super::Contact;
use super::stiffness::Wall;
use crate::vector::scale;
use haptograph_engine::frame::{Scalar, Vector};
use haptograph_engine::node::{
    BuildContext, BuildError, Built, Io, LiveId, NodeKind, Optional, Port, Processor, Tick,
};
use haptograph_signal::quantity::Quantity;
use haptograph_signal::units::NewtonsPerMillimetre;

haptograph_engine::settings! {
    /// Settings of [`NormalForce`].
    pub struct NormalForceSettings {
        /// Stiffness of the surface, N/mm: 0.25 in 4.3, 0.5 in A.3.2.
        [live] stiffness_n_per_mm: NewtonsPerMillimetre = NewtonsPerMillimetre(0.25), in 0.0..=1000.0;
        /// Damping of the motion along the normal, N s/m; needs `velocity`.
        [live] damping_n_s_per_m: f64 = 0.0, in 0.0..=1000.0;
        /// Viscous damping of the device itself, N s/m, which keeps the loop passive. None: no check.
        device_damping_n_s_per_m: Option<f64> = None, in 0.0..=1000.0;
    }
}

haptograph_engine::node! {
    /// The force of a surface on the tool along its normal, by Hooke's law, with optional damping. It pushes and never
    /// pulls. With the device's damping given, a warning reports a wall that is not passive, b <= K T / 2 + B.
    pub struct NormalForce(NormalForceSettings) in "contact";
    source: "4.3, A.3.2; Colgate and Schenkel 1997";
    example: r#""normal": NormalForce(contact: "touch.contact", stiffness_n_per_mm: 0.25)"#;
    in CONTACT: Contact = Port::of(Quantity::NUMBER, "The contact.");
    in VELOCITY: Vector, Optional = Port::of(Quantity::SPEED, "Velocity of the tool, m/s, for the damping.");
    out FORCE: Vector = Port::of(Quantity::FORCE, "Force on the tool, N.");
    out LOAD: Scalar = Port::of(Quantity::FORCE, "Its magnitude, N.");
}

impl NodeKind for NormalForce {
    fn build(settings: NormalForceSettings, cx: &BuildContext) -> Result<Built<Self>, BuildError> {
        if settings.damping_n_s_per_m > 0.0 && !cx.is_connected(Self::VELOCITY) {
            let message = "damping needs the velocity of the tool";
            return Err(BuildError::at("damping_n_s_per_m", message)
                .help("connect `velocity`, or remove the damping"));
        }
        Ok(Built::new(Pushing { wall: wall(&settings) }))
    }

    fn advice(settings: &NormalForceSettings, cx: &BuildContext) -> Vec<BuildError> {
        let Some(device_n_s_per_m) = settings.device_damping_n_s_per_m else {
            return Vec::new();
        };
        let rate_hz = cx.rate.hz();
        let verdict = wall(settings).passivity(device_n_s_per_m, rate_hz);
        if verdict.passive {
            return Vec::new();
        }
        let message = format!(
            "this wall is not passive at {rate_hz} Hz: the device needs a damping above {:.3} N s/m, but it has {device_n_s_per_m}",
            verdict.needed_n_s_per_m
        );
        let most = NewtonsPerMillimetre::of_si(verdict.most_stiffness_n_per_m).0;
        let help = format!("a stiffness below {most:.3} N/mm is passive; a hand on the device adds damping");
        vec![BuildError::at("stiffness_n_per_mm", message).help(help)]
    }
}

fn wall(settings: &NormalForceSettings) -> Wall {
    Wall {
        stiffness_n_per_m: settings.stiffness_n_per_mm.si(),
        damping_n_s_per_m: settings.damping_n_s_per_m,
    }
}

#[derive(Debug, Clone)]
struct Pushing {
    wall: Wall,
}

impl Processor<NormalForce> for Pushing {
    fn process(&mut self, _: &Tick, io: &mut Io<'_, NormalForce>) {
        let (contacts, velocities) = (io.decode(NormalForce::CONTACT), io.read(NormalForce::VELOCITY));
        let (force, load) = io.write_all((NormalForce::FORCE, NormalForce::LOAD));
        let frames = force.iter_mut().zip(load).zip(contacts);
        for (frame, ((force, load), contact)) in frames.enumerate() {
            let velocity_m_s = velocities.map_or([0.0; 3], |velocities| velocities[frame]);
            *load = self.wall.force_n(&contact, velocity_m_s);
            *force = scale(contact.normal, *load);
        }
    }

    fn set(&mut self, setting: LiveId<NormalForceSettings>, value: f64) {
        match setting {
            NormalForceSettings::stiffness_n_per_mm => self.wall.stiffness_n_per_m = value,
            NormalForceSettings::damping_n_s_per_m => self.wall.damping_n_s_per_m = value,
            _ => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptograph_engine::frame::OneKind;
    use haptograph_engine::frame::Record;
    use haptograph_engine::testing::Bench;
    use haptograph_signal::time::Rate;

    fn settings(stiffness_n_per_mm: f64, damping_n_s_per_m: f64) -> NormalForceSettings {
        NormalForceSettings {
            stiffness_n_per_mm: NewtonsPerMillimetre(stiffness_n_per_mm),
            damping_n_s_per_m,
            device_damping_n_s_per_m: Some(0.2),
        }
    }

    #[test]
    fn a_wall_pushes_by_hookes_law_and_its_stiffness_can_be_turned() {
        let contact =
            Contact { touching: true, penetration_m: 0.004, normal: [0.0, 0.0, 1.0], ..Contact::default() };
        let mut bench = Bench::new::<NormalForce>(settings(0.25, 0.0), 1000.0, &[Contact::KIND]).unwrap();
        assert_eq!(bench.run(&[&contact.to_components()]), vec![vec![0.0, 0.0, 1.0], vec![1.0]]);
        bench.set(NormalForceSettings::stiffness_n_per_mm, 500.0);
        assert_eq!(bench.run(&[&contact.to_components()])[1], [2.0]);
        let free = Contact::default().to_components();
        assert_eq!(bench.run(&[&free]), vec![vec![0.0; 3], vec![0.0]]);
    }

    #[test]
    fn a_wall_beyond_the_passivity_bound_is_warned_about() {
        let cx = BuildContext::new("", Rate::parse("1000").unwrap()).connected(&[Some(Contact::KIND), None]);
        assert!(NormalForce::advice(&settings(0.25, 0.0), &cx).is_empty(), "0.2 > 0.125");
        let doubts = NormalForce::advice(&settings(0.5, 0.0), &cx);
        assert_eq!(doubts[0].field, Some("stiffness_n_per_mm"));
        assert!(doubts[0].help.as_deref().is_some_and(|help| help.contains("0.400 N/mm")), "{doubts:?}");
    }

    #[test]
    fn damping_without_a_velocity_is_refused() {
        let refused = Bench::new::<NormalForce>(settings(0.25, 1.0), 1000.0, &[Contact::KIND]).err();
        assert_eq!(refused.and_then(|e| e.field), Some("damping_n_s_per_m"));
    }
}
