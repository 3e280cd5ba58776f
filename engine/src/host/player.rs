//! A graph in the caller's own callback.

use super::any::AnyOutput;
use super::handles::{HostError, HostFrame, Output, host, unknown};
use crate::frame::Kind;
use crate::graph::{Graph, NodeId};
use crate::node::Stream;
use crate::run::{ChangeError, Changed, Faults, Live, LiveOptions, LiveOutcome, LiveState, Outlets, Session};
use rtrb::Consumer;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// How a graph is played.
#[derive(Debug, Clone, Default)]
#[non_exhaustive]
pub struct PlayOptions {
    /// Outputs of nodes whose frames the caller wants as they are, past no limiter: `"texture.output"`.
    pub probes: Vec<String>,
    /// The folder that the graph's file sinks write in; none: they write nothing.
    pub folder: Option<PathBuf>,
    /// As of any live run. An actuator of which nobody knows whether it is cold begins as warm as its limit allows, unless
    /// `rested` says that it is.
    pub live: LiveOptions,
}

impl PlayOptions {
    /// Also hands this output's frames to the caller.
    #[must_use]
    pub fn probe(mut self, output: &str) -> Self {
        self.probes.push(output.to_owned());
        self
    }

    /// The actuators are known to be cold.
    #[must_use]
    pub fn rested(mut self) -> Self {
        self.live.rested = true;
        self
    }
}

/// The real-time side of a graph whose clock is the caller: each call of [`process`](Self::process) runs it on.
pub struct Player {
    live: Live,
    /// Frames between two looks at whether the endpoints are heard: whatever the calls, at the same frames.
    quantum: u64,
    probes: Probes,
    _playing: Playing,
}

impl Player {
    /// Both sides of a run of a graph with one driver: the player for the caller's callback, and the session, which sets
    /// parameters, puts another graph in its place and tells what happened, from any other thread.
    ///
    /// # Errors
    /// [`HostError`]: the graph has several drivers, is being played already, or has no such probe.
    pub fn open(graph: &Graph, options: &PlayOptions) -> Result<(Self, Session), HostError> {
        let drivers = graph.drivers();
        if drivers.len() != 1 {
            let drivers = drivers.iter().map(|driver| graph.clocks()[*driver].name.clone());
            let (count, drivers) = (drivers.len(), drivers.collect());
            return Err(HostError::Drivers { count, drivers });
        }
        let mut outlets = Outlets::new(graph);
        let mut names = Vec::new();
        for name in &options.probes {
            let (node, output) = graph.find_output(name)?;
            names.push((name.clone(), outlets.hand_over(node, output)));
        }
        let system = |reason: &dyn std::fmt::Display| HostError::System {
            reason: reason.to_string(),
        };
        if let Some(folder) = &options.folder {
            outlets.open_files(folder).map_err(|error| system(&error))?;
        }
        let playing = claim(graph)?;
        let (mut live, mut session) =
            Session::open(outlets, &options.live).map_err(|error| system(&error))?;
        let quantum = live.block() as u64;
        live.follow_inputs_every(quantum);
        let probes = Probes::new(names, session.handed());
        let player = Self {
            live,
            quantum,
            probes,
            _playing: playing,
        };
        Ok((player, session))
    }

    /// The frames of a probe, from the first on; handed out once.
    ///
    /// # Errors
    /// [`HostError`]: the probe was not asked for, its frames are of another shape, or it was handed out.
    pub fn probe<V: HostFrame>(&mut self, name: &str) -> Result<Output<V>, HostError> {
        self.probes.take(name)
    }

    /// The same for frames of any shape.
    ///
    /// # Errors
    /// [`HostError`]: the probe was not asked for, or was handed out.
    pub fn any_probe(&mut self, name: &str) -> Result<AnyOutput, HostError> {
        self.probes.take_any(name)
    }

    /// Runs `frames` frames of the driver. Real-time code: it does not allocate, lock, call the system or panic. What has
    /// been queued for the inputs is taken at the ticks that it is due at; outputs and probes have their frames
    /// afterwards.
    pub fn process(&mut self, frames: usize) {
        let mut left = frames as u64;
        while left > 0 {
            let to_boundary = self.quantum - self.live.frames() % self.quantum;
            let part = left.min(to_boundary);
            self.live.callback(part as usize, |_, _| {});
            left -= part;
        }
    }

    /// Frames run so far.
    pub fn frames(&self) -> u64 {
        self.live.frames()
    }

    /// What the run is doing.
    pub fn state(&self) -> LiveState {
        self.live.state()
    }

    /// What was seen so far of signals that are not numbers.
    pub fn faults(&self) -> Faults {
        self.live.faults()
    }

    /// Ends the run: completes the files and tells what it did. Lets go of the real-time side.
    pub fn finish(self, session: Session) -> LiveOutcome {
        session.finish(self.live)
    }
}

/// Probes whose frames nobody reads yet, by their names.
#[derive(Debug, Default)]
pub struct Probes(Vec<(String, Stream, Option<Consumer<f64>>)>);

impl Probes {
    fn new(names: Vec<(String, Stream)>, rings: Vec<Consumer<f64>>) -> Self {
        let mut rings = rings.into_iter();
        let probes = names
            .into_iter()
            .map(|(name, stream)| (name, stream, rings.next()));
        Self(probes.collect())
    }

    /// The frames of a probe, from the first on; handed out once.
    ///
    /// # Errors
    /// [`HostError`]: there is no such probe, its frames are of another shape, or it was handed out.
    pub fn take<V: HostFrame>(&mut self, name: &str) -> Result<Output<V>, HostError> {
        self.find(name, Some(V::KIND)).map(Output::of)
    }

    /// The same for frames of any shape.
    ///
    /// # Errors
    /// [`HostError`]: there is no such probe, or it was handed out.
    pub fn take_any(&mut self, name: &str) -> Result<AnyOutput, HostError> {
        self.find(name, None)
    }

    fn find(&mut self, name: &str, asked: Option<Kind>) -> Result<AnyOutput, HostError> {
        let known: Vec<String> = self.0.iter().map(|(name, ..)| name.clone()).collect();
        let found = self.0.iter_mut().find(|(known, ..)| known == name);
        let Some((_, stream, ring)) = found else {
            return Err(unknown("probe", name, &known));
        };
        let name = name.to_owned();
        let kind = stream.kind;
        if let Some(asked) = asked.filter(|asked| *asked != kind) {
            return Err(HostError::Kind { name, kind, asked });
        }
        let ring = ring
            .take()
            .ok_or_else(|| HostError::Taken { name: name.clone() })?;
        Ok(AnyOutput::of_ring(&name, stream, ring))
    }
}

impl Session {
    /// As [`change`](Self::change), and hands over the frames of outputs of the new graph. Probes that were there and are
    /// still named go on in the hands of their readers, the others end; those that are new are returned. Without a folder
    /// the graph's file sinks write nothing.
    ///
    /// # Errors
    /// [`ChangeError`]; the graph that runs goes on. What the graph has no output for is left out.
    pub fn change_and_probe(
        &mut self,
        graph: &Graph,
        folder: Option<&Path>,
        probes: &[String],
    ) -> Result<(Changed, Probes), ChangeError> {
        let ports = probes
            .iter()
            .filter_map(|name| Some((name, graph.find_output(name).ok()?)));
        let ports: Vec<(&String, (NodeId, usize))> = ports.collect();
        let wanted: Vec<(NodeId, usize)> = ports.iter().map(|(_, port)| *port).collect();
        let (changed, begun) = self.change_with(graph, folder, Some(&wanted))?;
        let name = |(port, stream): ((NodeId, usize), Stream)| {
            let (name, _) = ports.iter().find(|(_, known)| *known == port)?;
            Some(((*name).clone(), stream))
        };
        let named = begun.into_iter().filter_map(name).collect();
        Ok((changed, Probes::new(named, self.handed())))
    }
}

/// The queues of a graph's host endpoints, which are for one run.
struct Playing(Vec<Arc<AtomicBool>>);

impl Drop for Playing {
    fn drop(&mut self) {
        self.0
            .iter()
            .for_each(|playing| playing.store(false, Ordering::Release));
    }
}

fn claim(graph: &Graph) -> Result<Playing, HostError> {
    let mut claimed = Playing(Vec::new());
    for device in graph.devices() {
        let Some(endpoint) = host(device) else { continue };
        if endpoint.playing.swap(true, Ordering::AcqRel) {
            let name = device.name.clone();
            return Err(HostError::Playing { name });
        }
        claimed.0.push(Arc::clone(&endpoint.playing));
    }
    Ok(claimed)
}

impl Graph {
    /// The output that an input of the graph would name so: `"texture.acceleration"`, or `"texture"` where it has one. `texture`
    /// may be a node or the use of a template. Returns the node, and the output's place among its outputs.
    ///
    /// # Errors
    /// [`HostError::Unknown`] says what there is.
    pub fn find_output(&self, name: &str) -> Result<(NodeId, usize), HostError> {
        self.output_called(name).ok_or_else(|| {
            let ports = self.nodes().iter().flat_map(|node| {
                node.outputs
                    .iter()
                    .map(move |port| format!("{}.{}", node.path, port.name))
            });
            unknown("output", name, &ports.collect::<Vec<_>>())
        })
    }
}
