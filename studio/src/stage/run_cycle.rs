//! Begin and end of the runs of a stage.

use super::super::actuators::driven;
use super::super::drive::{Drive, DrivenBy};
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
use haptograph_engine::host::HostError;
use haptograph_engine::run::{Player, SessionOptions};
use haptograph_live::soundcard::{Inputs, card_requests};
use serde_json::json;
use std::sync::Arc;
use std::time::Duration;

/// How long a page waits for the fall to zero; a limiter may make it longer.
const STOPPING: Duration = Duration::from_secs(2);
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
            self.devices.release(&self.source.registry);
        }
        begun
    }

    fn begin(&mut self, how: NextRun) -> Result<(), StageError> {
        // The queues of endpoints serve one run only.
        self.loaded = self.source.load(&self.loaded.text)?;
        let ports = scope::ports(&self.loaded.graph);
        self.recorder.folder = match how {
            NextRun::Record => self
                .new_folder(&format!("{}-strokes", self.source.name()))
                .map_err(|error| other(format!("there is no folder to record to: {error}")))?,
            _ => None,
        };
        // A new run begins disarmed.
        self.disarm();
        let options = self.play_options(&ports);
        // A replay drives nothing real, and hears nothing that was not recorded.
        let is_live = self.host.can_drive && !matches!(how, NextRun::Replay(_));
        if is_live {
            self.devices.card_requests = Some(card_requests(&self.loaded.graph).map_err(other)?);
            self.devices.network.connect(&mut self.loaded.graph).map_err(other)?;
            self.note_refusals();
        }
        let graph = &self.loaded.graph;
        let (mut player, mut session) = Player::open(graph, &options).map_err(|error| match error {
            HostError::Drivers { count, drivers } => other(format_args!(
                "the studio runs graphs with one driver clock, and this one has {count}: `{}`; make the others `Derived` \
                 clocks of one of them, or run the graph without a page",
                drivers.join("`, `")
            )),
            error => other(error),
        })?;
        if is_live {
            self.devices.inputs = Inputs::open(graph, [&mut player]).map_err(other)?;
        }
        let pads = self.loaded.pads.iter().map(|pad| Pad::of(graph, pad));
        self.signals.pads = pads.collect::<Result<_, _>>().map_err(other)?;
        let scope = |port: Port| session.any_probe(&port.name).map(|frames| Scope::from_start(port, frames));
        let scopes = ports.into_iter().map(scope);
        self.signals.scopes = scopes.collect::<Result<_, _>>().map_err(other)?;
        self.signals.costs = Costs::default();
        let rate_of = |driver: &usize| graph.clocks()[*driver].rate.hz();
        self.signals.rate_hz = graph.drivers().first().map_or(1.0, rate_of);
        self.drive = Some(self.drive_by(player, &how, is_live)?);
        if is_live {
            self.devices.network.keep(&self.loaded.graph);
            let refused = self.drive.as_ref().and_then(|drive| drive.refused().first().cloned());
            self.devices.note = self.devices.note.take().or(refused);
        }
        self.begin_recording_or_replay(how);
        self.session = Some(session);
        self.cycle.state = State::Running;
        self.describe_actuators();
        Ok(())
    }

    /// Shows what devices lack, as a guard.
    pub(crate) fn note_refusals(&mut self) {
        let refused = self.devices.network.status().into_iter().flat_map(|known| known.refused);
        self.devices.note = refused.last().or(self.devices.note.take());
    }

    /// Options of a run with these probes.
    fn play_options(&self, probes: &[Port]) -> SessionOptions {
        let mut options = SessionOptions::default();
        options.sample_costs = true;
        options.probes = probes.iter().map(|port| port.name.clone()).collect();
        options.folder = self.recorder.folder.clone();
        // Outputs of a pad's endpoint are not connected.
        let mut devices = self.loaded.graph.devices().iter();
        options.rested =
            devices.all(|device| device.entry.spec.simulated || self.loaded.is_pad(&device.name));
        options.arm = Some(Arc::clone(&self.devices.switch));
        options
    }

    /// Starts the driver of the player: the soundcard that the graph plays on, a timer, or the caller.
    fn drive_by(&self, player: Player, how: &NextRun, is_live: bool) -> Result<Drive, StageError> {
        let requests = self.devices.card_requests.as_ref().filter(|_| is_live);
        if let Some(request) = requests.and_then(|requests| requests.output.clone()) {
            return Drive::start_by_card(player, request).map_err(other);
        }
        let is_real = self.host.can_drive && !driven(&self.loaded.graph).is_empty();
        let driven_by = match how {
            NextRun::Replay(_) => DrivenBy::Caller,
            _ if self.host.is_driven_by_caller => DrivenBy::Caller,
            _ => DrivenBy::Timer { is_real },
        };
        Drive::start(player, driven_by).map_err(other)
    }

    /// Begins the recording or the replay of a run.
    fn begin_recording_or_replay(&mut self, how: NextRun) {
        match how {
            NextRun::Record => {
                self.begin_recording();
                // Without a folder there is no page.
                let has_page = self.recorder.folder.is_some();
                self.recorder.signals = has_page.then(|| PageSignals::of(&self.loaded.graph));
            }
            NextRun::Replay(recording) => self.cycle.replay = Some(Replay::of(*recording)),
            NextRun::None | NextRun::Live => {}
        }
    }

    /// Lets the outputs fall to zero and stops, within this time or in the course of [`Stage::end_what_is_over`]; if the
    /// caller drives, within its next frames.
    fn stop_within(&mut self, longest: Duration) {
        self.disarm();
        let (Some(session), Some(drive)) = (&self.session, &mut self.drive) else {
            return;
        };
        session.stop();
        self.cycle.is_stopping = true;
        if drive.is_done_within(longest) {
            self.end();
        }
    }

    pub(crate) fn end(&mut self) {
        if self.recorder.recording.as_ref().is_some_and(|recording| recording.frames == 0) {
            self.close_recording();
        }
        let now_s = self.now_s();
        let (Some(session), Some(drive)) = (self.session.take(), self.drive.take()) else {
            return;
        };
        self.disarm();
        let ended = drive.join().map(|player| session.finish(player));
        self.devices.release(&self.source.registry);
        // The last frames: what begins next has scopes of its own.
        self.look_at_scopes(now_s);
        send_samples(self);
        let kept = std::mem::take(&mut self.recorder.signals);
        if let (Some(folder), Some(ended), Some(kept)) = (&self.recorder.folder, &ended, kept) {
            let (graph, outcome) = (&self.loaded.graph, &ended.outcome);
            let written = run_page::write(folder, &self.source, graph, outcome, &kept);
            self.recorder.page_error = written.err().map(|error| error.to_string());
        }
        let failed = ended.is_none_or(|ended| ended.panicked);
        self.cycle.state = if failed { State::Failed } else { State::Stopped };
        self.signals.pads.clear();
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
        if matches!(next, NextRun::None) || self.cycle.state == State::Failed {
            return;
        }
        match self.start_as(next) {
            Ok(()) => talk::tell_graph(self),
            Err(error) => self.tell_owner(&json!({ "type": "refused", "error": error.to_string() })),
        }
    }

    /// Ends the run with complete files.
    pub(crate) fn close(&mut self) {
        self.halt();
        if let Some(drive) = &mut self.drive {
            drive.is_done_within(CLOSING);
        }
        self.end();
    }
}
