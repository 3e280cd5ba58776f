//! Texture rendered by the motors of an arm.

use crate::contact::Contact;
use crate::tapping::transient::EFFECTIVE_MASS_KG;
use crate::vector::{Vec3, cross, direction, scale};
use haptograph_engine::frame::{Scalar, Vector};
use haptograph_engine::node::{BuildContext, BuildError, Built, Io, LiveId, NodeKind, Port, Processor, Tick};
use haptograph_signal::quantity::Quantity;
use haptograph_signal::units::Grams;

haptograph_engine::settings! {
    /// Settings of [`TextureForce`].
    pub struct TextureForceSettings {
        /// Effective mass of handle and hand, g; it converts acceleration to force.
        [live] mass_g: Grams = Grams::of_si(EFFECTIVE_MASS_KG), in 0.0..=10_000.0;
    }
}

haptograph_engine::node! {
    /// The vibration of a texture as a force on the tool, across both the normal and the friction, so that it disturbs
    /// neither. It keeps its direction while there is no friction, and is zero while nothing touches.
    pub struct TextureForce(TextureForceSettings) in "texture";
    source: "A.3.2";
    example: r#""shake": TextureForce(acceleration: "texture.acceleration", contact: "touch.contact", friction: "friction.force")"#;
    in ACCELERATION: Scalar = Port::of(Quantity::ACCELERATION, "The vibration, m/s2.");
    in CONTACT: Contact = Port::of(Quantity::NUMBER, "The contact.");
    in FRICTION: Vector = Port::of(Quantity::FORCE, "The friction on the tool, N.");
    out FORCE: Vector = Port::of(Quantity::FORCE, "Force on the tool, N.");
}

impl NodeKind for TextureForce {
    fn build(settings: TextureForceSettings, _: &BuildContext) -> Result<Built<Self>, BuildError> {
        Ok(Built::new(Shaking { mass_kg: settings.mass_g.si(), across: [0.0; 3] }))
    }
}

#[derive(Debug, Clone)]
struct Shaking {
    mass_kg: f64,
    across: Vec3,
}

impl Processor<TextureForce> for Shaking {
    fn process(&mut self, _: &Tick, io: &mut Io<'_, TextureForce>) {
        let (accelerations, contacts) =
            (io.read(TextureForce::ACCELERATION), io.decode(TextureForce::CONTACT));
        let frictions = io.read(TextureForce::FRICTION);
        let forces = io.write(TextureForce::FORCE).iter_mut();
        let frames = forces.zip(accelerations).zip(contacts).zip(frictions);
        for (((force, acceleration), contact), friction) in frames {
            if !contact.touching {
                self.across = [0.0; 3];
            } else if let Some(across) = direction(cross(contact.normal, *friction)) {
                self.across = across;
            }
            *force = scale(self.across, self.mass_kg * acceleration);
        }
    }

    fn set(&mut self, setting: LiveId<TextureForceSettings>, value: f64) {
        if setting == TextureForceSettings::mass_g {
            self.mass_kg = value;
        }
    }

    fn copy_state_into(&self, new: &mut Self) {
        new.across = self.across;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vector::dot;
    use haptograph_engine::frame::Record;
    use haptograph_engine::frame::{Kind, OneKind};
    use haptograph_engine::testing::Bench;

    #[test]
    fn the_shaking_is_across_normal_and_friction() {
        let kinds = [Kind::SCALAR, Contact::KIND, Kind::VECTOR];
        let mut bench =
            Bench::new::<TextureForce>(TextureForceSettings { mass_g: Grams(50.0) }, 1000.0, &kinds).unwrap();
        let normal = [0.0, 0.6, 0.8];
        let touching = |touching| Contact { touching, normal, ..Contact::default() }.to_components();
        let friction = [0.3, -0.4, 0.3];
        let out = bench.run(&[
            &[10.0, -10.0, 10.0],
            &[touching(true), touching(true), touching(false)].concat(),
            &[friction, [0.0; 3], friction].concat(),
        ]);
        let force = out[0].as_chunks::<3>().0;
        assert!(dot(force[0], normal).abs() < 1e-15 && dot(force[0], friction).abs() < 1e-15);
        assert!((dot(force[0], force[0]).sqrt() - 0.5).abs() < 1e-15);
        assert_eq!(force[1], force[0].map(|f| -f), "without friction it keeps its direction");
        assert_eq!(force[2], [0.0; 3], "nothing touches");
    }
}
