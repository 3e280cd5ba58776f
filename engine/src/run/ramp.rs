//! Settings that change while a plan runs go to their new values in straight lines, in steps too short to feel.

use super::Run;

/// How long a setting takes to its new value.
pub const PARAM_RAMP_S: f64 = 0.02;
/// How long it stays the same on its way.
const STEP_S: f64 = 0.000_25;

/// The settings on their way. Never more than it was made for: one more arrives at once.
pub(super) struct ParamRamps {
    list: Vec<ParamRamp>,
}

/// A change of a setting, as it is asked for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ParamRamp {
    /// The setting's place among the live ones of the plan.
    pub place: usize,
    pub from: f64,
    pub to: f64,
    /// Driver frame at which it left, and frames that it takes; 0 for a setting that jumps.
    pub begin: u64,
    pub frames: u64,
}

impl ParamRamps {
    pub fn with_room_for(most: usize) -> Self {
        Self {
            list: Vec::with_capacity(most),
        }
    }

    /// Sends a setting on its way, from where it is.
    pub fn start(&mut self, mut ramp: ParamRamp, run: &mut Run) {
        let now = run.driver_frames();
        ramp.begin = now;
        let room = self.list.len() < self.list.capacity();
        let on_its_way = self.list.iter_mut().find(|known| known.place == ramp.place);
        match on_its_way {
            Some(known) => {
                ramp.from = known.at(now);
                *known = ramp;
            }
            None if ramp.frames > 0 && room => self.list.push(ramp),
            None => run.set_live(ramp.place, ramp.to),
        }
    }

    /// Sets what is due now, and says how many driver frames at most may pass until the next time. When that is depends
    /// on when the settings left alone, not on the blocks that are run.
    pub fn step(&mut self, run: &mut Run, rate_hz: f64) -> usize {
        let step = (STEP_S * rate_hz).max(1.0) as u64;
        let now = run.driver_frames();
        let mut next = u64::MAX;
        self.list.retain(|ramp| {
            let passed = now.saturating_sub(ramp.begin);
            if passed.is_multiple_of(step) || passed >= ramp.frames {
                run.set_live(ramp.place, ramp.at(now));
            }
            let left = ramp.frames.saturating_sub(passed);
            if left > 0 {
                next = next.min(left).min(step - passed % step);
            }
            left > 0
        });
        usize::try_from(next).unwrap_or(usize::MAX)
    }

    /// Is nothing on its way?
    pub fn is_empty(&self) -> bool {
        self.list.is_empty()
    }

    /// Lets everything arrive: the plan is about to go.
    pub fn finish(&mut self, run: &mut Run) {
        for ramp in self.list.drain(..) {
            run.set_live(ramp.place, ramp.to);
        }
    }
}

impl ParamRamp {
    fn at(&self, now: u64) -> f64 {
        let passed = now.saturating_sub(self.begin);
        if passed >= self.frames {
            return self.to;
        }
        self.from + (self.to - self.from) * (passed as f64 / self.frames as f64)
    }
}
