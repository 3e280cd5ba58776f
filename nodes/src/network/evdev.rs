//! A tablet or mouse read through Linux's event devices, in physical units.

use super::remote::{Remote, SENSES, Watch};
use haptograph_engine::device::{Device, DeviceKind, DeviceSpec};
use haptograph_engine::node::{BuildContext, BuildError};
use haptograph_engine::silence::OnSilence;
use haptograph_signal::units::{MillimetresPerSecond, PerMillimetre};
use std::time::Duration;

haptograph_engine::settings! {
    /// A tablet or mouse, read from Linux's event devices.
    pub struct EvdevDeviceSettings {
        /// The event device, for example a link in /dev/input/by-id.
        path: String;
        /// Counts per millimetre: required for a mouse (1000 dpi are 39.4) and for a tablet that does not report it.
        counts_per_mm: Option<PerMillimetre> = None, in 0.01..=100_000.0;
        /// Normal force at full pressure, N. A device without pressure has it while a button is held or a finger is down.
        pressed_n: f64 = 1.0, in 0.0..=100.0;
        /// Speed above which a movement of the tip counts as a jump, mm/s.
        fastest_mm_s: MillimetresPerSecond = MillimetresPerSecond(5000.0), in 1.0..=1e6;
        /// Effect on dependent actuators while the device is gone, for example unplugged.
        on_silence: OnSilence = OnSilence::Zero;
    }
}

/// A tablet or mouse of this machine.
pub struct EvdevDevice;

impl DeviceKind for EvdevDevice {
    type Settings = EvdevDeviceSettings;
    const SPEC: DeviceSpec = DeviceSpec {
        name: "EvdevDevice",
        doc: "A tablet or mouse that Linux reads. It works in live runs only, and in programs built with the feature \
              `evdev`. The origin is the middle of a tablet, or the start position of a mouse; y points away from the user. \
              Normal force is pressure times `pressed_n`: no tablet reports newtons. While it is gone, every actuator that \
              depends on it is at zero, unless `on_silence` is `Hold`.",
        source: "2.4",
        simulated: false,
        senses: SENSES,
        drives: &[],
        example: r#""stylus": EvdevDevice(path: "/dev/input/by-id/usb-Tablet-event-mouse", pressed_n: 3.0)"#,
    };

    fn build(settings: EvdevDeviceSettings, cx: &BuildContext) -> Result<Box<dyn Device>, BuildError> {
        if settings.path.is_empty() {
            return Err(
                BuildError::at("path", "the path is empty").help("`ls /dev/input/by-id` lists the devices")
            );
        }
        let watch = Watch {
            timeout: TIMEOUT,
            fastest_m_s: settings.fastest_mm_s.si(),
            holds: settings.on_silence == OnSilence::Hold,
        };
        Ok(Box::new(Remote::new(watch, cx)))
    }
}

/// Silence after which the device counts as gone. Its thread reports it as present ten times as often.
const TIMEOUT: Duration = Duration::from_millis(50);
