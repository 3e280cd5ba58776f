//! The swap of the running graph for another.

use super::load::{Loaded, Source};
use super::scope::{self, Scope};
use super::stage::{Stage, StageError, other};
use haptograph_live::soundcard::card_requests;

impl Stage {
    /// Swaps the graph; returns a description of the change.
    pub fn swap(&mut self, source: Source, mut next: Loaded) -> Result<String, StageError> {
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
        if self.host.can_drive {
            self.network.connect(&mut next.graph).map_err(other)?;
        }
        self.disarm_unless_same(&next);
        let Some(session) = self.session.as_mut() else {
            return Err(other("the run is stopped"));
        };
        let changed = session.change_and_probe(&next.graph, None, &names);
        let (changed, mut probes) = changed.map_err(|error| {
            self.network.undo();
            other(error)
        })?;
        self.network.keep(&next.graph);
        self.note_refusals();
        self.scopes.retain(|scope| ports.contains(&scope.port));
        for port in ports {
            if !self.scopes.iter().any(|scope| scope.port == port) {
                let frames = probes.take_any(&port.name);
                self.scopes.extend(frames.map(|frames| Scope::of(port, frames)));
            }
        }
        (self.loaded, self.source) = (next, source);
        // The new pads have the same channels.
        for (pad, spec) in self.pads.iter_mut().zip(&self.loaded.pads) {
            pad.lay_on(spec);
        }
        self.describe_actuators();
        Ok(changed.change.to_string())
    }

    /// Reason why a graph cannot be swapped in without a new run.
    fn obstacle(&self, next: &Loaded) -> Option<String> {
        if self.recorder.is_some() || self.replay.is_some() {
            return Some("a recording or a replay keeps its graph; end it first".to_owned());
        }
        if self.card_requests.is_some() && self.card_requests != card_requests(&next.graph).ok() {
            return Some(
                "the graph requests another soundcard; stop the run, apply the graph, then resume".to_owned(),
            );
        }
        let channels = |loaded: &Loaded| -> Vec<String> {
            let channels = loaded.graph.host_inputs().chain(loaded.graph.host_outputs());
            channels.map(|(name, _)| name).collect()
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
