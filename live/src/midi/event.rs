//! The bytes of MIDI messages.

use super::selector::{Message, MidiSelector};

/// A message that carries a number.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Event {
    channel: u32,
    target: Target,
    /// From 0 to 1.
    share: f64,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Target {
    Of(Message),
    /// All keys are up.
    AllNotes,
}

impl Event {
    /// Parses a message; none if it is of another kind, truncated or invalid.
    pub(super) fn parse(bytes: &[u8]) -> Option<Self> {
        let (&status, data) = bytes.split_first()?;
        let &[first, second] = data else { return None };
        if first > 127 || second > 127 {
            return None;
        }
        let (number, value) = (u32::from(first), f64::from(second) / 127.0);
        let (target, share) = match status & 0xf0 {
            0x80 => (Target::Of(Message::Note(number)), 0.0),
            0x90 => (Target::Of(Message::Note(number)), value),
            // All sound off, all notes off.
            0xb0 if first == 120 || first == 123 => (Target::AllNotes, 0.0),
            0xb0 => (Target::Of(Message::Control(number)), value),
            0xe0 => (Target::Of(Message::PitchBend), bend(u16::from(first) | u16::from(second) << 7)),
            _ => return None,
        };
        let channel = 1 + u32::from(status & 0x0f);
        Some(Self { channel, target, share })
    }

    /// The number for a selector, if the message matches.
    pub(super) fn number(&self, selector: &MidiSelector) -> Option<f64> {
        let is_channel = selector.channel.is_none_or(|channel| channel == self.channel);
        let is_meant = match self.target {
            Target::AllNotes => matches!(selector.message, Message::Note(_)),
            Target::Of(message) => message == selector.message,
        };
        (is_channel && is_meant).then_some(self.share)
    }
}

/// Splits a stream of bytes into messages. A status byte may be left out where it repeats (running status), real-time
/// messages stand anywhere, and after wrong bytes the next status byte begins anew.
#[derive(Debug, Default)]
pub(super) struct ByteStream {
    /// Status of the message to come; none: data bytes belong to nothing.
    status: Option<u8>,
    /// First of the two data bytes.
    first: Option<u8>,
}

impl ByteStream {
    /// Takes a byte. Returns the event that it completes.
    pub(crate) fn take(&mut self, byte: u8) -> Option<Event> {
        match byte {
            0xf8.. => None,
            // Exclusive and common messages end the running status; their data bytes are skipped.
            0xf0..0xf8 => {
                *self = Self::default();
                None
            }
            0x80..0xf0 => {
                *self = Self { status: Some(byte), first: None };
                None
            }
            data => {
                let status = self.status?;
                // Program changes and the pressure of a channel have one data byte.
                if matches!(status & 0xf0, 0xc0 | 0xd0) {
                    return None;
                }
                match self.first.take() {
                    Some(first) => Event::parse(&[status, first, data]),
                    None => {
                        self.first = Some(data);
                        None
                    }
                }
            }
        }
    }
}

/// Position of a pitch wheel from 0 to 1; its middle is 0.5.
fn bend(position: u16) -> f64 {
    const MIDDLE: f64 = 8192.0;
    let off = f64::from(position) - MIDDLE;
    let most = if off < 0.0 { MIDDLE } else { MIDDLE - 1.0 };
    0.5 + 0.5 * off / most
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn heard(bytes: &[u8], message: Message, channel: Option<u32>) -> Option<f64> {
        Event::parse(bytes)?.number(&MidiSelector { message, channel })
    }

    #[test]
    fn controllers_keys_and_wheels_are_understood() {
        assert_eq!(heard(&[0xb0, 7, 127], Message::Control(7), None), Some(1.0));
        assert_eq!(heard(&[0xb0, 7, 127], Message::Control(8), None), None);
        assert_eq!(heard(&[0xb2, 7, 0], Message::Control(7), Some(3)), Some(0.0));
        assert_eq!(heard(&[0xb2, 7, 0], Message::Control(7), Some(1)), None);
        assert_eq!(heard(&[0x90, 60, 127], Message::Note(60), None), Some(1.0));
        assert_eq!(heard(&[0x90, 60, 0], Message::Note(60), None), Some(0.0), "struck with 0 is let go");
        assert_eq!(heard(&[0x80, 60, 64], Message::Note(60), None), Some(0.0));
        assert_eq!(heard(&[0xb0, 123, 0], Message::Note(60), None), Some(0.0));
        let wheel = |low, high| heard(&[0xe0, low, high], Message::PitchBend, None);
        assert_eq!((wheel(0, 0), wheel(0, 64), wheel(127, 127)), (Some(0.0), Some(0.5), Some(1.0)));
    }

    #[test]
    fn what_is_cut_short_or_wrong_says_nothing() {
        for bytes in [&[][..], &[0xb0], &[0xb0, 7], &[0xb0, 7, 128], &[0xb0, 7, 1, 1], &[0xf8], &[7, 7, 7]] {
            assert_eq!(Event::parse(bytes), None, "{bytes:?}");
        }
    }

    /// The numbers that a stream of bytes has for a message, in order.
    fn heard_of(stream: &[u8], message: Message) -> Vec<f64> {
        let (mut bytes, selector) = (ByteStream::default(), MidiSelector { message, channel: None });
        let events = stream.iter().filter_map(|byte| bytes.take(*byte));
        events.filter_map(|event| event.number(&selector)).collect()
    }

    #[test]
    fn a_status_is_not_repeated_and_a_clock_stands_anywhere() {
        // A keyboard: C pressed, E pressed, both released by velocity 0, with its clock and its active sensing.
        let keys = [0x90, 60, 127, 0xf8, 64, 0xfe, 127, 60, 0xf8, 0, 64, 0];
        assert_eq!(heard_of(&keys, Message::Note(60)), [1.0, 0.0]);
        assert_eq!(heard_of(&keys, Message::Note(64)), [1.0, 0.0]);
        // A fader: three positions after one status, then its wheel.
        let fader = [0xb0, 7, 0, 7, 127, 8, 64, 7, 0, 0xe0, 0, 64, 127, 127];
        assert_eq!(heard_of(&fader, Message::Control(7)), [0.0, 1.0, 0.0]);
        assert_eq!(heard_of(&fader, Message::PitchBend), [0.5, 1.0]);
    }

    #[test]
    fn other_messages_and_wrong_bytes_are_no_numbers_and_the_next_status_begins_anew() {
        let control = |stream: &[u8]| heard_of(stream, Message::Control(7));
        let (program, pressure) = ([0xc0, 7, 7, 0xb0, 7, 127], [0xd0, 7, 7, 0xb0, 7, 127]);
        assert_eq!((control(&program), control(&pressure)), (vec![1.0], vec![1.0]));
        // An exclusive message with a clock in it, and a song position: what follows has no status.
        assert_eq!(control(&[0xb0, 7, 127, 0xf0, 7, 0xf8, 7, 7, 0xf7, 7, 7]), [1.0]);
        assert_eq!(control(&[0xb0, 7, 127, 0xf2, 7, 7, 7, 7]), [1.0]);
        // Data without a status, a message cut short by the next, an exclusive one that never ends.
        assert_eq!(control(&[7, 7, 7, 0xb0, 7, 0xb0, 7, 127]), [1.0]);
        assert_eq!(control(&[0xb0, 0x90, 7, 7, 0xf0, 1, 2, 3, 0xb0, 7, 0]), [0.0]);
    }

    proptest! {
        #[test]
        fn any_stream_gives_numbers_within_the_range(bytes in prop::collection::vec(any::<u8>(), 0..500)) {
            let mut stream = ByteStream::default();
            for event in bytes.iter().filter_map(|byte| stream.take(*byte)) {
                prop_assert!((0.0..=1.0).contains(&event.share));
            }
        }

        #[test]
        fn any_bytes_are_within_the_range(bytes in prop::collection::vec(any::<u8>(), 0..5)) {
            let share = Event::parse(&bytes).map_or(0.0, |event| event.share);
            prop_assert!((0.0..=1.0).contains(&share));
        }
    }
}
