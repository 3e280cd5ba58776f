//! The thread of an arm: a command to the service, its state in answer, and so on.

use super::messages::{ArmStatus, Reading, State, command};
use super::service::{Received, Service};
use crate::backend::BackendEvent;
use crate::guard;
use crate::latest_command::LatestCommand;
use crate::udp::WAIT;
use haptograph_nodes::network::link::Link;
use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, SyncSender};
use std::time::{Duration, Instant};

/// Least time between two commands: each tick of a servo at 1 kHz goes out within half of its period.
const PERIOD: Duration = Duration::from_micros(500);
/// Time between attempts to reach the service anew.
const RETRY: Duration = Duration::from_millis(500);

/// Settings of an arm.
#[derive(Debug, Clone)]
pub(super) struct ArmConfig {
    pub link: Arc<Link>,
    pub service: SocketAddr,
    /// Identifier of the arm; none: the only one.
    pub arm: Option<String>,
    pub grip: Option<String>,
    pub preset: Option<&'static str>,
    /// Silence after which the arm counts as gone.
    pub timeout: Duration,
}

impl ArmConfig {
    /// True if grip, axes and timeout are the same.
    pub(super) fn has_same_settings(&self, other: &Self) -> bool {
        (&self.grip, self.preset, self.timeout) == (&other.grip, other.preset, other.timeout)
    }
}

/// What the arm last was.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Presence {
    Here,
    NotReady,
    Absent,
    NoService,
}

/// An arm and its connection.
pub(super) struct Exchange {
    config: ArmConfig,
    /// Identifier of the arm.
    arm: String,
    service: Option<Service>,
    driven: LatestCommand,
    presence: Presence,
    status: ArmStatus,
    /// True until the axes are set.
    is_first: bool,
    /// Time of the last command, and whether it was answered.
    sent: (Instant, bool),
    /// Time of the last state of the arm.
    heard: Option<Instant>,
    events: SyncSender<BackendEvent>,
}

impl Exchange {
    pub(super) fn new(
        config: ArmConfig,
        arm: String,
        (service, state): (Service, State),
        events: SyncSender<BackendEvent>,
    ) -> Self {
        Self {
            status: state.status(&arm),
            driven: LatestCommand::after(config.link.driven_version()),
            config,
            arm,
            service: Some(service),
            presence: Presence::Here,
            is_first: true,
            sent: (Instant::now(), true),
            heard: None,
            events,
        }
    }

    /// Runs until `stop`, with new settings from `edits`.
    pub(super) fn run(mut self, edits: &Receiver<ArmConfig>, stop: &AtomicBool) {
        while !stop.load(Ordering::Relaxed) && !guard::ends() {
            if let Some(config) = edits.try_iter().last() {
                self.is_first |= config.preset != self.config.preset;
                self.config = config;
            }
            match (&self.service, self.sent) {
                (None, _) => self.reconnect(),
                (Some(_), (_, true)) => self.send(),
                (Some(_), (_, false)) => self.receive(),
            }
        }
        self.release();
    }

    /// Sends a last command of zeros, which a service that is late gets, too. A stream that is closed ahead of an answer may take the
    /// command with it.
    fn release(&mut self) {
        let Some(mut service) = self.service.take() else { return };
        let mut answers = 1 + usize::from(!self.sent.1);
        if service.send(command(&self.arm, [0.0; 3], None)) {
            let begun = Instant::now();
            while answers > 0 && begun.elapsed() < RETRY {
                match service.receive() {
                    Received::State(_) | Received::Refused(_) => answers -= 1,
                    Received::Nothing => {}
                    Received::Lost(_) => break,
                }
            }
        }
        service.close();
    }

    fn reconnect(&mut self) {
        std::thread::sleep(RETRY);
        if let Ok((service, state)) = Service::connect(self.config.service) {
            (self.service, self.is_first, self.sent) = (Some(service), true, (Instant::now(), true));
            self.status = state.status(&self.arm);
        }
    }

    /// Sends the latest command; zeros while the arm is silent.
    fn send(&mut self) {
        if let Some(rest) = PERIOD.checked_sub(self.sent.0.elapsed()) {
            std::thread::sleep(rest);
        }
        self.driven.update(&self.config.link, self.config.timeout);
        let is_heard = self.heard.is_some_and(|heard| heard.elapsed() <= self.config.timeout);
        let [x, y, z, ..] = self.driven.values;
        let force_n = if is_heard { [x, y, z] } else { [0.0; 3] };
        let first = self.is_first.then_some(self.config.preset);
        let message = command(&self.arm, force_n, first);
        self.sent = (Instant::now(), false);
        match self.service.as_mut().is_some_and(|service| service.send(message)) {
            true => self.is_first = false,
            false => self.lose(),
        }
    }

    /// Receives the answer, and what else has come, of which the last state counts. A service that stalls gets no other command, which it would obey late.
    fn receive(&mut self) {
        let Some(service) = &mut self.service else { return };
        let link = &self.config.link;
        match service.latest(|what| link.count(what, 1)) {
            Received::State(state) => self.take(&state),
            Received::Refused(what) => {
                self.config.link.count(what, 1);
                self.sent.1 = true;
            }
            Received::Nothing if self.sent.0.elapsed() <= self.config.timeout.max(WAIT) => {}
            Received::Nothing => self.lose(),
            Received::Lost(what) => {
                what.into_iter().for_each(|what| self.config.link.count(what, 1));
                self.lose();
            }
        }
    }

    fn take(&mut self, state: &State) {
        self.sent.1 = true;
        self.status = self.status.then(state.status(&self.arm));
        match state.read(&self.arm, self.config.grip.as_deref()) {
            Ok(Reading::Sensed(_)) if !self.status.is_ready() => self.becomes(Presence::NotReady),
            Ok(Reading::Sensed(sensed)) => {
                self.heard = Some(Instant::now());
                self.config.link.publish(&sensed);
                self.becomes(Presence::Here);
            }
            Ok(Reading::Absent) => self.becomes(Presence::Absent),
            Err(what) => self.config.link.count(what, 1),
        }
    }

    /// Gives the connection up, with a force of zero.
    fn lose(&mut self) {
        self.heard = None;
        self.release();
        self.becomes(Presence::NoService);
    }

    fn becomes(&mut self, presence: Presence) {
        if presence == self.presence {
            return;
        }
        self.presence = presence;
        let (arm, service) = (&self.arm, self.config.service);
        let event = match presence {
            Presence::Here => format!("Haply arm {arm} is back"),
            Presence::NotReady => {
                format!(
                    "Haply arm {arm} is not ready or not calibrated, and silent until it is: calibrate it"
                )
            }
            Presence::Absent => format!("Haply arm {arm} is gone; it is silent until it is back"),
            Presence::NoService => {
                format!(
                    "the Haply Inverse Service at {service} is gone; arm {arm} is silent until it is back"
                )
            }
        };
        // Nobody may poll; then old events stay.
        let _ = self.events.try_send(BackendEvent::Changed(event));
    }
}
