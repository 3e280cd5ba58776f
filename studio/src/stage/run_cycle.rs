//! Begin and end of the runs of a stage.

use super::super::actuators::has_real;
use super::super::clock::Clock;
use super::super::error::{StageError, other};
use super::super::levels::Costs;
use super::super::pads::Pad;
use super::super::publish::send_samples;
use super::super::replay::Replay;
use super::super::run_cycle::{NextRun, State};
use super::super::run_page::{self, PageSignals};
use super::super::scope::{self, Port, Scope};
use super::super::talk;
use super::Stage;
use haptograph_engine::run::{Player, SessionOptions};
use haptograph_live::Connections;
use serde_json::json;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// How long a page waits for the fall to zero; a limiter may make it longer.
const STOPPING: Duration = Duration::from_secs(2);
/// Time between messages with the samples of a fall, s: the buffers of probes hold more.
const SENT_S: f64 = 0.2;
/// Number of frames in which a clock of a few hertz has fallen to zero.
const SLOWEST_FALL: u64 = 8;
/// How long the end of the program waits for it.
const CLOSING: Duration = Duration::from_secs(60);

impl Stage {
    /// Starts a live run.
    pub(crate) fn start(&mut self) -> Result<(), StageError> {
        self.start_as(NextRun::Live)
    }

    /// Starts a run. Real actuators start as warm as their limits allow, since their temperature is unknown.
    pub(crate) fn start_as(&mut self, how: NextRun) -> Result<(), StageError> {
        if self.cycle.state == State::Running {
            // It is falling to zero, more slowly than a page waits.
            if self.cycle.is_stopping {
                self.cycle.next_run = how;
            }
            return Ok(());
        }
        self.cycle.is_stopping = false;
        let begun = self.begin(how);
        if begun.is_err() {
            self.devices.forget();
        }
        begun
    }

    fn begin(&mut self, how: NextRun) -> Result<(), StageError> {
        match &how {
            NextRun::Replay(recording) => self.source.seed = recording.seed,
            _ => self.source.seed = None,
        }
        self.prepare_presentation();
        // The queues of endpoints serve one run only.
        self.loaded = self.source.load(&self.loaded.text)?;
        let ports = scope::ports(&self.loaded.graph);
        self.recorder.folder = match how {
            NextRun::Record => self
                .new_folder(
                    &self.recorder.name.clone().unwrap_or_else(|| format!("{}-strokes", self.source.name())),
                )
                .map_err(|error| other(format!("there is no folder to record to: {error}")))?,
            _ => None,
        };
        // A new run begins disarmed.
        self.disarm();
        let options = self.play_options(&ports);
        // A replay drives nothing real, and hears nothing that was not recorded.
        let is_live = self.host.can_drive && !matches!(how, NextRun::Replay(_));
        let mut connections = Connections::with_drivers(&self.source.registry);
        if is_live {
            connections.connect(&mut self.loaded.graph).map_err(other)?;
        }
        let graph = &self.loaded.graph;
        let (players, mut session) = Player::open_all(graph, &options).map_err(other)?;
        let pads = self.loaded.pads.iter().map(|pad| Pad::of(graph, pad));
        self.signals.pads = pads.collect::<Result<_, _>>().map_err(other)?;
        let inputs = self.loaded.inputs.iter().map(|input| Pad::of(graph, &input.pad));
        self.signals.inputs = inputs.collect::<Result<_, _>>().map_err(other)?;
        let scope = |port: Port| session.any_probe(&port.name).map(|frames| Scope::from_start(port, frames));
        let scopes = ports.into_iter().map(scope);
        self.signals.scopes = scopes.collect::<Result<_, _>>().map_err(other)?;
        self.signals.costs = Costs::default();
        self.signals.count_graph();
        let rate_of = |driver: &usize| graph.clocks()[*driver].rate.hz();
        self.signals.rate_hz = graph.drivers().first().map_or(1.0, rate_of);
        // Where no device is real, commands, pointers and a recording have an exact frame each.
        let has_drivers = is_live && (has_real(graph) || !connections.status().is_empty());
        let mut clock =
            Clock::start((graph, connections), (players, &session), &options, has_drivers).map_err(other)?;
        if is_live {
            clock.drivers.keep(graph);
        }
        self.clock = Some(clock);
        self.note_refusals(&[]);
        self.begin_recording_or_replay(how);
        self.session = Some(session);
        self.cycle.state = State::Running;
        self.describe_actuators();
        self.began_in_study();
        Ok(())
    }

    /// Shows what the system refused since it refused `before`, such as real-time scheduling.
    pub(crate) fn note_refusals(&mut self, before: &[String]) {
        let refused = self.clock.as_ref().map(|clock| clock.drivers.notes()).unwrap_or_default();
        let new = refused.into_iter().find(|note| !before.contains(note));
        self.devices.note = new.or(self.devices.note.take());
    }

    /// Options of a run with these probes.
    fn play_options(&self, probes: &[Port]) -> SessionOptions {
        let mut options = SessionOptions::default();
        options.sample_costs = true;
        options.probes = probes.iter().map(|port| port.name.clone()).collect();
        // A page has no disk for what nodes write.
        options.folder = self.recorder.folder.clone().filter(|_| !self.host.is_driven_by_caller);
        // Outputs of a pad's endpoint are not connected.
        let mut devices = self.loaded.graph.devices().iter();
        options.rested =
            devices.all(|device| device.entry.spec.simulated || self.loaded.is_pad(&device.name));
        options.arm = Some(Arc::clone(&self.devices.switch));
        options
    }

    /// Begins the recording or the replay of a run.
    fn begin_recording_or_replay(&mut self, how: NextRun) {
        match how {
            NextRun::Record => {
                self.begin_recording();
                // Without a folder there is no page.
                // An engine in a page has no disk, and is spared what draws pages.
                let has_page = cfg!(not(target_family = "wasm"))
                    && self.recorder.folder.is_some()
                    && self.recorder.name.is_none();
                self.recorder.signals = has_page.then(|| PageSignals::of(&self.loaded.graph));
            }
            NextRun::Replay(recording) => self.cycle.replay = Some(Replay::of(*recording)),
            NextRun::None | NextRun::Live => {}
        }
    }

    /// Lets the outputs fall to zero and stops, within this time or in the course of [`Stage::end_what_is_over`]; if the
    /// caller drives, within its next frames.
    pub(crate) fn stop_within(&mut self, longest: Duration) {
        self.disarm();
        let Some(session) = &self.session else {
            return;
        };
        session.stop();
        self.cycle.is_stopping = true;
        if self.is_done_within(longest) {
            self.end();
        }
    }

    /// True if the stopped run is over, within this time if no page's audio thread runs its frames. Without drivers they
    /// are run at once.
    fn is_done_within(&mut self, longest: Duration) -> bool {
        let is_over = |stage: &Self| stage.clock.as_ref().is_none_or(|clock| clock.is_over(true));
        match self.clock.as_mut().filter(|_| !self.host.is_driven_by_caller) {
            Some(clock) if clock.has_drivers() => clock.wait(longest),
            Some(clock) => {
                let (begun, part) = (Instant::now(), clock.part(self.signals.rate_hz));
                let frames = (longest.as_secs_f64() * self.signals.rate_hz).ceil() as u64;
                let sent_every = (SENT_S * self.signals.rate_hz / part as f64).ceil() as u64;
                // A fall takes some frames, also of a slow clock.
                for number in 1..=(frames / part).max(SLOWEST_FALL) {
                    if longest.is_zero() || is_over(self) || begun.elapsed() >= longest {
                        break;
                    }
                    self.run(part as usize);
                    if number % sent_every == 0 {
                        self.look_at_scopes();
                        send_samples(self);
                    }
                }
            }
            None => {}
        }
        is_over(self)
    }

    pub(crate) fn end(&mut self) {
        if self.recorder.recording.as_ref().is_some_and(|recording| recording.frames == 0) {
            self.close_recording();
        }
        let (Some(session), Some(clock)) = (self.session.take(), self.clock.take()) else {
            return;
        };
        self.disarm();
        let ended = clock.join().map(|players| session.finish_all(players));
        self.devices.forget();
        // The last frames: what begins next has scopes of its own.
        self.look_at_scopes();
        send_samples(self);
        let kept = std::mem::take(&mut self.recorder.signals);
        if let (Some(folder), Some(ended), Some(kept)) = (&self.recorder.folder, &ended, kept)
            && cfg!(not(target_family = "wasm"))
        {
            let (graph, outcome) = (&self.loaded.graph, &ended.outcome);
            let written = run_page::write(folder, &self.source, graph, outcome, &kept);
            self.recorder.page_error = written.err().map(|error| error.to_string());
        }
        let failed = ended.is_none_or(|ended| ended.panicked);
        self.cycle.state = if failed { State::Failed } else { State::Stopped };
        self.signals.pads.clear();
        self.signals.inputs.clear();
        self.signals.silent.clear();
        self.start_next_run();
    }

    /// Refuses an action that starts another run, after a STOP and in its course: only a resume ends it.
    ///
    /// # Errors
    /// [`StageError`] with the remedy.
    pub(crate) fn refuse_after_stop(&self, action: &str) -> Result<(), StageError> {
        let is_halting = self.cycle.is_stopping && matches!(self.cycle.next_run, NextRun::None);
        match self.cycle.state == State::Running && !is_halting {
            true => Ok(()),
            false => Err(other(format_args!("cannot {action}: the run is stopped; resume it first"))),
        }
    }

    /// Stops the run without a successor.
    pub(crate) fn halt(&mut self) {
        self.close_recording();
        (self.cycle.next_run, self.cycle.replay) = (NextRun::None, None);
        self.stop_within(STOPPING);
    }

    /// Stops the run, and starts this one after it, within [`STOPPING`] or later.
    pub(crate) fn restart(&mut self, next: NextRun) {
        self.restart_within(STOPPING, next);
    }

    /// Stops the run, and starts this one after it, within this time or later.
    pub(crate) fn restart_within(&mut self, longest: Duration, next: NextRun) {
        (self.cycle.next_run, self.cycle.replay) = (next, None);
        match self.session {
            Some(_) => self.stop_within(longest),
            None => self.start_next_run(),
        }
    }

    /// Delivers the recording of the finished run and starts the next run.
    pub(crate) fn start_next_run(&mut self) {
        if let Some(recording) = self.recorder.recording.take() {
            self.deliver_recording(&recording);
        }
        let next = std::mem::take(&mut self.cycle.next_run);
        if matches!(next, NextRun::None) {
            return;
        }
        if self.cycle.state == State::Failed {
            return self.fail_in_study("a node of the graph panicked; see the messages in the terminal");
        }
        match self.start_as(next) {
            Ok(()) => talk::tell_graph(self),
            Err(error) => {
                self.fail_in_study(&error.to_string());
                self.tell_owner(&json!({ "type": "refused", "error": error.to_string() }));
            }
        }
    }

    /// Ends the run with complete files.
    pub(crate) fn close(&mut self) {
        self.halt();
        self.is_done_within(CLOSING);
        self.end();
    }
}
