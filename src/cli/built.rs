//! Optional hardware support of this build, and messages about support that is missing.

use super::Failure;
use crate::engine::graph::Graph;
use crate::live::soundcard::SoundcardError;

/// A class of hardware and the cargo feature that supports it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Hardware {
    pub what: &'static str,
    /// Cargo feature.
    pub feature: &'static str,
    /// True if this build includes the feature.
    pub is_built: bool,
    /// Common prefix of the names of its device kinds.
    kinds: &'static str,
}

pub const SOUNDCARDS: Hardware = Hardware {
    what: "soundcards",
    feature: "soundcard",
    is_built: cfg!(any(feature = "soundcard", target_os = "macos", windows)),
    kinds: "Soundcard",
};
pub const POINTERS: Hardware = Hardware {
    what: "tablets and mice",
    feature: "evdev",
    is_built: cfg!(all(feature = "evdev", target_os = "linux")),
    kinds: "EvdevDevice",
};
pub const SERIAL: Hardware = Hardware {
    what: "serial ports",
    feature: "serial",
    is_built: cfg!(all(feature = "serial", unix)),
    kinds: "SerialInput",
};
pub const MIDI: Hardware = Hardware {
    what: "MIDI ports",
    feature: "midi",
    is_built: cfg!(feature = "midi"),
    kinds: "MidiInput",
};

/// Classes of hardware that a graph's devices need and this build lacks, with the endpoints that need them.
fn missing(graph: &Graph) -> Vec<(Hardware, Vec<&str>)> {
    let lacking = [SOUNDCARDS, POINTERS, SERIAL, MIDI]
        .into_iter()
        .filter(|hardware| !hardware.is_built);
    let with_needs = lacking.map(|hardware| {
        let devices = graph.devices().iter();
        let needing = devices.filter(|device| device.entry.spec.name.starts_with(hardware.kinds));
        (hardware, needing.map(|device| device.name.as_str()).collect())
    });
    with_needs
        .filter(|(_, endpoints): &(_, Vec<&str>)| !endpoints.is_empty())
        .collect()
}

/// Refuses a live run of a graph whose devices this build does not support, and names all missing features.
pub fn refuse_missing(graph: &Graph, set: &str) -> Result<(), Failure> {
    let missing = missing(graph);
    if missing.is_empty() {
        return Ok(());
    }
    let needs: Vec<String> = missing
        .iter()
        .map(|(hardware, endpoints)| format!("{} (`{}`)", hardware.what, endpoints.join("`, `")))
        .collect();
    let features: Vec<&str> = missing.iter().map(|(hardware, _)| hardware.feature).collect();
    let headers = match missing
        .iter()
        .any(|(hardware, _)| [SOUNDCARDS, MIDI].contains(hardware))
    {
        true => {
            "; on Linux it needs `sudo apt install libasound2-dev pkg-config` (Fedora: `sudo dnf install alsa-lib-devel`)"
        }
        false => "",
    };
    Err(Failure::Message(format!(
        "the {set} endpoints of this graph need {}, which this build of haptograph does not support; build with `cargo build \
         --release --features {}`{headers}; to run without hardware, give --endpoints simulated",
        needs.join(" and "),
        features.join(",")
    )))
}

/// Why the sound of a run cannot be played, what that means for the run, and where the sound can be heard.
pub fn cannot_play(error: &SoundcardError, run: &str) -> Failure {
    Failure::Message(format!(
        "--play: {error}; {run}: the player on the run's page needs no soundcard here"
    ))
}
