//! Chooses the mode of a swap; the only place that does.

use crate::plan::{DevicePlan, Plan};

/// Largest number of delay components copied for a cross-fade: 0.5 MB, which takes 0.05 ms.
const MAX_COPIED: u64 = 65_536;

/// Mode in which a plan replaces another.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in super::super) enum SwapMode {
    /// The graphs are equal: the new plan takes over all state, and no bit changes.
    InPlace,
    /// Both plans run for a while and cross-fade.
    CrossFade,
    /// The old plan fades out to zero, then the new one fades in.
    FadeThroughZero(NoCrossFade),
}

/// Reason why two plans fade through zero and cannot cross-fade.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum NoCrossFade {
    /// The graph has several drivers, which change over at different times.
    Drivers,
    /// An actuator is removed, or its device, rate or limits change.
    Actuators,
    /// The device of an actuator ticks faster than the driver.
    FastDevice,
    /// The delays that continue are too large to copy in a tick.
    Delays,
    /// There is no time to run both plans.
    Load,
}

impl std::fmt::Display for NoCrossFade {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Drivers => "there are several drivers",
            Self::Actuators => "an actuator changed",
            Self::FastDevice => "a device ticks faster than the driver",
            Self::Delays => "its delays are too large to copy",
            Self::Load => "there is no time to run both graphs",
        })
    }
}

/// Difference between a plan and the one that it replaces.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Change {
    /// Only in this many live settings: the run was not interrupted.
    Settings(usize),
    /// In more than settings: the plans cross-fade.
    CrossFade,
    /// In more than settings: the plans fade through zero, for this reason.
    FadeThroughZero(NoCrossFade),
    /// In more than settings, and neither plan has an actuator to fade.
    AtOnce,
}

impl std::fmt::Display for Change {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Settings(0) => f.write_str("nothing changed"),
            Self::Settings(1) => f.write_str("a setting changed"),
            Self::Settings(count) => write!(f, "{count} settings changed"),
            Self::CrossFade => f.write_str("the graph changed, cross-faded"),
            Self::AtOnce => f.write_str("the graph changed"),
            Self::FadeThroughZero(reason) => {
                write!(f, "the graph changed, faded through zero because {reason}")
            }
        }
    }
}

impl Change {
    /// The name of the change in reports, which later versions keep.
    pub fn code(self) -> &'static str {
        match self {
            Self::Settings(_) => "settings",
            Self::CrossFade => "cross-fade",
            Self::AtOnce => "at-once",
            Self::FadeThroughZero(NoCrossFade::Drivers) => "through-zero:drivers",
            Self::FadeThroughZero(NoCrossFade::Actuators) => "through-zero:actuators",
            Self::FadeThroughZero(NoCrossFade::FastDevice) => "through-zero:fast-device",
            Self::FadeThroughZero(NoCrossFade::Delays) => "through-zero:delays",
            Self::FadeThroughZero(NoCrossFade::Load) => "through-zero:load",
        }
    }

    /// The change that a swap of this mode with this many changed settings makes; `drives`: either plan has actuators.
    pub(in super::super) fn of(mode: SwapMode, settings: usize, drives: bool) -> Self {
        match mode {
            SwapMode::InPlace => Self::Settings(settings),
            _ if !drives => Self::AtOnce,
            SwapMode::CrossFade => Self::CrossFade,
            SwapMode::FadeThroughZero(reason) => Self::FadeThroughZero(reason),
        }
    }

    /// Combines the changes of two drivers.
    pub(in super::super) fn and(self, other: Self) -> Self {
        match (self, other) {
            (Self::Settings(some), Self::Settings(more)) => Self::Settings(some + more),
            (Self::FadeThroughZero(reason), _) | (_, Self::FadeThroughZero(reason)) => {
                Self::FadeThroughZero(reason)
            }
            (Self::CrossFade, _) | (_, Self::CrossFade) => Self::CrossFade,
            _ => Self::AtOnce,
        }
    }
}

/// The facts about two plans on which the mode depends.
#[derive(Debug, Clone, Copy)]
pub(super) struct Facts {
    /// The graphs differ in live settings at most.
    pub same_graph: bool,
    /// Either plan has rings to other drivers.
    pub has_rings: bool,
    /// The new plan has ring ends that the old one does not have.
    pub gets_rings: bool,
    /// Every actuator of the old plan continues unchanged.
    pub actuators_go_on: bool,
    /// A device that both plans have, or that the new one drives, ticks faster than the driver.
    pub has_fast_device: bool,
    /// Number of components in the delays that continue.
    pub delayed: u64,
    /// There is time to run both plans in a tick.
    pub has_time: bool,
}

/// Chooses the mode of a swap.
pub(super) fn decide(facts: &Facts) -> SwapMode {
    if facts.same_graph && !facts.gets_rings {
        return SwapMode::InPlace;
    }
    let reasons = [
        (facts.has_rings || facts.gets_rings, NoCrossFade::Drivers),
        (!facts.actuators_go_on, NoCrossFade::Actuators),
        (facts.has_fast_device, NoCrossFade::FastDevice),
        (facts.delayed > MAX_COPIED, NoCrossFade::Delays),
        (!facts.has_time, NoCrossFade::Load),
    ];
    match reasons.into_iter().find(|(holds, _)| *holds) {
        Some((_, reason)) => SwapMode::FadeThroughZero(reason),
        None => SwapMode::CrossFade,
    }
}

/// (old, new) indices of the items that two plans have in common.
#[derive(Clone, Copy)]
pub(super) struct Common<'a> {
    pub devices: &'a [(usize, usize)],
    /// Actuators that are the same channel of the same device.
    pub drives: &'a [(usize, usize)],
    pub delays: &'a [(usize, usize)],
}

impl Facts {
    /// Compares two plans. `has_time`: there is time to run both in a tick.
    pub(super) fn of(old: &Plan, new: &Plan, common: Common<'_>, has_time: bool) -> Self {
        let rings = |plan: &Plan| !plan.ring_reads.is_empty() || !plan.ring_writes.is_empty();
        let held = |(_, to): &(usize, usize)| {
            let delay = &new.delays[*to];
            delay.frames.saturating_mul(delay.kind.width() as u64)
        };
        Self {
            same_graph: old.is_same_as(new),
            has_rings: rings(old) || rings(new),
            gets_rings: false,
            actuators_go_on: actuators_go_on(old, new, common),
            has_fast_device: has_fast_device(old, new, common),
            delayed: common.delays.iter().map(held).fold(0, u64::saturating_add),
            has_time,
        }
    }
}

fn actuators_go_on(old: &Plan, new: &Plan, common: Common<'_>) -> bool {
    let device = |plan: &Plan, actuator| plan.devices.iter().position(|device| device.drives(actuator));
    let goes_on = |(from, to): &(usize, usize)| {
        let (a, b) = (&old.actuators[*from], &new.actuators[*to]);
        let moved = device(old, *from).zip(device(new, *to));
        moved.is_some_and(|pair| common.devices.contains(&pair))
            && (a.limit, a.rate, a.width) == (b.limit, b.rate, b.width)
    };
    (0..old.actuators.len()).all(|from| {
        let mut drives = common.drives.iter();
        drives.any(|pair| pair.0 == from && goes_on(pair))
    })
}

fn has_fast_device(old: &Plan, new: &Plan, common: Common<'_>) -> bool {
    let fast = |plan: &Plan, device: usize| {
        plan.base.period(plan.devices[device].clock) < plan.base.period(plan.driver)
    };
    let too_fast = |(from, to): &(usize, usize)| fast(old, *from) || fast(new, *to);
    let mut driven = (0..new.devices.len()).filter(|device| !new.devices[*device].driven_by.is_empty());
    common.devices.iter().any(too_fast) || driven.any(|device| fast(new, device))
}

impl DevicePlan {
    fn drives(&self, actuator: usize) -> bool {
        self.driven_by.iter().any(|(sink, ..)| *sink == actuator)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Different graphs that can cross-fade.
    const OTHER: Facts = Facts {
        same_graph: false,
        has_rings: false,
        gets_rings: false,
        actuators_go_on: true,
        has_fast_device: false,
        delayed: MAX_COPIED,
        has_time: true,
    };

    #[test]
    fn each_fact_decides_as_the_table_says() {
        let through_zero = SwapMode::FadeThroughZero;
        type Row = (fn(&mut Facts), SwapMode);
        let table: [Row; 11] = [
            (|_| (), SwapMode::CrossFade),
            (|f| f.same_graph = true, SwapMode::InPlace),
            // An equal graph neither runs twice nor is copied.
            (|f| (f.same_graph, f.has_time) = (true, false), SwapMode::InPlace),
            (|f| (f.same_graph, f.has_rings) = (true, true), SwapMode::InPlace),
            (|f| (f.same_graph, f.gets_rings) = (true, true), through_zero(NoCrossFade::Drivers)),
            (|f| f.has_rings = true, through_zero(NoCrossFade::Drivers)),
            (|f| f.actuators_go_on = false, through_zero(NoCrossFade::Actuators)),
            (|f| f.has_fast_device = true, through_zero(NoCrossFade::FastDevice)),
            (|f| f.delayed += 1, through_zero(NoCrossFade::Delays)),
            (|f| f.has_time = false, through_zero(NoCrossFade::Load)),
            // Reasons that do not depend on the load come first.
            (|f| (f.actuators_go_on, f.has_time) = (false, false), through_zero(NoCrossFade::Actuators)),
        ];
        for (row, (change, expected)) in table.into_iter().enumerate() {
            let mut facts = OTHER;
            change(&mut facts);
            assert_eq!(decide(&facts), expected, "row {row}");
        }
    }

    #[test]
    fn a_swap_without_actuators_is_at_once() {
        let through_zero = SwapMode::FadeThroughZero(NoCrossFade::Load);
        for (mode, drives, expected) in [
            (SwapMode::InPlace, true, Change::Settings(2)),
            (SwapMode::InPlace, false, Change::Settings(2)),
            (SwapMode::CrossFade, true, Change::CrossFade),
            (SwapMode::CrossFade, false, Change::AtOnce),
            (through_zero, true, Change::FadeThroughZero(NoCrossFade::Load)),
            (through_zero, false, Change::AtOnce),
        ] {
            assert_eq!(Change::of(mode, 2, drives), expected);
        }
    }
}
