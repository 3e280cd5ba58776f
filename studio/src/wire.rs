//! Messages of the page: parsing, with bounds.

use super::learn::{Compared, Dropped};
use super::pattern::Kept;
use super::pointer::{MAX_DEG, MAX_M, MAX_N, Pointer};
use super::record::Recording;
use haptograph_study::conduct::Said;
use serde::Deserialize;
use serde_json::Value;

/// Version of the protocol.
pub(crate) const VERSION: u32 = 1;
/// Subprotocol of the WebSocket.
pub(crate) const SUBPROTOCOL: &str = "haptograph.studio.1";
/// Maximum size of a message, bytes; recordings to learn from or to replay may be larger.
pub(crate) const MAX_BYTES: usize = 1 << 20;
pub(crate) const MAX_LEARNED_BYTES: usize = 80 << 20;
/// Beginnings of such messages.
const LONG: [&str; 4] =
    [r#"{"type":"export""#, r#"{"type":"learn""#, r#"{"type":"listen""#, r#"{"type":"replay""#];
/// Maximum number of ports displayed by a page.
pub(crate) const MAX_SCOPES: usize = 16;

/// A message in either direction.
#[derive(Debug, Clone, PartialEq)]
pub enum Message {
    /// JSON.
    Text(String),
    /// Pointers, samples or sound.
    Binary(Vec<u8>),
}

impl Message {
    /// Length, bytes.
    #[cfg(not(target_family = "wasm"))]
    pub(crate) fn length(&self) -> usize {
        match self {
            Self::Text(text) => text.len(),
            Self::Binary(bytes) => bytes.len(),
        }
    }
}

/// A JSON message of the page.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(tag = "type", rename_all = "lowercase")]
pub(crate) enum ClientMessage {
    /// Set a live setting.
    Set {
        name: String,
        value: f64,
    },
    /// Set a graph parameter, as RON text.
    Parameter {
        request: u64,
        name: String,
        value: String,
    },
    /// Check this text.
    Check {
        request: u64,
        text: String,
    },
    /// Swap this text in.
    Apply {
        request: u64,
        text: String,
    },
    /// Write this text to the graph's file.
    Save {
        request: u64,
        text: String,
    },
    /// Send the running text and the files that it needs.
    Files {
        request: u64,
    },
    /// The page's text stays, whatever another program wrote into the file.
    Keep,
    /// Send these ports.
    Scope {
        ports: Vec<ScopeRequest>,
    },
    /// Enable or disable the sound.
    Sound {
        on: bool,
    },
    /// Enable or disable levels and costs, for the drawing.
    Levels {
        on: bool,
    },
    /// Learn a surface from a recording.
    Learn {
        request: u64,
        #[serde(flatten)]
        dropped: Dropped,
    },
    /// Listen to a recording, and to surfaces along its motion.
    Listen {
        request: u64,
        #[serde(flatten)]
        compared: Compared,
    },
    /// Make a file of kept sound.
    Export {
        request: u64,
        #[serde(flatten)]
        kept: Kept,
    },
    /// Cancel the learning that this page requested under this number.
    Cancel {
        request: u64,
    },
    /// Restart the run and record it from its first frame on, or end the recording.
    Record {
        on: bool,
    },
    /// Replay a recording from the first frame of a new run on.
    Replay {
        request: u64,
        recording: Box<Recording>,
    },
    Stop,
    Resume,
    /// Arms the real actuators, at a low gain.
    Arm,
    /// Sets the gain behind the limits while armed, 0 to 1.
    Gain {
        gain: f64,
    },
    /// Keeps the actuators armed.
    Hold,
    Disarm,
    /// Make this page the owner.
    Own,
    /// What a page of a study says.
    Study(Said),
    #[serde(other)]
    Unknown,
}

impl ClientMessage {
    /// True for messages about files, other graphs, the end of a STOP, or real actuators, which pages on the
    /// network must not send.
    pub(crate) fn is_for_machine(&self) -> bool {
        matches!(
            self,
            Self::Apply { .. }
                | Self::Check { .. }
                | Self::Save { .. }
                | Self::Files { .. }
                | Self::Keep
                | Self::Learn { .. }
                | Self::Listen { .. }
                | Self::Export { .. }
                | Self::Cancel { .. }
                | Self::Record { .. }
                | Self::Replay { .. }
                | Self::Resume
                | Self::Arm
                | Self::Gain { .. }
                | Self::Hold
        )
    }

    /// The number of a message that is answered by a reply.
    pub(crate) fn request(&self) -> Option<u64> {
        match self {
            Self::Parameter { request, .. }
            | Self::Check { request, .. }
            | Self::Apply { request, .. }
            | Self::Save { request, .. }
            | Self::Files { request }
            | Self::Replay { request, .. }
            | Self::Learn { request, .. }
            | Self::Listen { request, .. }
            | Self::Export { request, .. } => Some(*request),
            _ => None,
        }
    }
}

/// A port to send.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize)]
pub(crate) struct ScopeRequest {
    pub name: String,
    /// Send every frame, even at high rates.
    #[serde(default)]
    pub raw: bool,
}

/// Reason why a message is rejected.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub(crate) enum WireError {
    /// Not a message of the protocol.
    #[error("unknown message: {0}")]
    Json(String),
    /// The message is longer than any of the protocol.
    #[error("a message of {0} bytes is too long")]
    Long(usize),
    /// A binary message of another kind or length.
    #[error("a binary message of {0} bytes is not a list of pointers")]
    Binary(usize),
    /// A pointer out of range.
    #[error(
        "a pointer is at NaN or infinity, further than {MAX_MM} mm from the middle, presses with more than {MAX_N} N, or is tilted by more than {MAX_DEG} degrees"
    )]
    Pointer,
}

const MAX_MM: f64 = MAX_M * 1e3;
const HEAD: usize = 8;
const POINTER: usize = 28;

/// Checks that no text but one with a recording is long.
///
/// # Errors
/// [`WireError::Long`].
pub(crate) fn check_length(text: &str) -> Result<(), WireError> {
    match text.len() > MAX_BYTES && !LONG.iter().any(|long| text.starts_with(long)) {
        true => Err(WireError::Long(text.len())),
        false => Ok(()),
    }
}

/// Parses a text message; `None` if its type is unknown.
pub(crate) fn parse_text(text: &str) -> Result<Option<ClientMessage>, WireError> {
    check_length(text)?;
    let wrong = |error: serde_json::Error| WireError::Json(error.to_string());
    let message = serde_json::from_str(text).map_err(wrong)?;
    Ok(Some(message).filter(|message| *message != ClientMessage::Unknown))
}

/// Pointers on a pad or input.
#[derive(Debug, PartialEq)]
pub(crate) struct Pointers {
    pub number: usize,
    /// Number of the graph that they were made for; `None` for any.
    pub graph: Option<u16>,
    /// True if they are sent ahead of their times, which are exact.
    pub are_planned: bool,
    pub points: Vec<Pointer>,
}

/// Parses a list of pointers.
pub(crate) fn pointers(bytes: &[u8]) -> Result<Pointers, WireError> {
    let wrong = || WireError::Binary(bytes.len());
    let (head, body) = bytes.split_at_checked(HEAD).ok_or_else(wrong)?;
    let count = usize::from(u16::from_le_bytes([head[2], head[3]]));
    if bytes.len() > MAX_BYTES || head[0] != 1 || body.len() != count * POINTER {
        return Err(wrong());
    }
    let points = body.chunks_exact(POINTER).map(pointer);
    let points = points.collect::<Option<Vec<_>>>().ok_or(WireError::Pointer)?;
    let graph = Some(u16::from_le_bytes([head[6], head[7]])).filter(|graph| *graph != 0);
    Ok(Pointers { number: usize::from(head[1]), graph, are_planned: head[4] == 1, points })
}

fn pointer(bytes: &[u8]) -> Option<Pointer> {
    let (time, rest) = bytes.split_first_chunk()?;
    let (x, rest) = rest.split_first_chunk()?;
    let (y, rest) = rest.split_first_chunk()?;
    let (force, rest) = rest.split_first_chunk()?;
    let (right, rest) = rest.split_first_chunk()?;
    let (towards, _) = rest.split_first_chunk()?;
    let time_ms = f64::from_le_bytes(*time);
    let [x_mm, y_mm, force_n] = [x, y, force].map(|four| f32::from_le_bytes(*four));
    let tilt_deg = [right, towards].map(|four| f64::from(f32::from_le_bytes(*four)));
    let is_near = |mm: f32| f64::from(mm.abs()) <= MAX_MM;
    // Comparisons with NaN are false.
    let is_right = is_near(x_mm)
        && is_near(y_mm)
        && (0.0..=MAX_N).contains(&f64::from(force_n))
        && tilt_deg.iter().all(|tilt| tilt.abs() <= MAX_DEG)
        && time_ms.abs() < 1e15;
    is_right.then(|| Pointer {
        at_s: time_ms * 1e-3,
        position_m: [f64::from(x_mm) * 1e-3, f64::from(y_mm) * 1e-3],
        force_n: f64::from(force_n),
        tilt_deg,
    })
}

/// A JSON value as a message.
pub(crate) fn text(value: &Value) -> Message {
    Message::Text(value.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn message(pad: u8, points: &[(f64, [f32; 5])]) -> Vec<u8> {
        let mut bytes = vec![1, pad];
        bytes.extend((points.len() as u16).to_le_bytes());
        bytes.extend([0; 4]);
        for (time_ms, values) in points {
            bytes.extend(time_ms.to_le_bytes());
            bytes.extend(values.iter().flat_map(|value| value.to_le_bytes()));
        }
        bytes
    }

    #[test]
    fn every_message_is_known_and_unknown_ones_are_no_error() {
        assert_eq!(parse_text(r#"{"type":"keep"}"#), Ok(Some(ClientMessage::Keep)));
        assert_eq!(parse_text(r#"{"type":"of a later version","more":1}"#), Ok(None));
        assert!(matches!(parse_text(r#"{"type":"set"}"#), Err(WireError::Json(_))));
    }

    #[test]
    fn pointers_are_read_in_si_units() {
        let mut bytes = message(1, &[(1500.0, [10.0, -20.0, 1.5, 30.0, -45.0])]);
        assert!(!pointers(&bytes).expect("right").are_planned);
        bytes[4] = 1;
        bytes[6..8].copy_from_slice(&300_u16.to_le_bytes());
        let Pointers { number, graph, are_planned, points } = pointers(&bytes).expect("right");
        assert_eq!(graph, Some(300));
        let [point] = points[..] else { panic!("one") };
        assert_eq!((number, are_planned, point.at_s, point.force_n), (1, true, 1.5, 1.5));
        assert_eq!(point.tilt_deg, [30.0, -45.0]);
        assert!((point.position_m[0] - 0.01).abs() < 1e-9 && (point.position_m[1] + 0.02).abs() < 1e-9);
    }

    #[test]
    fn what_is_no_pointer_is_refused() {
        let right = message(0, &[(0.0, [0.0, 0.0, 1.0, 0.0, 0.0])]);
        for length in 0..right.len() {
            assert_eq!(pointers(&right[..length]), Err(WireError::Binary(length)));
        }
        for values in [
            [f32::NAN, 0.0, 1.0, 0.0],
            [0.0, 2000.0, 1.0, 0.0],
            [0.0, 0.0, -0.1, 0.0],
            [0.0, 0.0, 21.0, 0.0],
            [0.0, 0.0, 1.0, 91.0],
            [0.0, 0.0, 1.0, f32::NAN],
        ] {
            let [x, y, force, tilt] = values;
            let wrong = message(0, &[(0.0, [x, y, force, tilt, 0.0])]);
            assert_eq!(pointers(&wrong), Err(WireError::Pointer), "{values:?}");
        }
        assert_eq!(pointers(&message(0, &[(f64::NAN, [0.0; 5])])), Err(WireError::Pointer));
    }

    #[test]
    fn unknown_messages_are_passed_over_and_wrong_ones_refused() {
        assert_eq!(parse_text(r#"{"type":"dance"}"#), Ok(None));
        assert_eq!(parse_text(r#"{"type":"stop"}"#), Ok(Some(ClientMessage::Stop)));
        for wrong in [
            "",
            "[]",
            "7",
            r#"{"type":7}"#,
            r#"{"type":"set","name":"a"}"#,
            r#"{"type":"set","name":"a","value":"b"}"#,
        ] {
            assert!(parse_text(wrong).is_err(), "{wrong}");
        }
    }
}
