//! Messages to pages during a run: samples, sound and status.

use super::clock::{Clock, Timing};
use super::frames;
use super::levels::short;
use super::run_cycle::State;
use super::stage::{Signals, Stage};
use super::wire::{Message, text};
use haptograph_engine::run::{ActuatorLevel, Session};
use serde_json::{Map, Value, json};
use std::time::Duration;

/// Period of [`Publisher::publish`].
pub(crate) const STEP: Duration = Duration::from_millis(10);
/// Number of periods between two status messages.
const STATUS: u32 = 10;

/// Sends new data to the pages.
#[derive(Debug, Default)]
pub(crate) struct Publisher {
    looks: u32,
    /// Timing of the run at the last status.
    timing: Timing,
}

impl Publisher {
    /// Call it about every [`STEP`].
    pub(crate) fn publish(&mut self, stage: &mut Stage) {
        stage.look();
        stage.conduct();
        send_samples(stage);
        stage.end_what_is_over();
        self.looks += 1;
        if self.looks == STATUS {
            let levels = stage.session.iter().flat_map(Session::actuator_levels).collect::<Vec<_>>();
            let status = status(stage, &levels, &mut self.timing);
            for page in 0..stage.pages.list.len() {
                let mut own = status.clone();
                own["owner"] = json!(stage.pages.owner == Some(stage.pages.list[page].id));
                own["lost"] = json!(stage.pages.list[page].lost);
                stage.pages.list[page].send(text(&own));
            }
            send_levels(stage, &levels);
            stage.append_recording();
            self.looks = 0;
        }
        let gone = stage.pages.list.iter().filter(|page| page.is_gone).map(|page| page.id);
        for page in gone.collect::<Vec<_>>() {
            stage.leave(page);
        }
    }
}

/// Sends the data that the last [`Stage::look`] collected.
pub(crate) fn send_samples(stage: &mut Stage) {
    let renders = stage.study_renders();
    let Stage { pages, signals, .. } = stage;
    let Signals { scopes, sound, .. } = signals;
    let sound = sound.as_ref().and_then(|sound| {
        let scope = scopes.iter().find(|scope| scope.port.name == sound.port)?;
        let values: Vec<f32> = scope.fresh().iter().map(|x| (x / sound.peak) as f32).collect();
        (!values.is_empty()).then(|| frames::sound(scope.fresh_s(), &values))
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
        if let Some(sound) = sound.as_ref().filter(|_| page.hears && renders) {
            page.send(Message::Binary(sound.clone()));
        }
    }
}

fn status(stage: &mut Stage, levels: &[ActuatorLevel], latest: &mut Timing) -> Value {
    let pointer = stage.pointer_latency();
    let time_s = stage.now_s();
    let recording_s = stage.recorder.recording.as_ref().map(|_| time_s);
    let frame = stage.frames();
    let replay = stage.cycle.replay.as_ref().map(|replay| replay.part(frame));
    let (gain, note) = (stage.devices.switch.gain(), stage.devices.note.clone());
    let recorded = stage.recorded();
    let Stage { signals, clock, session, pages, cycle, .. } = stage;
    let Signals { actuators, silent, .. } = signals;
    let actuators: Vec<Value> =
        actuators.iter_mut().map(|actuator| actuator.status(levels, gain > 0.0)).collect();
    let inputs = session.as_ref().map(|session| session.live_inputs()).unwrap_or_default();
    silent.retain(|(name, _)| inputs.iter().any(|input| input.device == *name && !input.state.is_heard()));
    for input in inputs.iter().filter(|input| !input.state.is_heard()) {
        if !silent.iter().any(|(name, _)| *name == input.device) {
            silent.push((input.device.clone(), time_s));
        }
    }
    let quiet = silent.iter().map(|(name, since)| json!({ "input": name, "for_s": time_s - since }));
    let quiet: Vec<Value> = quiet.collect();
    let xruns = clock.as_ref().and_then(Clock::xruns);
    let timing = clock.as_ref().zip(session.as_mut()).map(|(clock, session)| clock.timing(session));
    let timing = timing.unwrap_or_default();
    // A new run counts from zero.
    let before = std::mem::replace(latest, timing);
    let before = if timing.frames < before.frames { Timing::default() } else { before };
    let run_s = (timing.frames - before.frames) as f64 / signals.rate_hz;
    let busy_s = timing.work_ns.saturating_sub(before.work_ns) as f64 * 1e-9;
    let faults = session.as_ref().map_or(0, |session| session.faults().ticks);
    json!({
        "type": "status",
        "time_s": time_s,
        "state": match cycle.state { State::Running => "running", State::Stopped => "stopped", State::Failed => "failed" },
        "recording_s": recording_s, "recorded": recorded,
        "replay": replay,
        "pages": pages.list.len(),
        "behind_ms": timing.late_ns as f64 * 1e-6,
        "late": timing.late,
        "xruns": xruns,
        "silent": quiet,
        "actuators": actuators,
        "armed_gain": gain,
        "note": note,
        "faults": faults,
        "cost": if run_s > 0.0 { busy_s / run_s } else { 0.0 },
        "pointer": pointer,
    })
}

/// Sends the levels to pages that display the drawing; free of cost if there are none.
fn send_levels(stage: &mut Stage, actuators: &[ActuatorLevel]) {
    if !stage.pages.list.iter().any(|page| page.sees_levels) {
        return;
    }
    let message = text(&levels(stage, actuators));
    let pages = stage.pages.list.iter_mut().filter(|page| page.sees_levels);
    pages.for_each(|page| page.send(message.clone()));
}

fn levels(stage: &mut Stage, actuators: &[ActuatorLevel]) -> Value {
    let (mut ports, mut not_finite) = (Map::new(), Map::new());
    for scope in &mut stage.signals.scopes {
        if let Some(level) = scope.level.snapshot() {
            ports.insert(scope.port.name.clone(), json!(level.map(short)));
        }
        if scope.level.not_finite > 0 {
            not_finite.insert(scope.port.name.clone(), json!(scope.level.not_finite));
        }
    }
    let mut limits = Map::new();
    for actuator in actuators {
        let clipped = actuator.clipped;
        let ticks = json!({
            "ticks": clipped.ticks, "peak": clipped.peak, "continuous": clipped.continuous, "slew": clipped.slew,
            "fault": clipped.fault,
        });
        limits.insert(actuator.path.clone(), ticks);
    }
    let costs = stage.session.as_ref().map(|session| {
        let parts = stage.signals.costs.update(session, &stage.loaded.graph).into_iter();
        parts.map(|(path, part)| (path, json!(short(part)))).collect::<Map<_, _>>()
    });
    let origin = stage.session.as_ref().and_then(|session| session.faults().origin);
    json!({
        "type": "levels", "ports": ports, "not_finite": not_finite, "origin": origin.as_deref(), "limits": limits,
        "costs": costs.filter(|costs| !costs.is_empty()),
    })
}
