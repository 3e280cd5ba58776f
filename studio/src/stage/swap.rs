//! The swap of the running graph for another.

use super::super::actuators::{driven, has_real};
use super::super::channels::{InputPad, PadSpec};
use super::super::clock::Clock;
use super::super::error::{StageError, other};
use super::super::load::{Loaded, Source};
use super::super::pads::Pad;
use super::super::pointer::Pointer;
use super::super::scope::{self, Scope};
use super::Stage;
use haptograph_engine::graph::Graph;

impl Stage {
    /// Swaps the graph; returns a description of the change.
    pub(crate) fn swap(&mut self, source: Source, mut next: Loaded) -> Result<String, StageError> {
        if self.session.is_none() {
            (self.loaded, self.source) = (next, source);
            self.describe_actuators();
            return Ok("the graph was replaced; resume to run it".to_owned());
        }
        if let Some(why) = self.obstacle(&next) {
            return Err(other(why));
        }
        let ports = scope::ports(&next.graph);
        let names: Vec<String> = ports.iter().map(|port| port.name.clone()).collect();
        // What is driven with other settings is not what was armed.
        let disarms = driven(&self.loaded.graph) != driven(&next.graph);
        let (Some(session), Some(clock)) = (self.session.as_mut(), self.clock.as_mut()) else {
            return Err(other("the run is stopped"));
        };
        let refused = clock.drivers.notes();
        let mut change = |graph: &Graph| {
            if disarms {
                self.devices.switch.disarm();
            }
            session.change_and_probe(graph, None, &names)
        };
        let changed = match self.host.can_drive {
            true => clock.drivers.replace(&mut next.graph, change).map_err(other)?,
            false => change(&next.graph).map_err(other)?,
        };
        self.note_refusals(&refused);
        self.signals.scopes.retain(|scope| ports.contains(&scope.port));
        for port in ports {
            if !self.signals.scopes.iter().any(|scope| scope.port == port) {
                let Some(session) = self.session.as_mut() else { continue };
                let frames = session.any_probe(&port.name);
                self.signals.scopes.extend(frames.map(|frames| Scope::of(port, frames)));
            }
        }
        self.signals.inputs = self.inputs_of(&mut next)?;
        self.signals.count_graph();
        (self.loaded, self.source) = (next, source);
        // The new pads have the same channels.
        for (pad, spec) in self.signals.pads.iter_mut().zip(&self.loaded.pads) {
            pad.lay_on(spec);
        }
        self.describe_actuators();
        Ok(changed.change.to_string())
    }

    /// The inputs of a graph that took over: those of devices that went on are kept. A channel of such a device that is read anew is no
    /// input before the next run, since the device does not listen to it.
    fn inputs_of(&mut self, next: &mut Loaded) -> Result<Vec<Pad>, StageError> {
        let mut before = std::mem::take(&mut self.signals.inputs);
        let device = |graph: &Graph, name: &str| {
            let mut devices = graph.devices().iter();
            devices.find(|device| device.name == name).map(|device| device.fingerprint)
        };
        let (was, is) = (&self.loaded.graph, &next.graph);
        let goes_on = |spec: &PadSpec| device(was, &spec.endpoint) == device(is, &spec.endpoint);
        next.inputs.retain(|input| !goes_on(&input.pad) || before.iter().any(|pad| pad.is_of(&input.pad)));
        let input = |InputPad { pad: spec, .. }: &InputPad| {
            let place = before.iter().position(|pad| pad.is_of(spec)).filter(|_| goes_on(spec));
            place.map_or_else(|| Pad::of(is, spec).map_err(other), |place| Ok(before.swap_remove(place)))
        };
        let inputs = next.inputs.iter().map(input).collect();
        // What is not read any more is given back: a page that cannot release it would silence it.
        for (pad, pointer) in before.iter_mut().filter_map(|pad| pad.held().map(|pointer| (pad, pointer))) {
            let now_s = self.time_s_of(pad.driver.as_deref()).unwrap_or_default();
            pad.move_to(now_s, &Pointer { force_n: 0.0, ..pointer });
        }
        inputs
    }

    /// Reason why a graph cannot be swapped in without a new run.
    fn obstacle(&self, next: &Loaded) -> Option<String> {
        if self.recorder.recording.is_some() || self.cycle.replay.is_some() {
            return Some("a recording or a replay keeps its graph; end it first".to_owned());
        }
        let has_drivers = self.clock.as_ref().is_some_and(Clock::has_drivers);
        if self.host.can_drive && !has_drivers && has_real(&next.graph) {
            return Some(
                "the graph begins to reach a real device; stop the run, apply the graph, then resume"
                    .to_owned(),
            );
        }
        let channels = |loaded: &Loaded| -> Vec<String> {
            let channels = loaded.graph.host_inputs().chain(loaded.graph.host_outputs());
            let of_pad =
                |name: &String| name.rsplit_once('.').is_some_and(|(endpoint, _)| loaded.is_pad(endpoint));
            channels.map(|(name, _)| name).filter(of_pad).collect()
        };
        let (before, after) = (channels(&self.loaded), channels(next));
        (before != after).then(|| {
            format!(
                "the channels of the pads change from {} to {}; stop the run, apply the graph, then resume",
                list(&before),
                list(&after)
            )
        })
    }
}

fn list(names: &[String]) -> String {
    if names.is_empty() { "none".to_owned() } else { names.join(", ") }
}
