//! Numbers by Open Sound Control: one argument of the messages to one address.

use super::{Mapping, NumberInput, VALUE};
use crate::network::remote::address;
use haptograph_engine::device::{Device, DeviceKind, DeviceSpec};
use haptograph_engine::node::{BuildContext, BuildError};
use haptograph_engine::silence::OnSilence;
use haptograph_signal::units::Milliseconds;
use std::net::SocketAddr;
use std::time::Duration;

haptograph_engine::settings! {
    /// A number that another program sends by Open Sound Control.
    pub struct OscInputSettings {
        /// Address and port at which to listen; inputs at the same one share it.
        listen: String = "127.0.0.1:9752".to_owned();
        /// OSC address of the messages.
        address: String;
        /// Number of the argument in a message, counted from 1.
        argument: u32 = 1, in 1..=64;
        /// Range of received numbers.
        from: [f64; 2] = [0.0, 1.0];
        /// Output range for `from`, in the SI unit of the `LiveInput`'s quantity. The map is linear within the range
        /// and clamped beyond it.
        to: [f64; 2] = [0.0, 1.0];
        /// Silence after which the input counts as gone, ms.
        timeout_ms: Milliseconds = Milliseconds(1000.0), in 1.0..=10_000.0;
        /// Effect of silence on dependent actuators: `Hold` for senders that only send changes.
        on_silence: OnSilence = OnSilence::Zero;
    }
}

/// A number by Open Sound Control.
pub struct OscInput;

impl DeviceKind for OscInput {
    type Settings = OscInputSettings;
    const SPEC: DeviceSpec = DeviceSpec {
        name: "OscInput",
        doc: "One number that another program sends by Open Sound Control over UDP, such as a fader of TouchOSC: an \
              argument of the messages to one address, mapped to a range. It works in live runs only. While it is \
              silent, every actuator that depends on it is at zero, unless `on_silence` is `Hold`, for senders that \
              only send changes. It accepts packets from any sender that reaches the address.",
        source: "",
        simulated: false,
        senses: VALUE,
        drives: &[],
        example: r#""pitch": OscInput(listen: "127.0.0.1:9752", address: "/1/fader1", to: [80, 320], on_silence: Hold)"#,
    };

    fn build(settings: OscInputSettings, cx: &BuildContext) -> Result<Box<dyn Device>, BuildError> {
        if !settings.address.starts_with('/') {
            let message = format!("`{}` is not an OSC address", settings.address);
            return Err(
                BuildError::at("address", message).help("OSC addresses begin with a slash: \"/1/fader1\"")
            );
        }
        let listen = settings.listen()?;
        if listen.port() == 0 {
            return Err(BuildError::at("listen", "port 0 is not a port that a sender can know")
                .help("choose one: \"127.0.0.1:9752\""));
        }
        let mapping = Mapping::new(settings.from, settings.to)?;
        let timeout = Duration::from_secs_f64(settings.timeout_ms.si());
        Ok(Box::new(NumberInput::new(mapping, timeout, settings.on_silence, cx)))
    }
}

impl OscInputSettings {
    /// Address to listen at.
    ///
    /// # Errors
    /// [`BuildError`] if it is not an address; a checked graph has one.
    pub fn listen(&self) -> Result<SocketAddr, BuildError> {
        address("listen", &self.listen)
    }
}
