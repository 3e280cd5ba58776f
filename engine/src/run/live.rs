//! A plan that runs against a clock, and is changed while it runs.
//!
//! The real-time side is [`Live`]: a driver calls [`Live::callback`] with the frames that are due. The other side is
//! [`Control`]. Between them are rings only: commands one way, reports and what is to be freed the other. Architecture
//! invariant: nothing is allocated, freed or locked in a callback.

use super::drive::Drive;
use super::meter::{Meters, Wake};
use super::swap::{Next, Transfer};
use super::{ActuatorReport, Faults, Run};
use crate::plan::Plan;
use petgraph::graph::NodeIndex;
use rtrb::{Consumer, Producer, RingBuffer};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;

/// How long outputs take from nothing to everything and back, unless told otherwise.
pub const FADE_S: f64 = 0.01;
const COMMANDS: usize = 256;
const REPORTS: usize = 4096;

/// The real-time side of a live run.
pub struct Live {
    run: Run,
    /// Swapped in when the fade has reached zero.
    next: Option<Box<Next>>,
    stopping: bool,
    state: LiveState,
    fade_s: f64,
    commands: Consumer<Command>,
    reports: Producer<Report>,
    unreported: u64,
    pending: Option<Wake>,
}

/// What a live run is doing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LiveState {
    /// Running.
    Running,
    /// Faded out after a stop; nothing more will come.
    Stopped,
    /// A node panicked; the actuators were taken to zero and stay there.
    Panicked,
}

enum Command {
    Set {
        node: NodeIndex,
        setting: usize,
        value: f64,
    },
    Swap(Box<Next>),
    Stop,
}

/// What the real-time side sends back.
enum Report {
    Wake(Wake),
    /// An old plan, to be freed where freeing is allowed.
    Old(Box<Next>),
}

/// The other side of a live run.
pub struct Control {
    commands: Producer<Command>,
    reports: Consumer<Report>,
    /// The plan that runs, or will when the last swap is done.
    plan: Arc<Plan>,
    meters: Meters,
    /// Old plans that came home.
    freed: u64,
}

/// Why a command was not sent.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum ControlError {
    /// The real-time side has not read its commands for a while.
    #[error("the real-time side does not take commands: {COMMANDS} are waiting")]
    Full,
    /// The new graph has another driver rate.
    #[error("the driver's rate changed; that needs a restart of the run")]
    OtherRate,
}

/// Both sides of a live run of `plan`, its outputs faded in.
pub fn live(plan: Arc<Plan>) -> (Live, Control) {
    let (command_in, command_out) = RingBuffer::new(COMMANDS);
    let (report_in, report_out) = RingBuffer::new(REPORTS);
    let mut run = Run::new(Arc::clone(&plan));
    run.fade_in(FADE_S);
    let live = Live {
        run,
        next: None,
        stopping: false,
        state: LiveState::Running,
        fade_s: FADE_S,
        commands: command_out,
        reports: report_in,
        unreported: 0,
        pending: None,
    };
    let control = Control {
        commands: command_in,
        reports: report_out,
        plan,
        meters: Meters::default(),
        freed: 0,
    };
    (live, control)
}

impl Live {
    /// Runs `frames` driver frames, in blocks of at most the plan's; `each` sees every block when it is done.
    ///
    /// A panic in a node ends here: the actuators are taken to zero by the engine itself, outside the plan.
    pub fn callback(&mut self, frames: usize, mut each: impl FnMut(&Run, usize)) {
        self.take_commands();
        let mut left = frames;
        while left > 0 && self.state == LiveState::Running {
            self.change_over();
            if self.state != LiveState::Running {
                break;
            }
            let block = left.min(self.run.plan.block);
            let run = &mut self.run;
            // The plan's state may be half-way through a tick afterwards; it is never run again.
            if catch_unwind(AssertUnwindSafe(|| run.advance(block))).is_err() {
                self.state = LiveState::Panicked;
                break;
            }
            each(&self.run, block);
            left -= block;
        }
        if self.state == LiveState::Panicked {
            self.run.ramp_down(left, self.fade_s);
        }
    }

    /// Reports a wake-up; what finds no room is counted.
    pub fn report(&mut self, wake: Wake) {
        if let Some(old) = self.pending.take() {
            self.unreported += u64::from(self.reports.push(Report::Wake(old)).is_err());
        }
        self.unreported += u64::from(self.reports.push(Report::Wake(wake)).is_err());
    }

    /// What the run is doing.
    pub fn state(&self) -> LiveState {
        self.state
    }

    /// Reports that found no room.
    pub fn unreported(&self) -> u64 {
        self.unreported
    }

    /// Driver frames of the longest block.
    pub fn block(&self) -> usize {
        self.run.plan.block
    }

    /// The run, for what is asked when it is over.
    pub fn run(&self) -> &Run {
        &self.run
    }

    /// What was seen of signals that are not numbers.
    pub fn faults(&self) -> Faults {
        self.run.faults()
    }

    /// What each actuator sink held back.
    pub fn actuators(&self) -> impl Iterator<Item = ActuatorReport> {
        self.run.actuators()
    }

    fn take_commands(&mut self) {
        // A swap waits for the one before it, and so do the commands after it.
        while self.next.is_none() {
            match self.commands.pop() {
                Ok(Command::Set { node, setting, value }) => self.run.set(node, setting, value),
                Ok(Command::Swap(mut next)) if next.transfer == Transfer::Everything => {
                    next.take_over_everything(&mut self.run);
                    self.retire(next);
                }
                Ok(Command::Swap(next)) => {
                    self.run.fade_out(self.fade_s);
                    self.next = Some(next);
                }
                Ok(Command::Stop) => {
                    self.run.fade_out(self.fade_s);
                    self.stopping = true;
                }
                Err(_) => break,
            }
        }
    }

    /// At the zero of a fade: stops, or puts the next plan in the place of this one.
    fn change_over(&mut self) {
        if !self.run.is_silent() {
            return;
        }
        if self.stopping {
            self.state = LiveState::Stopped;
        } else if let Some(mut next) = self.next.take() {
            next.take_over(&mut self.run);
            self.run.fade_in(self.fade_s);
            self.retire(next);
        }
    }

    /// Sends an old plan home. The ring has room for many more than can be under way.
    fn retire(&mut self, old: Box<Next>) {
        if let Err(rtrb::PushError::Full(Report::Old(old))) = self.reports.push(Report::Old(old)) {
            // Not freed here: freeing is not for this thread. It is leaked, once, and counted.
            std::mem::forget(old);
            self.unreported += 1;
        }
    }
}

impl Control {
    /// Sets a live setting of a node.
    ///
    /// # Errors
    /// [`ControlError::Full`] if the real-time side does not read.
    pub fn set(&mut self, node: NodeIndex, setting: usize, value: f64) -> Result<(), ControlError> {
        self.send(Command::Set { node, setting, value })
    }

    /// Fades out and stops.
    ///
    /// # Errors
    /// [`ControlError::Full`] if the real-time side does not read.
    pub fn stop(&mut self) -> Result<(), ControlError> {
        self.send(Command::Stop)
    }

    /// Puts a new plan in the place of the one that runs. The same graph goes on without changing a bit; another one
    /// is swapped at the zero of a fade, the state of the nodes that stayed carried over.
    ///
    /// # Errors
    /// [`ControlError`] if the driver's rate differs or the real-time side does not read.
    pub fn swap(&mut self, plan: Arc<Plan>) -> Result<(), ControlError> {
        if plan.driver_rate() != self.plan.driver_rate() {
            return Err(ControlError::OtherRate);
        }
        let next = Box::new(Next::new(&self.plan, Arc::clone(&plan)));
        self.send(Command::Swap(next))?;
        self.plan = plan;
        Ok(())
    }

    /// Takes in what the real-time side reported since, frees what came home, and returns what was counted so far.
    pub fn poll(&mut self) -> &Meters {
        while let Ok(report) = self.reports.pop() {
            match report {
                Report::Wake(wake) => self.meters.record(&wake),
                Report::Old(old) => {
                    drop(old);
                    self.freed += 1;
                }
            }
        }
        &self.meters
    }

    /// Old plans that came home to be freed.
    pub fn freed(&self) -> u64 {
        self.freed
    }

    fn send(&mut self, command: Command) -> Result<(), ControlError> {
        self.commands.push(command).map_err(|_| ControlError::Full)
    }
}

impl Run {
    /// Lets the outputs rise from nothing, from now on.
    pub(crate) fn fade_in(&mut self, seconds: f64) {
        let (begin, end) = self.fade_span(seconds);
        self.state.drive = Drive::Rising { begin, end };
    }

    /// Lets the outputs fall to nothing, from now on.
    pub(crate) fn fade_out(&mut self, seconds: f64) {
        if !matches!(self.state.drive, Drive::Falling { .. }) {
            let (begin, end) = self.fade_span(seconds);
            self.state.drive = Drive::Falling { begin, end };
        }
    }

    /// Has a fade-out come to its end?
    pub(crate) fn is_silent(&self) -> bool {
        self.state.drive.is_zero_from(self.state.windows.block().1)
    }

    fn fade_span(&self, seconds: f64) -> (u64, u64) {
        let begin = self.state.windows.block().1;
        let units = (seconds * self.plan.base.units_per_second()).round().max(1.0) as u64;
        (begin, begin.saturating_add(units))
    }
}
