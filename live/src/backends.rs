//! The table of backends, and those that a program adds to its registry.

use crate::backend::{BackendEntry, BackendError};
use crate::numbers::{Listeners, NumberSource};
use haptograph_engine::device::DeviceKind;
use haptograph_engine::graph::Graph;
use haptograph_engine::registry::Registry;

/// All backends, in any order: the timer takes the drivers that are left by the others, so that a missing soundcard is found
/// before a timer moves anything.
pub const BACKENDS: &[BackendEntry] = &[
    crate::soundcard::BACKEND,
    crate::evdev::BACKEND,
    crate::udp::BACKEND,
    crate::osc::BACKEND,
    crate::serial::BACKEND,
    crate::midi::BACKEND,
    crate::haply::BACKEND,
    crate::timer::BACKEND,
];

/// The backends of a program's own, attached to its registry.
#[derive(Clone, Default)]
struct OwnBackends(Vec<BackendEntry>);

/// Adds a backend of the program's own to a registry, for device kinds that the program registers. All live runs of that
/// registry have it, those of the command and of the studio too; where the program drives the graph itself, those that do not
/// drive.
pub fn add_backend(registry: &mut Registry, entry: BackendEntry) {
    let mut own = registry.attached::<OwnBackends>().cloned().unwrap_or_default();
    own.0.push(entry);
    registry.attach(own);
}

/// The backends of the table and the program's own, in the order in which they take drivers.
pub(crate) fn backends(registry: &Registry) -> Vec<BackendEntry> {
    let own = registry.attached::<OwnBackends>().cloned().unwrap_or_default();
    let mut all: Vec<BackendEntry> = BACKENDS.iter().copied().chain(own.0).collect();
    all.sort_by_key(|entry| entry.drives_any_clock);
    all
}

impl BackendEntry {
    /// The backend of a source of numbers, a program's own; `what` is the hardware, in the plural.
    pub const fn numbers<S: NumberSource>(what: &'static str) -> Self {
        Self::new(what, const { &[S::Kind::SPEC.name] }, Listeners::<S>::boxed)
    }
}

/// Refuses a graph whose devices contradict each other, as a live run of it does before it reaches any.
///
/// # Errors
/// [`BackendError`] if two actuators are on one channel of a soundcard, two devices at one port, or two endpoints of one
/// arm.
pub fn refuse_conflicts(graph: &Graph) -> Result<(), BackendError> {
    crate::soundcard::card_requests(graph)?;
    #[cfg(feature = "udp")]
    crate::udp::refuse_conflicts(graph)?;
    #[cfg(feature = "haply")]
    crate::haply::refuse_conflicts(graph)?;
    Ok(())
}
