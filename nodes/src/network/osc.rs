//! Devices by Open Sound Control: SuperCollider, Max, Pure Data, TouchOSC.

use super::remote::{DRIVES, Remote, SENSES, Watch, address};
use haptograph_engine::device::{Device, DeviceKind, DeviceSpec};
use haptograph_engine::node::{BuildContext, BuildError};
use haptograph_engine::silence::OnSilence;
use haptograph_signal::units::{MillimetresPerSecond, Milliseconds};
use std::net::SocketAddr;
use std::time::Duration;

haptograph_engine::settings! {
    /// A device of another program, by Open Sound Control.
    pub struct OscDeviceSettings {
        /// Address and port at which to listen.
        listen: String = "127.0.0.1:9751".to_owned();
        /// OSC address of the tip's position: two or three numbers, mm.
        position: String = "/position".to_owned();
        /// OSC address of the force: one number, the normal force, or three, N.
        force: String = "/force".to_owned();
        /// Address and port to which commands are sent, as `/force` (N), `/current` and `/brake` (A); none: no commands
        /// are sent.
        send_to: Option<String> = None;
        /// Rate at which commands are sent, Hz.
        send_rate_hz: f64 = 50.0, in 0.1..=200.0;
        /// Silence after which the device counts as gone, ms. Many programs send only changes.
        timeout_ms: Milliseconds = Milliseconds(1000.0), in 1.0..=10_000.0;
        /// Effect of silence on dependent actuators. The device's own actuators are at zero meanwhile.
        on_silence: OnSilence = OnSilence::Zero;
        /// Speed above which a movement of the tip counts as a jump, mm/s.
        fastest_mm_s: MillimetresPerSecond = MillimetresPerSecond(5000.0), in 1.0..=1e6;
    }
}

/// A device that another program owns, by Open Sound Control.
pub struct OscDevice;

impl DeviceKind for OscDevice {
    type Settings = OscDeviceSettings;
    const SPEC: DeviceSpec = DeviceSpec {
        name: "OscDevice",
        doc: "A device that another program owns, by Open Sound Control over UDP. It works in live runs only. While it \
              is silent or jumps, its outputs are at zero; while it is silent, so is every actuator that depends on \
              it, unless `on_silence` is `Hold`, for senders that only send changes. For a force loop the device \
              protocol of `UdpDevice` is the better one: it answers every packet.",
        source: "",
        simulated: false,
        senses: SENSES,
        drives: DRIVES,
        example: r#""stylus": OscDevice(listen: "127.0.0.1:9751", position: "/pen/xy", force: "/pen/pressure")"#,
    };

    fn build(settings: OscDeviceSettings, cx: &BuildContext) -> Result<Box<dyn Device>, BuildError> {
        for (field, text) in [("position", &settings.position), ("force", &settings.force)] {
            if !text.starts_with('/') {
                let message = format!("`{text}` is not an OSC address");
                return Err(
                    BuildError::at(field, message).help("OSC addresses begin with a slash: \"/pen/xy\"")
                );
            }
        }
        settings.send_to()?;
        settings.listen()?;
        let watch = Watch {
            timeout: settings.timeout(),
            fastest_m_s: settings.fastest_mm_s.si(),
            holds: settings.on_silence == OnSilence::Hold,
        };
        Ok(Box::new(Remote::new(watch, cx)))
    }
}

impl OscDeviceSettings {
    /// Address to listen at.
    ///
    /// # Errors
    /// [`BuildError`] if it is not an address; a checked graph has one.
    pub fn listen(&self) -> Result<SocketAddr, BuildError> {
        address("listen", &self.listen)
    }

    /// Address to send commands to, if any.
    ///
    /// # Errors
    /// [`BuildError`] if it is not an address; a checked graph has one.
    pub fn send_to(&self) -> Result<Option<SocketAddr>, BuildError> {
        self.send_to.as_deref().map(|to| address("send_to", to)).transpose()
    }

    /// Silence after which the device counts as gone.
    pub fn timeout(&self) -> Duration {
        Duration::from_secs_f64(self.timeout_ms.si())
    }
}
