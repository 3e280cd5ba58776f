//! The backends of a run, together.

use crate::backend::{BACKENDS, Backend, BackendError, BackendEvent, Connected, Counts, Lives, Role};
use haptograph_engine::graph::Graph;
use haptograph_engine::run::RingReport;
use haptograph_nodes::network::link::Counts as PacketCounts;

/// The connected devices of a live run. Dropping it disconnects them.
pub struct Connections {
    backends: Vec<Box<dyn Backend>>,
}

/// Those of a program that drives the graph itself.
impl Default for Connections {
    fn default() -> Self {
        let exchanging = BACKENDS.iter().filter(|entry| !entry.drives);
        Self {
            backends: exchanging.map(|entry| entry.make()).collect(),
        }
    }
}

impl Connections {
    /// All backends, those that drive the graph included.
    pub(crate) fn with_drivers() -> Self {
        Self {
            backends: BACKENDS.iter().map(|entry| entry.make()).collect(),
        }
    }

    /// Connects the devices of a graph that are not connected yet, and attaches their bodies. [`Self::undo`] disconnects them
    /// if the graph is not run after all.
    ///
    /// # Errors
    /// [`BackendError`]; earlier connections remain, and no new one is made.
    pub fn connect(&mut self, graph: &mut Graph) -> Result<(), BackendError> {
        for number in 0..self.backends.len() {
            if let Err(error) = self.backends[number].open(graph) {
                self.backends[..=number]
                    .iter_mut()
                    .for_each(|opened| opened.undo());
                return Err(error);
            }
        }
        Ok(())
    }

    /// Disconnects what the last [`Self::connect`] connected.
    pub fn undo(&mut self) {
        self.backends.iter_mut().for_each(|backend| backend.undo());
    }

    /// Takes over the names and settings of the running graph's devices. Packets of devices that it does
    /// not have are still counted, for a later graph that has them again.
    pub fn keep(&mut self, graph: &Graph) {
        self.backends.iter_mut().for_each(|backend| backend.keep(graph));
    }

    /// Starts the drivers of a graph.
    ///
    /// # Errors
    /// [`BackendError`] if one cannot be started, or a clock has none.
    pub(crate) fn drive(&mut self, graph: &Graph, mut lives: Lives) -> Result<(), BackendError> {
        for backend in &mut self.backends {
            backend.drive(graph, &mut lives)?;
        }
        match lives.first() {
            Some((clock, _)) => Err(BackendError::NoDriver(graph.clocks()[*clock].name.clone())),
            None => Ok(()),
        }
    }

    /// What has happened since the last call.
    pub fn poll(&mut self) -> Vec<BackendEvent> {
        self.backends
            .iter_mut()
            .flat_map(|backend| backend.poll())
            .collect()
    }

    /// All connections and drivers.
    pub fn status(&self) -> Vec<Connected> {
        self.backends
            .iter()
            .flat_map(|backend| backend.status())
            .collect()
    }

    /// All connections and drivers of a role, with what they counted.
    pub fn counted(&self, role: Role) -> impl Iterator<Item = (Connected, Counts)> {
        let all = self.backends.iter();
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

    /// The OSC addresses at a device's port to which messages came that no device listens to, and how many.
    pub fn unclaimed(&self, device: &str) -> Vec<(String, u64)> {
        let mut known = self.packets().filter(|(name, ..)| name == device);
        known.next().map_or_else(Vec::new, |(.., unclaimed)| unclaimed)
    }

    /// Where a device is listened to or read from.
    pub fn place(&self, device: &str) -> Option<String> {
        let mut links = self.status().into_iter();
        let known =
            links.find(|link| link.role == Role::Link && link.names.iter().any(|name| name == device));
        known.map(|link| link.place)
    }

    /// Rings from the clocks of devices to the graph.
    pub fn rings(&self) -> impl Iterator<Item = RingReport> {
        self.backends.iter().flat_map(|backend| backend.rings())
    }

    /// Ends the drivers and returns what they drove.
    ///
    /// # Errors
    /// [`BackendError::Lost`] if a driver's thread panicked.
    pub(crate) fn close(&mut self) -> Result<Lives, BackendError> {
        let mut lives = Lives::new();
        for backend in &mut self.backends {
            lives.extend(backend.close()?);
        }
        lives.sort_by_key(|(clock, _)| *clock);
        Ok(lives)
    }
}
