//! Requests to a live run, and its events.

use crate::SettingValue;
use haptograph_engine::diagnostic::Diagnostics;
use haptograph_engine::graph::{Graph, GraphDevice};
use haptograph_engine::run::Change;
use std::fmt;

/// A request to a running graph: another value of a parameter (`gain`) or of a live setting of a node (`out.gain`).
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Request {
    /// The parameter or setting.
    pub name: String,
    /// The new value.
    pub value: SettingValue,
    /// Origin of the request.
    pub origin: Origin,
}

impl Request {
    /// A request of the embedding program.
    pub fn new(name: impl Into<String>, value: impl Into<SettingValue>) -> Self {
        Self::from_origin(Origin::Program, name, value)
    }

    /// A request of another origin.
    pub fn from_origin(origin: Origin, name: impl Into<String>, value: impl Into<SettingValue>) -> Self {
        Self { name: name.into(), value: value.into(), origin }
    }
}

/// Origin of a request.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Origin {
    /// A person at the terminal.
    Keyboard,
    /// The embedding program.
    Program,
    /// The network: values are checked more strictly, and limits and devices cannot be changed.
    Osc,
}

impl Origin {
    /// The name in the history.
    pub(super) fn as_str(self) -> &'static str {
        match self {
            Self::Keyboard => "typed",
            Self::Program => "program",
            Self::Osc => "OSC",
        }
    }
}

/// An event of a live run. It displays as one line of text.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub enum Event {
    /// A soundcard or another device vanished, came back, or failed.
    Device(String),
    /// A live input fell silent or delivers data again.
    Silence(String),
    /// A file can no longer be written.
    FileFailed(String),
    /// A live setting has another value.
    Set(String, f64),
    /// A refused request, with the reason.
    Refused(String),
    /// Errors or warnings of a graph that was loaded.
    Findings(Diagnostics),
    /// Another graph runs, or the same graph with other settings: how it took over, and the message about it.
    Changed(Change, String),
    /// The limit of an actuator has changed.
    Limit(String),
    /// The files of a saved graph could not be copied into the run's folder.
    NotKept(String),
}

impl fmt::Display for Event {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Device(note) | Self::Silence(note) => write!(f, "note: {note}"),
            Self::FileFailed(failed) => write!(
                f,
                "warning: {failed}; the file is complete up to here, and the run continues without it"
            ),
            Self::Set(name, value) => write!(f, "{name} is {value}"),
            Self::Findings(findings) => findings.fmt(f),
            Self::Refused(text) | Self::Changed(_, text) | Self::Limit(text) | Self::NotKept(text) => {
                f.write_str(text)
            }
        }
    }
}

/// A use of a device by a run.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct DeviceUse {
    /// Name of the endpoint.
    pub name: String,
    /// Kind of the device.
    pub kind: &'static str,
    /// True if the device is driven, not read.
    pub is_driven: bool,
    /// True if the device is simulated.
    pub is_simulated: bool,
}

impl DeviceUse {
    /// The devices of a graph: those that are read, then those that are driven.
    pub fn of(graph: &Graph) -> Vec<Self> {
        let one = |is_driven| {
            move |device: &GraphDevice| Self {
                name: device.name.clone(),
                kind: device.entry.spec.name,
                is_driven,
                is_simulated: device.entry.spec.simulated,
            }
        };
        let read = graph.read_devices().map(one(false));
        read.chain(graph.driven_devices().map(one(true))).collect()
    }
}
