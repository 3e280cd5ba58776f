//! Haply's arms, through the service of their manufacturer, and the source that reads what they measure beside a position.

use super::remote::{DRIVES, Remote, Watch, address};
use haptograph_engine::device::{Channel, Device, DeviceKind, DeviceSpec};
use haptograph_engine::frame::{Kind, Vector};
use haptograph_engine::node::{BuildContext, BuildError, Port};
use haptograph_engine::settings::NoSettings;
use haptograph_engine::silence::OnSilence;
use haptograph_signal::quantity::Quantity;
use haptograph_signal::units::{MillimetresPerSecond, Milliseconds};
use std::net::SocketAddr;
use std::time::Duration;

const VELOCITY: &str =
    "Velocity of the tip as the arm states it, m/s; zero while it is silent, unless `on_silence` is `Hold`.";
const ORIENTATION: &str = "Orientation of the grip as a rotation vector, rad; zero without one.";
const BUTTONS: &str = "1 while the grip's buttons a, b and c are held, else 0.";

haptograph_engine::node! {
    /// What an arm states beside the position that `Arm` reads: the velocity of its tip, and its grip.
    pub struct ArmGripSource as "ArmGrip"(NoSettings) in "sources";
    example: r#""grip": ArmGrip(clock: "servo", endpoint: "arm")"#;
    out VELOCITY: Vector = Port::of(Quantity::SPEED, VELOCITY);
    out ORIENTATION: Vector = Port::of(Quantity::ANGLE, ORIENTATION);
    out BUTTONS: Vector = Port::of(Quantity::NUMBER, BUTTONS);
}

haptograph_engine::choices! {
    /// Origin and direction of the axes: a preset of the service.
    pub enum HaplyPreset {
        /// The origin is the centre of the workspace; the arm's side is the front.
        ArmFrontCentered,
        /// The origin is the arm's base; the arm's side is the front.
        ArmFront,
        /// The origin is the centre of the workspace; the side of the lamp is the front.
        LedFrontCentered,
        /// The origin is the arm's base; the side of the lamp is the front.
        LedFront,
        /// As the service is set.
        Unchanged,
    }
}

impl HaplyPreset {
    /// The service's name of the preset; `None` if it is not set.
    pub fn name(&self) -> Option<&'static str> {
        match self {
            Self::ArmFrontCentered => Some("arm_front_centered"),
            Self::ArmFront => Some("arm_front"),
            Self::LedFrontCentered => Some("led_front_centered"),
            Self::LedFront => Some("led_front"),
            Self::Unchanged => None,
        }
    }
}

haptograph_engine::settings! {
    /// An arm of Haply's, through the Inverse Service of this machine.
    pub struct HaplyInverse3Settings {
        /// Address and port of the service, on this machine.
        service: String = "127.0.0.1:10001".to_owned();
        /// Identifier of the arm, for example "049D"; none: the only one. `haptograph devices` lists them.
        device: Option<String> = None;
        /// Identifier of its grip; none: the first that the service has.
        grip: Option<String> = None;
        /// Origin and direction of the axes.
        preset: HaplyPreset = HaplyPreset::ArmFrontCentered;
        /// Silence after which the arm counts as gone, ms.
        timeout_ms: Milliseconds = Milliseconds(20.0), in 1.0..=10_000.0;
        /// Effect of silence on dependent actuators. The arm's own motors are at zero meanwhile.
        on_silence: OnSilence = OnSilence::Zero;
        /// Speed above which a movement of the tip counts as a jump, mm/s.
        fastest_mm_s: MillimetresPerSecond = MillimetresPerSecond(5000.0), in 1.0..=1e6;
    }
}

/// An arm of Haply's.
pub struct HaplyInverse3;

impl DeviceKind for HaplyInverse3 {
    type Settings = HaplyInverse3Settings;
    const SPEC: DeviceSpec = DeviceSpec {
        name: "HaplyInverse3",
        doc: "Haply's Inverse3 with or without a VerseGrip, through the Haply Inverse Service (3.5 or later) on this machine. \
              It works in live runs only, and in programs built with the feature `haply`; it was tested with a simulated \
              service, not with an arm. x points to the right, y away from the user, z up. An arm that is not \
              calibrated counts as silent. While it is silent or jumps, its force is at zero; while it is silent, so is \
              every actuator that depends on it, unless `on_silence` is `Hold`.",
        source: "",
        simulated: false,
        senses: &[
            Channel::new(
                "position",
                Kind::VECTOR,
                Quantity::LENGTH,
                "Position of the tip, m; holds its last value while the arm is silent.",
            ),
            Channel::new("orientation", Kind::VECTOR, Quantity::ANGLE, ORIENTATION),
            Channel::new("velocity", Kind::VECTOR, Quantity::SPEED, VELOCITY),
            Channel::new("buttons", Kind::VECTOR, Quantity::NUMBER, BUTTONS),
        ],
        drives: DRIVES.split_at(1).0,
        example: r#""arm": HaplyInverse3(device: "049D")"#,
    };

    fn build(settings: HaplyInverse3Settings, cx: &BuildContext) -> Result<Box<dyn Device>, BuildError> {
        settings.service()?;
        for (field, id) in [("device", &settings.device), ("grip", &settings.grip)] {
            if id.as_ref().is_some_and(String::is_empty) {
                let help = "leave it out, or take one that `haptograph devices` lists";
                return Err(BuildError::at(field, "the identifier is empty").help(help));
            }
        }
        let watch = Watch {
            timeout: settings.timeout(),
            fastest_m_s: settings.fastest_mm_s.si(),
            holds: settings.on_silence == OnSilence::Hold,
        };
        Ok(Box::new(Remote::of_vectors(watch, cx)))
    }
}

impl HaplyInverse3Settings {
    /// Address of the service. Whoever reaches the service moves the arm, so it is one of this machine.
    ///
    /// # Errors
    /// [`BuildError`] if it is not an address of this machine; a checked graph has one.
    pub fn service(&self) -> Result<SocketAddr, BuildError> {
        let found = address("service", &self.service)?;
        match found.ip().is_loopback() {
            true => Ok(found),
            false => {
                let message = format!("{found} is not an address of this machine");
                Err(BuildError::at("service", message)
                    .help("run haptograph where the arm is: \"127.0.0.1:10001\""))
            }
        }
    }

    /// Silence after which the arm counts as gone.
    pub fn timeout(&self) -> Duration {
        Duration::from_secs_f64(self.timeout_ms.si())
    }
}
