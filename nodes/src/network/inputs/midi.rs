//! Numbers by MIDI: controllers, keys and pitch wheels.

#[cfg(any(test, feature = "midi"))]
mod event;
#[cfg(feature = "midi")]
mod port;

use super::{Mapping, NumberInput, Place, Selector, VALUE};
use haptograph_engine::device::{Device, DeviceKind, DeviceSpec};
use haptograph_engine::node::{BuildContext, BuildError};
use haptograph_engine::silence::OnSilence;
use std::fmt;
use std::time::Duration;

#[cfg(feature = "midi")]
pub(super) use port::listen;

/// Fails with build instructions.
#[cfg(not(feature = "midi"))]
pub(super) fn listen(
    _: &str,
    _: super::hub::Routes,
    _: std::sync::Arc<std::sync::atomic::AtomicBool>,
) -> std::io::Result<std::thread::JoinHandle<()>> {
    Err(std::io::Error::other(
        "this program was built without MIDI; `cargo build --release --features midi`, on Linux after `sudo apt install \
         libasound2-dev pkg-config`",
    ))
}

/// Names of the MIDI ports of this machine; empty in a build without MIDI.
pub fn midi_ports() -> Vec<String> {
    #[cfg(feature = "midi")]
    let names = port::names().unwrap_or_default();
    #[cfg(not(feature = "midi"))]
    let names = Vec::new();
    names
}

haptograph_engine::settings! {
    /// A controller: a fader, a knob, a pedal.
    pub struct MidiControlSettings {
        /// Its number; 1 is the modulation wheel.
        number: u32, in 0..=127;
    }
}

haptograph_engine::settings! {
    /// A key.
    pub struct MidiNoteSettings {
        /// Its number; 60 is the middle C.
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
        let selector = MidiSelector {
            message: Message::from(&settings.message),
            channel: settings.channel,
        };
        let mapping = Mapping::new([0.0, 1.0], settings.to)?;
        let silence = (TIMEOUT, settings.on_silence);
        Ok(NumberInput::device(
            Place::Midi(settings.port),
            Selector::Midi(selector),
            mapping,
            silence,
            cx,
        ))
    }
}

/// A message without its value.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Message {
    Control(u32),
    Note(u32),
    PitchBend,
}

impl From<&MidiMessage> for Message {
    fn from(message: &MidiMessage) -> Self {
        match message {
            MidiMessage::Control(control) => Self::Control(control.number),
            MidiMessage::Note(note) => Self::Note(note.number),
            MidiMessage::PitchBend => Self::PitchBend,
        }
    }
}

/// Selects a message of a device.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::network) struct MidiSelector {
    message: Message,
    channel: Option<u32>,
}

#[cfg(feature = "midi")]
impl MidiSelector {
    /// Whether it is a key, which is held and released.
    fn is_key(&self) -> bool {
        matches!(self.message, Message::Note(_))
    }
}

impl fmt::Display for MidiSelector {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.message {
            Message::Control(number) => write!(f, "control {number}")?,
            Message::Note(number) => write!(f, "note {number}")?,
            Message::PitchBend => f.write_str("pitch bend")?,
        }
        match self.channel {
            Some(channel) => write!(f, " channel {channel}"),
            None => Ok(()),
        }
    }
}
