//! Messages to pages during a run: samples, sound and status.

use super::levels;
use super::pages::{LineError, Page};
use super::scope::Scope;
use super::stage::{Signals, Stage, State};
use super::wire::{self, Message};
use haptograph_engine::silence::InputState;
use serde_json::{Value, json};
use std::sync::Arc;
use std::time::Duration;

/// Period of [`Publisher::publish`].
pub const STEP: Duration = Duration::from_millis(10);
/// Number of periods between two status messages.
const STATUS: u32 = 10;

/// Values delivered to an actuator since the last status.
#[derive(Debug, Clone, Default)]
pub struct Delivered {
    square: f64,
    count: u64,
    peak: f64,
    peak_ever: f64,
    /// Weighted mean square, as in the thermal limit.
    heat: f64,
}

impl Delivered {
    /// Adds frames of an actuator with the thermal window `window_s`.
    pub fn take(&mut self, scope: &Scope, window_s: f64) {
        let part = 1.0 / (window_s * scope.port.rate_hz);
        for frame in scope.fresh().chunks_exact(scope.lanes()) {
            let square: f64 = frame.iter().map(|x| x * x).sum();
            self.square += square;
            self.count += 1;
            self.peak = self.peak.max(square.sqrt());
            self.heat += (square - self.heat) * part;
        }
        self.peak_ever = self.peak_ever.max(self.peak);
    }

    fn status(&mut self, name: &str, continuous: f64, (is_real, is_armed): (bool, bool)) -> Value {
        let rms = (self.square / self.count.max(1) as f64).sqrt();
        let status = json!({
            "name": name, "rms": rms, "peak": self.peak, "delivered_peak": self.peak_ever,
            "heat": self.heat / (continuous * continuous), "simulated": !is_real, "armed": is_real && is_armed,
        });
        (self.square, self.count, self.peak) = (0.0, 0, 0.0);
        status
    }
}

/// Sends new data to the pages.
#[derive(Debug, Default)]
pub struct Publisher {
    looks: u32,
    /// Time since the last status.
    passed: Duration,
}

impl Publisher {
    /// Call it about every [`STEP`]; `passed` is the time since the last call.
    pub fn publish(&mut self, stage: &mut Stage, passed: Duration) {
        stage.look();
        send_samples(stage);
        stage.end_what_is_over();
        self.passed += passed;
        self.looks += 1;
        if self.looks == STATUS {
            let status = status(stage, self.passed);
            for page in 0..stage.pages.list.len() {
                let mut own = status.clone();
                own["owner"] = json!(stage.pages.owner == Some(stage.pages.list[page].id));
                own["lost"] = json!(stage.pages.list[page].lost);
                stage.pages.list[page].send(text(&own));
            }
            levels::send(stage);
            stage.append_recording();
            *self = Self::default();
        }
        let gone = stage.pages.list.iter().filter(|page| page.is_gone).map(|page| page.id);
        for page in gone.collect::<Vec<_>>() {
            stage.leave(page);
        }
    }
}

/// A JSON value as a message.
pub fn text(value: &Value) -> Message {
    Message::Text(value.to_string())
}

/// Sends the data that the last [`Stage::look`] collected.
pub fn send_samples(stage: &mut Stage) {
    let Stage { pages, signals, .. } = stage;
    let Signals { scopes, sound, .. } = signals;
    let sound = sound.as_ref().and_then(|sound| {
        let scope = scopes.iter().find(|scope| scope.port.name == sound.port)?;
        let values: Vec<f32> = scope.fresh().iter().map(|x| (x / sound.peak) as f32).collect();
        (!values.is_empty()).then(|| wire::sound(scope.fresh_s(), &values))
    });
    for page in &mut pages.list {
        let wanted = std::mem::take(&mut page.wanted);
        for (place, port) in wanted.iter().enumerate() {
            let scope = scopes.iter().find(|scope| scope.port.name == port.name);
            if let Some(message) = scope.and_then(|scope| scope.message(place, port.raw)) {
                page.send(Message::Binary(message));
            }
        }
        page.wanted = wanted;
        if let Some(sound) = sound.as_ref().filter(|_| page.hears) {
            page.send(Message::Binary(sound.clone()));
        }
    }
}

fn status(stage: &mut Stage, passed: Duration) -> Value {
    let pointer = stage.pointer_latency();
    let time_s = stage.now_s();
    let recording_s = stage.recorder.recording.as_ref().map(|_| time_s);
    let frame = stage.drive.as_ref().map_or(0, |drive| drive.pace.frames());
    let replay = stage.cycle.replay.as_ref().map(|replay| replay.part(frame));
    let (gain, note) = (stage.devices.switch.gain(), stage.devices.note.clone());
    let Stage { signals, drive, session, pages, cycle, .. } = stage;
    let Signals { actuators, silent, .. } = signals;
    let each = actuators.iter_mut().map(|actuator| {
        let continuous = actuator.continuous;
        let armed = (actuator.is_real, gain > 0.0);
        actuator.delivered.status(&actuator.name, continuous, armed)
    });
    let actuators: Vec<Value> = each.collect();
    let inputs = session.as_ref().map(|session| session.live_inputs()).unwrap_or_default();
    silent.retain(|(name, _)| {
        inputs.iter().any(|input| input.device == *name && input.state != InputState::Heard)
    });
    for input in inputs.iter().filter(|input| input.state != InputState::Heard) {
        if !silent.iter().any(|(name, _)| *name == input.device) {
            silent.push((input.device.clone(), time_s));
        }
    }
    let quiet = silent.iter().map(|(name, since)| json!({ "input": name, "for_s": time_s - since }));
    let quiet: Vec<Value> = quiet.collect();
    let xruns = drive.as_ref().and_then(|drive| drive.xruns());
    let pace = drive.as_ref().map(|drive| Arc::clone(&drive.pace));
    let busy = pace.as_ref().map_or(0.0, |pace| pace.take_busy().as_secs_f64());
    json!({
        "type": "status",
        "time_s": time_s,
        "state": match cycle.state { State::Running => "running", State::Stopped => "stopped", State::Failed => "failed" },
        "recording_s": recording_s,
        "replay": replay,
        "pages": pages.list.len(),
        "behind_ms": pace.as_ref().map_or(0.0, |pace| pace.behind_ms()),
        "late": pace.as_ref().map_or(0, |pace| pace.late()),
        "xruns": xruns,
        "silent": quiet,
        "actuators": actuators,
        "armed_gain": gain,
        "note": note,
        "faults": pace.as_ref().map_or(0, |pace| pace.faults()),
        "cost": busy / passed.as_secs_f64().max(1e-9),
        "pointer": pointer,
    })
}

impl Page {
    /// Sends a message to a page that may not read. Lost samples are counted; if a text is lost, such as the new graph,
    /// the page is disconnected and receives the full state when it reconnects.
    pub fn send(&mut self, message: Message) {
        let is_text = matches!(message, Message::Text(_));
        match self.line.send(message) {
            Ok(()) => {}
            Err(LineError::Full) if !is_text => self.lost += 1,
            Err(LineError::Full | LineError::Gone) => self.is_gone = true,
        }
    }
}
