//! The speed of a tool along a surface.

use super::speed::{SpeedEstimator, SpeedFilter};
use crate::contact::Contact;
use crate::filters::design_error;
use crate::vector::{norm, reject};
use haptograph_engine::frame::{Scalar, Vector};
use haptograph_engine::node::{
    BuildContext, BuildError, Built, Io, Latency, LiveId, NodeKind, Port, Processor, Tick,
};
use haptograph_signal::quantity::Quantity;

haptograph_engine::settings! {
    /// Settings of [`ContactSpeed`].
    pub struct ContactSpeedSettings {
        /// Cut-off of the second-order low-pass.
        [live, below_nyquist] cutoff_hz: f64 = 20.0, in 1e-3..=1e6;
    }
}

haptograph_engine::node! {
    /// The low-passed velocity of a tool, and its component along the touched surface. The low-pass also keeps the
    /// texture's own vibration out of the speed.
    pub struct ContactSpeed(ContactSpeedSettings) in "sensing";
    source: "A.3.2";
    example: r#""speed": ContactSpeed(contact: "touch.contact", cutoff_hz: 20.0)"#;
    in CONTACT: Contact = Port::of(Quantity::NUMBER, "The contact, with the position of the tool.");
    out SPEED: Scalar = Port::of(Quantity::SPEED, "Speed along the surface, m/s; zero in free space.");
    out ALONG: Vector = Port::of(Quantity::SPEED, "Velocity along the surface, m/s; zero in free space.");
    out VELOCITY: Vector = Port::of(Quantity::SPEED, "Velocity in all directions, m/s.");
}

impl NodeKind for ContactSpeed {
    fn build(settings: ContactSpeedSettings, cx: &BuildContext) -> Result<Built<Self>, BuildError> {
        let filter = SpeedFilter::Butterworth { order: 2, cutoff_hz: settings.cutoff_hz };
        let estimator = SpeedEstimator::new(filter, cx.rate.hz()).map_err(design_error("cutoff_hz"))?;
        Ok(Built::new(Sliding { estimator }))
    }
}

#[derive(Debug, Clone)]
struct Sliding {
    estimator: SpeedEstimator<3>,
}

impl Processor<ContactSpeed> for Sliding {
    fn process(&mut self, _: &Tick, io: &mut Io<'_, ContactSpeed>) {
        let contacts = io.decode(ContactSpeed::CONTACT);
        let (speed, along, velocity) =
            io.write_all((ContactSpeed::SPEED, ContactSpeed::ALONG, ContactSpeed::VELOCITY));
        let frames = speed.iter_mut().zip(along).zip(velocity);
        for (((speed, along), velocity), contact) in frames.zip(contacts) {
            *velocity = self.estimator.update(contact.hip_m);
            *along = if contact.touching { reject(*velocity, contact.normal) } else { [0.0; 3] };
            *speed = norm(*along);
        }
    }

    fn set(&mut self, setting: LiveId<ContactSpeedSettings>, value: f64) {
        if setting == ContactSpeedSettings::cutoff_hz {
            self.estimator.turn(value);
        }
    }

    fn copy_state_into(&self, new: &mut Self) {
        new.estimator.copy_state_from(&self.estimator);
    }

    fn latency(&self) -> Latency {
        Latency::of_group(self.estimator.delay_s())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptograph_engine::frame::OneKind;
    use haptograph_engine::frame::Record;
    use haptograph_engine::testing::Bench;

    #[test]
    fn only_the_motion_along_the_surface_counts() {
        let settings = ContactSpeedSettings { cutoff_hz: 20.0 };
        let mut bench = Bench::new::<ContactSpeed>(settings, 1000.0, &[Contact::KIND]).unwrap();
        let contacts: Vec<f64> = (0..1000)
            .flat_map(|k| {
                Contact {
                    touching: k < 900,
                    hip_m: [5e-5 * f64::from(k), 0.0, -1e-6 * f64::from(k)],
                    normal: [0.0, 0.0, 1.0],
                    ..Contact::default()
                }
                .to_components()
            })
            .collect();
        let out = bench.run(&[&contacts]);
        assert!((out[0][899] - 0.05).abs() < 1e-9);
        assert!((out[2][3 * 899 + 2] + 0.001).abs() < 1e-9);
        assert_eq!(out[0][900], 0.0, "free");
    }
}
