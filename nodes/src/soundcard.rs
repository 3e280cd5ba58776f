//! Soundcards: devices that an amplifier with a voice-coil actuator hangs on, or a sensor.
//!
//! The device kinds are always there, so that graphs which name them can be checked and run offline anywhere. What
//! moves samples to a real card needs cpal, and that on Linux the headers of ALSA: it is the feature `soundcard`,
//! always on where no system package is needed.

mod card;
#[cfg(any(test, feature = "soundcard", target_os = "macos", windows))]
mod fill;
#[cfg(any(feature = "soundcard", target_os = "macos", windows))]
mod kept;
mod kinds;
#[cfg(any(test, feature = "soundcard", target_os = "macos", windows))]
mod listen;
#[cfg(any(feature = "soundcard", target_os = "macos", windows))]
mod play;
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
pub use without::{CardDriver, Inputs, list, play_once, ready_to_play};
#[cfg(any(feature = "soundcard", target_os = "macos", windows))]
pub use {
    play::{play_once, ready_to_play},
    streams::{CardDriver, Inputs},
    system::list,
};

pub use card::CardFormat;
pub use kinds::{
    SOUNDCARD_SOURCE, Soundcard, SoundcardAccelerometer, SoundcardAccelerometerSettings, SoundcardHaptuator,
    SoundcardHaptuatorSettings, SoundcardInput, SoundcardInputSettings, SoundcardSettings, SoundcardSink,
    SoundcardSinkSettings, SoundcardVoltage, SoundcardVoltageSettings,
};
pub use request::{Heard, Played, Request, Wanted, played, wanted};

use haptograph_engine::run::Histogram;

/// Why a graph cannot be driven by a soundcard.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum SoundcardError {
    /// The program was built without it.
    #[error(
        "this haptograph was built without soundcards; install the headers with `sudo apt install libasound2-dev \
         pkg-config` (Fedora: `sudo dnf install alsa-lib-devel`), then build with `cargo build --release --features \
         soundcard`"
    )]
    NotBuilt,
    /// It does not tick on a driver of its own.
    #[error(
        "device `{0}` is a soundcard and has to tick on a driver clock, not on a derived one: bridge to it"
    )]
    Derived(String),
    /// Two endpoints want the card in two ways.
    #[error("devices `{0}` and `{1}` want soundcards that differ in {2}; one soundcard drives a graph")]
    Differ(String, String, &'static str),
    /// Two endpoints drive one channel.
    #[error("devices `{0}` and `{1}` both drive channel {2} of the soundcard")]
    Shared(String, String, u32),
    /// No such card.
    #[error("there is no soundcard `{wanted}` that {does}; there are: {found}")]
    Unknown {
        /// The name that was asked for.
        wanted: String,
        /// What it should do.
        does: &'static str,
        /// What there is.
        found: String,
    },
    /// The card cannot do what is asked for.
    #[error("{card} cannot do {wanted}; it does: {found}")]
    Unsupported {
        /// Its name.
        card: String,
        /// What was asked for.
        wanted: String,
        /// What it can do.
        found: String,
    },
    /// What the system says.
    #[error("the soundcard cannot be opened: {0}")]
    System(String),
}

/// What there is to say of a card while it runs.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum CardNote {
    /// It went or came.
    Turn(String),
    /// The system complains of it: the same may come a thousand times.
    Complaint(String),
}

/// A soundcard as it is listed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Listed {
    /// Name to give as `device`.
    pub name: String,
    /// Longer name.
    pub about: String,
    /// Can it play?
    pub plays: Option<Ability>,
    /// Can it listen?
    pub listens: Option<Ability>,
}

/// What a card can do one way.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Ability {
    /// Is it the system's default?
    pub default: bool,
    /// Forms of streams: a line for each.
    pub formats: Vec<String>,
}

/// What came of a request for a stream.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Got {
    /// Name of the card.
    pub card: String,
    /// Rate, Hz.
    pub rate_hz: u32,
    /// Channels of the stream.
    pub channels: u16,
    /// Form of its samples.
    pub format: String,
    /// Frames of a callback, as far as the system says.
    pub buffer_frames: Option<u32>,
}

/// What was counted of a stream beside the wake-ups.
#[derive(Debug, Clone, Default)]
pub struct CardCounts {
    /// Under- and overruns that the system reported.
    pub xruns: u64,
    /// The longest time that a callback came late after one, ns.
    pub xrun_delay_max_ns: u64,
    /// When the latest was, since the start, ns.
    pub xrun_last_ns: u64,
    /// Samples at or beyond full scale.
    pub clipped: u64,
    /// How often the card vanished.
    pub vanished: u64,
    /// Times from callback to sound, or from sound to callback, that the system stated.
    pub latency: Histogram,
}
