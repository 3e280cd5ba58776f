//! What stands between a plan and its actuators: the sinks' gains, the fade, and the limiters that nothing gets around.

use super::fade::FadeGate;
use super::silence::SilenceGate;
use crate::limiter::{ClipCounts, Hottest, Limiter};
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
    /// Closes while a live input that it depends on is silent.
    pub gate: SilenceGate,
    pub role: CrossFadeRole,
    /// What it is given, for whoever watches.
    pub level: Level,
}

/// How much an actuator is given: a moving mean square, and the largest magnitude since it was published.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Level {
    mean_square: f64,
    largest_square: f64,
    /// The share of the mean that a frame renews.
    a_frame: f64,
}

/// Time constant of the moving mean, s.
const LEVEL_S: f64 = 0.3;

impl Level {
    fn new(rate_hz: f64) -> Self {
        Self {
            mean_square: 0.0,
            largest_square: 0.0,
            a_frame: 1.0 / (LEVEL_S * rate_hz),
        }
    }

    /// Takes frames that were given.
    pub(super) fn take(&mut self, given: &[f64], width: usize) {
        let frames = given.chunks_exact(width.max(1));
        let count = frames.len() as f64;
        let (mut sum, mut largest) = (0.0, self.largest_square);
        for frame in frames {
            let square: f64 = frame.iter().map(|y| y * y).sum();
            sum += square;
            largest = f64::max(largest, square);
        }
        self.largest_square = largest;
        if count > 0.0 {
            self.mean_square += (sum / count - self.mean_square) * (count * self.a_frame).min(1.0);
        }
    }

    /// The root of the mean, and the largest magnitude since this was asked before.
    pub(super) fn read(&mut self) -> (f64, f64) {
        let largest = std::mem::take(&mut self.largest_square);
        (self.mean_square.sqrt(), largest.sqrt())
    }
}

/// Whose wish the limiter is given.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum CrossFadeRole {
    /// The plan's own.
    Single,
    /// None: what the plan asked for last is given to the plan that fades it out.
    Outgoing([f64; 6]),
    /// The plan's own while it rises, with what is left of what another plan asks for.
    Mixer([f64; 6], FadeGate),
}

/// A limiter of as many axes as a drive can have.
pub(super) enum AnyLimiter {
    One(Limiter<1>),
    Three(Limiter<3>),
    Six(Limiter<6>),
    /// A limit that could not be made: nothing passes.
    Closed,
}

/// The fade, and the time of the frames it is applied to.
pub(super) struct When {
    pub fade: FadeGate,
    pub first: u64,
    pub period: u64,
}

impl When {
    fn time(&self, frame: usize) -> u64 {
        (self.first + frame as u64) * self.period
    }
}

impl CrossFadeRole {
    /// What the plan asked for last.
    pub(super) fn outgoing(&self) -> [f64; 6] {
        match self {
            Self::Outgoing(asked) => *asked,
            Self::Single | Self::Mixer(..) => [0.0; 6],
        }
    }

    /// Takes what the other plan asks for; what is no number is nothing. Was it one?
    pub(super) fn mix_in(&mut self, asked: [f64; 6]) -> bool {
        if let Self::Mixer(other, _) = self {
            *other = asked.map(|x| if x.is_finite() { x } else { 0.0 });
        }
        asked.iter().all(|x| x.is_finite())
    }

    /// From `time` on, does the plan have the actuator to itself?
    pub(super) fn is_over(&self, time: u64) -> bool {
        match self {
            Self::Mixer(_, rise) => rise.factor(time) >= 1.0,
            Self::Single | Self::Outgoing(_) => true,
        }
    }
}

impl ActuatorState {
    /// Open, until it is known what its live inputs are like.
    pub(super) fn new(plan: &ActuatorPlan) -> Self {
        Self {
            gain: plan.gain,
            limiter: AnyLimiter::new(plan),
            gate: SilenceGate::new(true),
            role: CrossFadeRole::Single,
            level: Level::new(plan.rate.hz()),
        }
    }

    /// Frames of a request to frames that keep the limit. How many of them were no numbers?
    pub(super) fn apply(&mut self, when: &When, x: &[f64], y: &mut [f64]) -> u64 {
        let faults = self.limiter.counts().fault;
        let (gain, gate) = (self.gain, self.gate);
        match &mut self.role {
            CrossFadeRole::Single => self.limiter.apply(x, y, |frame| {
                let time = when.time(frame);
                gain * when.fade.factor(time) * gate.factor(time)
            }),
            // While two plans run together there is one frame at most.
            CrossFadeRole::Outgoing(asked) => {
                let time = when.time(0);
                let factor = gain * when.fade.factor(time) * gate.factor(time);
                asked.iter_mut().zip(x).for_each(|(asked, x)| *asked = x * factor);
                // Who reads what is delivered does not see the change.
                y.iter_mut().zip(asked).for_each(|(y, asked)| *y = *asked);
            }
            CrossFadeRole::Mixer(other, rise) => {
                let (share, own) = (rise.factor(when.time(0)), gate.factor(when.time(0)));
                let mut mixed = other.map(|other| other * (1.0 - share));
                mixed
                    .iter_mut()
                    .zip(x)
                    .for_each(|(mixed, x)| *mixed += x * gain * own * share);
                let width = x.len().min(mixed.len());
                self.limiter
                    .apply(&mixed[..width], y, |_| when.fade.factor(when.time(0)));
            }
        }
        self.level.take(y, self.limiter.width());
        self.limiter.counts().fault - faults
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

    /// Frames of a request, each times a factor, to frames that keep the limit.
    fn apply(&mut self, x: &[f64], y: &mut [f64], factor: impl Fn(usize) -> f64) {
        any!(self, limiter => limit_frames(limiter, x, y, factor), closed: y.fill(0.0));
    }

    /// Axes of a frame.
    fn width(&self) -> usize {
        match self {
            Self::One(_) | Self::Closed => 1,
            Self::Three(_) => 3,
            Self::Six(_) => 6,
        }
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

    /// The latest output; zero beyond the drive's axes.
    pub(super) fn output(&self) -> [f64; 6] {
        let mut output = [0.0; 6];
        any!(self, limiter => output.iter_mut().zip(limiter.output()).for_each(|(to, y)| *to = y), closed: ());
        output
    }

    pub(super) fn is_idle(&self) -> bool {
        self.output() == [0.0; 6]
    }

    /// Its counts go on from those of another one.
    pub(super) fn count_on_from(&mut self, counts: ClipCounts) {
        any!(self, limiter => limiter.count_on_from(counts), closed: ());
    }

    /// Begins as warm as the limit allows: nobody knows what its actuator was given before.
    pub(super) fn assume_thermally_saturated(&mut self) {
        any!(self, limiter => limiter.assume_thermally_saturated(), closed: ());
    }

    /// The same for one that may be any of those that left the run.
    pub(super) fn begin_as_any_of(&mut self, hottest: &Hottest) {
        any!(self, limiter => limiter.begin_as_any_of(hottest), closed: ());
    }

    pub(super) fn has_unknown_history(&self) -> bool {
        any!(self, limiter => limiter.has_unknown_history(), closed: false)
    }

    /// Its actuator leaves the run.
    pub(super) fn leave_to(&self, hottest: &Hottest) {
        any!(self, limiter => limiter.leave_to(hottest), closed: ());
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

fn limit_frames<const N: usize>(
    limiter: &mut Limiter<N>,
    x: &[f64],
    y: &mut [f64],
    factor: impl Fn(usize) -> f64,
) {
    let frames = x.as_chunks::<N>().0.iter().zip(y.as_chunks_mut::<N>().0);
    for (frame, (x, y)) in frames.enumerate() {
        let factor = factor(frame);
        *y = limiter.apply(x.map(|x| x * factor));
    }
}
