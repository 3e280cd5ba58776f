//! Linear ramps of live settings, in steps too short to feel.

use super::Run;

/// Duration of a ramp, s.
pub const PARAM_RAMP_S: f64 = 0.02;
/// Duration of a step of a ramp, s.
const STEP_S: f64 = 0.000_25;

/// The ramps in progress. Beyond the capacity a setting jumps to its new value.
pub(super) struct ParamRamps {
    list: Vec<ParamRamp>,
}

/// A change of a live setting.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ParamRamp {
    /// Index of the setting in the plan's live settings.
    pub place: usize,
    pub from: f64,
    pub to: f64,
    /// Driver frame at which it starts.
    pub begin: u64,
    /// The length in driver frames; 0 for a jump.
    pub frames: u64,
}

impl ParamRamps {
    pub(super) fn with_room_for(most: usize) -> Self {
        Self { list: Vec::with_capacity(most) }
    }

    /// Starts a ramp from the setting's present value.
    pub(super) fn start(&mut self, mut ramp: ParamRamp, run: &mut Run) {
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

    /// Sets the values that are due, and returns the number of driver frames until the next step. The steps do not
    /// depend on the block size.
    pub(super) fn step(&mut self, run: &mut Run, rate_hz: f64) -> usize {
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

    /// True if no ramp is in progress at this frame; one that has reached its end may not have set it yet.
    pub(super) fn are_over(&self, now: u64) -> bool {
        self.list.iter().all(|ramp| now.saturating_sub(ramp.begin) >= ramp.frames)
    }

    /// Sets all ramps to their ends, before the plan is replaced.
    pub(super) fn finish(&mut self, run: &mut Run) {
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
