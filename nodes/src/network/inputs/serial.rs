//! Numbers on a serial line: lines of them, as an Arduino prints them.

#[cfg(any(test, all(feature = "serial", unix)))]
mod lines;
#[cfg(all(feature = "serial", unix))]
mod port;

use super::{Mapping, NumberInput, Place, Selector, VALUE};
use haptograph_engine::device::{Device, DeviceKind, DeviceSpec};
use haptograph_engine::node::{BuildContext, BuildError};
use haptograph_engine::silence::OnSilence;
use std::path::PathBuf;
use std::time::Duration;

#[cfg(all(feature = "serial", unix))]
pub(super) use port::listen;

/// Fails with build instructions.
#[cfg(not(all(feature = "serial", unix)))]
pub(super) fn listen(
    _: &std::path::Path,
    _: u32,
    _: super::hub::Routes,
    _: std::sync::Arc<std::sync::atomic::AtomicBool>,
) -> std::io::Result<std::thread::JoinHandle<()>> {
    Err(std::io::Error::other(
        "this program was built without serial ports; on Linux and macOS, `cargo build --release --features serial`",
    ))
}

/// Standard rates of serial lines, bit/s.
const RATES: [u32; 8] = [2400, 4800, 9600, 19_200, 38_400, 57_600, 115_200, 230_400];

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
        timeout_ms: f64 = 500.0, in 1.0..=10_000.0;
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
        if !RATES.contains(&settings.baud) {
            let message = format!("{} bit/s is not a rate of serial lines", settings.baud);
            let rates = RATES.map(|rate| rate.to_string()).join(", ");
            return Err(BuildError::at("baud", message).help(format!("choose one of {rates}")));
        }
        let place = Place::Serial {
            path: PathBuf::from(settings.port),
            baud: settings.baud,
        };
        let mapping = Mapping::new(settings.from, settings.to)?;
        let silence = (
            Duration::from_secs_f64(settings.timeout_ms * 1e-3),
            settings.on_silence,
        );
        Ok(NumberInput::device(
            place,
            Selector::Column(settings.column as usize),
            mapping,
            silence,
            cx,
        ))
    }
}
