//! Numbers by MIDI: controllers, keys and pitch wheels.

#[cfg(any(test, feature = "midi"))]
mod event;
#[cfg(feature = "midi")]
mod port;
#[cfg(any(test, feature = "midi"))]
mod selector;

use crate::backend::BackendEntry;
use haptograph_engine::device::DeviceKind;
use haptograph_nodes::network::inputs::MidiInput;

/// MIDI ports.
pub const BACKEND: BackendEntry = BackendEntry {
    what: "MIDI ports",
    feature: "midi",
    kinds: &[MidiInput::SPEC.name],
    is_built: cfg!(feature = "midi"),
    drives: false,
    drives_any_clock: false,
    #[cfg(feature = "midi")]
    new: Some(crate::numbers::Listeners::<port::MidiPort>::boxed),
    #[cfg(not(feature = "midi"))]
    new: None,
};

/// Names of the MIDI ports of this machine; empty in a build without MIDI.
pub fn midi_ports() -> Vec<String> {
    #[cfg(feature = "midi")]
    let names = port::names().unwrap_or_default();
    #[cfg(not(feature = "midi"))]
    let names = Vec::new();
    names
}
