//! What stands between a plan and its actuators: the sinks' gains, the fade, and the limiters that nothing gets around.

use super::drive::Drive;
use crate::limiter::{ClipCounts, Limiter};
use crate::plan::ActuatorPlan;

/// What an actuator sink held back.
#[derive(Debug, Clone, PartialEq)]
pub struct ActuatorReport {
    /// Path of the sink.
    pub path: String,
    /// How often each limit held something back.
    pub clipped: ClipCounts,
}

/// A gain and the limiter that every drive of a device goes through.
pub(super) struct ActuatorState {
    pub gain: f64,
    pub limiter: AnyLimiter,
}

/// A limiter of as many axes as a drive can have.
pub(super) enum AnyLimiter {
    One(Limiter<1>),
    Three(Limiter<3>),
    Six(Limiter<6>),
    /// A limit that could not be made: nothing passes.
    Closed,
}

/// How a sink's request becomes a drive: its gain, and the fade at the time of each frame.
pub(super) struct Asked {
    pub gain: f64,
    pub drive: Drive,
    pub first: u64,
    pub period: u64,
}

impl ActuatorState {
    pub(super) fn new(plan: &ActuatorPlan) -> Self {
        Self {
            gain: plan.gain,
            limiter: AnyLimiter::new(plan),
        }
    }
}

/// The same work for a limiter of any width.
macro_rules! any {
    ($any:expr, $limiter:ident => $work:expr, closed: $closed:expr) => {
        match $any {
            AnyLimiter::One($limiter) => $work,
            AnyLimiter::Three($limiter) => $work,
            AnyLimiter::Six($limiter) => $work,
            AnyLimiter::Closed => $closed,
        }
    };
}

impl AnyLimiter {
    fn new(plan: &ActuatorPlan) -> Self {
        let rate_hz = plan.rate.hz();
        match plan.width {
            1 => Limiter::new(&plan.limit, rate_hz).map(Self::One),
            3 => Limiter::new(&plan.limit, rate_hz).map(Self::Three),
            6 => Limiter::new(&plan.limit, rate_hz).map(Self::Six),
            _ => return Self::Closed,
        }
        .unwrap_or(Self::Closed)
    }

    /// Frames of a drive to frames that keep the limit. How many of them were no numbers?
    pub(super) fn apply(&mut self, asked: &Asked, x: &[f64], y: &mut [f64]) -> u64 {
        let faults = self.counts().fault;
        any!(self, limiter => limit_frames(limiter, asked, x, y), closed: y.fill(0.0));
        self.counts().fault - faults
    }

    /// Goes on for another limiter of the same actuator.
    pub(super) fn go_on_for(&mut self, other: &Self) {
        match (self, other) {
            (Self::One(this), Self::One(other)) => this.go_on_for(other),
            (Self::Three(this), Self::Three(other)) => this.go_on_for(other),
            (Self::Six(this), Self::Six(other)) => this.go_on_for(other),
            // A channel of a device has one kind.
            _ => {}
        }
    }

    pub(super) fn rests(&self) -> bool {
        any!(self, limiter => limiter.output().iter().all(|y| *y == 0.0), closed: true)
    }

    /// Begins as warm as the limit allows.
    pub(super) fn begin_spent(&mut self) {
        any!(self, limiter => limiter.begin_spent(), closed: ());
    }

    /// Begins from what the actuator was really given last.
    pub(super) fn begin_from(&mut self, given: &[f64; 6]) {
        any!(self, limiter => limiter.begin_from(std::array::from_fn(|axis| given[axis])), closed: ());
    }

    /// The next frame of the way from the latest output down to zero, by a factor on it.
    pub(super) fn ramp(&mut self, factor: f64, frame: &mut [f64; 6]) -> usize {
        let mut put = |lanes: &[f64]| {
            frame[..lanes.len()].copy_from_slice(lanes);
            lanes.len()
        };
        any!(self, limiter => put(&limiter.apply(limiter.output().map(|x| x * factor))), closed: 0)
    }

    pub(super) fn counts(&self) -> ClipCounts {
        any!(self, limiter => limiter.counts(), closed: ClipCounts::default())
    }
}

fn limit_frames<const N: usize>(limiter: &mut Limiter<N>, asked: &Asked, x: &[f64], y: &mut [f64]) {
    for (j, (x, y)) in x
        .as_chunks::<N>()
        .0
        .iter()
        .zip(y.as_chunks_mut::<N>().0)
        .enumerate()
    {
        let factor = asked.gain * asked.drive.factor((asked.first + j as u64) * asked.period);
        *y = limiter.apply(x.map(|x| x * factor));
    }
}
