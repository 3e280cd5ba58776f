//! Soundcards, whose clock drives a live run, and whose inputs read sensors.
//!
//! Access to a real card needs cpal, which on Linux needs the headers of ALSA: it is the feature `soundcard`, always on
//! where no system package is needed (macOS, Windows). Which streams a graph requests is known in every build.

#[cfg(any(feature = "soundcard", target_os = "macos", windows))]
mod backend;
#[cfg(any(test, feature = "soundcard", target_os = "macos", windows))]
mod fill;
#[cfg(any(test, feature = "soundcard", target_os = "macos", windows))]
mod listen;
#[cfg(any(feature = "soundcard", target_os = "macos", windows))]
mod play;
#[cfg(any(feature = "soundcard", target_os = "macos", windows))]
mod reconnecting;
mod request;
#[cfg(any(test, feature = "soundcard", target_os = "macos", windows))]
mod shared;
#[cfg(any(feature = "soundcard", target_os = "macos", windows))]
mod streams;
#[cfg(any(feature = "soundcard", target_os = "macos", windows))]
mod system;
#[cfg(not(any(feature = "soundcard", target_os = "macos", windows)))]
mod without;

#[cfg(not(any(feature = "soundcard", target_os = "macos", windows)))]
pub use without::{list, play_once, ready_to_play};
#[cfg(any(feature = "soundcard", target_os = "macos", windows))]
pub use {
    play::{play_once, ready_to_play},
    system::list,
};

pub use haptograph_nodes::soundcard::{CardFormat, Request};
pub use request::{CardOutputSink, CardRequests, InputRequest, card_requests, output_sinks};

use crate::backend::BackendEntry;
use haptograph_engine::device::DeviceKind;
use haptograph_engine::run::Histogram;
use haptograph_nodes::soundcard::{
    Soundcard, SoundcardAccelerometer, SoundcardHaptuator, SoundcardInput, SoundcardVoltage,
};

/// Soundcards. Without them their device kinds can still be checked and run offline.
pub const BACKEND: BackendEntry = BackendEntry {
    what: "soundcards",
    feature: "soundcard",
    kinds: &[
        Soundcard::SPEC.name,
        SoundcardVoltage::SPEC.name,
        SoundcardAccelerometer::SPEC.name,
        SoundcardInput::SPEC.name,
        SoundcardHaptuator::SPEC.name,
    ],
    is_built: cfg!(any(feature = "soundcard", target_os = "macos", windows)),
    drives: true,
    drives_any_clock: false,
    #[cfg(any(feature = "soundcard", target_os = "macos", windows))]
    new: Some(|| Box::new(backend::Soundcards::default())),
    #[cfg(not(any(feature = "soundcard", target_os = "macos", windows)))]
    new: None,
};

/// Error of a soundcard.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum SoundcardError {
    /// The program was built without soundcards.
    #[error("this program was built without soundcards, the feature `soundcard`")]
    NotBuilt,
    /// The device ticks on a derived clock.
    #[error("soundcard `{0}` ticks on a derived clock: put it on a driver clock and bridge to it")]
    Derived(String),
    /// Two endpoints request the card with different settings.
    #[error(
        "devices `{0}` and `{1}` request soundcards that differ in {2}: one soundcard drives a graph, so give both the same"
    )]
    Differ(String, String, &'static str),
    /// Two endpoints drive the same channel.
    #[error("devices `{0}` and `{1}` both drive channel {2} of the soundcard: give each its own")]
    Shared(String, String, u32),
    /// No card matches.
    #[error("there is no soundcard `{wanted}` that {does}; there are: {found}")]
    Unknown {
        /// The requested name.
        wanted: String,
        /// The requested direction, as a verb: `plays` or `listens`.
        does: &'static str,
        /// The cards that exist.
        found: String,
    },
    /// The card does not support the requested stream.
    #[error("{card} does not support {wanted}; it supports: {found}")]
    Unsupported {
        /// Name of the card.
        card: String,
        /// The requested stream.
        wanted: String,
        /// The streams that it supports.
        found: String,
    },
    /// An error of the sound system.
    #[error("the soundcard cannot be opened: {0}")]
    System(String),
}

/// A soundcard of this machine.
#[derive(Debug, Clone, PartialEq, Eq)]
#[cfg_attr(feature = "supervisor", derive(serde::Serialize))]
#[non_exhaustive]
pub struct Listed {
    /// Long name.
    pub about: String,
    /// Capture, if the card supports it.
    pub listens: Option<Ability>,
    /// Name for the setting `device`.
    pub name: String,
    /// Playback, if the card supports it.
    pub plays: Option<Ability>,
}

/// The capabilities of a card in one direction.
#[derive(Debug, Clone, PartialEq, Eq)]
#[cfg_attr(feature = "supervisor", derive(serde::Serialize))]
#[non_exhaustive]
pub struct Ability {
    /// True if the card is the system's default.
    pub default: bool,
    /// Supported streams, one per line.
    pub formats: Vec<String>,
}

/// A stream as the card opened it.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct OpenedStream {
    /// Name of the card.
    pub card: String,
    /// Rate, Hz.
    pub rate_hz: u32,
    /// Channels of the stream.
    pub channels: u16,
    /// Sample format.
    pub format: String,
    /// Frames of a callback, if the system states them.
    pub buffer_frames: Option<u32>,
}

/// Counts of a stream.
#[derive(Debug, Clone, Default)]
#[non_exhaustive]
pub struct CardCounts {
    /// Under- and overruns that the system reported.
    pub xruns: u64,
    /// Longest delay of a callback after an xrun, ns.
    pub xrun_delay_max_ns: u64,
    /// Time of the last xrun since the start, ns.
    pub xrun_last_ns: u64,
    /// Samples at or beyond full scale.
    pub clipped: u64,
    /// Times that the card vanished.
    pub vanished: u64,
    /// Times between callback and converter, as the system states them.
    pub latency: Histogram,
}
