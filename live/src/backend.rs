//! The trait of a backend, which reaches real devices, and its entry in a table.

use crate::soundcard::{CardCounts, SoundcardError};
use haptograph_engine::graph::{Graph, GraphDevice};
use haptograph_engine::run::{Player, RingReport};
use haptograph_nodes::network::link::Counts as PacketCounts;
use std::net::SocketAddr;
use std::path::PathBuf;

/// The real-time sides of a live run that no driver has taken yet, each with its driver clock.
pub type Lives = Vec<(usize, Player)>;

/// Reaches the real devices of some kinds in a live run.
///
/// 1. [`open`](Self::open) connects the devices of a graph. Another graph may be opened during the run.
/// 2. [`drive`](Self::drive) takes and starts, once, the drivers whose clocks are devices of the backend.
/// 3. [`keep`](Self::keep) or [`undo`](Self::undo) follows each open: the graph runs, or it does not after all.
/// 4. [`poll`](Self::poll), [`status`](Self::status) and [`counts`](Self::counts) serve the supervisor.
/// 5. [`close`](Self::close) waits for the drivers and returns the live runs that they drove. Dropping it disconnects
///    the devices.
///
/// A backend has one entry in [`BACKENDS`](crate::BACKENDS), or one that a program adds to its registry. This one reaches a printer, which sends
/// and counts nothing:
///
/// ```
/// use haptograph_engine::graph::Graph;
/// use haptograph_live::{Backend, BackendEntry, BackendError, Connected, Counts, add_backend};
///
/// #[derive(Default)]
/// struct Printer {
///     connected: Vec<Connected>,
///     /// How many of them the running graph has.
///     kept: usize,
/// }
///
/// impl Backend for Printer {
///     fn open(&mut self, graph: &mut Graph) -> Result<(), BackendError> {
///         for device in graph.devices().iter().filter(|device| device.entry.spec.name == "Printer") {
///             if !self.connected.iter().any(|known| known.names[0] == device.name) {
///                 self.connected.push(Connected::link(&device.name, "/dev/usb/lp0"));
///             }
///         }
///         Ok(())
///     }
///
///     fn undo(&mut self) {
///         self.connected.truncate(self.kept);
///     }
///
///     fn keep(&mut self, graph: &Graph) {
///         self.connected.retain(|known| graph.devices().iter().any(|device| device.name == known.names[0]));
///         self.kept = self.connected.len();
///     }
///
///     fn status(&self) -> Vec<Connected> {
///         self.connected.clone()
///     }
///
///     fn counts(&self) -> Vec<Counts> {
///         self.connected.iter().map(|_| Counts::None).collect()
///     }
/// }
///
/// let mut registry = haptograph_nodes::registry();
/// // registry.add_device(DeviceEntry::of::<PrinterKind>()); and nodes that print
/// add_backend(&mut registry, BackendEntry::new("printers", &["Printer"], || Box::new(Printer::default())));
/// ```
pub trait Backend: Send {
    /// Connects the devices of a graph that are not connected yet, and attaches their bodies.
    ///
    /// # Errors
    /// [`BackendError`] if a device cannot be reached, or conflicts with a connected one.
    fn open(&mut self, graph: &mut Graph) -> Result<(), BackendError>;

    /// Disconnects what the last [`open`](Self::open) connected.
    fn undo(&mut self) {}

    /// Takes over the names and settings of the graph that was opened last.
    fn keep(&mut self, graph: &Graph) {
        let _ = graph;
    }

    /// Takes and starts the drivers whose clocks are devices of the backend. Called on backends that can drive
    /// ([`BackendEntry::drives`]); [`status`](Self::status) then reports each of them ([`Connected::driver`]).
    ///
    /// # Errors
    /// [`BackendError`] if a driver cannot be started.
    fn drive(&mut self, graph: &Graph, lives: &mut Lives) -> Result<(), BackendError> {
        let _ = (graph, lives);
        Ok(())
    }

    /// Events since the last call.
    fn poll(&mut self) -> Vec<BackendEvent> {
        Vec::new()
    }

    /// Connections and drivers of the backend. The run ends when all drivers are [`State::Finished`].
    fn status(&self) -> Vec<Connected>;

    /// Counts of each connection, in the order of [`status`](Self::status).
    fn counts(&self) -> Vec<Counts>;

    /// Rings from the clocks of the backend's devices to those of the graph.
    fn rings(&self) -> Vec<RingReport> {
        Vec::new()
    }

    /// Waits for the drivers, whose stop flags are set, and returns the live runs that they drove.
    ///
    /// # Errors
    /// [`BackendError::Lost`] if a driver's thread panicked.
    fn close(&mut self) -> Result<Lives, BackendError> {
        Ok(Lives::new())
    }
}

/// A connection to a device, or a driver.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct Connected {
    /// Names of the endpoints; of a driver, its clock.
    pub names: Vec<String>,
    /// Role of the connection.
    pub role: Role,
    /// The clock that a driver drives; `None` for other roles.
    pub clock: Option<usize>,
    /// Address, path, port, stream or timer.
    pub place: String,
    /// The same in short: of a soundcard its name.
    pub hardware: String,
    /// State of the connection or driver.
    pub state: State,
    /// Privileges that the system refused at the start, and how to grant them.
    pub refused: Vec<String>,
}

impl Connected {
    /// A working connection of a device.
    pub fn link(name: &str, place: impl Into<String>) -> Self {
        let place = place.into();
        Self {
            names: vec![name.to_owned()],
            role: Role::Link,
            clock: None,
            hardware: place.clone(),
            place,
            state: State::Running,
            refused: Vec::new(),
        }
    }

    /// A running driver of a clock: its name and its index in the graph.
    pub fn driver(name: &str, clock: usize, place: impl Into<String>) -> Self {
        Self { role: Role::Driver, clock: Some(clock), ..Self::link(name, place) }
    }
}

/// Role of a connection.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Role {
    /// The connection drives a part of the graph.
    Driver,
    /// The connection delivers the samples of a sensor.
    Input,
    /// It exchanges the latest values with a device.
    Link,
}

/// State of a connection or driver.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum State {
    /// It works.
    Running,
    /// The device is gone and may come back.
    Waiting,
    /// The run is over, and every actuator of the driver is at zero.
    Finished,
}

/// Counts of a connection.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub enum Counts {
    /// Nothing: a timer.
    None,
    /// Packets or events of a device, and the OSC addresses of messages that no device listens to.
    Packets(PacketCounts, Vec<(String, u64)>),
    /// Samples of a soundcard's stream.
    Stream(Box<CardCounts>),
}

/// A message about a device during a run.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum BackendEvent {
    /// The device vanished or came back.
    Changed(String),
    /// An error of the system, which may repeat many times.
    Failed(String),
}

/// Error of a device, a live input or a driver.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum BackendError {
    /// The address cannot be bound.
    #[error("device `{device}` cannot listen at {address}: {error}")]
    Bind {
        /// Name of the endpoint.
        device: String,
        /// The address.
        address: SocketAddr,
        /// Error of the system.
        error: std::io::Error,
    },
    /// The event device cannot be read.
    #[error("device `{device}` cannot be read from {}: {error}", path.display())]
    Input {
        /// Name of the endpoint.
        device: String,
        /// The event device.
        path: PathBuf,
        /// The error.
        error: std::io::Error,
    },
    /// An input cannot be opened.
    #[error("input `{device}` cannot be opened at {place}: {error}")]
    Place {
        /// Name of the endpoint.
        device: String,
        /// An address, a serial port or a MIDI port.
        place: String,
        /// The error.
        error: std::io::Error,
    },
    /// Inputs at one serial port differ in `baud`.
    #[error("input `{0}` reads {1} at another rate than other inputs: give all of them the same `baud`")]
    Differ(String, String),
    /// Two endpoints listen at the same address.
    #[error("devices `{0}` and `{1}` both listen at {2}; give each a port of its own")]
    Shared(String, String, SocketAddr),
    /// The program was built without the backend of the device.
    #[error(
        "device `{device}` cannot be reached: this program was built without {what}; build it with the feature `{feature}`"
    )]
    NotBuilt {
        /// Name of the endpoint.
        device: String,
        /// The hardware that cannot be reached, in the plural.
        what: &'static str,
        /// The cargo feature.
        feature: &'static str,
    },
    /// A soundcard cannot be used.
    #[error(transparent)]
    Soundcard(#[from] SoundcardError),
    /// The graph needs soundcard streams that the run does not have.
    #[error("the graph needs {0}, which this run does not have; start a new run")]
    Stream(&'static str),
    /// No thread can be started.
    #[error(transparent)]
    Thread(std::io::Error),
    /// A backend of the program's own took the driver of a clock and does not report it, so that the run could not be stopped.
    #[error("the backend of {what} drives the clock `{clock}` and does not report it; its `status` has to")]
    Unreported {
        /// The backend's hardware.
        what: &'static str,
        /// Name of the clock.
        clock: String,
    },
    /// A backend of the program's own reaches a device that counts as simulated: nothing would disarm it.
    #[error(
        "device `{device}` is reached by the backend of {what}, but its kind `{kind}` is declared as simulated; declare it \
         `simulated: false`"
    )]
    Simulated {
        /// Name of the endpoint.
        device: String,
        /// Its kind.
        kind: &'static str,
        /// The backend's hardware.
        what: &'static str,
    },
    /// No backend of the registry reaches a real device, or one that drives the graph, which the caller does here.
    #[error(
        "nothing reaches device `{device}`, a `{kind}`: add a backend of that kind to the registry; one that drives the graph is \
         for `Drivers` or a `Supervisor`"
    )]
    Unreached {
        /// Name of the endpoint.
        device: String,
        /// Its kind.
        kind: &'static str,
    },
    /// A clock has no driver.
    #[error("nothing drives the clock `{0}`: this program was built without the feature `timer`")]
    NoDriver(String),
    /// A driver's thread panicked.
    #[error("the driver thread ended early")]
    Lost,
}

/// A backend of the table.
#[derive(Debug, Clone, Copy)]
#[non_exhaustive]
pub struct BackendEntry {
    /// The hardware, in the plural.
    pub what: &'static str,
    /// The cargo feature of this crate; empty for a backend of the program's own.
    pub feature: &'static str,
    /// Device kinds that the backend reaches.
    pub kinds: &'static [&'static str],
    /// True if this program was built with the backend.
    pub is_built: bool,
    /// True if the backend can drive a graph.
    pub drives: bool,
    /// True if it drives any clock that no other backend drives.
    pub(crate) drives_any_clock: bool,
    /// Makes the backend, without connections; `None` if this program was built without it.
    pub(crate) new: Option<fn() -> Box<dyn Backend>>,
}

impl BackendEntry {
    /// A backend of the program's own: the hardware, in the plural, the device kinds that it reaches, and what makes it.
    pub const fn new(
        what: &'static str,
        kinds: &'static [&'static str],
        new: fn() -> Box<dyn Backend>,
    ) -> Self {
        Self {
            what,
            feature: "",
            kinds,
            is_built: true,
            drives: false,
            drives_any_clock: false,
            new: Some(new),
        }
    }

    /// The same, of a backend that can drive a graph ([`Backend::drive`]).
    #[must_use]
    pub const fn driving(mut self) -> Self {
        self.drives = true;
        self
    }

    /// True if the backend is a program's own, and not one of the table.
    pub(crate) fn is_own(&self) -> bool {
        self.feature.is_empty()
    }

    /// True if the backend reaches a device.
    pub(crate) fn reaches(&self, device: &GraphDevice) -> bool {
        self.kinds.contains(&device.entry.spec.name)
    }

    /// The endpoints of a graph that the backend reaches.
    pub fn endpoints(self, graph: &Graph) -> impl Iterator<Item = &str> {
        let own = graph.devices().iter().filter(move |device| self.reaches(device));
        own.map(|device| &*device.name)
    }

    /// The backend; in a program that was built without it, one that refuses its devices.
    pub(crate) fn make(&self) -> Box<dyn Backend> {
        match self.new {
            Some(new) => new(),
            None => Box::new(Missing(*self)),
        }
    }
}

/// Stands in for a backend that is not built, and refuses its devices.
struct Missing(BackendEntry);

impl Backend for Missing {
    fn open(&mut self, graph: &mut Graph) -> Result<(), BackendError> {
        match self.0.endpoints(graph).next() {
            Some(device) => Err(BackendError::NotBuilt {
                device: device.to_owned(),
                what: self.0.what,
                feature: self.0.feature,
            }),
            None => Ok(()),
        }
    }

    fn status(&self) -> Vec<Connected> {
        Vec::new()
    }

    fn counts(&self) -> Vec<Counts> {
        Vec::new()
    }
}
