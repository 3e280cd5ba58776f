//! Cross-fade of two plans that run together frame by frame.
//!
//! The new plan owns the devices from the start: each advances once per tick, and both plans read the same sensed
//! values. The request of the old plan to an actuator goes to the new plan's sink, which mixes both before the one
//! limiter. So no actuator is driven twice, and the mix closes loops through a body.

use super::Run;
use super::actuator::CrossFadeRole;
use super::device::Ownership;
use super::fade::FadeGate;
use super::swap::PlanSwap;
use crate::limiter::Hottest;

impl PlanSwap {
    /// Replaces the running plan; the new plan fades in within `seconds`.
    pub(super) fn cross_fade(&mut self, running: &mut Run, seconds: f64, hottest: &Hottest) {
        self.take_over(running, hottest);
        let (begin, end) = running.fade_span(seconds);
        let (old, new) = (&mut self.run.state, &mut running.state);
        for (from, to) in &self.transfers.devices {
            old.devices[*from].ownership = Ownership::Shadow;
            new.devices[*to].ownership = Ownership::Primary;
        }
        let rise = FadeGate::Rising { begin, end };
        for actuator in &mut new.actuators {
            actuator.role = CrossFadeRole::Mixer([0.0; 6], rise);
        }
        for (from, to) in &self.transfers.drives {
            let (from, to) = (&mut old.actuators[*from], &mut new.actuators[*to]);
            to.limiter.begin_from(&from.limiter.output());
            from.role = CrossFadeRole::Outgoing([0.0; 6]);
        }
    }

    /// Runs both plans for a driver frame. Returns whether the cross-fade is over.
    pub(super) fn run_together(&mut self, new: &mut Run) -> bool {
        let old = &mut self.run;
        old.state.windows.next_block(1);
        new.state.windows.next_block(1);
        for (from, to) in &self.transfers.devices {
            let (from_plan, to_plan) = (&old.plan.devices[*from], &new.plan.devices[*to]);
            if new.state.windows.of(to_plan.clock as u32).count > 0 {
                let follower = &mut old.state.devices[*from];
                new.state.devices[*to].sense_for_both(to_plan, follower, from_plan);
            }
        }
        old.steps(0..old.plan.steps.len());
        for (from, to) in &self.transfers.drives {
            let outgoing = old.state.actuators[*from].role.outgoing();
            let is_finite = new.state.actuators[*to].role.mix_in(outgoing);
            new.state.faults.counts.ticks += u64::from(!is_finite);
        }
        new.steps(0..new.plan.steps.len());
        let time = new.state.windows.block().1;
        let over = new.state.actuators.iter().all(|actuator| actuator.role.is_over(time));
        if over {
            new.state.actuators.iter_mut().for_each(|actuator| actuator.role = CrossFadeRole::Single);
            new.state.devices.iter_mut().for_each(|device| device.ownership = Ownership::Exclusive);
        }
        over
    }
}
