//! Actuator limiters. Every actuator has a [`Limiter`], whose output satisfies for any input:
//!
//! - peak: |y| <= `peak`;
//! - continuous: the exponentially weighted mean square of y, with time constant `window_s` (the heat of a body with
//!   one thermal time constant), stays at or below `continuous` squared, so that a short overload is possible and a
//!   long one is not;
//! - slew: two successive outputs differ by at most `slew_per_s` / rate;
//! - faults: a NaN or infinite input counts as a request of zero; the output follows as fast as the slew limit allows.
//!
//! All limits hold at once: the output only takes a magnitude from which a ramp down to `continuous` at full slew stays
//! within the heat reserve. The heat of such a ramp is tabulated when the limiter is built (`Rung`); every admissible
//! state has an admissible successor, the next rung down.
//!
//! # Guarantee over a change of limits
//!
//! Let M(t) be the mean square of the **whole** output since the start of the run, under whatever limits, weighted by
//! the window of the limit in force. At every tick, with k = exp(-1 / (window rate)):
//!
//! ```text
//! M(t) - continuous^2 <= k max(0, M(t - 1) - continuous^2)
//! ```
//!
//! So M never exceeds the limit by new output. If a limit is lowered, or its window shortened, below the present heat,
//! the excess only decays, and the output since then keeps the limit by itself. Over T seconds the energy is at most
//! continuous^2 (T + window): M' = (y^2 - M) / window, integrated.
//!
//! Proof: a limiter that continues another one starts from m >= M, which `Heat` can give for any window. Both
//! follow m(t) = k m(t - 1) + (1 - k) y^2, so m >= M stays true. While m is above the limit there is no heat reserve,
//! the outputs are at most `continuous`, and the line above holds for M; else m <= continuous^2 by the ramp, and so is M.
//! A change of limits happens while the output is zero, from where every state is admissible.
//!
//! Output before the run is unknown and counts as the continuous limit in force: the actuator starts without heat
//! reserve, and a higher limit does not add any. An actuator that is removed and may come back under another name
//! counts as hot as the hottest removed one; no cooling is assumed.

mod heat;

pub(crate) use heat::Hottest;

use haptograph_signal::vector::{add_scaled, dot, norm, scale, sub};
use heat::Heat;

/// Components of the frames that a running limiter takes: a scalar, a 3-vector, a wrench.
pub(crate) const LIMITED_WIDTHS: [usize; 3] = [1, 3, 6];

/// Limits of one actuator, in the unit of its drive (A, N or V).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limit {
    /// Largest magnitude at any time.
    pub peak: f64,
    /// Largest root of the exponentially weighted mean square.
    pub continuous: f64,
    /// Time constant of that mean, s.
    pub window_s: f64,
    /// Largest rate of change, unit/s; `None`: unlimited.
    pub slew_per_s: Option<f64>,
}

/// Reason why a [`Limit`] is invalid.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum LimitError {
    /// A limit is zero, negative or not finite.
    #[error("limit {name} is {value}: choose a finite number above zero")]
    NotPositive {
        /// The setting.
        name: &'static str,
        /// The value.
        value: f64,
    },
    /// The continuous limit is above the peak.
    #[error("the continuous limit {continuous} is above the peak {peak}: lower it to at most the peak")]
    ContinuousAbovePeak {
        /// The setting `continuous`.
        continuous: f64,
        /// The setting `peak`.
        peak: f64,
    },
    /// A ramp from peak to continuous would take too many ticks to plan.
    #[error(
        "at a slew limit of {slew_per_s} per second a ramp from peak to continuous takes {ticks:.0} ticks, but at most \
         {most} are possible: raise the slew limit or lower the peak",
        most = MAX_RUNGS
    )]
    SlewTooSlow {
        /// The setting `slew_per_s`.
        slew_per_s: f64,
        /// Ticks from peak to continuous.
        ticks: f64,
    },
}

/// Number of ticks in which each limit acted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct ClipCounts {
    /// All ticks.
    pub ticks: u64,
    /// Ticks whose request was above the peak.
    pub peak: u64,
    /// Ticks limited by the heat reserve.
    pub continuous: u64,
    /// Ticks limited by the slew limit.
    pub slew: u64,
    /// Ticks whose request was NaN or infinite.
    pub fault: u64,
}

/// Enforces a [`Limit`] on an output of `N` axes; magnitudes are Euclidean. Allocates only when built.
#[derive(Debug, Clone)]
pub struct Limiter<const N: usize> {
    peak: f64,
    /// Largest change in a tick.
    step: f64,
    /// Square of the continuous limit.
    continuous_square: f64,
    /// Weight of one tick in the mean square.
    weight: f64,
    ramp: Box<[Rung]>,
    previous: [f64; N],
    /// Heat reserve: square of the continuous limit minus the mean square. Negative if an earlier limit, higher or with
    /// another window, allowed more heat.
    budget: f64,
    /// Heat for any window, for later limits.
    heat: Heat,
    window_s: f64,
    rate_hz: f64,
    counts: ClipCounts,
    largest_request: f64,
}

/// A step of the ramp down to the continuous limit: from this magnitude or below, `budget` suffices for the ramp.
#[derive(Debug, Clone, Copy)]
struct Rung {
    magnitude: f64,
    budget: f64,
}

const MAX_RUNGS: f64 = 1e6;
/// Relative margin of heat and rungs against rounding errors.
const MARGIN: f64 = 1e-9;
/// Relative margin against a single rounding.
const HAIR: f64 = 1.0 - 4.0 * f64::EPSILON;

impl<const N: usize> Limiter<N> {
    /// A limiter at rest, cold, for ticks at `rate_hz`.
    pub fn new(limit: &Limit, rate_hz: f64) -> Result<Self, LimitError> {
        let slew_per_s = limit.slew_per_s.unwrap_or(f64::MAX);
        for (name, value) in [
            ("peak", limit.peak),
            ("continuous", limit.continuous),
            ("window_s", limit.window_s),
            ("slew_per_s", slew_per_s),
            ("rate_hz", rate_hz),
        ] {
            if !(value > 0.0 && value.is_finite()) {
                return Err(LimitError::NotPositive { name, value });
            }
        }
        let (peak, continuous) = (limit.peak, limit.continuous);
        if continuous > peak {
            return Err(LimitError::ContinuousAbovePeak { continuous, peak });
        }
        let step = slew_per_s / rate_hz;
        let weight = -(-1.0 / (limit.window_s * rate_hz)).exp_m1();
        let continuous_square = continuous * continuous * (1.0 - MARGIN);
        let ticks = (peak - continuous_square.sqrt()) / step;
        if ticks > MAX_RUNGS {
            return Err(LimitError::SlewTooSlow { slew_per_s, ticks });
        }
        let unlimited_slew = limit.slew_per_s.is_none();
        Ok(Self {
            peak,
            step: if unlimited_slew { f64::INFINITY } else { step },
            continuous_square,
            weight,
            ramp: ramp(peak, continuous_square, step, weight, unlimited_slew),
            previous: [0.0; N],
            budget: continuous_square,
            heat: Heat::cold(rate_hz),
            window_s: limit.window_s,
            rate_hz,
            counts: ClipCounts::default(),
            largest_request: 0.0,
        })
    }

    /// Computes the limited output of a request for one tick.
    pub fn apply(&mut self, request: [f64; N]) -> [f64; N] {
        self.counts.ticks += 1;
        let is_finite = request.iter().all(|x| x.is_finite());
        self.counts.fault += u64::from(!is_finite);
        let wanted = self.within_peak(if is_finite { request } else { [0.0; N] });
        let reachable = self.within_slew(wanted);
        let sustainable = self.within_heat(reachable);
        self.put_out(sustainable)
    }

    /// Counts since the start.
    pub fn counts(&self) -> ClipCounts {
        self.counts
    }

    /// Largest magnitude of a finite request since the start.
    pub fn largest_request(&self) -> f64 {
        self.largest_request
    }

    /// Upper bound of the weighted mean square, unit squared: 0 when cold; can exceed the square of the continuous
    /// limit after a change of limits.
    pub fn mean_square(&self) -> f64 {
        self.continuous_square - self.budget
    }

    /// Used part of the continuous limit: 0 when cold, 1 without heat reserve.
    pub(crate) fn used_heat(&self) -> f64 {
        (self.mean_square() / self.continuous_square).max(0.0)
    }

    /// Continues the state of another limiter of the same actuator, with its heat.
    pub fn continue_from(&mut self, other: &Self) {
        self.heat.continue_from(&other.heat);
        let unknown = self.heat.unknown_part(self.window_s);
        let mut known = self.heat.mean_square(self.window_s);
        if (self.window_s, self.rate_hz) == (other.window_s, other.rate_hz) {
            if self.continuous_square == other.continuous_square {
                self.budget = other.budget;
                return;
            }
            known = known.min(other.mean_square() - unknown * other.continuous_square);
        }
        self.budget = self.continuous_square * (1.0 - unknown) - known;
    }

    /// Continues the counts and the largest request of another limiter.
    pub(crate) fn count_on_from(&mut self, counts: ClipCounts, largest_request: f64) {
        (self.counts, self.largest_request) = (counts, largest_request);
    }

    /// Starts without heat reserve: the earlier output of the actuator is unknown.
    pub(crate) fn assume_thermally_saturated(&mut self) {
        self.begin_unknown(None);
    }

    /// Starts with the heat of the hottest removed actuator: the hardware may be the same.
    pub(crate) fn begin_as_any_of(&mut self, hottest: &Hottest) {
        self.begin_unknown(Some(hottest));
    }

    fn begin_unknown(&mut self, hottest: Option<&Hottest>) {
        self.heat.begin_unknown(hottest);
        self.budget = -self.heat.mean_square(self.window_s);
    }

    /// True if its heat includes a time of unknown output.
    pub(crate) fn has_unknown_history(&self) -> bool {
        self.heat.is_partly_unknown()
    }

    /// Records the heat of a removed actuator.
    pub(crate) fn leave_to(&self, hottest: &Hottest) {
        hottest.take_in(&self.heat);
    }

    /// Sets the last output; the heat stays.
    pub(crate) fn begin_from(&mut self, output: [f64; N]) {
        self.previous = output;
    }

    /// The latest output.
    pub fn output(&self) -> [f64; N] {
        self.previous
    }

    fn within_peak(&mut self, request: [f64; N]) -> [f64; N] {
        // Scaled by the largest component first: the square of a large request overflows.
        let largest = request.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
        let relative =
            if largest > self.peak { norm(scale(request, 1.0 / largest)) * largest } else { norm(request) };
        self.largest_request = self.largest_request.max(relative);
        if relative <= self.peak {
            return request;
        }
        self.counts.peak += 1;
        let shape = scale(request, 1.0 / largest);
        scale(shape, self.peak / norm(shape) * HAIR)
    }

    fn within_slew(&mut self, wanted: [f64; N]) -> [f64; N] {
        let change = sub(wanted, self.previous);
        let length = norm(change);
        if length <= self.step {
            return wanted;
        }
        self.counts.slew += 1;
        add_scaled(self.previous, change, self.step / length * HAIR)
    }

    fn within_heat(&mut self, reachable: [f64; N]) -> [f64; N] {
        let most = self.max_magnitude(norm(reachable));
        if norm(reachable) <= most {
            return reachable;
        }
        self.counts.continuous += 1;
        // Between the fastest ramp down and the request: both keep the slew limit, so all points between do.
        let down = (1.0 - self.step / norm(self.previous)).max(0.0);
        let safest = scale(self.previous, if down.is_finite() { down } else { 0.0 });
        furthest_within(safest, reachable, most)
    }

    /// Largest magnitude up to `request` that leaves enough heat reserve for the ramp down.
    fn max_magnitude(&self, request: f64) -> f64 {
        // With a negative reserve from an earlier limit the continuous limit is allowed: the excess decays.
        let budget = self.budget.max(0.0);
        let above = self.ramp.partition_point(|rung| rung.magnitude < request);
        let mut most = 0.0_f64;
        for rung in self.ramp.iter().take(above + 1).rev() {
            if most >= rung.magnitude {
                break;
            }
            let left = (1.0 - self.weight) * budget - rung.budget;
            let square = self.continuous_square + left / self.weight;
            if square > 0.0 {
                most = most.max(rung.magnitude.min(square.sqrt()));
            }
        }
        most
    }

    fn put_out(&mut self, output: [f64; N]) -> [f64; N] {
        let square = dot(output, output);
        self.heat.note(square);
        let excess = square - self.continuous_square;
        self.budget = (1.0 - self.weight) * self.budget - self.weight * excess;
        self.previous = output;
        output
    }
}

/// Heat that the ramp down from each magnitude needs, from the continuous limit up to the peak.
fn ramp(peak: f64, continuous_square: f64, step: f64, weight: f64, unlimited_slew: bool) -> Box<[Rung]> {
    if unlimited_slew {
        return Box::new([Rung { magnitude: peak, budget: 0.0 }]);
    }
    let continuous = continuous_square.sqrt();
    let spacing = step * (1.0 - MARGIN);
    let mut rungs = vec![Rung { magnitude: continuous.min(peak), budget: 0.0 }];
    let mut below = rungs[0];
    while below.magnitude < peak {
        // budget' = (1 - weight) budget - weight (m^2 - continuous^2), one rung down, must be that rung's own.
        let spent = weight * (below.magnitude * below.magnitude - continuous_square);
        below = Rung {
            magnitude: (continuous + rungs.len() as f64 * spacing).min(peak),
            budget: (below.budget + spent.max(0.0)) / (1.0 - weight),
        };
        rungs.push(below);
    }
    rungs.into_boxed_slice()
}

/// The point on the line from `start` to `end` that is furthest from `start` and within `radius` of the origin.
fn furthest_within<const N: usize>(start: [f64; N], end: [f64; N], radius: f64) -> [f64; N] {
    let way = sub(end, start);
    let room = radius * radius - dot(start, start);
    if room <= 0.0 {
        // By rounding only: the start is within the radius by construction. Heat has priority over slew.
        let magnitude = norm(start);
        return if magnitude > 0.0 { scale(start, radius / magnitude) } else { start };
    }
    let (length_square, along) = (dot(way, way), dot(start, way));
    let root = (along * along + length_square * room).sqrt();
    let fraction = if along > 0.0 { room / (along + root) } else { (root - along) / length_square };
    add_scaled(start, way, if fraction.is_finite() { fraction.clamp(0.0, 1.0) } else { 0.0 })
}

#[cfg(test)]
mod tests;
