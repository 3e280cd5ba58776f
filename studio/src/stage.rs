//! A running graph with its connected pages, and the actions that these may take.

mod actuators;
mod arming;
mod envelope;
mod pages;
mod record;
mod replay;
mod run_cycle;
mod study;
mod swap;

use super::actuators::{Actuator, Sound, has_real};
use super::clock::Clock;
use super::devices::Devices;
use super::envelope::Permitted;
use super::error::{StageError, other};
use super::levels::Costs;
use super::load::{Loaded, Source};
use super::pads::Pad;
use super::pages::Pages;
use super::pointer::Pointer;
use super::record::{Move, Recorder, Recording};
use super::run_cycle::{RunCycle, State};
use super::scope::Scope;
use super::wire::Pointers;
use haptograph_engine::run::Session;
use haptograph_live::BackendEvent;
use serde_json::{Value, json};
use std::time::{Duration, Instant};

/// Abilities of the host of an engine.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Host {
    /// Name in the message `hello`.
    pub name: &'static str,
    /// True if the caller runs the frames, as a page's audio thread does.
    pub is_driven_by_caller: bool,
    pub can_save: bool,
    pub can_learn: bool,
    /// Real devices, where the graph has them.
    pub can_drive: bool,
}

/// The running graph and its pages.
pub(crate) struct Stage {
    pub host: Host,
    pub source: Source,
    pub loaded: Loaded,
    /// The text of the file when it was last read or saved.
    pub on_disk: String,
    pub permitted: Permitted,
    pub session: Option<Session>,
    pub clock: Option<Clock>,
    pub cycle: RunCycle,
    pub devices: Devices,
    pub signals: Signals,
    pub pages: Pages,
    pub recorder: Recorder,
}

/// The signals of the run that pages write, see and hear.
#[derive(Default)]
pub(crate) struct Signals {
    pub pads: Vec<Pad>,
    /// Of single channels, numbered after the pads.
    pub inputs: Vec<Pad>,
    pub scopes: Vec<Scope>,
    pub costs: Costs,
    pub actuators: Vec<Actuator>,
    pub sound: Option<Sound>,
    /// Silent live inputs, with the time of the run since which they are silent, s.
    pub silent: Vec<(String, f64)>,
    /// Delays from the arrival of pointers to their ticks, s.
    pub latencies_s: Vec<f64>,
    /// Rate of the first driver, whose frames count the time of the run, Hz.
    pub rate_hz: f64,
    /// Number of the graph, from 1 on: pointers that were made for another one are stale.
    pub graph: u16,
}

impl Signals {
    /// The pad or input with this number.
    pub(crate) fn pad_mut(&mut self, number: usize) -> Option<&mut Pad> {
        self.pads.iter_mut().chain(&mut self.inputs).nth(number)
    }

    /// Counts a graph that takes over, or is loaded anew.
    pub(crate) fn count_graph(&mut self) {
        self.graph = self.graph.wrapping_add(1).max(1);
    }
}

impl Stage {
    /// Opens and runs the graph of a file.
    pub(crate) fn open(source: Source, host: Host) -> Result<Self, StageError> {
        let text = source
            .read()
            .map_err(|error| other(format!("cannot read {}: {error}", source.path.display())))?;
        let loaded = source.load(&text)?;
        let mut stage = Self {
            host,
            devices: Devices::default(),
            source,
            loaded,
            on_disk: text,
            permitted: Permitted::default(),
            session: None,
            clock: None,
            cycle: RunCycle::default(),
            signals: Signals { rate_hz: 1.0, ..Signals::default() },
            pages: Pages::default(),
            recorder: Recorder::default(),
        };
        stage.start()?;
        Ok(stage)
    }

    /// Frames of the run. Where drivers run them, some may be computed meanwhile: exact to within a block.
    pub(crate) fn frames(&self) -> u64 {
        self.session.as_ref().map_or(0, Session::frames)
    }

    /// Time of the run, s.
    pub(crate) fn now_s(&self) -> f64 {
        self.frames() as f64 / self.signals.rate_hz
    }

    /// True if the drivers of devices run the graph, and false if its stage does, on one clock.
    pub(crate) fn has_drivers(&self) -> bool {
        let would_have = || self.host.can_drive && has_real(&self.loaded.graph);
        self.clock.as_ref().map_or_else(would_have, Clock::has_drivers)
    }

    /// Time of a driver by its own frames, s: drivers of devices drift and begin one after the other. That of the run if all run
    /// on one clock, and for the only driver; `None` without a run.
    pub(crate) fn time_s_of(&self, driver: Option<&str>) -> Option<f64> {
        let session = self.session.as_ref()?;
        let driver = driver.filter(|_| self.has_drivers());
        let time = driver.and_then(|driver| session.times_s().find(|(known, _)| *known == driver));
        Some(time.map_or_else(|| self.now_s(), |(_, time_s)| time_s))
    }

    /// Updates the timing if the caller drives: wall-clock time and computing time since the last call.
    pub(crate) fn keep_time(&mut self, passed: Duration, busy: Duration) {
        if let Some(clock) = &mut self.clock {
            clock.keep_time(passed, busy, self.signals.rate_hz);
        }
    }

    /// Runs the frames that are due after `passed` more time, unless drivers or a page's audio thread do. Holds the stage
    /// for little longer than `longest`. Returns whether this thread runs the frames.
    pub(crate) fn advance(&mut self, passed: Duration, longest: Duration) -> bool {
        let rate_hz = self.signals.rate_hz;
        let Some(clock) = self.clock.as_mut().filter(|clock| !clock.has_drivers()) else {
            return false;
        };
        let (due, part) = (clock.due(passed, rate_hz), clock.part(rate_hz));
        let (begun, mut done) = (Instant::now(), 0);
        while done < due && begun.elapsed() < longest {
            let frames = part.min(due - done);
            self.run(frames as usize);
            done += frames;
        }
        if let Some(clock) = &mut self.clock {
            clock.ran(done, begun.elapsed(), rate_hz);
        }
        true
    }

    /// Collects the new data of the run.
    pub(crate) fn look(&mut self) {
        let notes = self.clock.as_mut().map(|clock| clock.drivers.poll());
        for note in notes.unwrap_or_default() {
            if let BackendEvent::Changed(note) = note {
                // What is plugged in anew is not what was armed.
                self.disarm();
                self.devices.note = Some(note);
            }
        }
        if let Some(session) = &mut self.session {
            session.poll();
        }
        self.disarm_if_silent();
        self.look_at_scopes();
    }

    /// Ends runs and replays that are over, after their last data have been sent to the pages.
    pub(crate) fn end_what_is_over(&mut self) {
        if !self.cycle.is_stopping && self.clock.as_mut().is_some_and(Clock::is_partly_over) {
            self.stop_within(Duration::ZERO);
        }
        let is_stopping = self.cycle.is_stopping;
        if self.cycle.state == State::Running
            && self.clock.as_ref().is_some_and(|clock| clock.is_over(is_stopping))
        {
            self.end();
        }
        if self.recorder.recording.as_ref().is_some_and(Recording::is_full) {
            match self.pages.study.is_some() {
                true => self.interrupt_study("the recording is full"),
                // A run that is stopping ends it too.
                false => drop(self.record(false)),
            }
        }
    }

    pub(crate) fn look_at_scopes(&mut self) {
        let mut scopes = std::mem::take(&mut self.signals.scopes);
        for scope in &mut scopes {
            scope.look(self.time_s_of(scope.port.driver.as_deref()));
        }
        self.signals.scopes = scopes;
        if let Some(signals) = &mut self.recorder.signals {
            signals.take(&self.signals.scopes);
        }
    }

    /// Runs `frames` frames if the caller drives; returns the samples to play, where 1 is the peak limit.
    /// Real-time code: it does not allocate if [`look`](Self::look) is called often enough.
    pub(crate) fn process(&mut self, frames: usize) -> impl Iterator<Item = f64> {
        self.run(frames);
        let scopes = &mut self.signals.scopes;
        let played = self.signals.sound.as_ref().and_then(|sound| {
            let scope = scopes.iter_mut().find(|scope| scope.port.name == sound.port)?;
            Some((scope.take_in(), sound.peak))
        });
        let (values, peak) = played.unwrap_or((&[], 1.0));
        values.iter().map(move |value| value / peak)
    }

    /// Applies pointer events of a page to a pad or input; ignored for pages that do not own the pads, during a replay, and
    /// if they were made for another graph.
    pub(crate) fn point(&mut self, page: u64, pointers: &Pointers) {
        let number = pointers.number;
        if self.pages.owner != Some(page) || self.cycle.replay.is_some() || !self.study_feels() {
            return;
        }
        if pointers.graph.is_some_and(|graph| graph != self.signals.graph) {
            return;
        }
        // The participant of a study moves pads alone.
        if self.pages.study.is_some() && number >= self.signals.pads.len() {
            return;
        }
        let Some(pad) = self.signals.pad_mut(number) else { return };
        let driver = pad.driver.clone();
        let now_s = self.time_s_of(driver.as_deref()).unwrap_or_default();
        for point in &pointers.points {
            let page = self.pages.list.iter_mut().find(|known| known.id == page);
            let Some(page) = page else { return };
            let clock = page.clock_of(driver.as_deref());
            let due_s = match pointers.are_planned {
                true => clock.planned_s(point.at_s, now_s),
                false => clock.due_s(point.at_s, now_s),
            };
            if !pointers.are_planned {
                self.signals.latencies_s.push((due_s - now_s).max(0.0));
            }
            self.make(number, due_s, point);
        }
        let most = self.signals.latencies_s.len().saturating_sub(1000);
        self.signals.latencies_s.drain(..most);
    }

    /// Applies a pointer event that is due at a time of its driver to a pad or input, and records it by the time of the run.
    fn make(&mut self, number: usize, due_s: f64, point: &Pointer) {
        let Some(pad) = self.signals.pad_mut(number) else { return };
        let driver = pad.driver.clone();
        let ahead_s = self.ahead_s(driver.as_deref());
        // The recorded event is the one that is applied.
        let made = Move::new(self.frames(), number, due_s - ahead_s, point);
        self.apply(&made, ahead_s);
        if let Some(recording) = &mut self.recorder.recording {
            recording.moves.push(made);
        }
    }

    /// Time of a driver less that of the run, s.
    fn ahead_s(&self, driver: Option<&str>) -> f64 {
        self.time_s_of(driver).map_or(0.0, |time_s| time_s - self.now_s())
    }

    /// Gives a pad or input a recorded event; its driver is ahead of the run by `ahead_s`.
    pub(crate) fn apply(&mut self, made: &Move, ahead_s: f64) {
        let (due_s, pointer) = made.pointer();
        if let Some(pad) = self.signals.pad_mut(made.pad) {
            pad.move_to(due_s + ahead_s, &pointer);
        }
    }

    /// Gives the inputs that a page holds back to their devices.
    pub(crate) fn release_inputs(&mut self) {
        if self.cycle.replay.is_some() {
            return;
        }
        for number in 0..self.signals.inputs.len() {
            if let Some(held) = self.signals.inputs[number].held() {
                let due_s = self.time_s_of(self.signals.inputs[number].driver.as_deref());
                let (number, due_s) = (self.signals.pads.len() + number, due_s.unwrap_or_default());
                self.make(number, due_s, &Pointer { force_n: 0.0, ..held });
            }
        }
    }

    /// Statistics of the delays from pointer arrival to tick since the last call.
    pub(crate) fn pointer_latency(&mut self) -> Value {
        let mut all = std::mem::take(&mut self.signals.latencies_s);
        all.sort_by(f64::total_cmp);
        let middle = all.get(all.len() / 2).copied().unwrap_or(0.0);
        let most = all.last().copied().unwrap_or(0.0);
        json!({ "count": all.len(), "p50_ms": middle * 1e3, "max_ms": most * 1e3 })
    }

    /// Sets a live setting.
    pub(crate) fn set(&mut self, name: &str, value: f64) -> Result<(), StageError> {
        let frame = self.frames();
        let Some(session) = &mut self.session else {
            return Err(other("the run is stopped"));
        };
        if self.cycle.replay.is_some() {
            return Err(other("a replay is running; stop it first"));
        }
        session.set_by_name(name, value).map_err(other)?;
        if let Some(recording) = &mut self.recorder.recording {
            recording.add_setting_change(frame, name, value);
        }
        Ok(())
    }
}

impl Drop for Stage {
    fn drop(&mut self) {
        self.close();
    }
}
