//! Numbers on a serial line: lines of them, as an Arduino prints them.

use super::{Mapping, NumberInput, VALUE};
use haptograph_engine::device::{Device, DeviceKind, DeviceSpec};
use haptograph_engine::node::{BuildContext, BuildError};
use haptograph_engine::silence::OnSilence;
use haptograph_signal::units::Milliseconds;
use std::time::Duration;

/// Standard rates of serial lines, bit/s.
pub const SERIAL_RATES: [u32; 8] = [2400, 4800, 9600, 19_200, 38_400, 57_600, 115_200, 230_400];

haptograph_engine::settings! {
    /// A column of the numbers that come in lines on a serial port.
    pub struct SerialInputSettings {
        /// The port, for example a link in /dev/serial/by-id. Several inputs can share a port.
        port: String;
        /// Column of the number in a line, counted from 1.
        column: u32 = 1, in 1..=64;
        /// Rate of the line, bit/s; ports over USB mostly ignore it.
        baud: u32 = 115_200;
        /// Range of received numbers.
        from: [f64; 2] = [0.0, 1.0];
        /// Output range for `from`, in the SI unit of the `LiveInput`'s quantity. The map is linear within the range and
        /// clamped beyond it.
        to: [f64; 2] = [0.0, 1.0];
        /// Silence after which the input counts as gone, ms.
        timeout_ms: Milliseconds = Milliseconds(500.0), in 1.0..=10_000.0;
        /// Effect of silence, for example after unplugging, on dependent actuators.
        on_silence: OnSilence = OnSilence::Zero;
    }
}

/// A number on a serial line.
pub struct SerialInput;

impl DeviceKind for SerialInput {
    type Settings = SerialInputSettings;
    const SPEC: DeviceSpec = DeviceSpec {
        name: "SerialInput",
        doc: "One number from a serial port, for example from a sensor on an Arduino: a column of lines of numbers separated by commas, \
              spaces or tabs, mapped to a range. It works in live runs only, and in programs built with the feature \
              `serial`. A line of more than 512 bytes is dropped whole. While the port is silent or gone, every actuator \
              that depends on it is at zero, unless `on_silence` is `Hold`; it tries to reopen a port that is gone twice a second.",
        source: "",
        simulated: false,
        senses: VALUE,
        drives: &[],
        example: r#""squeeze": SerialInput(port: "/dev/ttyACM0", column: 2, from: [0, 1023], to: [0, 10])"#,
    };

    fn build(settings: SerialInputSettings, cx: &BuildContext) -> Result<Box<dyn Device>, BuildError> {
        if settings.port.is_empty() {
            return Err(
                BuildError::at("port", "the path is empty").help("`ls /dev/serial/by-id` lists the ports")
            );
        }
        if !SERIAL_RATES.contains(&settings.baud) {
            let message = format!("{} bit/s is not a rate of serial lines", settings.baud);
            let rates = SERIAL_RATES.map(|rate| rate.to_string()).join(", ");
            return Err(BuildError::at("baud", message).help(format!("choose one of {rates}")));
        }
        let mapping = Mapping::new(settings.from, settings.to)?;
        let timeout = Duration::from_secs_f64(settings.timeout_ms.si());
        Ok(Box::new(NumberInput::new(mapping, timeout, settings.on_silence, cx)))
    }
}
