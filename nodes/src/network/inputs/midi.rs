//! Numbers by MIDI: controllers, keys and pitch wheels.

use super::{Mapping, NumberInput, VALUE};
use haptograph_engine::device::{Device, DeviceKind, DeviceSpec};
use haptograph_engine::node::{BuildContext, BuildError};
use haptograph_engine::silence::OnSilence;
use std::time::Duration;

haptograph_engine::settings! {
    /// A controller: a fader, a knob, a pedal.
    pub struct MidiControlSettings {
        /// The number; 1 is the modulation wheel.
        number: u32, in 0..=127;
    }
}

haptograph_engine::settings! {
    /// A key.
    pub struct MidiNoteSettings {
        /// The number; 60 is the middle C.
        number: u32, in 0..=127;
    }
}

haptograph_engine::choices! {
    /// The message of a MIDI device that an input reads.
    pub enum MidiMessage {
        /// A fader, knob or pedal. Its position is unknown until it moves.
        Control(MidiControlSettings),
        /// A key: its velocity while it is down, else 0.
        Note(MidiNoteSettings),
        /// The pitch wheel, from its lowest to its highest position.
        PitchBend,
    }
}

haptograph_engine::settings! {
    /// A number from a MIDI device.
    pub struct MidiInputSettings {
        /// Part of the port's name; several inputs can share a port. `haptograph devices` lists the ports.
        port: String;
        /// The message: `Control(number: 1)`, `Note(number: 60)`, `PitchBend`.
        message: MidiMessage;
        /// Channel, counted from 1; none: all of them.
        channel: Option<u32> = None, in 1..=16;
        /// Output at the smallest and at the largest value, in the SI unit of the `LiveInput`'s quantity.
        to: [f64; 2] = [0.0, 1.0];
        /// Effect on dependent actuators while the device is gone, for example unplugged.
        on_silence: OnSilence = OnSilence::Zero;
    }
}

/// Silence after which the port counts as gone. Its thread reports it as present five times as often.
const TIMEOUT: Duration = Duration::from_millis(50);

/// A number by MIDI.
pub struct MidiInput;

impl DeviceKind for MidiInput {
    type Settings = MidiInputSettings;
    const SPEC: DeviceSpec = DeviceSpec {
        name: "MidiInput",
        doc: "One number from a MIDI device: a controller, a key or the pitch wheel, mapped to a range. It works in live \
              runs only, and in programs built with the feature `midi`. A controller is silent until it is first moved, because \
              its position is unknown. \
              If messages are lost in a flood, all keys count as released. While the device is gone, every actuator that depends on it is at zero, unless \
              `on_silence` is `Hold`.",
        source: "",
        simulated: false,
        senses: VALUE,
        drives: &[],
        example: r#""pitch": MidiInput(port: "nanoKONTROL", message: Control(number: 1), to: [80, 320])"#,
    };

    fn build(settings: MidiInputSettings, cx: &BuildContext) -> Result<Box<dyn Device>, BuildError> {
        if settings.port.is_empty() {
            return Err(
                BuildError::at("port", "the name is empty").help("`haptograph devices` lists the ports")
            );
        }
        let mapping = Mapping::new([0.0, 1.0], settings.to)?;
        Ok(Box::new(NumberInput::new(mapping, TIMEOUT, settings.on_silence, cx)))
    }
}
