//! Actuator sinks: gain, fade, silence gate and limiter. Every output to a device passes them.

use super::fade::FadeGate;
use super::silence::SilenceGate;
use crate::limiter::{ClipCounts, Hottest, Limit, Limiter};
use crate::plan::ActuatorPlan;

/// Report of the limiter of an actuator sink.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct ActuatorReport {
    /// Path of the sink.
    pub path: String,
    /// Ticks in which each limit acted.
    pub clipped: ClipCounts,
    /// Largest magnitude of a request, before the limits.
    pub largest_request: f64,
    /// The limit.
    pub limit: Limit,
    /// Unit of the request and of the limit.
    pub unit: String,
}

/// State of an actuator sink.
pub(super) struct ActuatorState {
    pub gain: f64,
    pub limiter: AnyLimiter,
    /// Gate that closes while a live input upstream is silent.
    pub gate: SilenceGate,
    pub role: CrossFadeRole,
    /// Level of its output, for display.
    pub level: Level,
}

/// Level of an actuator's output: a moving mean square, and the largest magnitude since the last reading.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Level {
    mean_square: f64,
    largest_square: f64,
    /// Weight of a frame in the mean.
    weight: f64,
}

/// Time constant of the moving mean, s.
const LEVEL_S: f64 = 0.3;

impl Level {
    fn new(rate_hz: f64) -> Self {
        Self { mean_square: 0.0, largest_square: 0.0, weight: 1.0 / (LEVEL_S * rate_hz) }
    }

    /// Measures frames of the output.
    pub(super) fn measure(&mut self, output: &[f64], width: usize) {
        let frames = output.chunks_exact(width.max(1));
        let count = frames.len() as f64;
        let (mut sum, mut largest) = (0.0, self.largest_square);
        for frame in frames {
            let square: f64 = frame.iter().map(|y| y * y).sum();
            sum += square;
            largest = f64::max(largest, square);
        }
        self.largest_square = largest;
        if count > 0.0 {
            self.mean_square += (sum / count - self.mean_square) * (count * self.weight).min(1.0);
        }
    }

    /// Root mean square, and the largest magnitude since the last call.
    pub(super) fn read(&mut self) -> (f64, f64) {
        let largest = std::mem::take(&mut self.largest_square);
        (self.mean_square.sqrt(), largest.sqrt())
    }
}

/// Role of an actuator sink in a cross-fade.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum CrossFadeRole {
    /// No cross-fade: the limiter receives the plan's own request.
    Single,
    /// The plan fades out: its last request goes to the mixer of the new plan.
    Outgoing([f64; 6]),
    /// The plan fades in: the limiter receives the mix of its own request and the old plan's.
    Mixer([f64; 6], FadeGate),
}

/// A limiter of one, three or six axes.
pub(super) enum AnyLimiter {
    One(Limiter<1>),
    Three(Limiter<3>),
    Six(Limiter<6>),
    /// The limiter could not be built: the output is zero.
    Closed,
}

/// The fade, and the time of the frames to which it applies.
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
    /// The last request of an outgoing sink; zero in other roles.
    pub(super) fn outgoing(&self) -> [f64; 6] {
        match self {
            Self::Outgoing(request) => *request,
            Self::Single | Self::Mixer(..) => [0.0; 6],
        }
    }

    /// Sets the old plan's request, NaN and infinity replaced by zero. Returns whether it was finite.
    pub(super) fn mix_in(&mut self, outgoing: [f64; 6]) -> bool {
        if let Self::Mixer(other, _) = self {
            *other = outgoing.map(|x| if x.is_finite() { x } else { 0.0 });
        }
        outgoing.iter().all(|x| x.is_finite())
    }

    /// True if the cross-fade is over at `time`.
    pub(super) fn is_over(&self, time: u64) -> bool {
        match self {
            Self::Mixer(_, rise) => rise.factor(time) >= 1.0,
            Self::Single | Self::Outgoing(_) => true,
        }
    }
}

impl ActuatorState {
    /// Makes the initial state. The gate is open until the live inputs are polled.
    pub(super) fn new(plan: &ActuatorPlan) -> Self {
        Self {
            gain: plan.gain,
            limiter: AnyLimiter::new(plan),
            gate: SilenceGate::new(true),
            role: CrossFadeRole::Single,
            level: Level::new(plan.rate.hz()),
        }
    }

    /// Computes the limited output of a request. Returns the number of frames with NaN or infinity.
    pub(super) fn apply(&mut self, when: &When, x: &[f64], y: &mut [f64]) -> u64 {
        let faults = self.limiter.counts().fault;
        let (gain, gate) = (self.gain, self.gate);
        match &mut self.role {
            CrossFadeRole::Single => self.limiter.apply(x, y, |frame| {
                let time = when.time(frame);
                gain * when.fade.factor(time) * gate.factor(time)
            }),
            // In a cross-fade a call has one frame at most.
            CrossFadeRole::Outgoing(request) => {
                let time = when.time(0);
                let factor = gain * when.fade.factor(time) * gate.factor(time);
                request.iter_mut().zip(x).for_each(|(to, x)| *to = x * factor);
                // Readers of `delivered` see no step.
                y.iter_mut().zip(request).for_each(|(y, x)| *y = *x);
            }
            CrossFadeRole::Mixer(other, rise) => {
                let (share, own) = (rise.factor(when.time(0)), gate.factor(when.time(0)));
                let mut mixed = other.map(|other| other * (1.0 - share));
                mixed.iter_mut().zip(x).for_each(|(mixed, x)| *mixed += x * gain * own * share);
                let width = x.len().min(mixed.len());
                self.limiter.apply(&mixed[..width], y, |_| when.fade.factor(when.time(0)));
            }
        }
        self.level.measure(y, self.limiter.width());
        self.limiter.counts().fault - faults
    }
}

/// Runs the same code for a limiter of any width.
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

    /// Computes the limited output of a request times a factor for each frame.
    fn apply(&mut self, x: &[f64], y: &mut [f64], factor: impl Fn(usize) -> f64) {
        any!(self, limiter => limit_frames(limiter, x, y, factor), closed: y.fill(0.0));
    }

    /// Number of axes.
    fn width(&self) -> usize {
        match self {
            Self::One(_) | Self::Closed => 1,
            Self::Three(_) => 3,
            Self::Six(_) => 6,
        }
    }

    /// Continues the state of another limiter of the same actuator.
    pub(super) fn continue_from(&mut self, other: &Self) {
        match (self, other) {
            (Self::One(this), Self::One(other)) => this.continue_from(other),
            (Self::Three(this), Self::Three(other)) => this.continue_from(other),
            (Self::Six(this), Self::Six(other)) => this.continue_from(other),
            // Unreachable: a channel of a device has one kind.
            _ => {}
        }
    }

    /// The last output; zero beyond its axes.
    pub(super) fn output(&self) -> [f64; 6] {
        let mut output = [0.0; 6];
        any!(self, limiter => output.iter_mut().zip(limiter.output()).for_each(|(to, y)| *to = y), closed: ());
        output
    }

    pub(super) fn is_idle(&self) -> bool {
        self.output() == [0.0; 6]
    }

    /// Continues the counts and the largest request of another limiter.
    pub(super) fn count_on_from(&mut self, other: &Self) {
        any!(self, limiter => limiter.count_on_from(other.counts(), other.largest_request()), closed: ());
    }

    /// Starts without heat reserve: the earlier output of the actuator is unknown.
    pub(super) fn assume_thermally_saturated(&mut self) {
        any!(self, limiter => limiter.assume_thermally_saturated(), closed: ());
    }

    /// Starts with the heat of the hottest removed actuator: the hardware may be the same.
    pub(super) fn begin_as_any_of(&mut self, hottest: &Hottest) {
        any!(self, limiter => limiter.begin_as_any_of(hottest), closed: ());
    }

    /// Used part of the continuous limit.
    pub(super) fn used_heat(&self) -> f64 {
        any!(self, limiter => limiter.used_heat(), closed: 0.0)
    }

    pub(super) fn has_unknown_history(&self) -> bool {
        any!(self, limiter => limiter.has_unknown_history(), closed: false)
    }

    /// Records the heat of a removed actuator.
    pub(super) fn leave_to(&self, hottest: &Hottest) {
        any!(self, limiter => limiter.leave_to(hottest), closed: ());
    }

    /// Sets the last output.
    pub(super) fn begin_from(&mut self, given: &[f64; 6]) {
        any!(self, limiter => limiter.begin_from(std::array::from_fn(|axis| given[axis])), closed: ());
    }

    /// Computes the next frame of a ramp to zero: the last output times `factor`, limited. Returns the number of axes.
    pub(super) fn ramp(&mut self, factor: f64, frame: &mut [f64; 6]) -> usize {
        let mut put = |components: &[f64]| {
            frame[..components.len()].copy_from_slice(components);
            components.len()
        };
        any!(self, limiter => put(&limiter.apply(limiter.output().map(|x| x * factor))), closed: 0)
    }

    pub(super) fn counts(&self) -> ClipCounts {
        any!(self, limiter => limiter.counts(), closed: ClipCounts::default())
    }

    /// Largest magnitude of a request.
    pub(super) fn largest_request(&self) -> f64 {
        any!(self, limiter => limiter.largest_request(), closed: 0.0)
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
