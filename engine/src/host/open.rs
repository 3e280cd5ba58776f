//! Opening a run whose clock is the caller, and reading its probes.

use super::any::AnyOutput;
use super::endpoint::HostEndpoint;
use super::handles::{HostError, HostFrame, Output, host, unknown};
use super::queue::{Queue, Shared};
use crate::frame::Kind;
use crate::graph::{Graph, NodeId};
use crate::plan::Planner;
use crate::run::{ChangeError, Changed, Claim, FileSinks, HandedProbe, Player, Session, SessionOptions};
use std::path::Path;
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Weak};

/// Driver frames between checks for silent endpoints.
const FOLLOWED_FRAMES: u64 = 64;

impl Player {
    /// Opens a run of a graph with one driver, which is the caller: the player for the caller's callback, and the session,
    /// which sets parameters, replaces the graph and reports, from any other thread.
    ///
    /// # Errors
    /// [`HostError`] if the graph has several drivers, and as [`open_all`](Self::open_all).
    pub fn open(graph: &Graph, options: &SessionOptions) -> Result<(Self, Session), HostError> {
        let drivers = graph.drivers();
        if drivers.len() != 1 {
            let drivers = drivers.iter().map(|driver| graph.clocks()[*driver].name.clone());
            let (count, drivers) = (drivers.len(), drivers.collect());
            return Err(HostError::Drivers { count, drivers });
        }
        let (mut players, session) = Self::open_all(graph, options)?;
        let none = || HostError::System { reason: "the graph has no driver".to_owned() };
        Ok((players.pop().ok_or_else(none)?, session))
    }

    /// As [`open`](Self::open), of a graph with any number of drivers: their players in the order of the graph. Each is run by
    /// a driver, or all by a [`VirtualClock`](crate::run::VirtualClock).
    ///
    /// # Errors
    /// [`HostError`] if the graph has a script among its nodes, another player runs it, or it has no such probe.
    pub fn open_all(graph: &Graph, options: &SessionOptions) -> Result<(Vec<Self>, Session), HostError> {
        if !options.offline {
            graph.refuse_scripts()?;
        }
        let mut sinks = FileSinks::new(graph);
        for name in &options.probes {
            sinks.hand_over(name, graph.find_output(name)?);
        }
        let system = |reason: &dyn std::fmt::Display| HostError::System { reason: reason.to_string() };
        if let Some(folder) = &options.folder {
            sinks.open_files(folder).map_err(|error| system(&error))?;
        }
        let claim = Arc::new(claim(graph)?);
        let (mut players, mut session) =
            Session::open_all(sinks, options, None).map_err(|error| system(&error))?;
        session.claim = Arc::downgrade(&claim);
        for player in &mut players {
            player.hold(Arc::clone(&claim));
            // At fixed frames: the checks for silent endpoints depend neither on the calls nor on the block.
            player.follow_inputs_every(FOLLOWED_FRAMES);
            if options.sample_costs && !cfg!(target_family = "wasm") {
                player.sample_costs();
            }
        }
        Ok((players, session))
    }
}

impl Session {
    /// As [`change`](Self::change), with probes of the new graph. Existing probes that are named continue with their
    /// handles, the others end; the handles of new ones can be taken. Unknown outputs are ignored. Without a folder the
    /// graph's file sinks write nothing.
    ///
    /// # Errors
    /// [`ChangeError`]; the running graph continues.
    pub fn change_and_probe(
        &mut self,
        graph: &Graph,
        folder: Option<&Path>,
        probes: &[String],
    ) -> Result<Changed, ChangeError> {
        let ports = probes.iter().filter_map(|name| Some((&**name, graph.find_output(name).ok()?)));
        let ports: Vec<(&str, (NodeId, usize))> = ports.collect();
        self.change_with(graph.into(), folder, Some(&ports))
    }

    /// Takes the handle of a probe. Its frames start with the first of the run, or of the graph that brought it.
    ///
    /// # Errors
    /// [`HostError`] if there is no such probe, its frames are of another kind, or its handle has been taken.
    pub fn probe<V: HostFrame>(&mut self, name: &str) -> Result<Output<V>, HostError> {
        self.take_probe(name, Some(V::KIND)).map(Output::of)
    }

    /// As [`probe`](Self::probe), for frames of any kind.
    ///
    /// # Errors
    /// [`HostError`] if there is no such probe, or its handle has been taken.
    pub fn any_probe(&mut self, name: &str) -> Result<AnyOutput, HostError> {
        self.take_probe(name, None)
    }

    fn take_probe(&mut self, name: &str, asked: Option<Kind>) -> Result<AnyOutput, HostError> {
        let Some(place) = self.probes.iter().position(|probe| probe.name == name) else {
            let names: Vec<String> = self.probes.iter().map(|probe| probe.name.clone()).collect();
            return Err(unknown("probe", name, &names));
        };
        let HandedProbe { stream, ring, .. } = &mut self.probes[place];
        let (name, kind) = (name.to_owned(), stream.kind);
        if let Some(asked) = asked.filter(|asked| *asked != kind) {
            return Err(HostError::Kind { name, kind, asked });
        }
        let ring = ring.take().ok_or_else(|| HostError::Taken { name: name.clone() })?;
        Ok(AnyOutput::of_ring(&name, stream, ring))
    }
}

/// Claims the host endpoints of a graph for a player.
fn claim(graph: &Graph) -> Result<Claim, HostError> {
    let claimed = Claim::default();
    for device in graph.devices() {
        let Some(endpoint) = host(device) else { continue };
        if !claimed.take(endpoint.playing.get()) {
            let name = device.name.clone();
            return Err(HostError::Playing { name });
        }
    }
    Ok(claimed)
}

/// The endpoints of the program in a graph that is to replace the running one.
#[derive(Default)]
pub(crate) struct NewEndpoints {
    /// Each channel of those that continue, and the running queue.
    queues: Vec<(Shared<Queue>, Arc<Queue>)>,
    /// Those that continue, and the running flag.
    playing: Vec<(Shared<AtomicBool>, Arc<AtomicBool>)>,
    /// Those that the graph brings.
    claim: Claim,
}

impl NewEndpoints {
    /// Joins the endpoints that continue with the running ones, and gives the others to the player.
    pub(crate) fn take_over(self, claim: &Weak<Claim>) {
        self.queues.into_iter().for_each(|(new, running)| new.join(running));
        self.playing.into_iter().for_each(|(new, running)| new.join(running));
        if let Some(claim) = claim.upgrade() {
            claim.add(&self.claim);
        }
    }
}

impl Session {
    /// What becomes of the program's endpoints if a graph replaces the running one.
    pub(crate) fn endpoints_of(&self, planner: Planner<'_>) -> Result<NewEndpoints, ChangeError> {
        let mut found = NewEndpoints::default();
        let (plans, own) = (self.plans(), self.claim.upgrade());
        for device in planner.devices() {
            let Some(new) = host(device) else { continue };
            let continued = plans.first().and_then(|plan| plan.continued(device));
            let running = continued.and_then(|device| device.as_any().downcast_ref::<HostEndpoint>());
            let flag = new.playing.get();
            let is_own = own.as_ref().is_some_and(|own| own.has(&flag));
            if !is_own && !found.claim.take(flag) {
                return Err(ChangeError::Playing { endpoint: device.name.clone() });
            }
            let Some(running) = running else {
                // What was queued while no graph read it is old.
                let own = new.queues().filter(|_| is_own);
                own.for_each(|new| while new.queue.get().take_if(|_| true, &mut []).is_some() {});
                continue;
            };
            for (new, running) in new.queues().zip(running.queues()) {
                let (queue, running) = (new.queue.get(), running.queue.get());
                if !Arc::ptr_eq(&queue, &running) {
                    if queue.is_held() {
                        let channel = format!("{}.{}", device.name, new.channel.name);
                        return Err(ChangeError::Taken { channel });
                    }
                    found.queues.push((new.queue.clone(), running));
                }
            }
            found.playing.push((new.playing.clone(), running.playing.get()));
        }
        Ok(found)
    }
}

impl Graph {
    /// Finds an output by the name that an input of the graph would use: `"texture.acceleration"`, or `"texture"` if it
    /// has one output. `texture` is a node or the use of a template. Returns the node and the index of the output.
    ///
    /// # Errors
    /// [`HostError::Unknown`] with the existing outputs.
    pub fn find_output(&self, name: &str) -> Result<(NodeId, usize), HostError> {
        self.output_called(name).ok_or_else(|| {
            let ports = self
                .nodes()
                .iter()
                .flat_map(|node| node.outputs.iter().map(move |port| format!("{}.{}", node.path, port.name)));
            unknown("output", name, &ports.collect::<Vec<_>>())
        })
    }
}
