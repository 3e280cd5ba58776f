//! The player: runs a graph in the caller's callback.

use super::any::AnyOutput;
use super::handles::{HostError, HostFrame, Output, host, unknown};
use crate::device::Device;
use crate::frame::Kind;
use crate::graph::{Graph, NodeId};
use crate::node::Stream;
use crate::run::{
    ChangeError, Changed, Driven, Faults, FileSinks, Live, LiveOptions, LiveOutcome, LiveState, Session, Wake,
};
use rtrb::Consumer;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Options of a player.
#[derive(Debug, Clone, Default)]
#[non_exhaustive]
pub struct PlayOptions {
    /// Outputs of nodes whose frames the caller reads, without a limiter: `"texture.output"`.
    pub probes: Vec<String>,
    /// Folder of the graph's file sinks; without one they write nothing.
    pub folder: Option<PathBuf>,
    /// Times about one block in sixteen, step by step, for [`Session::node_costs`]. It has no effect in a browser,
    /// whose clock is too coarse.
    pub sample_costs: bool,
    /// Options of the live run.
    pub live: LiveOptions,
}

impl PlayOptions {
    /// Adds a probe.
    #[must_use]
    pub fn probe(mut self, output: &str) -> Self {
        self.probes.push(output.to_owned());
        self
    }

    /// Declares the actuators cold.
    #[must_use]
    pub fn rested(mut self) -> Self {
        self.live.rested = true;
        self
    }
}

/// The real-time side of a graph whose driver is the caller: each call of [`process`](Self::process) runs it further.
pub struct Player {
    live: Live,
    probes: Probes,
    _playing: Playing,
}

impl Driven for Player {
    fn rate_hz(&self) -> f64 {
        self.live.run().rate_hz()
    }
    fn run_frames(&mut self, frames: usize) {
        self.process(frames);
    }
    fn block(&self) -> usize {
        self.live.block()
    }
    fn is_idle(&self) -> bool {
        self.live.is_idle()
    }
    fn devices_mut(&mut self) -> impl Iterator<Item = &mut (dyn Device + 'static)> {
        self.live.devices_mut()
    }
    fn report(&mut self, wake: Wake) {
        self.live.report(wake);
    }
    fn resume(&mut self) {
        self.live.resume();
    }
}

impl Player {
    /// Opens a run of a graph with one driver: the player for the caller's callback, and the session, which sets
    /// parameters, replaces the graph and reports, from any other thread.
    ///
    /// # Errors
    /// [`HostError`] if the graph has several drivers or a script among its nodes, another player runs it, or it has no such
    /// probe.
    pub fn open(graph: &Graph, options: &PlayOptions) -> Result<(Self, Session), HostError> {
        let drivers = graph.drivers();
        if drivers.len() != 1 {
            let drivers = drivers.iter().map(|driver| graph.clocks()[*driver].name.clone());
            let (count, drivers) = (drivers.len(), drivers.collect());
            return Err(HostError::Drivers { count, drivers });
        }
        if !options.live.offline {
            graph.refuse_scripts()?;
        }
        let mut sinks = FileSinks::new(graph);
        let mut names = Vec::new();
        for name in &options.probes {
            let (node, output) = graph.find_output(name)?;
            names.push((name.clone(), sinks.hand_over(node, output)));
        }
        let system = |reason: &dyn std::fmt::Display| HostError::System { reason: reason.to_string() };
        if let Some(folder) = &options.folder {
            sinks.open_files(folder).map_err(|error| system(&error))?;
        }
        let playing = claim(graph)?;
        let (mut live, mut session) = Session::open(sinks, &options.live).map_err(|error| system(&error))?;
        // At fixed frames, so that the checks for silent endpoints do not depend on the calls.
        live.follow_inputs_every(live.block() as u64);
        if options.sample_costs && !cfg!(target_family = "wasm") {
            live.sample_costs();
        }
        let probes = Probes::new(names, session.handed());
        let player = Self { live, probes, _playing: playing };
        Ok((player, session))
    }

    /// Takes the handle of a probe. Its frames start with the first of the run.
    ///
    /// # Errors
    /// [`HostError`] if there is no such probe, its frames are of another kind, or its handle has been taken.
    pub fn probe<V: HostFrame>(&mut self, name: &str) -> Result<Output<V>, HostError> {
        self.probes.take(name)
    }

    /// As [`probe`](Self::probe), for frames of any kind.
    ///
    /// # Errors
    /// [`HostError`] if there is no such probe, or its handle has been taken.
    pub fn any_probe(&mut self, name: &str) -> Result<AnyOutput, HostError> {
        self.probes.take_any(name)
    }

    /// Runs `frames` frames of the driver. Real-time code: it does not allocate, lock, make system calls or panic.
    /// Queued inputs are taken at the ticks at which they are due; outputs and probes have their frames afterwards.
    pub fn process(&mut self, frames: usize) {
        if frames > 0 {
            self.live.callback(frames, |_, _| {});
        }
    }

    /// The live run that it plays, to connect its devices before the first frame.
    pub fn live_mut(&mut self) -> &mut Live {
        &mut self.live
    }

    /// Number of frames run.
    pub fn frames(&self) -> u64 {
        self.live.frames()
    }

    /// State of the run.
    pub fn state(&self) -> LiveState {
        self.live.state()
    }

    /// NaN and infinity at actuators so far.
    pub fn faults(&self) -> Faults {
        self.live.faults()
    }

    /// Ends the run: completes the files, drops the real-time side and returns the outcome.
    pub fn finish(self, session: Session) -> LiveOutcome {
        session.finish(self.live)
    }
}

/// Probes by name, whose handles can be taken.
#[derive(Debug, Default)]
pub struct Probes(Vec<(String, Stream, Option<Consumer<f64>>)>);

impl Probes {
    fn new(names: Vec<(String, Stream)>, rings: Vec<Consumer<f64>>) -> Self {
        let mut rings = rings.into_iter();
        let probes = names.into_iter().map(|(name, stream)| (name, stream, rings.next()));
        Self(probes.collect())
    }

    /// Takes the handle of a probe.
    ///
    /// # Errors
    /// [`HostError`] if there is no such probe, its frames are of another kind, or its handle has been taken.
    pub fn take<V: HostFrame>(&mut self, name: &str) -> Result<Output<V>, HostError> {
        self.find(name, Some(V::KIND)).map(Output::of)
    }

    /// As [`take`](Self::take), for frames of any kind.
    ///
    /// # Errors
    /// [`HostError`] if there is no such probe, or its handle has been taken.
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
        let ring = ring.take().ok_or_else(|| HostError::Taken { name: name.clone() })?;
        Ok(AnyOutput::of_ring(&name, stream, ring))
    }
}

impl Session {
    /// As [`change`](Self::change), with probes of the new graph. Existing probes that are named continue with their
    /// handles, the others end; new ones are returned. Unknown outputs are ignored. Without a folder the graph's file
    /// sinks write nothing.
    ///
    /// # Errors
    /// [`ChangeError`]; the running graph continues.
    pub fn change_and_probe(
        &mut self,
        graph: &Graph,
        folder: Option<&Path>,
        probes: &[String],
    ) -> Result<(Changed, Probes), ChangeError> {
        let ports = probes.iter().filter_map(|name| Some((name, graph.find_output(name).ok()?)));
        let ports: Vec<(&String, (NodeId, usize))> = ports.collect();
        let wanted: Vec<(NodeId, usize)> = ports.iter().map(|(_, port)| *port).collect();
        let (changed, begun) = self.change_with(graph.into(), folder, Some(&wanted))?;
        let name = |(port, stream): ((NodeId, usize), Stream)| {
            let (name, _) = ports.iter().find(|(_, known)| *known == port)?;
            Some(((*name).clone(), stream))
        };
        let named = begun.into_iter().filter_map(name).collect();
        Ok((changed, Probes::new(named, self.handed())))
    }
}

/// The claim of a player on the host endpoints of a graph.
struct Playing(Vec<Arc<AtomicBool>>);

impl Drop for Playing {
    fn drop(&mut self) {
        self.0.iter().for_each(|playing| playing.store(false, Ordering::Release));
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
