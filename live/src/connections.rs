//! The backends of a run, together.

use crate::backend::{Backend, BackendEntry, BackendError, BackendEvent, Connected, Counts, Role};
use crate::backends::backends;
use haptograph_engine::graph::Graph;
use haptograph_engine::registry::Registry;
use haptograph_engine::run::RingReport;
use haptograph_nodes::network::link::Counts as PacketCounts;

/// The connected devices of a live run. Dropping it disconnects them.
///
/// For a program that drives a graph itself, with devices that haptograph reaches:
///
/// ```
/// use haptograph_engine::document::Document;
/// use haptograph_engine::graph::{CheckOptions, check};
/// use haptograph_engine::run::{FileSinks, Session, SessionOptions};
/// use haptograph_live::Connections;
///
/// # if !haptograph_live::udp::BACKEND.is_built { return Ok(()); }
/// let text = r#"Graph(format: 1, clocks: { "servo": Driver(rate_hz: 1000) },
///     nodes: { "touch": Tablet(clock: "servo", endpoint: "stylus") },
///     endpoints: { "simulated": { "stylus": UdpDevice(listen: "127.0.0.1:0") } })"#;
/// let document = Document::parse("g.ron", text)?;
/// let registry = haptograph_nodes::registry();
/// let mut graph = check(&document, &registry, &CheckOptions::default())?;
/// let mut connections = Connections::new(&registry);
/// connections.connect(&mut graph)?;
/// println!("send packets to {}", connections.place("stylus").unwrap());
/// let (mut live, mut session) = Session::open(FileSinks::new(&graph), &SessionOptions::default())?;
/// connections.keep(&graph);
/// for _ in 0..10 {
///     // In the program's own callback.
///     live.process(64);
///     // Elsewhere, now and then.
///     session.poll();
///     connections.poll();
/// }
/// assert_eq!(session.finish(live).outcome.driver_frames, 640);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Connections {
    backends: Vec<Member>,
    /// The backends of the registry that are left to the caller, who drives.
    left_out: Vec<BackendEntry>,
    /// True if a graph was connected since the last error, undo or keep.
    is_undoable: bool,
}

struct Member {
    entry: BackendEntry,
    backend: Box<dyn Backend>,
}

impl Connections {
    /// The backends of a registry, for a program that drives the graph itself.
    pub fn new(registry: &Registry) -> Self {
        Self::of(registry, |entry| !entry.drives)
    }

    /// All backends of a registry, those that drive the graph included, for [`Drivers`](crate::Drivers).
    pub fn with_drivers(registry: &Registry) -> Self {
        Self::of(registry, |_| true)
    }

    fn of(registry: &Registry, is_member: impl FnMut(&BackendEntry) -> bool) -> Self {
        let (members, left_out): (Vec<_>, Vec<_>) = backends(registry).into_iter().partition(is_member);
        let member = |entry: BackendEntry| Member { backend: entry.make(), entry };
        Self { backends: members.into_iter().map(member).collect(), left_out, is_undoable: false }
    }

    /// Refuses real devices that nothing reaches, and reached ones that would count as simulated.
    fn check(&self, graph: &Graph) -> Result<(), BackendError> {
        for device in graph.devices().iter().filter(|device| !device.entry.is_host()) {
            let mut entries = self.backends.iter().map(|member| member.entry);
            let reaching = entries.find(|entry| entry.reaches(device));
            // A caller that drives reaches other devices itself, but drives in the place of a backend of the program's own.
            let is_left_out = || {
                let mut own = self.left_out.iter().filter(|entry| entry.is_own());
                self.left_out.is_empty() || own.any(|entry| entry.reaches(device))
            };
            let (name, kind) = (device.name.clone(), device.entry.spec.name);
            match reaching {
                Some(entry) if device.entry.spec.simulated && !device.entry.spec.drives.is_empty() => {
                    let (device, what) = (name, entry.what);
                    return Err(BackendError::Simulated { device, kind, what });
                }
                None if !device.entry.spec.simulated && is_left_out() => {
                    return Err(BackendError::Unreached { device: name, kind });
                }
                _ => {}
            }
        }
        Ok(())
    }

    fn all(&self) -> impl Iterator<Item = &dyn Backend> {
        self.backends.iter().map(|member| &*member.backend)
    }

    fn all_mut(&mut self) -> impl Iterator<Item = &mut Box<dyn Backend>> {
        self.backends.iter_mut().map(|member| &mut member.backend)
    }

    /// Connects the devices of a graph that are not connected yet, and attaches their bodies. [`Self::undo`] disconnects them
    /// if the graph is not run after all.
    ///
    /// # Errors
    /// [`BackendError`]; earlier connections remain, no new one is made, and another graph can be connected.
    pub fn connect(&mut self, graph: &mut Graph) -> Result<(), BackendError> {
        self.is_undoable = false;
        self.check(graph)?;
        for number in 0..self.backends.len() {
            if let Err(error) = self.backends[number].backend.open(graph) {
                self.all_mut().take(number + 1).for_each(|opened| opened.undo());
                return Err(error);
            }
        }
        self.is_undoable = true;
        Ok(())
    }

    /// Disconnects what the last [`Self::connect`] connected: nothing if it failed, or if its graph was
    /// [kept](Self::keep).
    pub fn undo(&mut self) {
        if std::mem::take(&mut self.is_undoable) {
            self.all_mut().for_each(|backend| backend.undo());
        }
    }

    /// Takes over the names and settings of the running graph's devices. Packets of devices that it does
    /// not have are still counted, for a later graph that has them again.
    pub fn keep(&mut self, graph: &Graph) {
        self.is_undoable = false;
        self.all_mut().for_each(|backend| backend.keep(graph));
    }

    /// Replaces the running graph: connects the devices of the new one, then hands it over by `change`. On an error the running
    /// graph continues with its connections.
    ///
    /// # Errors
    /// A description of the error of the connection or of `change`.
    pub fn replace<T, E: std::fmt::Display>(
        &mut self,
        graph: &mut Graph,
        change: impl FnOnce(&Graph) -> Result<T, E>,
    ) -> Result<T, String> {
        self.connect(graph).map_err(|error| error.to_string())?;
        match change(graph) {
            Ok(changed) => {
                self.keep(graph);
                Ok(changed)
            }
            Err(error) => {
                self.undo();
                Err(error.to_string())
            }
        }
    }

    /// Starts the drivers of a graph.
    ///
    /// # Errors
    /// [`BackendError`] if one cannot be started, or a clock has none.
    pub(crate) fn drive(
        &mut self,
        graph: &Graph,
        mut lives: crate::backend::Lives,
    ) -> Result<(), BackendError> {
        for member in self.backends.iter_mut().filter(|member| member.entry.drives) {
            let before: Vec<usize> = lives.iter().map(|(clock, _)| *clock).collect();
            member.backend.drive(graph, &mut lives)?;
            let status = member.backend.status();
            let is_reported = |clock: usize| {
                let is_it = |known: &Connected| known.role == Role::Driver && known.clock == Some(clock);
                lives.iter().any(|(left, _)| *left == clock) || status.iter().any(is_it)
            };
            if let Some(clock) = before.into_iter().find(|clock| !is_reported(*clock)) {
                return Err(BackendError::Unreported {
                    what: member.entry.what,
                    clock: graph.clocks()[clock].name.clone(),
                });
            }
        }
        match lives.first() {
            Some((clock, _)) => Err(BackendError::NoDriver(graph.clocks()[*clock].name.clone())),
            None => Ok(()),
        }
    }

    /// Events since the last call.
    pub fn poll(&mut self) -> Vec<BackendEvent> {
        self.all_mut().flat_map(|backend| backend.poll()).collect()
    }

    /// All connections and drivers.
    pub fn status(&self) -> Vec<Connected> {
        self.all().flat_map(|backend| backend.status()).collect()
    }

    /// The drivers. Backends without drivers are not polled.
    pub(crate) fn drivers(&self) -> impl Iterator<Item = Connected> {
        let driving = self.backends.iter().filter(|member| member.entry.drives);
        let all = driving.flat_map(|member| member.backend.status());
        all.filter(|connected| connected.role == Role::Driver)
    }

    /// All connections and drivers of a role, with their counts.
    pub fn counted(&self, role: Role) -> impl Iterator<Item = (Connected, Counts)> {
        let all = self.all();
        let all = all.flat_map(|backend| backend.status().into_iter().zip(backend.counts()));
        all.filter(move |(connected, _)| connected.role == role)
    }

    /// Counts of each device's packets, or of its Linux events, and the OSC addresses of messages that no device listens to.
    pub fn packets(&self) -> impl Iterator<Item = (String, PacketCounts, Vec<(String, u64)>)> {
        let links = self.counted(Role::Link);
        links.filter_map(|(connected, counts)| match counts {
            Counts::Packets(packets, unclaimed) => {
                Some((connected.names.into_iter().next()?, packets, unclaimed))
            }
            Counts::None | Counts::Stream(_) => None,
        })
    }

    /// The OSC addresses of messages that came to a device's port and that no device listens to, with the number of
    /// messages.
    pub fn unclaimed(&self, device: &str) -> Vec<(String, u64)> {
        let mut known = self.packets().filter(|(name, ..)| name == device);
        known.next().map_or_else(Vec::new, |(.., unclaimed)| unclaimed)
    }

    /// Address, path or port at which a device is read.
    pub fn place(&self, device: &str) -> Option<String> {
        let mut links = self.status().into_iter();
        let known =
            links.find(|link| link.role == Role::Link && link.names.iter().any(|name| name == device));
        known.map(|link| link.place)
    }

    /// Rings from the clocks of devices to the graph.
    pub fn rings(&self) -> impl Iterator<Item = RingReport> {
        self.all().flat_map(|backend| backend.rings())
    }

    /// Ends the drivers and returns the live runs that they drove.
    ///
    /// # Errors
    /// [`BackendError::Lost`] if a driver's thread panicked.
    pub(crate) fn close(&mut self) -> Result<crate::backend::Lives, BackendError> {
        // All of them, whatever happened to one.
        let closed: Vec<_> = self.all_mut().map(|backend| backend.close()).collect();
        let mut lives = crate::backend::Lives::new();
        for ended in closed {
            lives.extend(ended?);
        }
        lives.sort_by_key(|(clock, _)| *clock);
        Ok(lives)
    }
}

#[cfg(test)]
#[cfg(feature = "udp")]
mod tests {
    use super::*;
    use haptograph_engine::document::Document;
    use haptograph_engine::graph::{CheckOptions, check};
    use std::net::{SocketAddr, UdpSocket};

    /// A graph that receives from a device at an address and drives another one.
    fn graph(listen: SocketAddr, out: &str) -> Graph {
        let text = format!(
            r#"Graph(format: 1, clocks: {{ "audio": Driver(rate_hz: 48000) }},
            nodes: {{
                "touch": Tablet(clock: "audio", endpoint: "stylus"),
                "one": Constant(clock: "audio", value: 1, quantity: "current"),
                "out": ActuatorSink(current: "one", endpoint: "coil", limit: (peak_a: 1, continuous_a: 1)),
            }},
            endpoints: {{ "simulated": {{ "stylus": UdpDevice(listen: "{listen}"), "coil": {out} }} }})"#
        );
        let document = Document::parse("g.ron", &text).unwrap();
        let graph = check(&document, &haptograph_nodes::registry(), &CheckOptions::default());
        graph.unwrap_or_else(|wrong| panic!("{wrong}"))
    }

    const SIMULATED: &str = "SimulatedHaptuator()";

    fn taken() -> (UdpSocket, SocketAddr) {
        let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
        let address = socket.local_addr().unwrap();
        (socket, address)
    }

    #[test]
    fn another_graph_is_connected_after_one_that_failed() {
        let (_socket, address) = taken();
        for mut connections in [
            Connections::new(&haptograph_nodes::registry()),
            Connections::with_drivers(&haptograph_nodes::registry()),
        ] {
            let refused = connections.connect(&mut graph(address, SIMULATED));
            assert!(matches!(refused, Err(BackendError::Bind { .. })), "{refused:?}");
            assert_eq!(connections.status(), []);
            let free = "127.0.0.1:0".parse().unwrap();
            connections.connect(&mut graph(free, SIMULATED)).unwrap();
            let connected = connections.place("stylus");
            assert!(connected.is_some());
            // The connected graph outlives another one that fails, and an undo after that.
            assert!(connections.connect(&mut graph(address, SIMULATED)).is_err());
            connections.undo();
            assert_eq!(connections.place("stylus"), connected);
        }
    }

    /// The soundcard of the graph that failed binds no later one.
    #[cfg(any(feature = "soundcard", target_os = "macos", windows))]
    #[test]
    fn another_soundcard_is_requested_after_a_graph_that_failed() {
        let (_socket, address) = taken();
        let card = |frames: u32| format!("Soundcard(amperes_full_scale: 1, buffer_frames: {frames})");
        let mut connections = Connections::with_drivers(&haptograph_nodes::registry());
        assert!(connections.connect(&mut graph(address, &card(64))).is_err());
        let free: SocketAddr = "127.0.0.1:0".parse().unwrap();
        connections.connect(&mut graph(free, &card(128))).unwrap();
        connections.undo();
        let mut connected = graph(free, &card(256));
        connections.connect(&mut connected).unwrap();
        connections.keep(&connected);
        let other = connections.connect(&mut graph(free, &card(64)));
        assert!(matches!(other, Err(BackendError::Stream(_))), "{other:?}");
    }

    #[cfg(not(any(feature = "soundcard", target_os = "macos", windows)))]
    #[test]
    fn a_soundcard_that_is_not_built_is_refused_before_anything_runs() {
        let free: SocketAddr = "127.0.0.1:0".parse().unwrap();
        let refused = Connections::with_drivers(&haptograph_nodes::registry())
            .connect(&mut graph(free, "Soundcard(amperes_full_scale: 1)"));
        assert!(
            matches!(&refused, Err(BackendError::NotBuilt { device, feature: "soundcard", .. }) if device == "coil"),
            "{refused:?}"
        );
    }
}
