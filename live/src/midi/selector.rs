//! The selector of an input: one kind of message of a MIDI device.

#[cfg(feature = "midi")]
use haptograph_nodes::network::inputs::MidiInputSettings;
use haptograph_nodes::network::inputs::MidiMessage;
use std::fmt;

/// A message without its value.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Message {
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
pub(super) struct MidiSelector {
    pub message: Message,
    pub channel: Option<u32>,
}

#[cfg(feature = "midi")]
impl MidiSelector {
    /// The selector of an input.
    pub(super) fn of(settings: &MidiInputSettings) -> Self {
        Self { message: Message::from(&settings.message), channel: settings.channel }
    }

    /// True if the message is that of a key, which is held and released.
    pub(crate) fn is_key(&self) -> bool {
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
